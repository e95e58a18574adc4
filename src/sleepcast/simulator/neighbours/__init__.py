"""What robots sense of each other, without arrays of pairs: one table for compiled code, and the kernels."""
