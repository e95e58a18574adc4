"""A fleet of mixed robots on the air for a simulated day: see `__main__`."""
