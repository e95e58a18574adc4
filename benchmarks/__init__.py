"""Benchmarks: what sleepcast promises about speed, measured beside what people use instead."""
