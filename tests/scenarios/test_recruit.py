"""Recruiting: only robots that meet the conditions join, four of them soon, and a lost member is replaced."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.language import CheckError
from sleepcast.language.reader import read, show
from sleepcast.simulator import find_scenario

STEP = 0.5
"""Seconds between two looks at the convoy."""
CHARGED, NEAR = 0.6, 20.0
DRAWN, ROAMED = 0.005, 2.0
"""Charge, and metres between a rover and the leader, that may change between the order and the roll call."""
BEHIND = 3.0
"""A member has fallen behind when the robot before it is so many metres away."""
REPEATS = 8
"""Of each command, one in a step, as in the mission."""


class Drive(NamedTuple):
    """What came of a drive. whole: s until it had four members; misfits: who joined without meeting the conditions;
    in_place: share of all gaps of the drive that are 1 to 3 m; replaced: s from a loss, which is a death or a gap above
    BEHIND, until four were there again."""

    whole: float
    misfits: list[str]
    in_place: float
    replaced: float


def drive(
    seed: int, scenario: str = "recruit", *, lost_at: float, seconds: float, forget: str = "", break_down: bool = False
) -> Drive:
    """Recruit at 20 % loss, lose the second member, and drive on.

    forget: a rule that the leader forgets before that, in a run whose order is without the condition about charge.
    break_down: the member stands still and goes on answering.
    """
    over = {"constants.CHARGED": "0%"} if forget else {}
    misfits: list[str] = []
    gaps: list[float] = []
    members: list[tuple[float, int]] = []
    before: set[int] = set()
    lost, second = -1.0, -1
    with sc.open(scenario, seed=seed, over=over, threads=1) as fleet:
        recruiting = [command.text for command in fleet.swarm.simulator.scenario.commands[:-1]]
        while fleet.time < seconds:
            if fleet.time < REPEATS * STEP:
                for text in recruiting:
                    fleet.send(text, wait=0, everybody=True, sure=True)  # one declares what the next reads
            fleet.run(STEP, quiet=True)
            try:
                convoy = set(np.flatnonzero(fleet["(IN convoy)"] > 0).tolist())
            except CheckError:  # nobody has heard a roll call yet
                continue
            members.append((fleet.time, len(convoy - {second})))
            away = np.hypot(fleet.x - fleet.x[0], fleet.y - fleet.y[0])
            for robot in convoy - before:
                if fleet["battery"][robot] < CHARGED - DRAWN or away[robot] > NEAR + ROAMED:
                    misfits.append(fleet.names[robot])
            before = convoy
            following = np.flatnonzero((fleet["(IN convoy)"] > 0) & ~(fleet["frozen"] > 0))
            if fleet["ready"][0] > 0:
                ahead = fleet["ahead"][following].astype(int) - 1
                gaps += np.hypot(fleet.x[following] - fleet.x[ahead], fleet.y[following] - fleet.y[ahead]).tolist()
            if second < 0 and fleet.time >= lost_at:
                second = int(following[fleet["place"][following] == 2][0])
                if forget:
                    _say(fleet, f"(WHEN (= role LEADER) (FORGET {forget}))")
                _say(fleet, f"(WHEN (= id {second + 1}) {'(RULE stuck (ST))' if break_down else '(FREEZE)'})")
            if second >= 0 and lost < 0:
                ahead = int(fleet["ahead"][second]) - 1
                gap = np.hypot(fleet.x[second] - fleet.x[ahead], fleet.y[second] - fleet.y[ahead])
                if gap > BEHIND or not break_down:
                    lost = fleet.time
    whole = [time for time, count in members if count >= 4]
    again = [time for time, count in members if time > lost > 0 and count >= 4]
    within = np.mean([1.0 <= gap <= 3.0 for gap in gaps]) if gaps else 0.0
    replaced = again[0] - lost if again else np.inf
    return Drive(whole[0] if whole else np.inf, misfits, float(within), replaced)


def _say(fleet: sc.Fleet, text: str) -> None:
    """Send a command until it can hardly have been lost."""
    for _ in range(6):
        fleet.send(text, wait=0, sure=True)


@pytest.mark.parametrize(
    ("scenario", "break_down"), [("recruit", False), ("recruit", True), ("recruit-best", False), ("recruit-best", True)]
)
def test_a_convoy_is_recruited_and_a_lost_member_replaced(scenario: str, break_down: bool) -> None:
    found = drive(1, scenario, lost_at=22.0, seconds=34.0, break_down=break_down)
    assert found.whole < 10.0
    assert found.replaced < 10.0
    assert found.in_place > 0.8, "a short drive; the loss is a large part of it"
    assert found.misfits == []


def test_without_its_conditions_and_the_rule_about_losses_it_is_not() -> None:
    found = drive(2, lost_at=16.0, seconds=28.0, forget="lose")
    assert found.misfits
    assert found.replaced == np.inf


def size_of(scenario: str, names: Sequence[str]) -> tuple[int, int, int]:
    """The lines of some rules and words as they are written, their bytes as they are sent, and those of all commands
    before somebody dies."""
    texts = [command.text for command in find_scenario(scenario).commands[:-1]]
    whole = "\n".join(texts)
    found = [written(whole, match.start()) for match in re.finditer(rf"\((RULE|DEFUN) ({'|'.join(names)})\b", whole)]
    assert len(found) == len(names)
    size = sum(len(show(read(text))) for text in found)
    return sum(text.count("\n") + 1 for text in found), size, sum(len(show(read(text))) for text in texts)


def written(text: str, start: int) -> str:
    """The form that begins there, as it is written."""
    depth = 0
    for at in range(start, len(text)):
        depth += {"(": 1, ")": -1}.get(text[at], 0)
        if depth == 0:
            return text[start : at + 1]
    raise AssertionError("it has no end")


def test_the_page_tells_how_long_both_are() -> None:
    rules = size_of("recruit", ("consider", "answer", "call", "choose"))
    best = size_of("recruit-best", ("call",))
    page = (find_scenario("recruit-best").path.parent / "README.md").read_text(encoding="utf-8")
    for row, (left, right) in zip(
        ("its lines", "its bytes", "bytes of all"), zip(rules, best, strict=True), strict=True
    ):
        assert re.search(rf"^\| {row}.* \| {left:,} \| {right:,} \|$", page, re.MULTILINE), (row, left, right)


@pytest.mark.nightly
@pytest.mark.parametrize("scenario", ["recruit", "recruit-best"])
@pytest.mark.parametrize("break_down", [False, True], ids=["dies", "stands still"])
def test_held_out_seeds(scenario: str, break_down: bool) -> None:
    found = [drive(seed, scenario, lost_at=60.0, seconds=150.0, break_down=break_down) for seed in range(100, 120)]
    assert not any(each.misfits for each in found)
    assert max(each.whole for each in found) < 10.0
    assert min(each.in_place for each in found) > 0.95
    assert max(each.replaced for each in found) < 10.0
