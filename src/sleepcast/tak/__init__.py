"""The common operational picture: robots, groups and places on the maps of TAK, and markers from there as places."""
