"""The machine: programs, the memory they touch, and how one is evaluated within its bounds.

A `Program` is a checked expression. The first evaluations walk its tree of parts; once it has proved worth it, Python
code is generated from the tree (`compiler`). Both give the same numbers, faults and effects, bit for bit, because
both leave everything unusual to the few functions below.

Every program is charged its static cost when it is entered, so evaluations end however buffers and operators call
each other: past the budget the evaluation stops with a fault, and what was assigned before it stands.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import cached_property
from math import nan
from typing import TYPE_CHECKING, TypeAlias
from weakref import ref

from sleepcast.core.errors import SleepcastError
from sleepcast.core.records import NamedTuple
from sleepcast.language import special_forms
from sleepcast.language.checker import MAX_COST, Checker, CheckError, cost
from sleepcast.language.evaluate import Memory, Walker
from sleepcast.language.parts import CHANCY, Part, acts, deciding, is_acting, walk
from sleepcast.language.reader import Form, height, read_all
from sleepcast.language.remembering import REMEMBERS, written_out
from sleepcast.language.symbols import Group, Names, Operator, Stored, reaches, uses_in
from sleepcast.language.vocabulary import Vocabulary

if TYPE_CHECKING:
    from sleepcast.language.codegen import Code

MAX_STEPS = MAX_COST
"""Steps of one evaluation, all buffers and operators it enters included: about two milliseconds of a slow computer."""
HOT = 20
"""Evaluations of a program by walking before code is generated; generating costs about as much as twenty walks."""
_SLOTTED = frozenset({"var", "write", "defvar", "set_user"})
_DECLARES: dict[str, type] = {"rule": Stored, "group": Group}
"""What a text may declare that reads the same before and after it has been learned."""
MAX_PROGRAMS = 512
"""Programs kept by their text for one vocabulary; when full, those are forgotten that nobody has, and are made again as
they are needed. Where half as many and more are in use, there is room for as many besides."""
MAX_COMPILED = 8_192
"""Compiled programs of which is known that they were compiled; when full, all are forgotten."""
MAX_ASKED = 64
"""Questions whose programs are kept beside them, for the other robots that are asked: the latest."""


class OutOfSteps(Exception):
    """The evaluation went past `MAX_STEPS`; caught by `evaluate`."""


class Program:
    """A checked expression that can be entered. body: its parts, evaluated in order (an operator may have several).

    cost: steps charged when entered.
    height: levels of parentheses inside one another.
    uses: keys of buffers, rules and operators it names.
    free: keys of learned names it depends on.
    meanings: what they were when it was checked, as far as they had been learned.
    declares: rules and groups that the text itself makes.
    stores: keys that it stores expressions under, with what those use.
    is_test: whether it is nothing but a test, whose value says whether it held.
    for_everybody: whether it has no test, so that everybody matches.
    acts, chancy: of the whole program.
    slots: the length of values it needs.
    """

    def __init__(self, forms: Sequence[Form], root: Part, parameters: int, checker: Checker, steps: int) -> None:
        self.form, self.root, self.parameters, self.text = forms[0], root, parameters, checker.text
        self.height = max(map(height, forms))
        self.uses, self.free = frozenset(checker.uses), frozenset(checker.free)
        learned = {key: checker.names.declared(key) for key in sorted(self.free)}
        self.meanings = {key: known for key, known in learned.items() if known is not None}
        self.stores = dict(checker.pending_uses)
        self.declares = {key: _DECLARES[kind] for key, kind in checker.pending.items() if kind in _DECLARES}
        self.locals, self.cost = checker.locals, steps
        self._vocabulary = ref(checker.names.vocabulary.first)  # as long as it lives, libraries keep this program
        parts = walk(root)
        for index, part in enumerate(parts):
            part.index = index
        self.size = len(parts)
        self.slots = 1 + max((p.slot for p in parts if p.op in _SLOTTED), default=-1)
        self._look_at(parts)
        self.runs = 0
        self.code: Code | None = None
        self.is_test = False
        self._test: Program | None = None
        if parameters == 0:
            self._find_test()
        self.for_everybody = not self.is_test and self._test is None

    @property
    def vocabulary(self) -> Vocabulary:
        """What its names mean; an empty one when no robot has that any more."""
        return self._vocabulary() or Vocabulary()

    @property
    def test(self) -> Program | None:
        """The top-level test as a program of its own, None if everybody matches."""
        return self if self.is_test else self._test  # a program that kept itself would be garbage that is searched for

    def run(self, memory: Memory, *arguments: float) -> float:
        """Enter the program: charge its cost, evaluate it, give its value. Raises OutOfSteps."""
        memory.steps += self.cost
        if memory.steps > MAX_STEPS:
            raise OutOfSteps
        return self.go(memory, *arguments)

    def go(self, memory: Memory, *arguments: float) -> float:
        """Evaluate the program, its cost having been charged."""
        values = memory.values
        if len(values) < self.slots:
            values.extend([nan] * (self.slots - len(values)))
        code = self.code
        if code is None:
            self.runs += 1
            if self.runs <= HOT:
                return Walker(memory, self, arguments).value(self.root)
            code = self.compile()
        return code(values, memory, *arguments)

    def compile(self) -> Code:
        """The program's Python code, generated now if it was not before."""
        if self.code is None:
            from sleepcast.language.codegen import generate  # most commands are done before anything is worth it

            self.code = generate(self.root, self.parameters)
        return self.code

    def _look_at(self, parts: list[Part]) -> None:
        ops = {part.op for part in parts}
        self.acts = any(map(is_acting, parts))
        self.chancy = not CHANCY.isdisjoint(ops)

    def _find_test(self) -> None:
        part = deciding(self.root)
        tests = () if part is None else _watch(part)
        if part is None or not tests:
            return
        if part is self.root and part.op == "and" and len(tests) == len(part.parts):
            part.watch = 0
            self.is_test = True
            return
        root = tests[0] if len(tests) == 1 else Part("and" if part.op == "and" else "or", part.form, tests)
        self._test = test = self._of(_within(self.root, part, root))
        test.is_test, test.for_everybody = True, False

    @cached_property
    def bid_cost(self) -> Program | None:
        """The cost of a BEST as a program of its own; None where nothing is chosen by a cost."""
        auction = next((part for part in walk(self.root) if part.op == "auction"), None)
        return None if auction is None or not auction.parts[:-1] else self._of(auction.parts[0])

    def _of(self, root: Part) -> Program:
        """A piece of the program as one of its own, without a test."""
        piece = Program.__new__(Program)
        piece.__dict__.update(self.__dict__)
        piece.root, piece.form, piece.cost = root, root.form, cost(root)
        piece.runs, piece.code, piece._test = 0, None, None
        piece.is_test, piece.for_everybody = False, True
        piece._look_at(walk(root))
        return piece


