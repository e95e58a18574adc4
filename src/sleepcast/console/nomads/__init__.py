"""The page of the Nomads: what it shows, what it can ask, and the session of one open page."""
