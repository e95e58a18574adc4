"""What a robot's mind means, without arrays: rules, merging, authority, leases. Nodes and fleets import it."""
