"""What carries bytes from each party to all others; each transport is one file."""
