"""Programs by their texts: what robots run, and what they are only asked."""

from __future__ import annotations

import pytest

from language.cases import Setting
from sleepcast.channel import Kind, Message
from sleepcast.language.explain import foretell, rehearse
from sleepcast.language.program import MAX_ASKED, MAX_PROGRAMS, Library, Program
from sleepcast.language.reader import read
from sleepcast.node.node import Node


def node() -> Node:
    return Node("r1", Setting().vocabulary())


def compiled(library: Library, robot: Node, text: str, *, asked: bool) -> Program:
    return library.program(text, lambda: [read(text)], robot.memory.base, asked=asked)


def test_no_question_drives_out_what_robots_run() -> None:
    library, robot = Library(), node()
    run = compiled(library, robot, "(+ 1 2)", asked=False)
    for number in range(MAX_PROGRAMS + 10):
        compiled(library, robot, f"(+ {number} 3)", asked=True)
    assert compiled(library, robot, "(+ 1 2)", asked=False) is run


def test_a_question_is_checked_once_for_all_robots_that_are_asked_it_at_a_time() -> None:
    library, robot = Library(), node()
    first = compiled(library, robot, "(+ 1 2)", asked=True)
    assert compiled(library, node(), "(+ 1 2)", asked=True) is first
    for number in range(MAX_ASKED):
        compiled(library, robot, f"(+ {number} 3)", asked=True)
    assert compiled(library, robot, "(+ 1 2)", asked=True) is not first


def test_a_node_that_is_asked_compiles_nothing() -> None:
    robot = node()
    robot.memory.library = library = Library()
    robot.receive(Message("desk", 1, 1, Kind.ASK, 0.0, text="(+ 1 41)"))
    robot.think(1, 0.1)
    assert [message.body["value"] for message in robot.outbox] == [42.0]
    again = compiled(library, robot, "(+ 1 41)", asked=True)
    assert compiled(library, robot, "(+ 1 41)", asked=False) is not again


@pytest.mark.parametrize(
    "text",
    [
        "(WHEN (> id 100) (REPORT id))",
        "(AND (> (/ 1 0) 2) (SETQ e1 1))",
        "(DOTIMES (i 99) (SQRT (- 0 i)))",
        "(COND ((< id 100) (MARK)) (TRUE 5))",
        "(IF (> marked 0) 1 2)",
        "(LET ((a 3)) (> a id))",
    ],
)
def test_what_would_come_of_a_question_is_the_same_without_an_explanation(text: str) -> None:
    robot = node()
    program = compiled(Library(), robot, text, asked=True)
    explained, plain = robot.memory.rehearsal(), robot.memory.rehearsal()
    whole, short = rehearse(program, explained), foretell(program, plain)
    assert (str(whole.value), whole.matched, whole.faults) == (str(short.value), short.matched, short.faults)
    assert (explained.undecided, explained.steps) == (plain.undecided, plain.steps)