def _watch(part: Part) -> tuple[Part, ...]:
    """Mark where the top-level test is, for `Memory.matched`; gives the parts that are the test."""
    if part.op == "cond":
        for clause in part.parts:
            clause.watch = 1
        return tuple(clause.parts[0] for clause in part.parts)
    if part.op == "if":
        part.watch = 1
        return part.parts[:1]
    leading = 0
    while leading < len(part.parts) and not acts(part.parts[leading]):
        leading += 1
    part.watch = leading
    return part.parts[:leading]


def _within(root: Part, inside: Part, test: Part) -> Part:
    """The test of `inside`, with the LETs of `root` around it, so that their names have their values."""
    if root is inside:
        return test
    if root.op in ("progn", "timed"):
        return _within(next(p for p in root.parts if inside in walk(p)), inside, test)
    count = int(root.number)
    body = _within(next(p for p in root.parts[count:] if inside in walk(p)), inside, test)
    return Part("let", root.form, (*root.parts[:count], body), slot=root.slot, number=count)


def build(
    text: str, forms: Sequence[Form], names: Names, parameters: tuple[str, ...] = (), *, warns: bool = True
) -> tuple[Program, Checker]:
    """Check `forms` (read from `text`) and make a program of them; look at the checker's findings before using it."""
    checker = Checker(names, text, special_forms.SPECIAL, warns=warns)
    if not text or REMEMBERS.search(text):
        for form in forms:
            checker.declare_all(form)
        forms = [written_out(form, lambda key: checker.meaning(key) is not None) for form in forms]
    for form in forms:
        checker.declare_all(form)
    with checker.scope([p.casefold() for p in parameters]):
        body = checker.parts(tuple(forms))
    root = body[0] if len(body) == 1 else Part("progn", forms[0], body)
    steps = checker.bounded(root, forms[0])
    return Program(forms, root, len(parameters), checker, steps), checker


