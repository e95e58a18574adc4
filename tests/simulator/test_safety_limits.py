"""Limits from a file: no expression, however wild, gets a body beyond them."""

from __future__ import annotations

from dataclasses import replace
from math import hypot, inf, nan, pi
from pathlib import Path
from random import Random

import numpy as np
import pytest

from sleepcast.core.errors import MisuseError
from sleepcast.core.settings import SettingsError
from sleepcast.loop import vocabulary_of
from sleepcast.node.node import Node
from sleepcast.robot import Limits, Setpoint
from sleepcast.simulator import SafetyLimits, Simulator, SingleRobot, find_scenario, limited, read_limits
from sleepcast.simulator.engine import NumPyMachine
from sleepcast.simulator.scenario.world_settings import Changes
from small_worlds import scouts, simulator

FENCE = (480.0, 490.0, 520.0, 505.0)
LIMITS = Limits(1.0, pi, 2.0)


def fenced(folder: Path, wheels: bool, **changes: float) -> tuple[Simulator, SafetyLimits]:
    limits = Limits(changes.get("speed", inf), inf, inf, FENCE)
    open_world = ('width = "12m"\nheight = "12m"\nedge = "wall"', 'width = "1km"\nheight = "1km"')
    plain = scouts(folder, open_world) if wheels else simulator(folder)
    world = Simulator(limited(plain.scenario, limits), machine=NumPyMachine())
    return world, SafetyLimits(world, limits)


def is_within(world: Simulator) -> bool:
    left, bottom, right, top = FENCE
    return bool(((world.x >= left) & (world.x <= right) & (world.y >= bottom) & (world.y <= top)).all())


def wild(chance: Random) -> str:
    """Something that moves a body, as somebody who does not care may say it."""
    speed, turn = chance.uniform(-50, 50), chance.uniform(-9, 9)
    return chance.choice(
        [
            f"(DRIVE {speed:.3f} {turn:.3f})",
            f"(DRIVE {abs(speed):.3f} 0)",
            f"(GOTO {chance.uniform(-1e4, 1e4):.1f} {chance.uniform(-1e4, 1e4):.1f})",
            f"(SETQ drive_speed {speed:.3f})",
            f"(SETQ drive_turn {turn:.3f})",
            "(WANDER)",
            "(TUMBLE)",
        ]
    )


@pytest.mark.parametrize("wheels", [True, False])
def test_nothing_gets_beyond_the_fence(tmp_path: Path, wheels: bool) -> None:
    world, guard = fenced(tmp_path, wheels)
    chance, nearest = Random(4), inf
    nodes = [
        Node(name, vocabulary_of(world.model), number=i, body=world.robots[i]) for i, name in enumerate(world.names)
    ]
    for tick in range(500):
        for node, body in zip(nodes, world.robots, strict=True):
            if chance.random() < 0.05:
                node.evaluate(wild(chance))
                wanted = node.actuators()
                if wanted:
                    body.act(Setpoint(wanted.get("drive_speed", nan), wanted.get("drive_turn", nan)))
        guard.enforce()
        world.step()
        assert is_within(world), tick
        nearest = min(nearest, float(FENCE[3] - world.y.max()), float(world.y.min() - FENCE[1]))
    assert nearest < 0.5, "they do get to the fence"


def test_at_the_fence_a_body_can_turn_round_and_come_back(tmp_path: Path) -> None:
    world, guard = fenced(tmp_path, True)
    body = world.robots[0]
    world.place(0, 519.0, 500.0, 0.0)

    def run(seconds: float) -> None:
        for _ in range(round(seconds / world.scenario.tick)):
            guard.enforce()
            world.step()

    body.drive(1.0, 0.0)
    run(10.0)
    assert 519.4 < world.x[0] <= 520.0
    assert world.bodies.speed[0] == 0.0
    body.drive(-1.0, 0.0)
    run(5.0)
    assert world.x[0] < 517.0
    body.drive(0.0, 1.0)
    run(pi)
    body.drive(1.0, 0.0)
    run(3.0)
    assert world.x[0] < 515.0


def test_a_body_beyond_the_fence_may_come_back_only(tmp_path: Path) -> None:
    world, guard = fenced(tmp_path, True)
    world.place(0, 530.0, 500.0, 0.0)
    for speed, moves in ((1.0, False), (-1.0, True)):
        world.robots[0].drive(speed, 0.0)
        guard.enforce()
        world.step()
        assert bool(world.bodies.speed[0]) is moves


def test_nothing_drives_into_what_it_sees(tmp_path: Path) -> None:
    limits = Limits(inf, inf, inf, None, 0.3)
    scenario = find_scenario("stop", Changes(6, None, True))
    world = Simulator(limited(scenario, limits), 11, machine=NumPyMachine())
    guard, chance = SafetyLimits(world, limits), Random(2)
    near = inf
    for tick in range(300):
        for i, body in enumerate(world.robots):
            if (tick + i) % 15 == 0:
                body.drive(chance.uniform(-1.0, 1.0), 0.0)
            if (tick + i) % 15 == 12:
                body.drive(0.0, chance.uniform(-3.0, 3.0))
        guard.enforce()
        before = world.x.copy(), world.y.copy()
        ahead = [body.nearest(-pi / 8, pi / 8) for body in world.robots]
        world.step()
        for i in range(len(world.names)):
            way = hypot(world.x[i] - before[0][i], world.y[i] - before[1][i])
            if world.bodies.speed[i] > 0.01:
                near = min(near, ahead[i] - way)
    assert 0.25 < near < 0.6, "they come near, and not nearer"
    assert not world.bodies.bumper.any()


