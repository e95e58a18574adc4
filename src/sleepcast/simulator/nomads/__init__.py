"""Simulated robots of a Nomad's kind: driven axis by axis, in worlds from files."""
