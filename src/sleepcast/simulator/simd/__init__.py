"""How kernels are compiled, and their building blocks: vectors, memory access and formulas."""
