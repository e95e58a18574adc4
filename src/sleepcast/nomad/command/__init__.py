"""The command `sleepcast nserver`."""
