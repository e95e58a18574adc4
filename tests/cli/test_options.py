"""Options that take a value with its unit: one type, with the words of files and of Python."""

from __future__ import annotations

import re

import click
import pytest

from sleepcast.cli import main, program
from sleepcast.cli.options import NumberRange, QuantityType
from sleepcast.core.units import LENGTH, TIME

PLAIN = {"--rate", "--density", "--speed"}
"""Options of plain numbers: signatures, square metres, multiples of real time."""


def commands() -> list[tuple[str, click.Command]]:
    context, found = click.Context(program), []
    for name in program.list_commands(context):
        command = program.get_command(context, name)
        assert command is not None
        inner = command.commands if isinstance(command, click.Group) else {}
        found += [(name, command), *((f"{name} {each}", below) for each, below in inner.items())]
    return found


@pytest.mark.parametrize(("name", "command"), commands(), ids=[name for name, _ in commands()])
def test_no_option_takes_a_time_as_a_bare_number_only(name: str, command: click.Command) -> None:
    for each in command.params:
        if isinstance(each.type, click.types.FloatParamType):
            assert set(each.opts) <= PLAIN, f"{name} {each.opts}: wanted QuantityType"
        if isinstance(each.type, QuantityType):
            assert each.metavar in ("TIME", "WHEN"), f"{name} {each.opts}"
            assert each.default is None or not isinstance(each.default, float), f"{name} {each.opts}: without its unit"


@pytest.mark.parametrize(
    ("said", "meant"), [("30s", 30.0), ("2min", 120.0), ("2.5", 2.5), (" 1 H ", 3600.0), ("0", 0.0)]
)
def test_a_time_may_have_its_unit(said: str, meant: float) -> None:
    assert QuantityType().convert(said, None, None) == meant


@pytest.mark.parametrize(
    ("type_", "said", "sentence"),
    [
        (QuantityType(), "soon", 'wanted a time such as "30s", not "soon"'),
        (QuantityType(), "5m", 'wanted a time such as "30s", not "5m", a length'),
        (QuantityType(), "5mn", 'unknown unit in "5mn" (did you mean min?); wanted a time such as "30s"'),
        (QuantityType(), "-5s", 'wanted a time of at least 0s, not "-5s"'),
        (QuantityType(), "nan", 'wanted a time such as "30s", not "nan"'),
        (QuantityType(), "1e999h", "wanted a time of at least 0h"),
        (QuantityType(TIME, 0.2, 60.0), "2min", 'wanted a time from 0.2s to 1min, not "2min"'),
        (QuantityType(LENGTH), "5s", 'wanted a length such as "5m", not "5s", a time'),
    ],
)
def test_what_is_none_is_said_as_in_a_file(type_: QuantityType, said: str, sentence: str) -> None:
    with pytest.raises(click.BadParameter, match=re.escape(sentence)):
        type_.convert(said, None, None)


def test_other_numbers_may_have_the_letters_that_people_write_behind_them() -> None:
    assert NumberRange(0.1, 100.0, suffix="x").convert("30x", None, None) == 30.0
    assert NumberRange(suffix="m2").convert("4m2", None, None) == 4.0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["ask", "--seconds", "30", "fuel"], "there is no option --seconds here: what takes a time is --within"),
        (["who", "--timeout", "3"], "there is no option --timeout here: what takes a time is --within"),
        (["stop", "--wait", "3"], "what takes a time is --seconds, --within"),
        (["run", "bravo", "--duration", "3"], "what takes a time is --seconds, --record-pictures"),
        (["eval", "--sed", "3"], "No such option"),
    ],
)
def test_an_option_for_a_time_by_another_name_is_told(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    assert said in capsys.readouterr().err
