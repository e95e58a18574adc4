"""Nomads behind a Nserver as bodies: the `robot`, and the `model` of what a mind can call by name on it."""
