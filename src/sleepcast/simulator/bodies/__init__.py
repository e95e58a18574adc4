"""The state of all simulated robots as arrays; their contact and sensors."""
