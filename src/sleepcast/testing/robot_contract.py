"""What every robot promises, whatever its body is made of: derive from `RobotContract` and give it a `rig`.

Bodies behind a bridge promise more: derive from `BridgeContract`, whose rig lets time pass for body and robot alike
(`BridgeRig`), so that no test waits; bodies that hover from `HoverContract`.
`pytest.register_assert_rewrite("sleepcast.testing.robot_contract")` in a conftest.py makes failures say what differed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import hypot, inf, isclose, isfinite, isnan, nan

from sleepcast.bridges import BridgedBody, OutOfReachError
from sleepcast.bridges.body import LATEST, ROUND, UNATTENDED
from sleepcast.core.clock import ManualClock
from sleepcast.core.records import dataclass
from sleepcast.robot import Limits, RestSensing, Robot, Setpoint


@dataclass
class Rig:
    """A robot that may move freely, and a way to let time pass for it (s).

    resolution: the smallest difference of speeds that it can tell, m/s.
    """

    robot: Robot
    wait: Callable[[float], None]
    resolution: float = 0.0

    def sensed(self) -> dict[str, float]:
        values = self.robot.sense().values
        names = [sensor.name for sensor in self.robot.model.sensors]
        return dict(zip(names, values, strict=True))

    def time_to_full_speed(self) -> float:
        limits = self.robot.model.limits
        return 2.0 * limits.speed / limits.acceleration + 1.0


class BridgeRig(Rig):
    """A body whose I/O thread was not started, so that time passes for it only here, and the same for its robot.

    body: not in step, with this clock.
    advance: lets so many s pass for the robot.
    cut, mend: the way to the robot.
    step: s between two rounds.
    """

    def __init__(
        self,
        body: BridgedBody,
        clock: ManualClock,
        advance: Callable[[float], None],
        cut: Callable[[], None],
        mend: Callable[[], None],
        *,
        resolution: float = 0.0,
        step: float = ROUND,
    ) -> None:
        super().__init__(body, self._wait, resolution)
        self.body, self.cut, self.mend = body, cut, mend
        self._clock, self._advance, self._step = clock, advance, step

    def prepare(self) -> None:
        """Do what must be done before the robot drives, also after it has come to rest by itself: for most, nothing."""

    def _wait(self, seconds: float) -> None:
        self.look_away(seconds, looking=True)

    def look_away(self, seconds: float, *, looking: bool = False) -> None:
        """Let so many s pass in which the mind does not look at its body."""
        for _ in range(round(seconds / self._step)):
            self._clock.advance(self._step)
            self._advance(self._step)
            self.body.round()
            if looking:
                self.body.sense()


class RobotContract:
    """The tests; a derived class has a fixture `rig`. The robot measures its `speed` and its `heading`."""

    def test_is_a_robot(self, rig: Rig) -> None:
        assert isinstance(rig.robot, Robot)

    def test_names_are_unique(self, rig: Rig) -> None:
        model = rig.robot.model
        quantities, functions = (*model.sensors, *model.actuators), model.functions
        names = [*(each.name.casefold() for each in quantities), *(each.name.casefold() for each in functions)]
        assert len(names) == len(set(names))
        assert names

    def test_limits_are_positive_and_finite(self, rig: Rig) -> None:
        limits = rig.robot.model.limits
        for limit in (limits.speed, limits.turn_rate, limits.acceleration, rig.robot.model.geometry.radius):
            assert 0 < limit < inf

    def test_a_reading_has_one_value_in_its_range_for_each_sensor(self, rig: Rig) -> None:
        rig.robot.act(Setpoint(speed=rig.robot.model.limits.speed))
        for _ in range(5):
            rig.wait(1.0)
            reading = rig.robot.sense()
            for sensor, value in zip(rig.robot.model.sensors, reading.values, strict=True):
                assert isnan(value) or sensor.low <= value <= sensor.high, sensor.name

    def test_readings_are_timed(self, rig: Rig) -> None:
        before = rig.robot.sense().time
        rig.wait(2.0)
        assert isclose(rig.robot.sense().time - before, 2.0, rel_tol=0.2)

    def test_drives_as_asked(self, rig: Rig) -> None:
        limits = rig.robot.model.limits
        rig.robot.act(Setpoint(speed=limits.speed / 2, turn_rate=0.0))
        rig.wait(rig.time_to_full_speed())
        assert isclose(rig.sensed()["speed"], limits.speed / 2, rel_tol=0.1)

    def test_nothing_exceeds_the_limits(self, rig: Rig) -> None:
        limits = rig.robot.model.limits
        for sign in (1.0, -1.0):
            rig.robot.act(Setpoint(speed=sign * 100 * limits.speed, turn_rate=sign * 100 * limits.turn_rate))
            for _ in range(20):
                before = rig.sensed()
                rig.wait(0.2)
                after = rig.sensed()
                assert abs(after["speed"]) <= limits.speed * 1.001 + rig.resolution
                assert abs(after["speed"] - before["speed"]) <= limits.acceleration * 0.2 * 1.001 + rig.resolution

    def test_unknown_leaves_the_motion_as_it_is(self, rig: Rig) -> None:
        wanted = rig.robot.model.limits.speed / 2
        rig.robot.act(Setpoint(speed=wanted, turn_rate=0.0))
        rig.robot.act(Setpoint(speed=nan, turn_rate=nan))
        rig.wait(rig.time_to_full_speed())
        assert isclose(rig.sensed()["speed"], wanted, rel_tol=0.1)
        assert all(isfinite(rig.sensed()[name]) for name in ("speed", "heading"))

    def test_stop_comes_to_rest_and_stays(self, rig: Rig) -> None:
        full = Setpoint(speed=rig.robot.model.limits.speed, turn_rate=0.0)
        rig.robot.act(full)
        rig.wait(rig.time_to_full_speed())
        assert rig.sensed()["speed"] > 0
        rig.robot.stop()
        assert rig.robot.stopped
        rig.robot.act(full)
        rig.wait(rig.time_to_full_speed())
        assert rig.sensed()["speed"] == 0
        rig.robot.stop()
        assert rig.robot.stopped

    def test_a_stopped_robot_tells_when_it_is_at_rest(self, rig: Rig) -> None:
        """If it is one that tells: never at rest before it is, nor farther to go than its limits allow."""
        limits, robot = rig.robot.model.limits, rig.robot
        if not isinstance(robot, RestSensing):
            return
        robot.act(Setpoint(speed=limits.speed, turn_rate=0.0))
        rig.wait(rig.time_to_full_speed())
        rig.robot.sense()
        before = robot.rest_state()
        if before is None:
            return
        assert isclose(before.speed, limits.speed, rel_tol=0.2)
        way = limits.speed * limits.speed / (2.0 * limits.acceleration)
        assert 0.5 * way <= before.distance <= 2.0 * way + limits.speed
        robot.stop()
        rig.wait(rig.time_to_full_speed())
        rig.robot.sense()
        after = robot.rest_state()
        assert after is not None
        assert after.at_rest
        assert after.distance == 0.0

    def test_release_resumes_nothing_by_itself(self, rig: Rig) -> None:
        full = Setpoint(speed=rig.robot.model.limits.speed, turn_rate=0.0)
        rig.robot.act(full)
        rig.robot.stop()
        rig.wait(rig.time_to_full_speed())
        rig.robot.release()
        assert not rig.robot.stopped
        rig.wait(1.0)
        assert rig.sensed()["speed"] == 0
        rig.robot.act(full)
        rig.wait(rig.time_to_full_speed())
        assert rig.sensed()["speed"] > 0

    def test_hold_pauses_the_motion(self, rig: Rig) -> None:
        rig.robot.act(Setpoint(speed=rig.robot.model.limits.speed, turn_rate=0.0))
        rig.robot.hold(True)
        rig.wait(rig.time_to_full_speed())
        assert rig.sensed()["speed"] == 0
        rig.robot.hold(False)
        rig.wait(rig.time_to_full_speed())
        assert rig.sensed()["speed"] > 0

    def test_stop_holds_even_after_a_hold(self, rig: Rig) -> None:
        rig.robot.act(Setpoint(speed=rig.robot.model.limits.speed, turn_rate=0.0))
        rig.robot.hold(True)
        rig.robot.stop()
        rig.robot.hold(False)
        rig.wait(rig.time_to_full_speed())
        assert rig.sensed()["speed"] == 0


class BridgeContract(RobotContract):
    """The tests for a body behind a bridge; a derived class has a fixture `rig`, a `BridgeRig`. The robot
    measures its `x`, `y` and `turn_rate`, too."""

    def test_what_every_bridge_has_in_common_is_there(self, rig: BridgeRig) -> None:
        assert isinstance(rig.body, BridgedBody)
        assert {"x", "y", "heading", "speed", "turn_rate"} <= {sensor.name for sensor in rig.body.model.sensors}

    def test_a_mind_that_no_longer_looks_loses_its_body(self, rig: BridgeRig) -> None:
        self._drive(rig)
        rig.look_away(UNATTENDED + rig.time_to_full_speed())
        assert rig.sensed()["speed"] == 0
        rig.wait(1.0)
        assert rig.sensed()["speed"] == 0, "nothing old resumes"
        self._drive(rig)

    def test_a_fence_holds_whatever_is_asked(self, rig: BridgeRig) -> None:
        start, limits = rig.sensed(), rig.body.model.limits
        way = 2.0 * limits.speed + limits.speed**2 / limits.acceleration
        left, bottom, right, top = (start["x"] - way, start["y"] - way, start["x"] + way, start["y"] + way)
        rig.body.narrow(Limits(inf, inf, inf, fence=(left, bottom, right, top)))
        farthest = 0.0
        for turn in (0.0, 0.3, -1.0, 0.0):
            for sign in (1.0, -1.0):
                for _ in range(40):
                    rig.body.act(Setpoint(sign * limits.speed, turn * limits.turn_rate))
                    rig.wait(0.2)
                    sensed = rig.sensed()
                    assert left <= sensed["x"] <= right
                    assert bottom <= sensed["y"] <= top
                    farthest = max(farthest, hypot(sensed["x"] - start["x"], sensed["y"] - start["y"]))
        assert farthest > way / 3.0, "it does drive"

    def test_a_robot_that_was_gone_is_at_rest_when_it_is_back(self, rig: BridgeRig) -> None:
        self._drive(rig)
        rig.cut()
        self._wait_until(rig, lambda: bool(rig.body.lost))
        for ask in (partial(rig.body.drive, 1.0, 0.0), partial(rig.body.send, list)):
            try:
                ask()
            except OutOfReachError:
                continue
            raise AssertionError("what cannot be done must be refused")
        rig.body.act(Setpoint(rig.body.model.limits.speed, 0.0))  # does nothing, and never fails
        rig.mend()
        self._wait_until(rig, lambda: not rig.body.lost)
        rig.wait(rig.time_to_full_speed())
        assert rig.sensed()["speed"] == 0
        complaints = rig.body.complaints()
        assert complaints[0].startswith("the body is out of reach: ")
        assert complaints[-1] == "the body is within reach again, and at rest until a command moves it"
        self._drive(rig)

    def test_stop_holds_while_the_robot_is_gone(self, rig: BridgeRig) -> None:
        self._drive(rig)
        rig.cut()
        self._wait_until(rig, lambda: bool(rig.body.lost))
        rig.body.stop()
        unknown = rig.body.rest_state()
        assert unknown is not None
        assert not unknown.at_rest, "nobody knows what it does"
        rig.mend()
        self._wait_until(rig, lambda: not rig.body.lost)
        rig.body.act(Setpoint(rig.body.model.limits.speed, 0.0))
        rig.wait(rig.time_to_full_speed())
        assert rig.body.stopped
        assert rig.sensed()["speed"] == 0

    @staticmethod
    def _drive(rig: BridgeRig) -> None:
        rig.prepare()
        rig.body.act(Setpoint(rig.body.model.limits.speed / 2, 0.0))
        rig.wait(rig.time_to_full_speed())
        assert isclose(rig.sensed()["speed"], rig.body.model.limits.speed / 2, rel_tol=0.1)

    @staticmethod
    def _wait_until(rig: BridgeRig, true: Callable[[], bool]) -> None:
        for _ in range(round(4.0 * LATEST)):
            if true():
                return
            rig.wait(1.0)
        raise AssertionError(f"this has not come true in {4.0 * LATEST} s")


class HoverContract(BridgeContract):
    """The tests for a body that hovers, whose `rig` has it in the air, away from floor and ceiling. It measures its
    `height` and `climb_rate`, too, and `drift_measured` says how it goes to its side."""

    def test_it_has_the_actuators_of_all_that_hover(self, rig: BridgeRig) -> None:
        names = [actuator.name for actuator in rig.body.model.actuators]
        assert names == ["drive_speed", "drive_turn", "drive_side", "drive_climb"]
        limits = rig.body.model.limits
        assert isfinite(limits.climb + limits.floor + limits.ceiling)

    def test_it_goes_and_climbs_in_any_direction_at_once(self, rig: BridgeRig) -> None:
        limits = rig.body.model.limits
        speed, climb = limits.speed / 2.0, limits.climb / 2.0
        rig.body.act(Setpoint(speed, 0.0, side=-speed))
        rig.body.act(Setpoint(climb=climb))
        rig.wait(rig.time_to_full_speed())
        ahead, left = rig.body.drift_measured()
        assert isclose(ahead, speed, rel_tol=0.1)
        assert isclose(left, -speed, rel_tol=0.1)
        assert isclose(rig.sensed()["climb_rate"], climb, rel_tol=0.1)

    def test_its_speed_is_limited_in_whatever_direction(self, rig: BridgeRig) -> None:
        limits, before = rig.body.model.limits, (0.0, 0.0, 0.0)
        for sign in (1.0, -1.0):
            rig.body.act(Setpoint(sign * 100 * limits.speed, 0.0, 100 * limits.speed, sign * 100 * limits.climb))
            for _ in range(10):
                rig.wait(0.2)
                now = (*rig.body.drift_measured(), rig.sensed()["climb_rate"])
                assert hypot(*now[:2]) <= limits.speed * 1.001 + 2.0 * rig.resolution
                assert abs(now[2]) <= limits.climb * 1.001 + rig.resolution
                change = hypot(*(b - a for a, b in zip(before, now, strict=True)))
                assert change <= limits.acceleration * 0.2 * 1.001 + 3.0 * rig.resolution
                before = now

    def test_it_comes_to_rest_before_its_floor_and_its_ceiling(self, rig: BridgeRig) -> None:
        start = rig.sensed()["height"]
        room = 0.5 * min(start, rig.body.model.limits.climb**2 / rig.body.model.limits.acceleration + 1.0)
        rig.body.narrow(Limits(inf, inf, inf, floor=start - room, ceiling=start + room))
        for climb, end in ((inf, start + room), (-inf, start - room)):
            rig.body.act(Setpoint(climb=climb))
            for _ in range(50):
                rig.wait(0.2)
                assert start - room - rig.resolution <= rig.sensed()["height"] <= start + room + rig.resolution
            assert isclose(rig.sensed()["height"], end, abs_tol=0.1 * room), "it does go there"

    def test_a_fence_holds_to_its_sides(self, rig: BridgeRig) -> None:
        start, limits = rig.sensed(), rig.body.model.limits
        way = 2.0 * limits.speed + limits.speed**2 / limits.acceleration
        left, bottom, right, top = (start["x"] - way, start["y"] - way, start["x"] + way, start["y"] + way)
        rig.body.narrow(Limits(inf, inf, inf, fence=(left, bottom, right, top)))
        farthest = 0.0
        for speed, turn, side in ((0.0, 0.0, 1.0), (-1.0, 0.0, -1.0), (0.3, 1.0, -1.0), (1.0, 0.0, 1.0)):
            for _ in range(40):
                rig.body.act(Setpoint(speed * limits.speed, turn * limits.turn_rate, side * limits.speed))
                rig.wait(0.2)
                sensed = rig.sensed()
                assert left <= sensed["x"] <= right
                assert bottom <= sensed["y"] <= top
                farthest = max(farthest, hypot(sensed["x"] - start["x"], sensed["y"] - start["y"]))
        assert farthest > way / 3.0, "it does go there"

    def test_what_ends_its_motion_ends_it_in_all_directions(self, rig: BridgeRig) -> None:
        """STOP, a hold, and a mind that is gone: it hovers where it is."""
        limits, body = rig.body.model.limits, rig.body
        stop, hold, look_away = body.stop, partial(body.hold, True), partial(rig.look_away, UNATTENDED + 0.2)
        for end, begin_anew in ((stop, body.release), (hold, partial(body.hold, False)), (look_away, list)):
            rig.prepare()
            body.act(Setpoint(0.0, 0.0, limits.speed / 2.0, limits.climb / 2.0))
            rig.wait(rig.time_to_full_speed() / 2.0)
            assert body.drift_measured()[1] > 0.0 < rig.sensed()["climb_rate"]
            end()
            rig.wait(rig.time_to_full_speed())
            height = rig.sensed()["height"]
            rig.wait(1.0)
            assert hypot(*body.drift_measured()) <= rig.resolution
            assert isclose(rig.sensed()["height"], height, abs_tol=rig.resolution)
            body.act(Setpoint(0.0, 0.0, 0.0, 0.0))
            begin_anew()
