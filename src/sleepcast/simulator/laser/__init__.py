"""Laser scanners: what each of many beams hits first."""
