"""The Nomads' protocol without sockets: bytes in, requests out; words in, bytes out."""
