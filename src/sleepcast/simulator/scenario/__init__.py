"""What a scenario file says: the world, its robots, events, measures and missions, read and checked."""
