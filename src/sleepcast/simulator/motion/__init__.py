"""How bodies move: formulas, steps and contact, in NumPy and as compiled kernels."""
