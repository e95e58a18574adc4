"""A Scout behind a real server with a real simulation: it keeps the contract, obeys its mind, and stops without it."""

from __future__ import annotations

import json
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from math import hypot, inf, isclose, isnan, nan, pi
from pathlib import Path
from random import Random
from typing import cast

import pytest

from nomad.serving import LONGEST, TICK, Served, empty_room, serving
from nomad.troubled import TROUBLES, troubled
from packages import install
from processes import start
from sleepcast.bridges import BodyError, BusyError, Opening, OutOfReachError, open_robot
from sleepcast.bridges.body import MAX_JOBS
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import MisuseError
from sleepcast.loop import vocabulary_of
from sleepcast.nomad.bridge.model import model_of
from sleepcast.nomad.bridge.robot import SCOUT, NomadRobot
from sleepcast.nomad.client.nomad import Nomad, RefusedError
from sleepcast.nomad.wire.units import TENTH
from sleepcast.nomad.world.nomad_world import NomadWorld
from sleepcast.robot import FencedError, Limits, Setpoint
from sleepcast.testing.robot_contract import BridgeContract, BridgeRig, Rig, RobotContract


@pytest.fixture
def world() -> NomadWorld:
    return empty_room()


@pytest.fixture
def stepped(world: NomadWorld) -> Iterator[Served]:
    """A server whose time waits for its clients."""
    with serving(world, lockstep=True, headless=True) as served:
        yield served


@pytest.fixture
def running(world: NomadWorld) -> Iterator[Served]:
    """A server in five times real time."""
    with serving(world, speed=5.0, headless=True) as served:
        yield served


def reach(served: Served, tail: str = "#1", *, in_step: bool = False) -> NomadRobot:
    return cast(NomadRobot, open_robot(f"nomad://127.0.0.1:{served.port}{tail}", Opening(in_step)))


@pytest.fixture
def robot(stepped: Served) -> Iterator[NomadRobot]:
    with reach(stepped, in_step=True) as found:
        yield found


def until(true: Callable[[], bool], look: Callable[[], object] = lambda: None) -> None:
    deadline = time.monotonic() + LONGEST
    while not true():
        assert time.monotonic() < deadline
        look()
        time.sleep(0.005)


def keep_on(robot: NomadRobot, speed: float, turn_rate: float = 0.0) -> Callable[[], object]:
    """A mind's tick: on a busy machine the server may have stopped the robot for want of a request."""

    def look() -> object:
        robot.act(Setpoint(speed, turn_rate))
        return robot.sense()

    return look


def sensed(robot: NomadRobot) -> dict[str, float]:
    return dict(zip((sensor.name for sensor in robot.model.sensors), robot.sense().values, strict=True))


class LookOnly(Rig):
    """In step, to sense is to let a tick pass; here only `wait` does."""

    def sensed(self) -> dict[str, float]:
        robot = cast(NomadRobot, self.robot)
        return dict(zip((sensor.name for sensor in robot.model.sensors), robot.reading().values, strict=True))


def waiting(robot: NomadRobot) -> Callable[[float], None]:
    """Let so many s pass for a robot in step."""

    def wait(seconds: float) -> None:
        end = robot.now() + seconds - TICK / 2
        while robot.now() < end:
            robot.sense()

    return wait


class TestScoutBehindAServer(RobotContract):
    @pytest.fixture
    def rig(self, robot: NomadRobot) -> Rig:
        return LookOnly(robot, waiting(robot), resolution=2 * TENTH)


class TestScoutInItsOwnTime(BridgeContract):
    @pytest.fixture
    def rig(self, stepped: Served) -> Iterator[Rig]:
        clock, nomad = ManualClock(), Nomad.connect("127.0.0.1", stepped.port)

        def cut() -> None:
            body._nomad.connection.close()
            body._nomad.connection.port = 1

        def mend() -> None:
            body._nomad.connection.port = stepped.port

        with NomadRobot(nomad, SCOUT, model_of(SCOUT), clock=clock) as body:
            yield BridgeRig(body, clock, lambda _: None, cut, mend, resolution=2 * TENTH, step=TICK)


