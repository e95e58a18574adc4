"""`sleepcast check-exercise`: whether an answer to an exercise makes the robots do what was asked."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable
from contextlib import closing
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import click

from sleepcast.cli.options import NegativeNumbersAllowed
from sleepcast.cli.streams import complain, put, read_file

if TYPE_CHECKING:
    from sleepcast.experiments.exercises import Exercise
    from sleepcast.experiments.goals import Miss


@click.command("check-exercise", cls=NegativeNumbersAllowed)
@click.argument("name", required=False)
@click.argument("answer", metavar="[TEXT|FILE]", required=False)
@click.option("--hint", is_flag=True, help="Show the hint as well.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead.")
@click.option("--quiet", is_flag=True, help="Show no progress on standard error.")
def check_exercise(name: str | None, answer: str | None, hint: bool, as_json: bool, quiet: bool) -> int:
    """List the exercises; with a NAME, show its task; with an answer too, run it three times, with other robots each
    time, and say whether it is passed, or why not yet.

    The answer is an expression, a file of expressions, which are all sent at the start, or a mission script. The exit
    status is 0 if the exercise is passed, 1 if it is not yet, and 2 for an answer that cannot be sent.

    \b
    Examples:
      sleepcast check-exercise
      sleepcast check-exercise mark
      sleepcast check-exercise mark '(WHEN (> fuel 50%) (MARK))'
      sleepcast check-exercise ring ring.sleep
    """
    from sleepcast.experiments.exercises import exercise_names, find_exercise

    if name is None:
        exercises = list(map(find_exercise, exercise_names()))
        if as_json:
            put(json.dumps([_as_dict(each) for each in exercises]))
            return 0
        width = max(len(each.name) for each in exercises)
        for number, each in enumerate(exercises, 1):
            put(f"{number:>2}  {each.name:<{width}}  {each.title}")
        return 0
    exercise = find_exercise(name)
    if answer is None:
        put(json.dumps(_as_dict(exercise)) if as_json else _page(exercise, hint=hint))
        return 0
    return _judge(exercise, answer, hint=hint, as_json=as_json, quiet=quiet)


def _as_dict(exercise: Exercise) -> dict[str, object]:
    return {
        "name": exercise.name,
        "title": exercise.title,
        "task": exercise.task.strip(),
        "hint": exercise.hint.strip(),
    }


def _page(exercise: Exercise, *, hint: bool) -> str:
    lines = [f"{exercise.name}: {exercise.title}", "", exercise.task.strip(), ""]
    if hint and exercise.hint:
        lines += ["Hint:", exercise.hint.strip(), ""]
    for goal in exercise.goals:
        lines.append(f"{'in the end' if goal.when == 'end' else goal.when}: {goal.holds.text}")
    lines += ["", f"try it:   sleepcast demo {exercise.source}"]
    lines.append(f"check it: sleepcast check-exercise {exercise.name} answer.sleep")
    return "\n".join(lines)


def _judge(exercise: Exercise, answer: str, *, hint: bool, as_json: bool, quiet: bool) -> int:
    from sleepcast.api.progress import steps
    from sleepcast.experiments.exercises import SEEDS, attempt, read_answer

    is_text = _is_text(answer)
    text = answer if is_text else read_file(Path(answer))
    orders, warnings = read_answer(exercise, text, "the answer" if is_text else answer)
    for warning in warnings:
        complain(f"warning: {warning}")
    missed: dict[int, list[Miss]] = {}
    with closing(steps(len(SEEDS), "running", quiet=quiet)) as runs:
        for _, seed in zip(runs, SEEDS, strict=False):
            missed[seed] = attempt(exercise, orders, seed)
    passed = not any(missed.values())
    if as_json:
        runs_done = [
            {"seed": seed, "missed": [{"goal": m.goal, "value": m.shown(), "time": m.time} for m in misses]}
            for seed, misses in missed.items()
        ]
        put(json.dumps({"exercise": exercise.name, "passed": passed, "runs": runs_done}))
        return int(not passed)
    put(f"{exercise.name}: {'passed' if passed else 'not yet'}")
    for sentence, count in _together(missed.values()):
        put(f"  in {count} of {len(SEEDS)} runs: {sentence}")
    if hint and not passed:
        put(f"hint: {' '.join(exercise.hint.split())}")
    return int(not passed)


def _is_text(answer: str) -> bool:
    """Whether an answer is meant as an expression, well formed or not, and not as the name of a file."""
    if answer.strip()[:1] in ("(", ""):
        return True
    return re.search(r"[\s<>=]", answer.strip()) is not None and not Path(answer).exists()


def _together(runs: Iterable[list[Miss]]) -> list[tuple[str, int]]:
    """The goals that were missed, each as it was missed first, and in how many runs it was."""
    first: dict[str, str] = {}
    counts: Counter[str] = Counter()
    for miss in chain.from_iterable(runs):
        first.setdefault(miss.goal, miss.sentence())
        counts[miss.goal] += 1
    return [(sentence, counts[goal]) for goal, sentence in first.items()]
