"""The broadcast channel between real processes in real networks: how fast, how dear, how sure."""
