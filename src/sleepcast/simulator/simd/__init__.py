"""How kernels are compiled, and the vectors, memory and formulas they calculate with."""
