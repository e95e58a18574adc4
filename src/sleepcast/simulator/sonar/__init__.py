"""Sonar readings: exact ranges of cones, firing orders, cross-talk and noise, in NumPy and as kernels."""
