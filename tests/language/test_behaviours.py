"""Hoskins' behaviours: what is known of the notation is read, becomes rules, and everything else is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from cli.calling import called
from sleepcast.language import ReadError, check
from sleepcast.language.behaviours import behaviours, rules
from sleepcast.language.learned_names import LearnedNames
from sleepcast.loop import vocabulary_of
from sleepcast.simulator import Simulator, find_scenario

PAGE = find_scenario("braitenberg").path.parent / "README.md"
EYES = re.findall(r"```text\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0]
THESIS = "4: ((F, 3, *, *) & (F, S, *, *), PING, 0.9)"


def test_the_thesiss_own_rule() -> None:
    assert rules(behaviours(THESIS)) == [
        "(RULE behaviour1 (WHEN (AND (EQ myCaste 4) pFlag (EQ pBearing FRONT) (EQ pCaste 3) sFlag (EQ sBearing FRONT) "
        "(PROB 0.9)) (PING myCaste)))"
    ]


@pytest.mark.parametrize(
    ("text", "test"),
    [
        ("(*, TUMBLE, 2%)", "(PROB 2%)"),
        ("((*, *, *, *), tumble, 1)", "(AND pFlag (PROB 1))"),
        ("((r, *, 6m, f), TUMBLE, .3)", "(AND pFlag (EQ pBearing REAR) (> pRange 6m) (PROB .3))"),
        ("((*, S, 10, N), TUMBLE, 1)", "(AND sFlag (< sRange 10) (PROB 1))"),
    ],
)
def test_events(text: str, test: str) -> None:
    assert rules(behaviours(text)) == [f"(RULE behaviour1 (WHEN {test} (TUMBLE)))"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no behaviour at 1:1"),
        ("; nothing", "no behaviour at 1:1"),
        ("((F, 3, *", "the text ends at 1:10"),
        ("(*, PING, 1)\n((X, 3, *, *), PING, 1)", "X at 2:3 is no side: wanted F, R, \\*"),
        ("((F, T, *, *), PING, 1)", "T at 1:6: wanted a caste, S for the light, or \\*"),
        ("((F, 3, 6kg, N), PING, 1)", "6kg at 1:9: wanted a range such as 6m"),
        ("((F, 3, -6m, N), PING, 1)", "-6m at 1:9: wanted a range such as 6m"),
        ("((F, 3, 6m, *), PING, 1)", "6m beside \\* at 1:9 says nothing"),
        ("((F, 3, *, N), PING, 1)", "\\* beside N at 1:9 says nothing"),
        ("((F, 3, *, *), HOP, 1)", "HOP at 1:16 is no action: wanted TUMBLE, PING"),
        ("((F, 3, *, *), PING, 1.5)", "1.5 at 1:22: wanted a probability"),
        ("((F, 3, *, *), PING)", r"\) at 1:20: wanted ,"),
        ("((F, 3, *, *) & (R, 4, *, *), PING, 1)", "a second ping in one event at 1:15"),
        ("((F, S, *, *) & (R, S, *, *), PING, 1)", "a second light in one event at 1:15"),
        ("eyes: (*, PING, 1)", "eyes at 1:1: wanted a caste"),
        ("(*, PING, 1)\n" * 1_001, "more than 1,000 behaviours at 1001:1"),
    ],
)
def test_what_is_no_behaviour_is_refused_with_its_place(text: str, said: str) -> None:
    with pytest.raises(ReadError, match=said):
        behaviours(text)


def test_the_rules_of_the_page_are_without_a_finding() -> None:
    names = LearnedNames(vocabulary_of(Simulator(find_scenario("braitenberg")).model))
    for rule in rules(behaviours(f"{EYES}\n{THESIS}")):
        assert not check(rule, names).findings, rule


def way(text: str) -> float:
    """How far the vehicles are from the lamp on average, after 700 s of these behaviours, m."""
    with sc.open("braitenberg", seed=1, threads=1) as fleet:
        for rule in rules(behaviours(text)):
            fleet.send(rule, everybody=True)
        fleet.run(700.0, quiet=True)
        return float(np.hypot(fleet.x - 140.0, fleet.y - 80.0).mean())


def test_vehicles_that_follow_the_page_come_to_the_lamp_and_without_its_light_they_do_not() -> None:
    without = "\n".join(line for line in EYES.splitlines() if ", S," not in line)
    assert way(EYES) < 30.0
    assert way(without) > 45.0


class TestCommand:
    def test_rules_of_a_file_and_of_what_is_typed(self, tmp_path: Path) -> None:
        file = tmp_path / "eyes.hoskins"
        file.write_text(EYES, encoding="utf-8")
        done = called("check", "--from", "hoskins", str(file), THESIS)
        assert done.status == 0
        assert done.out.splitlines() == rules(behaviours(f"{EYES}\n{THESIS}"))

    def test_what_is_not_understood_is_status_2(self, tmp_path: Path) -> None:
        file = tmp_path / "eyes.hoskins"
        file.write_text("; one\n(*, HOP, 1)", encoding="utf-8")
        done = called("check", "--from", "hoskins", str(file))
        assert (done.status, done.out.splitlines()[0]) == (2, f"{file}:2: HOP is no action: wanted TUMBLE, PING")
        done = called("check", "--from", "hoskins", "--json", "(*, HOP, 1)")
        assert done.status == 2
        assert '"message": "HOP at 1:5 is no action' in done.out

    def test_it_only_translates(self) -> None:
        done = called("check", "--from", "hoskins", "--strict", THESIS)
        assert done.status == 2
        assert "--from only translates" in done.err
