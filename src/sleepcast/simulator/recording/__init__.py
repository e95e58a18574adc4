"""Runs written to MCAP files, and read from them."""