class TestNomad200BehindAServer(RobotContract):
    @pytest.fixture
    def rig(self) -> Iterator[Rig]:
        world = empty_room("nomad200")
        with (
            serving(world, lockstep=True, headless=True) as served,
            reach(served, "?type=nomad200#1", in_step=True) as robot,
        ):
            yield LookOnly(robot, waiting(robot), resolution=2 * TENTH)

    def test_it_goes_where_its_turret_looks(self, rig: Rig) -> None:
        rig.robot.act(Setpoint(0.2, 0.3))
        rig.wait(5.0)
        found = rig.sensed()
        assert found["speed"] == pytest.approx(0.2, abs=0.003)
        assert found["turn_rate"] == pytest.approx(0.3, abs=0.003)
        assert found["turret"] == pytest.approx(found["heading"], abs=0.02)
        assert found["heading"] > 1.0
        assert hypot(found["x"], found["y"]) > 0.5
        assert 0.0 <= found["infrared15"] <= 24 * 0.0254
        robot = cast(NomadRobot, rig.robot)
        robot.turn_axes(9.0, 9.0, -9.0)
        rig.wait(3.0)
        assert [abs(word) for word in robot.state.velocities] == [200, 450, 450]
        robot.travel(0.1, 0.0, 1.0)
        robot.cruise(0.1, 0.1, 0.1)
        robot.believe_heading(1.0, 0.5)
        rig.wait(1.0)
        assert robot.complaints() == []


# ---- what is asked, and its limits


def test_wheels_are_brought_within_the_limits_on_the_same_curve(stepped: Served, world: NomadWorld) -> None:
    with reach(stepped, "?speed=0.3&turn_rate=1#1", in_step=True) as robot:
        assert (robot.model.limits.speed, robot.model.limits.turn_rate) == (0.3, 1.0)
        robot.turn_axes(5.0, 2.5)
        robot.sense()
        right, left = robot.state.velocities[:2]
        for _ in range(30):
            robot.sense()
            right, left = robot.state.velocities[:2]
            assert max(abs(right), abs(left)) * TENTH <= 0.3
        assert isclose((right - left) / (right + left), 1.0 * 0.3452 / 0.6, rel_tol=0.03)
        robot.travel(-1e12, 0.0)
        robot.cruise(9.0, 9.0)
        for _ in range(30):
            robot.sense()
            assert abs(robot.state.velocities[0]) * TENTH <= 0.3


def test_short_commands(robot: NomadRobot, stepped: Served, world: NomadWorld) -> None:
    for _ in range(30):
        robot.sense()
    robot.travel(0.5, 0.5)
    robot.sense()
    assert sensed(robot)["moving"] == 1.0
    for _ in range(30):
        robot.sense()
    assert sensed(robot)["x"] == pytest.approx(0.5, abs=0.01)
    assert sensed(robot)["moving"] == 0.0
    robot.believe_place(1.0, -1.0)
    robot.believe_heading(pi / 2)
    found = sensed(robot)
    assert (found["x"], found["y"], found["heading"]) == pytest.approx((1.0, -1.0, pi / 2), abs=0.003)
    robot.place(0.5, 0.0, pi)
    robot.sense()
    assert world.observe(0).real.heading % (2 * pi) == pytest.approx(pi)
    assert hypot(world.observe(0).real.x - 0.5, world.observe(0).real.y) < 0.01
    robot.say("hello")
    robot.limp()
    robot.accelerate(0.5, 0.5)
    robot.sense()
    assert stepped.nserver.windows.robots[0].said[-1][1] == "hello"
    assert robot.complaints() == []


@pytest.mark.parametrize("huge", [1e308, -1e308, 1e18])
def test_numbers_of_any_size_do_no_harm(robot: NomadRobot, huge: float) -> None:
    robot.drive(huge, -huge)
    robot.turn_axes(huge, huge)
    robot.travel(huge, huge)
    robot.cruise(huge, huge)
    robot.accelerate(huge, huge)
    robot.believe_place(huge, huge)
    robot.believe_heading(huge)
    robot.place(huge, huge, huge)
    robot.fire_sonars(huge, huge)
    robot.sense()
    assert -pi <= robot.nearest(huge, -huge) * robot.sonar(huge)
    robot.say("x" * 20_000)
    robot.sense()
    assert [text for text in robot.complaints() if "bytes of text" in text]


def test_each_look_asks_the_server_once(robot: NomadRobot, world: NomadWorld) -> None:
    before = world.time
    for _ in range(10):
        robot.sense()
    robot.turn_axes(0.1, 0.1)
    robot.sense()
    robot.say("this has a reply without the state")
    robot.sense()
    assert round((world.time - before) / TICK) == 12


