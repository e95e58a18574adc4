"""A node of a sleepcast fleet for MicroPython: see README.md beside this folder."""
