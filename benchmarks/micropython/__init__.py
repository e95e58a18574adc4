"""A node on a small computer: its memory and its speed, under MicroPython with a heap of 128 KB."""
