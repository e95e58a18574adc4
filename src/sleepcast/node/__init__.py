"""The node: one robot's mind. It knows no socket, no array and no page."""
