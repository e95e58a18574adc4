"""What it costs to ask a Nomad's server, and how many may ask at once."""
