"""What recording costs a run."""
