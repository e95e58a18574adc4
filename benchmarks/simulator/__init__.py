"""What many bodies cost: sonar, motion and contact, per robot and tick."""
