"""Nomads on the page: what it shows of them beside any robots, and what it can ask of them alone."""
