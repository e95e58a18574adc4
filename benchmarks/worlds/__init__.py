"""Many small swarms at once, and one small swarm: beside the release before, ARGoS, VMAS and Mesa."""
