"""What robots say comes in one order, however many of their rules are native code by then."""

from __future__ import annotations

import pytest

from sleepcast.loop import snapshot, step_swarm
from sleepcast.simulator import Changes, find_scenario
from swarms import desk_of, swarm_of

pytest.importorskip("llvmlite")

NEVER, SOON, LATE = 1_000_000, 1, 8
"""Rounds after which rules are compiled."""
REPORTS = (
    '(WHEN (= (MOD id 3) 0) (RULE a (PROGN (REPORT "here" x) (WHEN (> y x) (TELL `(MARK))))))',
    '(WHEN (= (MOD id 2) 0) (RULE b (PROGN (REPORT "here" y) (REPORT "there"))))',
    '(RULE c (WHEN (> x y) (REPORT "here" heading)))',
    '(WHEN (= (MOD id 5) 0) (RULE a (PROGN (REPORT "there") (SQRT x))))',
)
"""So that there are several minds, some of which have rules in common."""


def snapshots(name: str, robots: int | None, texts: tuple[str, ...], hot: int) -> list[bytes]:
    """After each tick. hot: after how many rounds rules are native code."""
    swarm, found = swarm_of(find_scenario(name, Changes(robots, over=(("radio.loss", 0.1),))), 3, 1), list[bytes]()
    kernels = swarm.fleet.kernels
    assert kernels is not None
    kernels._hot = hot
    for tick in range(16):
        if tick < 2 * len(texts) and tick % 2 == 0:
            desk_of(swarm).send(texts[tick // 2], everybody=True)
        step_swarm(swarm)
        kernels.settle()
        found.append(snapshot(swarm))
    return found


@pytest.mark.parametrize(("name", "robots", "texts"), [("explore", None, ()), ("bravo", 30, REPORTS)])
def test_what_rules_say_does_not_depend_on_native_code(name: str, robots: int | None, texts: tuple[str, ...]) -> None:
    walked, soon, late = (snapshots(name, robots, texts, hot) for hot in (NEVER, SOON, LATE))
    assert [tick for tick in range(16) if not walked[tick] == soon[tick] == late[tick]] == []