def test_sonars_are_fired_as_told(robot: NomadRobot) -> None:
    robot.fire_sonars(0.0)
    for _ in range(20):
        robot.sense()
    assert sensed(robot)["front_range"] == robot.nearest(-pi / 2, pi / 2) == robot.sonar(0.0) == pytest.approx(6.477)
    robot.fire_sonars(0.024, 0.0, 2.0, 15.0)
    robot.sense()
    assert robot.complaints() == []


def test_what_was_measured_a_while_ago_is_unknown(stepped: Served) -> None:
    clock, nomad = ManualClock(), Nomad.connect("127.0.0.1", stepped.port)
    with NomadRobot(nomad, SCOUT, model_of(SCOUT), clock=clock, in_step=True) as robot:
        robot.sense()
        clock.advance(0.9)
        assert robot.sonar(0.0) == robot.nearest(-1.0, 1.0) == pytest.approx(6.477)
        clock.advance(0.2)
        assert isnan(robot.sonar(0.0))
        assert isnan(robot.nearest(-1.0, 1.0))
        robot.sense()
        assert robot.sonar(0.0) == pytest.approx(6.477)


def test_it_can_always_brake(robot: NomadRobot, stepped: Served) -> None:
    robot.accelerate(0.0, 99.0)
    robot.sense()
    assert stepped.nserver.windows.robots[0].commands[-1][1] == "ac(394, 787, 0)"


def test_a_way_that_was_held_up_is_not_gone_afterwards(robot: NomadRobot) -> None:
    robot.travel(5.0, 5.0)
    for _ in range(10):
        robot.sense()
    robot.hold(True)
    for _ in range(20):
        robot.sense()
    robot.hold(False)
    there = sensed(robot)["x"]
    for _ in range(10):
        robot.sense()
    assert sensed(robot)["x"] == there > 0.0


def test_what_is_stopped_does_nothing_until_it_is_asked_anew(robot: NomadRobot, world: NomadWorld) -> None:
    robot.stop()
    robot.travel(1.0, 1.0)
    robot.limp()
    robot.zero()
    robot.place(1.0, 1.0, 0.0)
    for _ in range(10):
        robot.sense()
    robot.release()
    for _ in range(10):
        assert sensed(robot)["speed"] == 0.0
    assert hypot(*world.observe(0).real[:2]) < 0.01


def test_more_jobs_than_it_remembers_are_refused(robot: NomadRobot) -> None:
    for _ in range(MAX_JOBS):
        robot.say("x")
    with pytest.raises(BusyError, match="64 requests wait"):
        robot.say("x")
    robot.sense()
    robot.say("x")


def test_its_names_fit_the_language(robot: NomadRobot) -> None:
    names = {name.casefold() for name in vocabulary_of(robot.model).names()}
    wanted = {"vm", "pr", "st", "tk", "zr", "dp", "da", "conf_sn", "front_range", "sonar15", "bumper", "x", "y"}
    assert wanted | {"heading", "speed", "motor_volts", "drive_speed", "drive_turn"} <= names


# ---- the I/O thread


def test_the_mind_never_waits_and_the_io_thread_brings_everything(running: Served, world: NomadWorld) -> None:
    with reach(running) as robot:
        robot.say("on my way")
        until(lambda: robot.state.right_speed > 0.25, keep_on(robot, 0.3))
        robot.stop()
        until(lambda: robot.state.velocities == (0, 0, 0), robot.sense)
        assert running.nserver.windows.robots[0].said[-1][1] == "on my way"
        robot.release()
        until(lambda: robot.state.right_speed > 0.05 > -0.05 > robot.state.left_speed, keep_on(robot, nan, 0.5))
    assert world.observe(0).speeds[0] == pytest.approx(0.0, abs=0.3)
    until(lambda: world.observe(0).speeds[:2] == (0.0, 0.0))


def test_a_mind_that_no_longer_looks_loses_its_robot(running: Served) -> None:
    with reach(running) as robot:
        until(lambda: robot.state.right_speed > 0.25, keep_on(robot, 0.3))
        until(lambda: robot.state.velocities == (0, 0, 0))
        robot.sense()
        time.sleep(0.2)
        assert robot.state.velocities == (0, 0, 0)  # nothing old resumes


