"""Letting time pass in a world of Nomads."""

from __future__ import annotations

from sleepcast.nomad.world.nomad_world import NomadWorld


def run(world: NomadWorld, seconds: float) -> None:
    for _ in range(round(seconds / world.tick)):
        world.step()


def until_rest(world: NomadWorld, robot: int = 0, most: float = 60.0) -> float:
    """Seconds until nothing of the robot moves."""
    begin = world.time
    while any(world.observe(robot).moving):
        world.step()
        assert world.time - begin < most
    return world.time - begin
