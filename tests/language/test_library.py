"""Programs by their texts: what robots run, and what they are only asked."""

from __future__ import annotations

from weakref import WeakSet, ref

import pytest

from language.cases import Setting
from sleepcast.channel import Kind, Message
from sleepcast.language.explain import foretell, rehearse
from sleepcast.language.parts import walk
from sleepcast.language.program import MAX_ASKED, MAX_PROGRAMS, Library, Program
from sleepcast.language.reader import read
from sleepcast.language.symbols import FreshNames
from sleepcast.language.vocabulary import Vocabulary
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


def test_what_somebody_has_is_one_program_whatever_else_is_compiled() -> None:
    library, robot = Library(), node()
    had, others = compiled(library, robot, "(+ 1 2)", asked=False), WeakSet[Program]()
    for number in range(MAX_PROGRAMS + 10):
        others.add(compiled(library, robot, f"(+ {number} 3)", asked=False))
    assert compiled(library, robot, "(+ 1 2)", asked=False) is had
    assert len(others) < 20, "nobody has the others"


BOTH = "(PROGN (DEFVAR a 1) (DEFVAR b (+ a 1)) (RULE r (SETQ b a)))"


class TestRobotsOfOneType:
    """Vocabularies that were made anew from one."""

    def made(self, vocabulary: Vocabulary) -> Program:
        return Library(vocabulary).program(BOTH, lambda: [read(BOTH)], FreshNames(vocabulary))

    def test_what_was_compiled_for_some_is_not_compiled_again_for_others(self) -> None:
        first = Setting().vocabulary()
        one, other = first.anew(), first.anew()
        program = self.made(one)
        assert self.made(other) is program
        assert other.user_slots == one.user_slots == {"a": first.size, "b": first.size + 1}
        assert not first.user_slots
        assert self.made(other.anew()) is program

    def test_texts_that_come_once_do_not_drive_out_what_all_have(self) -> None:
        first, known = Setting().vocabulary(), []
        for swarm in range(3):
            known.append(ref(self.made(first.anew())))
            for number in range(MAX_PROGRAMS):
                Library(first.anew()).program(f"(+ {swarm} {number})", lambda: [read("0")], FreshNames(first))
        assert [each() is None for each in known] == [True, False, False], "the first time nobody can know yet"
        assert known[1]() is known[2]()

    def test_who_has_heard_of_other_variables_before_has_them_in_other_places(self) -> None:
        first = Setting().vocabulary()
        one, other = first.anew(), first.anew()
        other.user_slot("b")
        program, again = self.made(one), self.made(other)
        assert again is not program
        assert other.user_slots == {"b": first.size, "a": first.size + 1}
        slots = {part.name: part.slot for part in walk(again.root) if part.op == "defvar"}
        assert slots == other.user_slots

    def test_one_that_was_not_made_anew_shares_nothing(self) -> None:
        first = Setting().vocabulary()
        assert self.made(first) is not self.made(first.anew())

    def test_a_program_knows_what_its_names_mean_when_its_first_robots_are_gone(self) -> None:
        first = Setting().vocabulary()
        program = self.made(first.anew())
        assert program.vocabulary is first

    def test_no_more_are_kept_than_have_room(self) -> None:
        first = Setting().vocabulary()
        library, names = Library(first.anew()), FreshNames(first.anew())
        kept = ref(compiled_for(names, library, "(+ 1 2)"))
        for number in range(MAX_PROGRAMS):
            compiled_for(names, library, f"(+ {number} 3)")
        assert kept() is None, "nobody has it any more"


def compiled_for(names: FreshNames, library: Library, text: str) -> Program:
    return library.program(text, lambda: [read(text)], names)
