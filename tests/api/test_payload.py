"""Classes of one's own in a simulated fleet: what is refused, what stops, and what fails."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.node.linking import LinkError, actuator, command, function, sensor


class Lamp:
    """A robot with a lamp, which only some of them can switch on."""

    def __init__(self, body: sc.SimulatedBody) -> None:
        self.body, self.rate, self.lamp = body, 0.0, 0.0

    @property
    @actuator(unit="m/s", low=-2, high=2)
    def winch(self) -> float:
        """How fast it pulls."""
        return self.rate

    @winch.setter
    def winch(self, value: float) -> None:
        self.rate = value

    @property
    @sensor(unit="m/s")
    def pulling(self) -> float:
        return self.rate

    @property
    @sensor(unit="s", freshness=5.0, measured_at="began")
    def since(self) -> float:
        return 1.0

    began = 0.0

    @command
    def light(self, on: float) -> None:
        if self.body.numbers == 2:
            raise RuntimeError("broken")
        self.lamp = on

    @function
    def lit(self) -> float:
        return self.lamp


class Lamps:
    """The same for all at once."""

    vectorised = True

    def __init__(self) -> None:
        self.rate = np.zeros(5)

    @property
    @actuator(unit="m/s", low=-2, high=2)
    def winch(self) -> np.ndarray:
        return self.rate

    @winch.setter
    def winch(self, values: np.ndarray) -> None:
        self.rate = values

    @sensor(unit="m/s")
    def pulling(self) -> np.ndarray:
        return self.rate


def opened(robots: type) -> sc.SimulatedFleet:
    return sc.open("bravo", robots=robots, over={"robots.count": 5})


@pytest.mark.parametrize("robots", [Lamp, Lamps])
def test_actuators_are_clamped_and_stop_sets_them_to_rest(robots: type) -> None:
    fleet = opened(robots)
    fleet.send("(RULE pull (SETQ winch 5m/s))", everybody=True)
    fleet.run(0.5, quiet=True)
    assert fleet["pulling"].tolist() == [2.0] * 5
    fleet.stop()
    fleet.run(0.5, quiet=True)
    assert fleet["pulling"].tolist() == [0.0] * 5
    fleet.release()
    fleet.run(0.5, quiet=True)
    assert fleet["pulling"].tolist() == [2.0] * 5


def test_what_fails_in_one_robot_is_its_fault_alone() -> None:
    fleet = opened(Lamp)
    sent = fleet.send("(LIGHT 1)", everybody=True)
    assert sent.fault == ("scout2",)
    assert sent.why("scout2").faults == ("light failed: RuntimeError: broken in (LIGHT 1)",)
    assert fleet["(LIT)"].tolist() == [1.0, 0.0, 1.0, 1.0, 1.0]


def test_what_is_too_old_is_unknown() -> None:
    fleet = opened(Lamp)
    assert not np.isnan(fleet["since"]).any()
    fleet.run(6, quiet=True)
    assert np.isnan(fleet["since"]).all()


def test_a_run_whose_state_only_the_class_knows_is_not_saved(tmp_path: Path) -> None:
    fleet = opened(Lamp)
    for refused in (fleet.snapshot, fleet.fork, lambda: fleet.record(tmp_path / "run.mcap")):
        with pytest.raises(sc.errors.MisuseError, match="only the class knows their state"):
            refused()


def test_a_class_that_cannot_be_used_is_refused() -> None:
    class Nothing:
        pass

    class Clash:
        @property
        @sensor()
        def fuel(self) -> float:
            return 1.0

    class Failing:
        @property
        @sensor()
        def moisture(self) -> float:
            raise OSError("no probe")

    class Short:
        vectorised = True

        @property
        @sensor()
        def moisture(self) -> np.ndarray:
            return np.zeros(3)

    class Unasked:
        vectorised = True

        @function
        def lit(self) -> float:
            return 1.0

    for robots, wrong in (
        (Nothing, "declares nothing"),
        (Failing, "cannot be read: OSError: no probe"),
        (Short, "no array of 5 numbers"),
        (Unasked, "takes no robots"),
    ):
        with pytest.raises(LinkError, match=wrong):
            opened(robots)
    with pytest.raises(sc.errors.MisuseError, match="fuel"):
        opened(Clash)


@pytest.mark.parametrize("which", [3, slice(None)])
def test_where_robots_were_stays_when_time_goes_on(which: int | slice) -> None:
    fleet = sc.open("bravo", robots=8)
    fleet.send("(RULE go (DRIVE 5m/s 2deg/s))", everybody=True)
    body = sc.SimulatedBody(fleet.run(1).swarm.simulator.bodies, which)
    before = body.x, body.y, body.heading
    fleet.run(10)
    assert np.mean(np.hypot(body.x - before[0], body.y - before[1])) > 5.0
    assert np.mean(np.abs(body.heading - before[2])) > 0.1
