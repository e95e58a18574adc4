"""What the fleet costs, beside NumPy written by hand and what people use for columns."""
