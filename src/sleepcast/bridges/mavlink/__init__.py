"""MAVLink 2: vehicles as bodies, and robots as vehicles of a ground station. `link` sends and checks for both."""