def test_a_body_that_was_out_of_reach_is_at_rest_when_it_is_found_again(running: Served, world: NomadWorld) -> None:
    with reach(running) as robot:
        until(lambda: robot.state.right_speed > 0.25, keep_on(robot, 0.3))
        before = robot.reading().time
        robot._nomad.connection.close()
        until(lambda: robot.lost != "", robot.sense)
        until(lambda: world.observe(0).speeds[:2] == (0.0, 0.0))  # its server has stopped it
        with pytest.raises(OutOfReachError, match="the body is out of reach"):
            robot.turn_axes(0.3, 0.3)
        with pytest.raises(OutOfReachError, match="the body is out of reach"):
            robot.say("nobody hears this")
        robot.act(Setpoint(0.3, 0.0))
        robot.stop()
        assert robot.stopped
        until(lambda: robot.lost == "", robot.sense)
        assert robot.stopped
        robot.act(Setpoint(0.3, 0.0))
        until(lambda: robot.sense().time > before + 1.0)
        assert robot.state.velocities == (0, 0, 0)
        robot.release()
        until(lambda: robot.state.right_speed > 0.25, keep_on(robot, 0.3))
        found = robot.complaints()
        assert found[0].startswith("the body is out of reach: ")
        assert found[-1] == "the body is within reach again, and at rest until a command moves it"


