"""A number with a decimal comma: wherever people type one, it is named as what it is, with the number to write."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from cli.calling import called_here
from sleepcast.channel.transports.address import number_option
from sleepcast.core.errors import MisuseError, decimal_comma
from sleepcast.experiments.measures import read_measure, read_stop
from sleepcast.experiments.plan import read_experiment
from sleepcast.language import Vocabulary, check
from sleepcast.language.learned_names import LearnedNames
from sleepcast.mind.authority import read_lease
from sleepcast.nomad.world.sites import read_site
from sleepcast.simulator import parse_mission, read_scenario
from sleepcast.simulator.recording.recorder import read_rotation

POINT = "Decimals have a point, not a comma: "
PLAN = 'scenario = "bravo"\nsampling = "sobol"\npoints = 2\n[measures]\nf = "mean fuel"\n[over]\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("12,5", f". {POINT}12.5"),
        ("-0,25 m/s", f". {POINT}-0.25 m/s"),
        ("1,000", f". {POINT}1.000, or 1000 if thousands are meant"),
        ("12.5", ""),
        ("1,2,3", ""),
        ("a,5", ""),
        (",5", ""),
        ("(1,5)", ""),
        (7.5, ""),
    ],
)
def test_what_has_one(text: object, said: str) -> None:
    assert decimal_comma(text) == said


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("(> fuel 12,5)", "a comma in a number at 1:11. " + POINT + "12.5"),
        ("(> fuel 12,5%)", "a comma in a number at 1:11. " + POINT + "12.5%"),
        ("(GOTO 1,5km -2,25km)", "a comma in a number at 1:8. " + POINT + "1.5km"),
        ("(TELL `(WHEN (> fuel 12,5) (ST)))", "a comma in a number at 1:24. " + POINT + "12.5"),
    ],
)
def test_in_an_expression(text: str, said: str) -> None:
    messages = [finding.message for finding in check(text, LearnedNames(Vocabulary())).errors]
    assert said in messages
    assert not any("quoted" in each for each in messages)


@pytest.mark.parametrize(
    "text", ["(TELL `(DEFVAR n ,(+ 1 2)))", "(LET ((a 2)) (TELL `(GOTO 12 ,a)))", "(TELL `(ST ,5))"]
)
def test_what_stands_behind_a_comma_in_a_template_is_none(text: str) -> None:
    assert not any("comma" in finding.message for finding in check(text, LearnedNames(Vocabulary())).errors)


@pytest.mark.parametrize(
    ("read", "number"),
    [
        (lambda: read_lease("1,5s"), "1.5s"),
        (lambda: read_rotation("1,5MB"), "1.5MB"),
        (lambda: parse_mission("@12,5s (ST)", "m.sleep"), "12.5s"),
        (lambda: read_measure("quantile 0,9 fuel"), "0.9"),
        (lambda: read_measure("largest_cluster 2,5m"), "2.5m"),
        (lambda: read_stop("share (IN bravo) >= 0,9"), "0.9"),
        (lambda: read_scenario('format = 1\n[world]\nwidth = "1,5km"\nheight = 3'), "1.5km"),
        (lambda: number_option("udp://x?loss=0,1", "loss", "0,1"), "0.1"),
    ],
)
def test_in_what_is_read(read: Callable[[], object], number: str) -> None:
    with pytest.raises(MisuseError) as caught:
        read()
    assert str(caught.value).endswith(POINT + number)


def test_in_files(tmp_path: Path) -> None:
    site = tmp_path / "room.txt"
    site.write_text("3 0 0 10,5 0 5 5\n")
    with pytest.raises(MisuseError, match=rf"{POINT}10\.5"):
        read_site(site)
    with pytest.raises(MisuseError, match=rf"{POINT}0\.5"):
        read_experiment(tmp_path / "experiment.toml", PLAN + '"radio.loss" = { low = 0, high = "0,5" }\n')


@pytest.mark.parametrize(
    ("arguments", "number"),
    [
        (("run", "bravo", "--headless", "--seconds", "1,5"), "1.5"),
        (("run", "bravo", "--density", "16,5"), "16.5"),
        (("run", "bravo", "--headless", "--snapshot-at", "1,5s"), "1.5s"),
        (("send", "(ST)", "--deadline", "2,5"), "2.5"),
        (("watch", "--every", "0,5"), "0.5"),
        (("eval", "(+ 1,5 2)"), "1.5"),
        (("sweep", "crowd", "--over", "radio.loss=0,5", "--measure", "mean x", "--out", "never"), "0.5"),
    ],
)
def test_on_the_command_line(arguments: tuple[str, ...], number: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = called_here(capsys, *arguments)
    assert found.status in (1, 2)
    assert POINT + number in " ".join(found.err.split())
