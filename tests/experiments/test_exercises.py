"""Exercises: the solutions pass, mistakes do not, and what is wrong is said."""

from __future__ import annotations

from pathlib import Path

import pytest

from sleepcast.core.errors import MisuseError
from sleepcast.core.settings import SettingsError
from sleepcast.experiments.exercises import SEEDS, attempt, exercise_names, find_exercise, read_answer
from sleepcast.simulator import MissionError

SOLUTIONS = Path(__file__).resolve().parents[2] / "examples" / "exercises"
MISTAKES = {
    "mark": ("(MARK)", "Somebody with less than half"),
    "team": ("(WHEN (> fuel 50%) (JOIN bravo))", "too far away"),
    "come": ("(GOTO blue_x blue_y)", "not there yet"),
    "halves": ("(PROGN (JOIN reds) (GOTO red_x red_y))", "The group `blues`"),
    "wall": ("(DRIVE 0.5 0)", "has touched something"),
    "blink": ("(MARK)", "not in step"),
    "ring": ("(GOTO (+ 10m (* 5m (COS (* id 1deg)))) (+ 10m (* 5m (SIN (* id 1deg)))))", "too near"),
    "spread": ("(GOTO 10m 10m)", "too near"),
    "gather": ("(ST)", "have not met"),
    "flock": ("(DRIVE 0.03 0)", "all drive the same way"),
}
OWN = """
title = "Drive"
task = "Drive for a second, then stop."
scenario = "crowd"
seconds = "3s"

[[goals]]
holds = "max speed > 0.1"
when = "once"
otherwise = "Nobody has driven."

[[goals]]
holds = "max (ABS speed) <= 0.01"
otherwise = "Somebody still drives."
"""


def misses(name: str, answer: str, seed: int = 1) -> str:
    exercise = find_exercise(name)
    return " ".join(miss.sentence() for miss in attempt(exercise, read_answer(exercise, answer, "answer").orders, seed))


def test_there_are_ten_with_a_solution_and_a_mistake_each() -> None:
    assert len(exercise_names()) == 10
    assert set(exercise_names()) == set(MISTAKES) == {file.stem for file in SOLUTIONS.glob("*.sleep")}
    for name in exercise_names():
        exercise = find_exercise(name)
        assert exercise.hint
        assert all(goal.otherwise for goal in exercise.goals)


@pytest.mark.parametrize(
    ("name", "seed"),
    [
        pytest.param(name, seed, marks=() if seed == SEEDS[number % len(SEEDS)] else pytest.mark.nightly)
        for number, name in enumerate(exercise_names())
        for seed in SEEDS
    ],
)
def test_the_solution_passes(name: str, seed: int) -> None:
    assert not misses(name, (SOLUTIONS / f"{name}.sleep").read_text(), seed)


@pytest.mark.parametrize("name", exercise_names())
def test_nothing_and_a_mistake_do_not(name: str) -> None:
    answer, why = MISTAKES[name]
    assert why in misses(name, answer)
    assert misses(name, "(PING)")


def test_goals_hold_at_their_times(tmp_path: Path) -> None:
    file = tmp_path / "drive.toml"
    file.write_text(OWN)
    assert not misses(str(file), "@0s (DRIVE 0.5 0)\n@1s (DRIVE 0 0)")
    assert misses(str(file), "(DRIVE 0.5 0)").startswith(
        "wanted max (ABS speed) <= 0.01, but it was 0.5 at 3 s. Somebody"
    )
    assert "Nobody has driven" in misses(str(file), "(DRIVE 0 0)")


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("[[goals]]", "[[goal]]"), r"drive.toml:\d+: goals: an exercise has at least one goal|unknown key"),
        (('"max speed > 0.1"', '"max speed"'), "wanted a measure and a bound"),
        (('"max speed > 0.1"', '"max speed > 0.1.2"'), "wanted a measure and a bound"),
        (('"max speed > 0.1"', '"os.getpid > 0.1"'), "what comes from others is not run"),
        (('"once"', '"often"'), "when"),
        (('"crowd"', '"crowed"'), "no scenario"),
        (('"3s"', '"3h"'), "seconds"),
        (('"Drive"', "5"), "title"),
    ],
)
def test_a_wrong_file_is_refused_with_its_place(tmp_path: Path, change: tuple[str, str], why: str) -> None:
    file = tmp_path / "drive.toml"
    file.write_text(OWN.replace(*change))
    with pytest.raises(SettingsError, match=why):
        find_exercise(str(file))


@pytest.mark.parametrize(
    ("answer", "error", "why"),
    [
        ("", MisuseError, "nothing to send"),
        ("; nothing", MisuseError, "nothing to send"),
        ("MARK fuel > 50%", MisuseError, r"write \(WHEN \(> fuel 50%\) \(MARK\)\)"),
        ("(MARK", MisuseError, r'^answer.sleep: the "\(" at 1:1 is not closed'),
        ("(ST)\n; two\n(MARK 5 6)", MisuseError, r"^answer.sleep:3: .*takes 0 arguments"),
        ("@1s (ST)\n@2s (MARK", MisuseError, r"^answer.sleep:2: .*not closed"),
        ("@1s (ST)\n@9999h (MARK)", MisuseError, r"^answer.sleep:2: sent at .* s, but the exercise ends at"),
        ("@5 minutes (MARK)", MissionError, "wanted"),
        ("(WHEN (< id 5) (MARK))", MisuseError, "id is used: this exercise is to be done without it"),
    ],
)
def test_an_answer_that_cannot_be_sent_is_refused(answer: str, error: type[Exception], why: str) -> None:
    with pytest.raises(error, match=why):
        read_answer(find_exercise("gather"), answer, "answer.sleep")


def test_warnings_say_where() -> None:
    found = read_answer(find_exercise("gather"), "(ST)\n(FOO)", "answer.sleep")
    assert [each.split("(did")[0] for each in found.warnings] == ['answer.sleep:2: unknown function "FOO" ']


def test_a_goal_that_cannot_be_measured_is_named(tmp_path: Path) -> None:
    file = tmp_path / "tired.toml"
    file.write_text(
        'title = "t"\ntask = "t"\nscenario = "bravo"\nseconds = "1s"\n[[goals]]\nholds = "mean fule > 1"\n',
        encoding="utf-8",
    )
    exercise = find_exercise(str(file))
    with pytest.raises(MisuseError, match=r"^tired, goal mean fule > 1: unknown name"):
        attempt(exercise, read_answer(exercise, "(ST)", "answer").orders, 1)


def test_no_such_exercise() -> None:
    with pytest.raises(MisuseError, match=r"did you mean mark\?"):
        find_exercise("mork")
