"""What keeps real bodies safe, tried on a body in this process whose rover forgets where it is."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from math import inf, nan
from typing import ClassVar

import pytest

from sleepcast.bridges import BridgedBody, BusyError, Motion, OutOfReachError
from sleepcast.bridges.body import MAX_JOBS, REST, ROUND
from sleepcast.core.clock import Clock, ManualClock, WallClock
from sleepcast.core.errors import MisuseError
from sleepcast.core.model import Quantity
from sleepcast.robot import Geometry, Limits, Reading, RobotModel, Setpoint

SENSORS = tuple(Quantity(name) for name in ("x", "y", "heading", "speed", "turn_rate"))
PATIENCE = 60.0
"""Seconds that a busy machine may take."""
MODEL = RobotModel("cart", SENSORS, (), (), Limits(1.0, 1.0, 2.0), Geometry(0.1))


class Cart(BridgedBody):
    """Does nothing but note what it is told."""

    def __init__(self, clock: Clock, model: RobotModel = MODEL) -> None:
        super().__init__(model, clock=clock)
        self.told: list[Motion] = []
        self.x, self.time = 0.0, 0.0

    def carry_out(self, motion: Motion) -> None:
        self.told.append(motion)

    def measure(self) -> None:
        self.time += ROUND

    def reading(self) -> Reading:
        return Reading(self.time, (self.x, 0.0, 0.0, 0.0, 0.0)[: len(self.model.sensors)])

    def seek(self) -> None:
        raise AssertionError("it is never gone")

    def leave(self) -> None:
        self.told.append(Motion("rest"))


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def cart(clock: ManualClock) -> Cart:
    return Cart(clock)


class Hasty(WallClock):
    """Ten times as fast as any other."""

    def now(self) -> float:
        return 10.0 * super().now()


def pass_time(cart: Cart, clock: ManualClock, seconds: float) -> None:
    for _ in range(round(seconds / ROUND)):
        clock.advance(ROUND)
        cart.round()


def test_a_body_that_does_not_know_where_it_is_stands_if_it_has_a_fence(cart: Cart, clock: ManualClock) -> None:
    cart.narrow(Limits(inf, inf, inf, fence=(-9.0, -9.0, 9.0, 9.0)))
    cart.act(Setpoint(0.5))
    pass_time(cart, clock, 0.5)
    assert cart.told[-1].values[0] == pytest.approx(0.5)
    cart.x = nan
    pass_time(cart, clock, 0.5)
    assert cart.told[-1].sort == "rest"
    assert cart.complaints() == ["it is at rest: it does not know where it is, and has a fence"]
    cart.x = 0.0
    pass_time(cart, clock, 0.2)
    assert cart.told[-1].sort == "rest", "nothing old resumes"


def test_what_hovers_rests_if_it_drifts_towards_its_fence_wherever_it_wants_to_go(clock: ManualClock) -> None:
    names = ("drive_speed", "drive_turn", "drive_side", "drive_climb")
    limits = Limits(1.0, 1.0, 2.0, fence=(-9.0, -1.0, 9.0, 1.0), climb=1.0, floor=0.0, ceiling=9.0)
    model = replace(MODEL, actuators=tuple(map(Quantity, names)), limits=limits)

    class Blown(Cart):
        drift = 0.0

        def drift_measured(self) -> tuple[float, float]:
            return 0.0, self.drift

    for x, drift, rests in ((0.0, 0.02, False), (0.0, 2.0, True), (0.0, -2.0, True), (8.95, 0.0, True)):
        body = Blown(clock, model)
        body.x, body.drift = x, drift
        body.act(Setpoint(0.5, climb=0.5))
        pass_time(body, clock, 0.1)
        assert (body.complaints() == ["it is at rest: its fence is ahead"]) is rests, (x, drift)


def test_who_sees_that_it_is_lost_or_found_has_been_told(clock: ManualClock) -> None:
    """A mind looks at any moment, from another thread."""

    class Leaving(Cart):
        gone = False

        def __init__(self) -> None:
            super().__init__(clock)
            self.seen: list[tuple[str, str]] = []

        def measure(self) -> None:
            if self.gone:
                raise OutOfReachError("no answer")

        def seek(self) -> None:
            self.measure()

        def complain(self, sentence: str) -> None:
            self.seen.append((self.lost, sentence.partition(":")[0]))

    cart = Leaving()
    for cart.gone in (True, False):
        pass_time(cart, clock, 10.0)
    there, away = "", "no answer"
    assert cart.seen == [
        (there, "the body is out of reach"),
        (away, "the body is within reach again, and at rest until a command moves it"),
    ]
    assert cart.lost == there


def test_what_its_limits_keep_it_from_is_told_and_not_in_every_tick(cart: Cart, clock: ManualClock) -> None:
    cart.narrow(Limits(inf, inf, inf, fence=(-9.0, -9.0, 9.0, 9.0)))
    cart.x = 8.9

    def push(speed: float, seconds: float) -> list[str]:
        for _ in range(round(seconds * 10)):
            cart.act(Setpoint(speed))
            pass_time(cart, clock, 0.1)
            cart.sense()
        return cart.complaints()

    assert push(0.5, 20.0) == ["it is at rest: its fence is ahead"]
    assert push(-0.5, 6.0) == [], "it may come back"
    assert push(0.5, 20.0) == ["it is at rest: its fence is ahead"]
    seeing = Cart(clock, replace(MODEL, geometry=Geometry(0.1, sonars=16)))
    seeing.narrow(Limits(inf, inf, inf, least_range=1.0))
    seeing.act(Setpoint(0.5))
    pass_time(seeing, clock, 0.1)
    assert seeing.complaints() == ["it is at rest: less than its least range of 1 m is known to be free ahead"]


def test_limits_that_a_body_cannot_keep_are_refused(cart: Cart, clock: ManualClock) -> None:
    with pytest.raises(MisuseError, match="a cart has no range sensors"):
        cart.narrow(Limits(inf, inf, inf, least_range=1.0))
    blind = Cart(clock, replace(MODEL, sensors=SENSORS[3:]))
    with pytest.raises(MisuseError, match="a cart does not know where it is, so it cannot keep within a fence"):
        blind.narrow(Limits(inf, inf, inf, fence=(0.0, 0.0, 1.0, 1.0)))


def test_changes_of_speed_are_spread_over_time_those_of_stop_among_them(cart: Cart, clock: ManualClock) -> None:
    cart.act(Setpoint(1.0))
    pass_time(cart, clock, 0.7)
    cart.stop()
    pass_time(cart, clock, 1.0)
    speeds = [motion.values[0] if motion.values else 0.0 for motion in cart.told]
    assert max(abs(after - before) for before, after in pairwise(speeds)) <= 2.0 * ROUND + 1e-9
    assert (max(speeds), speeds[-1]) == (1.0, 0.0)


def test_a_motion_of_a_bridge_ends_with_the_mind_and_with_a_hold(cart: Cart, clock: ManualClock) -> None:
    for end in (lambda: cart.hold(True), lambda: pass_time(cart, clock, 1.2)):
        cart.sense()
        cart.move(Motion("dock"))
        pass_time(cart, clock, 0.1)
        assert cart.told[-1].sort == "dock"
        end()
        cart.hold(False)
        pass_time(cart, clock, 0.1)
        assert cart.told[-1].sort == "rest"


def test_a_robot_that_is_told_once_and_looked_at_rarely_is_left_in_peace_between(clock: ManualClock) -> None:
    class Obedient(Cart):
        RENEWS = False

    def every(cart: Cart, looks: float) -> float:
        for _ in range(2):
            clock.advance(looks)
            cart.sense()
        return cart.round_every

    cart = Obedient(clock)
    assert [every(cart, looks) for looks in (0.02, 0.1, 0.2, 0.5, 5.0)] == pytest.approx(
        [ROUND, ROUND, 0.1, 0.25, 0.25]
    )
    assert every(Cart(clock), 0.5) == ROUND, "a motion that is renewed is renewed in each round"
    cart.narrow(Limits(inf, inf, inf, fence=(-9.0, -9.0, 9.0, 9.0)))
    assert every(cart, 0.5) == ROUND, "limits are watched in each round"


def test_more_jobs_than_it_remembers_are_refused_and_one_that_fails_is_told(cart: Cart, clock: ManualClock) -> None:
    def refuse() -> None:
        raise MisuseError("no lamp here")

    for _ in range(MAX_JOBS):
        cart.send(refuse)
    with pytest.raises(BusyError, match="64 requests wait"):
        cart.send(refuse)
    pass_time(cart, clock, 0.1)
    assert cart.complaints() == ["no lamp here"] * MAX_JOBS
    assert cart.lost == ""


def test_whatever_a_bridge_raises_its_io_thread_goes_on_and_its_robot_rests() -> None:
    class Faulty(Cart):
        faults: ClassVar[set[str]] = set()

        def carry_out(self, motion: Motion) -> None:
            self._fail_in("carry_out")
            super().carry_out(motion)

        def measure(self) -> None:
            self._fail_in("measure")
            super().measure()

        def seek(self) -> None:
            self._fail_in("seek")

        def _fail_in(self, part: str) -> None:
            if part in self.faults:
                raise KeyError(part)

    with Faulty(Hasty()) as cart:
        cart.begin()
        said: list[str] = []

        def looks(true: Callable[[], bool]) -> None:
            ends = time.monotonic() + PATIENCE
            while not true():
                assert time.monotonic() < ends, said
                cart.sense()
                said.extend(cart.complaints())
                time.sleep(0.005)

        def told(sentence: str) -> Callable[[], bool]:
            return lambda: any(each.startswith(sentence) for each in said)

        def drives() -> bool:
            cart.act(Setpoint(0.5))
            return bool(cart.told) and cart.told[-1].sort == "speeds"

        for fault in ("measure", "carry_out"):
            looks(drives)
            cart.faults |= {fault, "seek"}
            looks(told(f"the body is out of reach: its bridge has failed, please report it: KeyError: '{fault}'"))
            looks(told("the body is still out of reach: its bridge has failed, please report it: KeyError: 'seek'"))
            cart.told.clear()
            cart.faults.clear()
            looks(told("the body is within reach again, and at rest until a command moves it"))
            looks(lambda: bool(cart.told))
            assert cart.told[0] is REST
            said.clear()


def test_what_is_done_beside_the_io_thread_is_told_whatever_it_fails_of(cart: Cart) -> None:
    def nothing() -> None:
        raise LookupError

    cart.beside(nothing, "the emergency stop was not sent").join()
    assert cart.complaints() == ["the emergency stop was not sent: LookupError"]
