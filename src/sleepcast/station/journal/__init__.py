"""The journal: everything that an operator's station sent, heard and decided, in order; in memory or in a file."""