@pytest.mark.parametrize("trouble", TROUBLES)
def test_a_server_that_goes_wrong_while_it_moves_is_told_and_nothing_old_resumes(
    running: Served, world: NomadWorld, trouble: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("model", "robot"):
        monkeypatch.setattr(f"sleepcast.nomad.bridge.{module}.PATIENCE", 0.5)
    with troubled(running.port) as between, closing(open_robot(f"nomad://127.0.0.1:{between.port}#1")) as robot:
        assert isinstance(robot, NomadRobot)
        goes_wrong(robot, lambda trouble=trouble: setattr(between, "trouble", trouble))
        until(lambda: world.observe(0).speeds[:2] == (0.0, 0.0))  # its server has stopped it
        comes_back(robot, lambda: setattr(between, "trouble", ""))


def test_a_server_whose_process_freezes_is_told_and_nothing_old_resumes(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("model", "robot"):
        monkeypatch.setattr(f"sleepcast.nomad.bridge.{module}.PATIENCE", 1.0)
    with start(*SERVER) as server:
        try:
            assert server.stdout is not None
            port = json.loads(server.stdout.readline())["port"]
            with closing(open_robot(f"nomad://127.0.0.1:{port}#1")) as robot:
                assert isinstance(robot, NomadRobot)
                goes_wrong(robot, lambda: server.send_signal(signal.SIGSTOP))
                comes_back(robot, lambda: server.send_signal(signal.SIGCONT))
        finally:
            server.kill()


SERVER = (sys.executable, "-m", "sleepcast", "nserver", "--headless", "--port", "0", "--json", "--speed", "5")


def goes_wrong(robot: NomadRobot, happen: Callable[[], object]) -> None:
    """While the robot moves; it is told, and stopped meanwhile."""
    until(lambda: robot.state.right_speed > 0.25, keep_on(robot, 0.3))
    happen()
    until(lambda: robot.lost != "", keep_on(robot, 0.3))
    robot.stop()
    assert robot.complaints()[-1].startswith("the body is out of reach: ")


def comes_back(robot: NomadRobot, happen: Callable[[], object]) -> None:
    """It rests then, until it is asked anew."""
    happen()
    until(lambda: robot.lost == "", robot.sense)
    before = robot.sense().time
    until(lambda: robot.sense().time > before + 1.0)
    assert robot.state.velocities == (0, 0, 0)
    robot.release()
    before = robot.sense().time
    until(lambda: robot.sense().time > before + 1.0)
    assert robot.state.velocities == (0, 0, 0)
    until(lambda: robot.state.right_speed > 0.25, keep_on(robot, 0.3))


def test_zeroing_takes_its_time_and_stop_does_not_wait_for_it(running: Served) -> None:
    with reach(running) as robot:
        until(lambda: robot.state.x > 0.2, keep_on(robot, 0.5, 0.3))
        robot.zero()
        with pytest.raises(BusyError, match="still on its way home"):
            robot.zero()
        until(lambda: robot.state.words[34:37] == (0, 0, 0) and not any(robot.state.moving), robot.sense)
        assert robot.complaints() == []


def test_what_the_server_refuses_is_told(robot: NomadRobot) -> None:
    robot.send(lambda: robot._nomad.special_request(1, 40))
    robot.sense()
    assert [text.partition(" with")[0] for text in robot.complaints()] == ["the server refused special_request"]
    assert robot.sense().time > 0


# ---- URIs


@pytest.mark.parametrize(
    ("uri", "error"),
    [
        ("nomat://127.0.0.1", "did you mean nomad"),
        ("127.0.0.1:7019", "names no body; wanted something like nomad://127.0.0.1:7019#1"),
        ("", "names no body"),
        ("nomad://", "has no host"),
        ("nomad://:7019", "has no host"),
        ("nomad://127.0.0.1:70190#1", "Port out of range"),
        ("nomad://127.0.0.1:port", "leads nowhere"),
        ("nomad://[::1", "leads nowhere"),
        ("nomad://127.0.0.1/extra#1", "has no host, or more"),
        ("nomad://127.0.0.1#0", "robots are numbered from 1"),
        ("nomad://127.0.0.1#one", "robots are numbered from 1"),
        ("nomad://127.0.0.1#" + "9" * 500, "robots are numbered from 1"),
        ("nomad://127.0.0.1?sped=1#1", "did you mean speed"),
        (
            "nomad://127.0.0.1?type=nomad20#1",
            r"there is no type 'nomad20' \(did you mean nomad200\?\); there are scout, nomad200",
        ),
        ("nomad://127.0.0.1?speed=fast#1", "speed is a number above 0"),
        ("nomad://127.0.0.1?turn_rate=nan#1", "turn_rate is a number above 0"),
        ("nomad://127.0.0.1?speed=#1", "speed is a number above 0"),
    ],
)
def test_a_uri_that_leads_nowhere(uri: str, error: str) -> None:
    with pytest.raises(BodyError, match=error):
        open_robot(uri)


def test_what_is_installed_is_named() -> None:
    with pytest.raises(BodyError, match=r"names no body \(did you mean sim\?\).*; installed are .*nomad.*sim"):
        open_robot("simm:maze")


def test_a_body_that_nothing_would_stop_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    points = "[sleepcast.bodies]\nloose = loose_bodies:open_body\n"
    install(tmp_path, monkeypatch, "loose", points, loose_bodies="def open_body(uri, opening): return object()")
    with pytest.raises(MisuseError, match="gives a object, which is no BridgedBody: nothing would bring it to rest"):
        open_robot("loose://here")


def test_a_robot_that_there_is_not(running: Served) -> None:
    with pytest.raises(RefusedError, match="has no robot 2"):
        reach(running, "#2")


def test_a_fence_holds_whatever_the_mind_asks(stepped: Served, world: NomadWorld) -> None:
    limits = Limits(0.5, inf, 1.0, fence=(-1.0, -0.5, 1.5, 0.8))
    chance, reached = Random(3), 0.0
    with cast(NomadRobot, open_robot(f"nomad://127.0.0.1:{stepped.port}#1", Opening(True, limits))) as robot:
        for tick in range(250):
            if tick % 10 == 0:
                speed, turn = chance.uniform(-2.0, 2.0), chance.uniform(-3.0, 3.0)
                chance.choice(
                    [
                        lambda: robot.drive(speed, turn),  # noqa: B023  # called at once
                        lambda: robot.drive(speed, 0.0),  # noqa: B023
                        lambda: robot.travel(5.0, 5.0),
                        lambda: robot.turn_axes(1.0, -1.0),
                    ]
                )()
            robot.sense()
            real = world.observe(0).real
            assert -1.0 <= real.x <= 1.5
            assert -0.5 <= real.y <= 0.8
            assert abs(robot.state.velocities[0]) * TENTH <= 0.5
            reached = max(reached, real.x / 1.5, real.y / 0.8, -real.y / 0.5)
        assert reached > 0.7, "it does get near it"
        for talk in (
            lambda: robot.believe_place(5.0, 5.0),
            lambda: robot.believe_heading(1.0),
            lambda: robot.place(0.0, 0.0, 0.0),
            robot.zero,
        ):
            with pytest.raises(FencedError, match="its position may not be set"):
                talk()


def test_a_least_range_holds_whatever_the_mind_asks(stepped: Served, world: NomadWorld) -> None:
    world.add([(1.5, -1.0), (1.7, -1.0), (1.7, 1.0), (1.5, 1.0)])
    limits = Limits(inf, inf, inf, least_range=0.4)
    with cast(NomadRobot, open_robot(f"nomad://127.0.0.1:{stepped.port}#1", Opening(True, limits))) as robot:
        for _ in range(60):
            robot.drive(1.0, 0.0)
            robot.sense()
        assert 0.4 <= robot.nearest(-0.3, 0.3) < 0.9
        robot.drive(-0.5, 0.0)
        for _ in range(20):
            robot.sense()
        assert world.observe(0).real.x < 0.5, "away from it the way is free"
