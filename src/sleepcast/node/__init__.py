"""The node: one robot's mind, without sockets, arrays or pages."""
