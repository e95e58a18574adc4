"""sleepcast: one broadcast expression, and every robot decides for itself whether it is meant.

Nothing is imported here, so that `import sleepcast.language` stays light: ask for each room by its name.
"""

__version__ = "0.1.0"