def test_speeds_are_those_of_the_slower_of_both(tmp_path: Path) -> None:
    limits = Limits(0.4, 0.5, 0.2)
    world = Simulator(limited(scouts(tmp_path).scenario, limits), machine=NumPyMachine())
    assert world.model.limits.speed == 0.4
    world.place(0, 6.0, 6.0, 0.0)
    world.robots[0].drive(99.0, 0.0)
    speeds = []
    for _ in range(40):
        world.step()
        speeds.append(float(world.bodies.speed[0]))
    assert max(speeds) == pytest.approx(0.4)
    assert np.diff([0.0, *speeds]).max() <= 0.2 * world.scenario.tick * 1.001
    faster = limited(scouts(tmp_path).scenario, Limits(99.0, 99.0, 99.0))
    assert faster.robots.limits == scouts(tmp_path).scenario.robots.limits


def test_a_body_alone_is_guarded_as_well(tmp_path: Path) -> None:
    world, guard = fenced(tmp_path, True)
    body = SingleRobot(world, None, guard)
    for _ in range(300):
        body.drive(1.0, 0.0)
        body.sense()
    assert is_within(world)


def test_they_start_within_the_fence(tmp_path: Path) -> None:
    world, _ = fenced(tmp_path, False)
    assert is_within(world)
    scenario = simulator(tmp_path).scenario
    with pytest.raises(MisuseError, match="outside of a world"):
        limited(scenario, Limits(inf, inf, inf, (2_000.0, 0.0, 3_000.0, 10.0)))
    blind = replace(scenario, robots=replace(scenario.robots, geometry=replace(scenario.robots.geometry, sonars=0)))
    with pytest.raises(MisuseError, match="no sonars"):
        limited(blind, Limits(inf, inf, inf, None, 1.0))


def test_what_a_file_says(tmp_path: Path) -> None:
    file = tmp_path / "limits.toml"
    file.write_text('speed = "0.5m/s"\nrange = "10in"\n[fence]\nx = ["0m", "20m"]\ny = [0, "10m"]\n')
    assert read_limits(file) == Limits(0.5, inf, inf, (0.0, 0.0, 20.0, 10.0), 0.254)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("sped = 1", "speed"),
        ('speed = "1s"', "limits.toml:1: speed"),
        ("speed = 0", "limits.toml:1: speed"),
        ('[fence]\nx = ["5m", "1m"]\ny = ["0m", "1m"]', "least before the greatest"),
        ('[fence]\nx = ["0m", "1m"]', "fence.y"),
        ("range = -1", "range"),
        ('[fence]\nx = ["1m", "1m"]\ny = ["0m", "1m"]', "limits.toml:2: fence.x: there is no room"),
    ],
)
def test_what_a_file_may_not_say(tmp_path: Path, text: str, complaint: str) -> None:
    file = tmp_path / "limits.toml"
    file.write_text(text)
    with pytest.raises(SettingsError, match=complaint):
        read_limits(file)


@pytest.mark.parametrize(
    ("x", "heading", "speed", "wanted", "may"),
    [
        (0.0, 0.0, 0.0, 1.0, True),
        (9.99, 0.0, 0.0, 1.0, False),
        (9.99, pi, 0.0, 1.0, True),
        (9.99, 0.0, 0.0, -1.0, True),
        (9.0, 0.0, 1.0, 1.0, True),
        (9.6, 0.0, 1.0, 1.0, False),
        (9.4, 0.0, 1.0, -1.0, True),  # it brakes
        (12.0, 0.0, 0.0, 1.0, False),
        (12.0, pi, 0.0, 1.0, True),
    ],
)
def test_who_may_go_on(x: float, heading: float, speed: float, wanted: float, may: bool) -> None:
    limits = replace(LIMITS, fence=(-10.0, -10.0, 10.0, 10.0))
    assert limits.may_go_on((x, 0.0, heading), speed, wanted, 0.0, 0.2, lambda first, last: inf) is may


@pytest.mark.parametrize(("ahead", "may"), [(inf, True), (1.2, True), (0.5, False), (nan, False)])
def test_what_is_not_known_to_be_free_is_not(ahead: float, may: bool) -> None:
    limits = replace(LIMITS, least_range=0.3)
    assert limits.may_go_on((0.0, 0.0, 0.0), 1.0, 1.0, 0.0, 0.2, lambda first, last: ahead) is may


@pytest.mark.parametrize("seed", range(4))
def test_wanderers_that_start_anywhere_within_stay_within(seed: int) -> None:
    limits = Limits(2.0, inf, inf, (100.0, 100.0, 130.0, 130.0))
    world = Simulator(limited(find_scenario("bravo", Changes(20, None, True)), limits), seed, machine=NumPyMachine())
    guard = SafetyLimits(world, limits)
    for _ in range(300):
        guard.enforce()
        world.step()
    assert ((world.x >= 100.0) & (world.x <= 130.0) & (world.y >= 100.0) & (world.y <= 130.0)).all()
