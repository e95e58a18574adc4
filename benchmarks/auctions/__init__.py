"""How often the right robots obey a BEST or QUORUM where messages are lost and robots die, and that there are never too
many."""
