"""What nodes and fleets share of a robot's mind, without arrays: rules, merging, authority, telemetry, state."""
