"""The front door for Python: one object for a fleet and its operator's desk. `import sleepcast` gives its names."""
