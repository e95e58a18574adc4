"""Crazyflies: quadcopters as bodies, the `link` to one of them, and a `radio` that many programs share."""