Slots: TypeAlias = tuple[str, ...]
"""The keys of user variables in the order of their slots."""


class _Kept(NamedTuple):
    """A program under its text and parameters, with what its learned names were. added: the slots that it got."""

    key: tuple[str, Slots]
    meanings: tuple[object, ...]
    program: Program
    added: Slots = ()


class _Shelf:
    """Programs by their texts, and what else they are kept under; when it is full, all are dropped."""

    def __init__(self) -> None:
        self._programs: dict[Hashable, tuple[_Kept, ...]] = {}
        self._count, self._room = 0, MAX_PROGRAMS

    def under(self, key: Hashable) -> tuple[_Kept, ...]:
        return self._programs.get(key, ())

    def add(self, key: Hashable, kept: _Kept) -> None:
        if self._count >= self._room:
            self._make_room()
        self._programs[key] = (*self.under(key), kept)
        self._count += 1

    def _make_room(self) -> None:
        self._programs, self._count = {}, 0


class _UsedShelf(_Shelf):
    """When it is full, those are dropped that nobody else has. So the same text with the same meanings is one program
    for all robots that have it, whatever has been compiled meanwhile: equal minds are one, and a snapshot holds a
    program once, no matter what else there was in the same process."""

    def _make_room(self) -> None:
        known = [
            (key, kept.key, kept.meanings, ref(kept.program), kept.added)
            for key, alike in self._programs.items()
            for kept in alike
        ]
        super()._make_room()
        for key, its_own, meanings, program, added in known:
            if (used := program()) is not None:
                self._programs[key] = (*self.under(key), _Kept(its_own, meanings, used, added))
                self._count += 1
        self._room = max(MAX_PROGRAMS, 2 * self._count)


class _Known:
    """The programs of vocabularies that were made `anew` from one, for the next of them: their robots are given the
    slots of user variables in the order in which they hear of them, so a program is kept under those before it.

    What was compiled once and what was compiled again stand apart. Robots tell each other hundreds of texts with
    numbers in them that never come again, and which would fill the room of those that all swarms have.
    """

    def __init__(self) -> None:
        self._once, self._again = _Shelf(), _Shelf()
        self._compiled = set[int]()
        """Of what was compiled: the hashes of texts and what else they are kept under."""

    def find(self, text: str, parameters: Slots, names: Names) -> _Kept | None:
        """The program of a text for a robot with these names, whose vocabulary gets the slots that it gives."""
        vocabulary = names.vocabulary
        key = text, parameters, tuple(vocabulary.user_slots)
        found = _suiting(self._again.under(key) + self._once.under(key), names)
        for slot in () if found is None else found.added:
            vocabulary.user_slot(slot)
        return found

    def keep(self, kept: _Kept, before: Slots) -> None:
        """Keep what was just compiled. before: the slots then."""
        key = *kept.key, before
        if len(self._compiled) >= MAX_COMPILED:
            self._compiled = set()
        (self._again if hash(key) in self._compiled else self._once).add(key, kept)
        self._compiled.add(hash(key))


class Library:
    """Programs by text, shared by all robots of one vocabulary: a text is compiled once for a thousand robots.

    What a text means may depend on what a robot has learned, so each program is kept with what its learned names were.
    What is only asked never takes the place of what robots run: anybody may ask, and each question is another one.

    vocabulary: of the robots; what was compiled for another one that was made `anew` from the same is taken over. None
        takes nothing over.
    """

    def __init__(self, vocabulary: Vocabulary | None = None) -> None:
        self._known = None if vocabulary is None else vocabulary.common(_Known)
        self._programs = _UsedShelf()
        self._questions: OrderedDict[str, list[_Kept]] = OrderedDict()

    def program(
        self,
        text: str,
        forms: Callable[[], Sequence[Form]],
        names: Names,
        parameters: tuple[str, ...] = (),
        *,
        asked: bool = False,
    ) -> Program:
        """The program of `text` for a robot with these names. asked: whether it is only asked. Raises ReadError (from
        `forms`) and CheckError."""
        suiting = _suiting(self._programs.under((text, parameters)), names)
        if suiting is not None:
            return suiting.program
        if asked:
            return self._question(text, forms, names)
        kept = self._compiled(text, forms, names, parameters)
        self._programs.add(kept.key, kept)
        return kept.program

    def _compiled(self, text: str, forms: Callable[[], Sequence[Form]], names: Names, parameters: Slots) -> _Kept:
        known, before = self._known, tuple(names.vocabulary.user_slots)
        kept = None if known is None else known.find(text, parameters, names)
        if kept is None:
            program = _checked(text, forms(), names, parameters)
            added = tuple(names.vocabulary.user_slots)[len(before) :]
            kept = _Kept((text, parameters), _meanings(program, names), program, added)
            if known is not None:
                known.keep(kept, before)
        return kept

    def _question(self, text: str, forms: Callable[[], Sequence[Form]], names: Names) -> Program:
        alike = self._questions.get(text, [])
        suiting = _suiting(alike, names)
        if suiting is not None:
            return suiting.program
        program = _checked(text, forms(), names)
        self._questions[text] = [*alike[1 - MAX_ASKED :], _Kept((text, ()), _meanings(program, names), program)]
        self._questions.move_to_end(text)
        if len(self._questions) > MAX_ASKED:
            self._questions.popitem(last=False)
        return program

    def again(self, program: Program, names: Names, parameters: tuple[str, ...] = ()) -> Program:
        """A program that was checked when it came in, as its text reads now that its names mean something else.

        If it cannot be compiled any more it stays as it was: what it then meets is a fault of its own.
        """
        try:
            return self.program(program.text, lambda: read_all(program.text), names, parameters)
        except SleepcastError:
            return program


