"""Copters that keep apart in the air, beside ARGoS and crazyflow."""
