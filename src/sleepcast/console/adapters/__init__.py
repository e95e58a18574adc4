"""What a page can show, in the shape of `view`: a simulated swarm, a recording, robots on a channel, Nomads."""
