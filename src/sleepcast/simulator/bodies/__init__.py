"""The state of all simulated robots as arrays, and how they move, touch and sense."""
