"""The contents of a scenario file - world, robots, events, measures and missions - read and checked."""
