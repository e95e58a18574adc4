"""The ground floor: errors, units, time, files, bytes and threads. Every room may import it."""
