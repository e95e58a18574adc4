"""Simulated Nomads: robots driven axis by axis, in worlds from files."""
