"""The language's speed on one robot; `python -m benchmarks.language` prints it."""
