"""A node of a sleepcast fleet for MicroPython: see README.md beside this folder."""

import gc

gc.threshold(4096)
"""Bytes after which garbage is collected while modules are loaded and texts are checked: what stays then lies close
together, so that large pieces still find room. Checking signatures makes much garbage and leaves nothing; there it is
collected when memory is full (`Mind.compile`, `Node`)."""
