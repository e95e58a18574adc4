"""What every robot promises, whatever its body is made of: derive from `RobotContract` and give it a `rig`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, isclose, isfinite, isnan, nan

from sleepcast.robot import Robot, Setpoint


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
        return {sensor.name: value for sensor, value in zip(self.robot.model.sensors, values, strict=True)}

    def time_to_full_speed(self) -> float:
        limits = self.robot.model.limits
        return 2.0 * limits.speed / limits.acceleration + 1.0


class RobotContract:
    """The tests; a derived class has a fixture `rig`. The robot measures its `speed` and its `heading`."""

    def test_is_a_robot(self, rig: Rig) -> None:
        assert isinstance(rig.robot, Robot)

    def test_names_are_unique(self, rig: Rig) -> None:
        model = rig.robot.model
        names = [named.name.casefold() for named in (*model.sensors, *model.actuators, *model.functions)]
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
                assert abs(after["speed"]) <= limits.speed * 1.001
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
