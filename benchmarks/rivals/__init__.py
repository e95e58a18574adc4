"""The same job in other simulators: wander with avoidance, robots with range sensors."""
