"""The whole loop of the scenario `crowd`: sense, ten rules, move, collide."""
