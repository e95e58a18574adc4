"""The server of simulated Nomads: what each request does, whom it is for, and the sockets."""
