"""What packages with robots of their own test them with: `robot_contract`."""
