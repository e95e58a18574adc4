"""A mind with a body in real time: the order of a tick, the watch over it, and that the body is stopped in the end."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from sleepcast.channel import Kind, Message
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import SleepcastError
from sleepcast.loop import vocabulary_of
from sleepcast.loop.real import EmbodiedMind, TickTiming, run_robots
from sleepcast.node.node import Node
from sleepcast.robot import Reading
from sleepcast.simulator import Simulator
from sleepcast.simulator.bodies.body import Body
from small_worlds import simulator

TICK = 0.1


class Desk:
    """The other end of the channel, at hand. due: what is to be received in which tick."""

    def __init__(self, **due: str) -> None:
        self.due = {int(tick.removeprefix("at")): text for tick, text in due.items()}
        self.heard: list[Message] = []
        self.asked = 0

    def send(self, message: Message) -> None:
        self.heard.append(message)

    def receive(self) -> list[Message]:
        self.asked += 1
        text = self.due.get(self.asked)
        if text is None:
            return []
        kind = Kind(text) if text in ("stop", "release") else Kind.COMMAND
        return [Message("desk", 0, self.asked, kind, 0.0, text="" if kind is not Kind.COMMAND else text)]

    def stops(self) -> list[Message]:
        return []


class Run:
    """One robot of a simulator, its time moved on as the loop sleeps."""

    def __init__(self, folder: Path, desk: Desk, **slow: float) -> None:
        self.simulator = simulator(folder)
        self.body: Body = self.simulator.robots[0]
        self.node = Node("r0", vocabulary_of(self.body.model), body=self.body)
        self.clock, self.desk, self.watch = ManualClock(100.0), desk, TickTiming()
        self.speeds: list[float] = []
        self.slow = {int(tick.removeprefix("at")): seconds for tick, seconds in slow.items()}

    def sleep(self, seconds: float) -> None:
        self.clock.advance(seconds)
        self.simulator.step()
        self.speeds.append(self.body.sense().values[3])

    def going(self, ticks: int) -> Callable[[], bool]:
        def still() -> bool:
            self.clock.advance(self.slow.get(self.watch.ticks, 0.0))
            return self.watch.ticks < ticks

        return still

    def run(self, ticks: int, body: Body | None = None) -> None:
        run_robots([self.mind(body or self.body)], self.clock, tick=TICK, going=self.going(ticks), sleep=self.sleep)

    def mind(self, body: Body) -> EmbodiedMind:
        return EmbodiedMind(self.node, body, self.clock, self.desk, self.watch, None, self.clock.now())

    def value(self, text: str) -> float:
        return self.node.evaluate(text).value


def test_rules_drive_the_body_and_it_is_stopped_in_the_end(tmp_path: Path) -> None:
    run = Run(tmp_path, Desk(at3="(RULE go (SETQ drive_speed 2m/s))", at20='(REPORT "at" x)'))
    before = run.body.sense().values[0]
    run.run(30)
    assert run.value("x") != before
    assert run.value("tick") == 30
    assert run.value("time") == pytest.approx(2.9)
    assert [message.kind for message in run.desk.heard] == [Kind.ANSWER, Kind.REPORT, Kind.ANSWER]
    assert run.body.stopped


def test_stop_is_obeyed_in_the_tick_that_heard_of_it(tmp_path: Path) -> None:
    run = Run(tmp_path, Desk(at5="(DRIVE 3m/s 0)", at20="stop", at30="(DRIVE 3m/s 0)", at50="release"))
    run.run(70)
    speeds = run.speeds  # the body moves after each tick
    assert speeds[3] == 0.0 < speeds[4] < speeds[18]
    assert speeds[19] < speeds[18]
    assert speeds[40:] == [0.0] * 29
    assert [message.body["outcome"] for message in run.desk.heard] == ["matched", "stopped", "matched", "released"]


def test_a_stop_that_comes_while_another_mind_evaluates_halts_the_body(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = Run(tmp_path, Desk()), Run(tmp_path, Desk())
    minds, order = [each.mind(each.body) for each in (first, second)], list[str]()
    stop = Message("desk", 0, 1, Kind.STOP, 0.0)
    think = EmbodiedMind.think

    def thinking(mind: EmbodiedMind) -> None:
        other = minds[mind is minds[0]]
        if not order:
            monkeypatch.setattr(other.channel, "stops", lambda: [] if other.node.stopped else [stop])
        elif len(order) == 1:
            assert mind.robot.stopped
            assert mind.channel.heard == [], "it is answered after the tick"
        order.append(mind.node.name)
        first.clock.advance(TICK)
        think(mind)

    monkeypatch.setattr(EmbodiedMind, "think", thinking)
    run_robots(minds, first.clock, tick=TICK, going=lambda: len(order) < 2, sleep=first.sleep)
    assert [len(each.desk.heard) for each in (first, second)] in ([0, 1], [1, 0])


def test_late_ticks_are_counted_and_not_made_up_for(tmp_path: Path) -> None:
    run = Run(tmp_path, Desk(), at5=0.35, at8=0.04)
    run.run(12)
    assert (run.watch.ticks, run.watch.late) == (12, 1)
    assert run.watch.worst == pytest.approx(0.25)
    assert str(run.watch) == "12 ticks, 1 late, the latest by 0.25 s"
    assert run.clock.now() == pytest.approx(100.0 + 11 * TICK + 0.15)  # the tick that was due meanwhile, not two
    assert str(TickTiming(7)) == "7 ticks, 0 late"


class Broken(Body):
    """A body whose sensors fail after a while."""

    __slots__ = ("looks",)

    def sense(self) -> Reading:
        self.looks = getattr(self, "looks", 0) + 1
        if self.looks > 3:
            raise SleepcastError("the robot is gone")
        return super().sense()


def test_a_body_that_fails_ends_the_run_stopped(tmp_path: Path) -> None:
    run = Run(tmp_path, Desk())
    body = Broken(run.simulator.bodies, run.simulator.senses, run.body.model, 0)
    with pytest.raises(SleepcastError, match="the robot is gone"):
        run.run(10, body)
    assert run.watch.ticks == 4
    assert run.body.stopped


def test_whatever_ends_the_run_stops_the_body(tmp_path: Path) -> None:
    run = Run(tmp_path, Desk())

    def interrupted() -> bool:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_robots([run.mind(run.body)], run.clock, tick=TICK, going=interrupted)
    assert run.body.stopped


def test_minds_may_join_while_others_run_and_one_that_fails_ends_alone(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    (tmp_path / "two").mkdir()
    one, two = Run(tmp_path / "one", Desk()), Run(tmp_path / "two", Desk(at5="(DRIVE 3m/s 0)"))
    broken = Broken(one.simulator.bodies, one.simulator.senses, one.body.model, 0)
    minds, failed = [one.mind(broken)], list[str]()

    def fails(mind: EmbodiedMind, error: SleepcastError) -> None:
        failed.append(f"{mind.node.name}: {error}")
        minds.remove(mind)

    def going() -> bool:
        if one.watch.ticks == 2 and len(minds) == 1:
            minds.append(two.mind(two.body))
        return two.watch.ticks < 20

    run_robots(minds, two.clock, tick=TICK, going=going, sleep=two.sleep, fails=fails)
    assert failed == ["r0: the robot is gone"]
    assert one.watch.ticks == 4
    assert two.value("time") == pytest.approx(2.0), "its time began when it joined"
    assert two.speeds[-1] > 0.0
    assert two.body.stopped


class Stuck(Body):
    """A body that always says what it measured at first."""

    __slots__ = ()

    def sense(self) -> Reading:
        return Reading(0.0, super().sense().values)


def test_what_is_not_measured_anew_is_not_sensed_anew(tmp_path: Path) -> None:
    run = Run(tmp_path, Desk(at1="(DRIVE 3m/s 0)"))
    run.run(1)
    first = run.value("x")
    run.body.release()
    run.run(20, Stuck(run.simulator.bodies, run.simulator.senses, run.body.model, 0))
    assert run.value("x") == first


def test_a_body_in_step_is_its_own_clock(tmp_path: Path) -> None:
    run = Run(tmp_path, Desk())
    stepping = Stepping(run.simulator)
    mind = EmbodiedMind(run.node, stepping, stepping, run.desk, run.watch, None, stepping.now())
    run_robots([mind], stepping, tick=0.0, going=run.going(10))
    assert run.watch.late == 0
    assert run.value("time") == pytest.approx(10 * TICK)


class Stepping(Body):
    """A body whose time goes on when it is looked at."""

    __slots__ = ("simulator",)

    def __init__(self, simulator: Simulator) -> None:
        super().__init__(simulator.bodies, simulator.senses, simulator.robots[0].model, 0)
        self.simulator = simulator

    def now(self) -> float:
        return self.simulator.time

    def sense(self) -> Reading:
        self.simulator.step()
        return super().sense()
