"""The terminal desk: an operator's station as a full screen in a terminal."""
