"""Exercises: something to make robots do, and goals by which a run is judged.

    title = "Mark who can help"
    task = "Mark every scout with more than half of its fuel."
    hint = "MARK marks the robot that evaluates it."
    scenario = "bravo"                      # of the gallery, or a folder beside this file
    without = "id x y"                      # optional: names that an answer may not use
    seconds = "1s"

    [[goals]]
    holds = "share (= marked (> fuel 50%)) >= 0.99"
    otherwise = "Somebody is marked who should not be, or the other way round."

When goals hold: see `goals`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from sleepcast.api.fleet import open as open_fleet
from sleepcast.core.errors import MisuseError, did_you_mean, in_file
from sleepcast.core.records import dataclass
from sleepcast.core.settings import Table, toml_document
from sleepcast.core.ticks import nearest_ticks
from sleepcast.core.units import TIME
from sleepcast.experiments.goals import MAX_GOALS, Goal, GoalJudge, Miss, answering, read_goal
from sleepcast.language import List, check, read, read_all
from sleepcast.language.learned_names import LearnedNames
from sleepcast.language.reader import Symbol, walk
from sleepcast.simulator import Scenario, find_scenario, parse_mission, scenario_names
from sleepcast.simulator.scenario.mission import Order, instruction

FOLDER = Path(__file__).resolve().parent.parent / "exercises"
"""The included exercises, a file each, in the order in which they are meant to be done."""
LONGEST = 600.0
SEEDS = (1, 2, 3)
"""Runs by which an answer is judged: with other robots, places and chance each."""


@dataclass(frozen=True)
class Exercise:
    """Something to make robots do.

    source: name or folder of its scenario.
    without: names that an answer may not use.
    seconds: length of a run, in simulated time.
    """

    name: str
    title: str
    task: str
    hint: str
    source: str
    scenario: Scenario
    without: frozenset[str]
    seconds: float
    goals: tuple[Goal, ...]


def exercise_names() -> list[str]:
    """The names of the included exercises, in their order."""
    return [_name_of(file) for file in sorted(FOLDER.glob("*.toml"))]


def find_exercise(name: str) -> Exercise:
    """The included exercise of this name, or the one in the TOML file at this path. Raises MisuseError, also a
    SettingsError for what is wrong in the file."""
    included = {_name_of(file): file for file in sorted(FOLDER.glob("*.toml"))}
    file = included.get(name, Path(name))
    if not file.is_file():
        raise MisuseError(
            f'no exercise "{name:.80}"{did_you_mean(name, list(included))}: wanted one of {", ".join(included)}, or a '
            "TOML file"
        )
    with toml_document(file).root() as table:
        return _read(table, file)


def _name_of(file: Path) -> str:
    return file.stem.partition("-")[2] or file.stem


def _read(table: Table, file: Path) -> Exercise:
    source = table.text("scenario", most=4096)
    if source not in scenario_names():
        source = str(file.parent / source)
    with table.answering("scenario"):
        scenario = find_scenario(source)
    exercise = Exercise(
        name=_name_of(file),
        title=table.text("title", most=80),
        task=table.text("task", most=4000),
        hint=table.text("hint", "", most=4000),
        source=source,
        scenario=scenario,
        without=frozenset(table.text("without", "").casefold().split()),
        seconds=table.number("seconds", TIME, low=0.1, high=LONGEST),
        goals=tuple(map(read_goal, table.array("goals", most=MAX_GOALS))),
    )
    if not exercise.goals:
        raise table.error("goals", "an exercise has at least one goal: write [[goals]] and what holds")
    return exercise


class ExerciseAnswer(NamedTuple):
    """What is sent, and what the checker warns of in it."""

    orders: tuple[Order, ...]
    warnings: tuple[str, ...]


def read_answer(exercise: Exercise, text: str, name: str) -> ExerciseAnswer:
    """An answer: a mission script, or expressions that are all sent at the start. Raises MisuseError for what cannot be
    sent, with its place.

    name: of the answer, for errors.
    """
    if any(line.startswith("@") for line in text.split("\n")):
        orders = parse_mission(text, name)
    else:
        with answering(name):
            forms = read_all(text)
            if len(forms) > 1 and not isinstance(forms[0], List):
                read(text)  # which says what was probably meant
        lines = [1 + text.count("\n", 0, form.start) for form in forms]
        places = [f"{name}:{line}" if "\n" in text.strip() else name for line in lines]
        orders = tuple(
            Order(0.0, text[form.start : form.end], place) for form, place in zip(forms, places, strict=True)
        )
    if not orders:
        raise MisuseError(f"{name}: nothing to send: wanted an expression such as (MARK)")
    with open_fleet(exercise.scenario, threads=1) as fleet:
        names = LearnedNames(fleet.station.vocabulary)
    warnings: list[str] = []
    for order in orders:
        if order.time >= exercise.seconds:
            raise MisuseError(
                f"{order.place}: sent at {order.time:g} s, but the exercise ends at {exercise.seconds:g} s: choose an "
                "earlier time"
            )
        text = instruction(order).text
        if not text:
            continue
        with answering(order.place):
            checked = check(text, names)
            form = checked.required().form
        for inside in walk(form):
            if isinstance(inside, Symbol) and inside.key in exercise.without:
                raise MisuseError(f"{order.place}: {inside.text} is used: this exercise is to be done without it")
        names.learn(form)
        warnings += [in_file(order.place, finding.render(text)) for finding in checked.warnings]
    return ExerciseAnswer(orders, tuple(warnings))


def attempt(exercise: Exercise, orders: Sequence[Order], seed: int) -> list[Miss]:
    """Run an answer once; the goals that were not met, none if it passed."""
    scenario = replace(exercise.scenario, mission=tuple(orders), seed=seed)
    judge = GoalJudge(exercise.goals, exercise.name)
    with open_fleet(scenario, mission=True, threads=1) as fleet:
        ticks = max(1, nearest_ticks(exercise.seconds, scenario.tick))
        for number in range(1, ticks + 1):
            fleet.run(scenario.tick, quiet=True)
            judge.look(fleet, is_end=number == ticks)
    return judge.missed
