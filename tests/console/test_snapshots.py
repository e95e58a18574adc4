"""What a page keeps of a run stays within its budget, whatever comes, and says how much it is."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest

from sleepcast.cli.run import demo
from sleepcast.console import snapshots
from sleepcast.console.account_table import CommandRow
from sleepcast.console.adapters.live_past import LivePast
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.marks import Marks
from sleepcast.console.replay_client import RerunError
from sleepcast.console.snapshots import Budget, SnapshotStore
from sleepcast.core.clock import ManualClock, WallClock
from sleepcast.core.memory import read_size
from sleepcast.loop import Swarm
from sleepcast.simulator import Changes, Circle, find_scenario
from swarms import desk_of, swarm_of

FEW = 6


def past_of(budget: Budget, *, states: bool) -> tuple[LivePast, Swarm]:
    """The past of a few robots; whether states are kept as time passes, or only the first one."""
    swarm = swarm_of(find_scenario("bravo", Changes(robots=FEW)), seed=4)
    swarm.mission.clear()
    clock = WallClock() if states else ManualClock()
    return LivePast(SwarmAdapter(swarm), swarm, desk_of(swarm), clock, budget), swarm


def run_on(swarm: Swarm, ticks: int, each: Callable[[int], None] = lambda tick: None) -> None:
    for tick in range(ticks):
        each(tick)
        swarm.step()


def test_pictures_of_few_robots_are_bounded_too() -> None:
    """Of few robots a picture is small, and what lies around it was not counted."""
    past, swarm = past_of(Budget(10_000), states=False)
    run_on(swarm, 600)
    timeline = past.timeline
    assert timeline.size_of_pictures == past._size <= past.budget.pictures
    assert len(timeline.poses.times) * 250 <= past.budget.pictures
    assert timeline.poses.times[0] == 0.0
    assert timeline.seconds - timeline.poses.times[-1] <= past._every * past.tick
    past.close()


def test_obstacles_that_come_and_go_are_bounded() -> None:
    past, swarm = past_of(Budget(200_000), states=False)
    world = swarm.simulator.world

    def build(tick: int) -> None:
        if tick % 5 == 0:
            world.add(Circle(10.0 + tick, 10.0, 1.0))

    run_on(swarm, 100, build)
    assert past.timeline.size_of_pictures <= past.budget.pictures
    assert past.timeline.obstacles.at(past.ended)  # as they were in the last picture
    past.close()


@pytest.mark.parametrize("state_every", [0.0, 1e9], ids=["states often", "states hardly ever"])
def test_messages_are_bounded_and_what_is_forgotten_is_said(
    monkeypatch: pytest.MonkeyPatch, state_every: float
) -> None:
    monkeypatch.setattr(snapshots, "STATE_EVERY", state_every)
    monkeypatch.setattr(snapshots, "COST", 0.0)
    past, swarm = past_of(Budget(800_000), states=True)

    def send(tick: int) -> None:
        desk_of(swarm).send(f"(WHEN (> id {tick}) (SETQ seen {tick}))", everybody=True, confirmed=True)

    run_on(swarm, 60, send)
    assert past._log.size <= past.budget.inputs
    assert len(past.inputs.posted) <= 40_000 // 1_000
    assert past.size <= past.budget.most

    async def look() -> None:
        assert (await past.look(past.tick_of(past.ended) - 1, 0)).tick == past.tick_of(past.ended) - 1
        with pytest.raises(RerunError, match="before everything that is kept"):
            await past.look(1, 0)

    asyncio.run(look())
    past.close()


def test_accounts_of_ever_new_commands_are_bounded() -> None:
    """Accounts were left out only where there was a later one of the same command."""
    past, _ = past_of(Budget(2_000_000), states=False)
    rows, most = past.timeline.rows, past.budget.accounts
    rows.add(0.0, _row(0, "stop"))
    for number in range(1, 1_000):
        rows.add(float(number), _row(number))
    past.timeline.forget_accounts(most)
    assert 0 < past.timeline.size_of_rows <= most // 2 + 2_000
    assert rows.values[-1].id == "desk-1.999"
    assert past.timeline.latched_at(500.0)
    past.close()


def _row(number: int, kind: str = "command") -> CommandRow:
    return CommandRow(f"desk-1.{number}", kind, "(SETQ a 1)", float(number), 5, 0, 0, 0, 5)


def test_marks_remember_no_more_commands_than_they_may(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sleepcast.console.marks.MAX_KNOWN", 20)
    marks = Marks()
    for number in range(100):
        marks.rows(float(number), [_row(number)])
    assert marks.number == 100
    assert len(marks._known) == 20


def test_states_before_a_tick_are_forgotten() -> None:
    states = SnapshotStore(0.1, 1_000)
    for tick in (0, 10, 20, 30):
        states.add(tick, bytes(100))
    assert states.after(11) == 20
    states.forget_before(20)
    assert (states.first, states.size, states.after(31)) == (20, 200, None)


def test_a_past_too_small_for_a_second_picture_can_still_be_looked_at() -> None:
    past, swarm = past_of(Budget(1_000), states=False)
    run_on(swarm, 120)

    async def look() -> None:
        for tick in (1, 60, 119):
            assert (await past.look(tick, 0)).tick == tick

    asyncio.run(look())
    assert "1 picture and 1 state from which every tick can be run again" in past.kept
    past.close()


def test_the_page_says_how_much_is_kept_and_how_much_may_be() -> None:
    past, swarm = past_of(Budget(), states=False)
    run_on(swarm, 20)
    assert ": 0 MB, of 300 MB at most (--past). This program " in past.kept
    assert past.kept.endswith(" MB in all.")
    past.close()


def test_help_says_what_is_kept_unless_one_says_otherwise() -> None:
    option = next(each for each in demo.params if each.name == "past")
    default = str(getattr(option, "help", "")).rpartition("default: ")[2].rstrip(").")
    assert read_size(default) == Budget().most
    budget = Budget()
    assert budget.states + budget.pictures + budget.inputs + budget.accounts == budget.most