def _suiting(stored: Iterable[_Kept], names: Names) -> _Kept | None:
    """The one of a text's programs that is right for a robot with these names."""
    for kept in stored:
        if kept.meanings == _meanings(kept.program, names) and not _circular(kept.program, names):
            return kept
    return None


def _checked(text: str, forms: Sequence[Form], names: Names, parameters: tuple[str, ...] = ()) -> Program:
    """A new program. Raises CheckError."""
    program, checker = build(text, forms, names, parameters, warns=False)
    if count := checker.findings.counts["error"]:
        errors = [finding for finding in checker.findings.shown() if finding.severity == "error"]
        raise CheckError(errors, text, count - len(errors))
    return program


def _circular(program: Program, names: Names) -> bool:
    """Whether what the program stores would come to name itself on this robot, which it did not on another.

    The stored expressions are looked at in the checker's order, each knowing those before it.
    """
    known: dict[str, frozenset[str]] = {}

    def uses_of(key: str) -> frozenset[str]:
        return known[key] if key in known else uses_in(names, key)

    for key, uses in program.stores.items():
        if reaches(uses, key, uses_of) is not None:
            return True
        known[key] = uses
    return False


def _meanings(program: Program, names: Names) -> tuple[object, ...]:
    """What the learned names of a program are on a robot: their types, and of operators the number of parameters."""
    meanings: list[object] = []
    for key in sorted(program.free):
        known = names.declared(key)
        declared = program.declares.get(key, type(None)) if known is None else type(known)
        meanings.append(len(known.parameters) if isinstance(known, Operator) else declared)
    return tuple(meanings)


def evaluate(program: Program, memory: Memory) -> float:
    """One evaluation from outside: a fresh budget, and no way out but a value; past the budget a fault and unknown."""
    memory.steps, memory.depth, memory.levels = program.cost, 0, program.height
    memory.matched = program.for_everybody
    code, values = program.code, memory.values
    try:
        value = program.go(memory) if code is None or len(values) < program.slots else code(values, memory)
    except OutOfSteps:
        return memory.fault(program.root, f"out of steps: at most {MAX_STEPS} in one evaluation")
    if program.is_test:
        memory.matched = value < 0.0 or value > 0.0
    return value


def decide(program: Program, memory: Memory, walker: Walker | None = None) -> float:
    """The same as `evaluate`, and the memory knows whether the top-level test was unknown: for what is answered,
    foretold or explained. The program is walked, because rules, whose code has to be fast, need not know it. walker:
    walks it, for whoever looks at its parts."""
    memory.steps, memory.depth, memory.levels = program.cost, 0, program.height
    memory.matched, memory.undecided = program.for_everybody, False
    memory.values.extend([nan] * (program.slots - len(memory.values)))
    try:
        value = (walker or Walker(memory, program)).value(program.root)
    except OutOfSteps:
        value = memory.fault(program.root, f"out of steps: at most {MAX_STEPS} in one evaluation")
    if program.is_test:
        memory.matched, memory.undecided = value < 0.0 or value > 0.0, value != value
    return value
