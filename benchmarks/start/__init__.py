"""How long somebody waits until something happens."""
