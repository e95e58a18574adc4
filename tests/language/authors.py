"""An author of random expressions: well formed, of every form there is, and mostly such as the checker lets through.

It writes text, as people and radios do, out of one source of chance, so a test can hand it hypothesis's own and have
failures made small. Its names come from small fixed pools, one for each sort, so that what one text makes the next
one finds, changes and forgets. A buffer names only those before it, rules name buffers and earlier rules, operators
name all of them and earlier operators: circles are rare, and are written on purpose.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from typing import NamedTuple, TypeVar

SENSORS = ("fuel", "ordnance", "x", "y", "speed", "sonar1", "sonar2")
ACTUATORS = ("throttle", "lamp")
FLAGS = ("marked", "marking", "frozen", "sleeping", "active1", "active2")
USER = ("v1", "v2", "V3", "v4")
BUFFERS = ("E1", "e2", "expr3", "E4")
RULES = ("r1", "r2", "R3")
OPERATORS = (("f0", 0), ("f1", 1), ("F2", 2))
GROUPS = ("bravo", "charlie")
CONSTANTS = ("PI", "TRUE", "NIL", "UNKNOWN", "FRONT")
LOCALS = ("p", "q", "s", "x", "v1", "fuel")
STRANGERS = ("nobody", "somebody")
NUMBERS = (
    "0", "-0", "1", "-1", "2", "3", "10", "0.5", "-0.25", "0.1", "50%", "10in", "90deg", "2s", "1e308", "-1e308",
    "1e-320", "1e16", "4.9e-324", "1e200", "100", "7.5",
)  # fmt: skip
FOLDS = ("+", "-", "*", "/", "MIN", "MAX")
UNARY = ("ABS", "SQRT", "EXP", "LOG", "SIN", "COS", "TAN", "FLOOR", "CEIL", "ROUND", "WRAP", "-", "/", "NOT", "KNOWN")
BINARY = ("^", "MOD", "ATAN2", "+", "-", "*", "/", "MIN", "MAX")
COMPARISONS = ("=", "EQ", "/=", "<", "<=", ">", ">=")
REMEMBERING = (
    ("ONCE", 1, 2), ("HELD", 2, 0), ("HYSTERESIS", 3, 0), ("EVERY", 1, 2), ("AFTER", 1, 2), ("WITHIN", 2, 0),
    ("AGE", 1, 0),
)  # fmt: skip
OVER = ("SUM-OVER", "MEAN-OVER", "MIN-OVER", "MAX-OVER", "COUNT-OVER", "BEST-OVER")
ACTS = ("SLEEP", "WAKE", "FREEZE", "THAW", "MARK", "UNMARK")


Thing = TypeVar("Thing")


class Place(NamedTuple):
    """What may be named where something is being written. level: how much of the stored expressions' order."""

    readable: tuple[str, ...] = ()
    assignable: tuple[str, ...] = ()
    loops: int = 0
    level: int = 99


class Author:
    """Writes expressions. deepest: calls inside one another at most."""

    def __init__(self, chance: Random, deepest: int = 5) -> None:
        self.chance, self.deepest = chance, deepest
        self.calls = (
            *(self.fold,) * 4, *(self.unary,) * 4, *(self.binary,) * 4, self.geometry, self.edge, self.clamp,
            *(self.comparison,) * 5, *(self.junction,) * 5, *(self.cond,) * 3, *(self.choice,) * 4,
            *(self.sequence,) * 2, *(self.let,) * 3, self.dotimes, *(self.over,) * 3, self.each, *(self.of,) * 2,
            *(self.setq,) * 5, *(self.setq_local,) * 2, self.defvar, *(self.store,) * 3, self.rule,
            *(self.remembering,) * 2, self.about_rule, self.defun, self.area, *(self.operator,) * 2,
            *(self.group,) * 2, self.prob, self.dice, self.random, self.act, self.report, self.tell,
            *(self.body,) * 2, self.stranger,
        )  # fmt: skip
        self.looking = (
            self.fold, self.unary, self.binary, self.comparison, self.junction, self.choice, self.of, self.prob,
        )  # fmt: skip
        """What does nothing, whatever it is made of."""

    def text(self) -> str:
        """One expression, as a message."""
        return self.expression(Place(), self.deepest)

    def whole(self) -> str:
        """The same, and now and then a command that chooses among robots, or is about an instant for all, which is a
        whole message."""
        if self.chance.randrange(60):
            return self.text()
        if self.chance.randrange(4) == 0:
            return self.one_of(("(CANCEL)", "(WHEN fuel (CANCEL))", f"(AFTER-ISSUE 2s {self.text()})"))
        place, calls, self.calls = Place(), self.calls, self.looking
        looked = self.several(place, 2, 2, 2)
        self.calls = calls
        which = f"(BEST {self.chance.randint(1, 4)}" if self.chance.randrange(2) else "(QUORUM 1 2"
        test = looked if which.startswith("(BEST") else self.one_of(("TRUE", "UNKNOWN", "fuel", "(IN red)"))
        return f"{which} {test} {self.expression(place, 2)})"

    def expression(self, place: Place, depth: int) -> str:
        if depth <= 0 or self.chance.randrange(4) == 0:
            return self.leaf(place)
        return self.one_of(self.calls)(place, depth - 1)

    def one_of(self, things: Sequence[Thing]) -> Thing:
        return things[self.chance.randrange(len(things))]

    def several(self, place: Place, depth: int, least: int, most: int) -> str:
        count = self.chance.randint(least, most)
        return " ".join(self.expression(place, depth) for _ in range(count))

    # ---- leaves

    def leaf(self, place: Place) -> str:
        kind = self.chance.randrange(20)
        if kind < 7:
            return self.one_of(NUMBERS)
        if kind < 9:
            return repr(self.chance.uniform(-20, 20))
        if kind < 12 and place.readable:
            return self.one_of(place.readable)
        if kind < 15:
            return self.one_of(USER)
        if kind < 17:
            return self.one_of(SENSORS + ACTUATORS)
        if kind < 18:
            return self.one_of(CONSTANTS + FLAGS + ("id",))
        return self.stored_name(place)

    def stored_name(self, place: Place) -> str:
        """The name of a buffer or rule that what is being written may name."""
        allowed = (BUFFERS + RULES)[: place.level]
        if not allowed or self.chance.randrange(40) == 0:
            return self.one_of(STRANGERS + BUFFERS)
        return self.one_of(allowed)

    # ---- arithmetic, comparison, boolean

    def fold(self, place: Place, depth: int) -> str:
        return f"({self.one_of(FOLDS)} {self.several(place, depth, 1, 4)})"

    def unary(self, place: Place, depth: int) -> str:
        return f"({self.one_of(UNARY)} {self.expression(place, depth)})"

    def binary(self, place: Place, depth: int) -> str:
        return f"({self.one_of(BINARY)} {self.several(place, depth, 2, 2)})"

    def geometry(self, place: Place, depth: int) -> str:
        return f"({self.one_of(('DIST', 'BEARING'))} {self.several(place, depth, 4, 4)})"

    def edge(self, place: Place, depth: int) -> str:
        corners = self.chance.randint(3, 6)
        return f"(EDGE-DIST {self.several(place, min(depth, 1), 2 + 2 * corners, 2 + 2 * corners)})"

    def clamp(self, place: Place, depth: int) -> str:
        return f"(CLAMP {self.several(place, depth, 3, 3)})"

    def comparison(self, place: Place, depth: int) -> str:
        most = 2 if self.chance.randrange(3) else 4
        return f"({self.one_of(COMPARISONS)} {self.several(place, depth, min(most, 2), most)})"

    def junction(self, place: Place, depth: int) -> str:
        return f"({self.one_of(('AND', 'OR'))} {self.several(place, depth, 0, 4)})"

    # ---- control

    def cond(self, place: Place, depth: int) -> str:
        clauses = (f"({self.several(place, depth, 1, 3)})" for _ in range(self.chance.randint(0, 3)))
        return f"(COND {' '.join(clauses)})"

    def choice(self, place: Place, depth: int) -> str:
        if self.chance.randrange(3) == 0:
            return f"(WHEN {self.several(place, depth, 1, 3)})"
        return f"(IF {self.several(place, depth, 2, 3)})"

    def sequence(self, place: Place, depth: int) -> str:
        return f"(PROGN {self.several(place, depth, 0, 3)})"

    def let(self, place: Place, depth: int) -> str:
        names = self.chance.sample(LOCALS, self.chance.randint(0, 2))
        pairs = " ".join(f"({name} {self.expression(place, depth)})" for name in names)
        inside = place._replace(readable=(*place.readable, *names), assignable=self.with_names(place, names))
        return f"(LET ({pairs}) {self.several(inside, depth, 0, 3)})"

    def with_names(self, place: Place, names: list[str]) -> tuple[str, ...]:
        return (*(name for name in place.assignable if name not in names), *names)

    def dotimes(self, place: Place, depth: int) -> str:
        if place.loops >= 2:
            return self.leaf(place)
        counter = self.one_of(("i", "j", "p"))
        inside = place._replace(
            readable=(*place.readable, counter),
            assignable=tuple(name for name in place.assignable if name != counter),
            loops=place.loops + 1,
        )
        return f"(DOTIMES ({counter} {self.chance.randint(0, 4)}) {self.several(inside, depth, 0, 3)})"

    # ---- neighbours

    def around(self, place: Place, depth: int) -> tuple[str, str, Place]:
        """A neighbour's name, where neighbours are looked for, and a place where that name may be read."""
        name = self.one_of(("n", "m", "p"))
        radius = self.one_of(("1m", "3m", "3m", "10m", "10m", "10m", "-1m", "UNKNOWN"))
        colour = f" {self.one_of(('0', '1', 'v1'))}" if self.chance.randrange(4) == 0 else ""
        inside = place._replace(
            readable=(*place.readable, name),
            assignable=tuple(each for each in place.assignable if each != name),
            loops=place.loops + 2,
        )
        return name, f"({name} {radius}{colour})", inside

    def over(self, place: Place, depth: int) -> str:
        if place.loops:
            return self.leaf(place)
        name, which, inside = self.around(place, depth)
        calls, self.calls = self.calls, self.looking
        value = self.of_one(name) if self.chance.randrange(2) else self.expression(inside, min(depth, 1))
        self.calls = calls
        return f"({self.one_of(OVER)} {which} {value})"

    def each(self, place: Place, depth: int) -> str:
        if place.loops:
            return self.leaf(place)
        _, which, inside = self.around(place, depth)
        return f"(FOR-NEIGHBOURS {which} {self.several(inside, min(depth, 2), 0, 2)})"

    def of(self, place: Place, depth: int) -> str:
        return self.of_one(self.one_of(("2", "3", "7", "7.5", "(NEAREST_ID 10m)", "id", *place.readable)))

    def of_one(self, neighbour: str) -> str:
        return f"(OF {neighbour} {self.one_of(('x', 'y', 'heading', 'distance', 'bearing', 'colour', 'opinion'))})"

    # ---- assignment

    def setq(self, place: Place, depth: int) -> str:
        target = self.one_of(USER * 3 + ACTUATORS + FLAGS)
        if target in place.readable and target not in place.assignable:
            return self.leaf(place)
        return f"(SETQ {target} {self.expression(place, depth)})"

    def setq_local(self, place: Place, depth: int) -> str:
        if not place.assignable:
            return self.setq(place, depth)
        return f"(SETQ {self.one_of(place.assignable)} {self.expression(place, depth)})"

    def defvar(self, place: Place, depth: int) -> str:
        return f"(DEFVAR {self.one_of(USER)} {self.several(place, depth, 0, 1)})"

    # ---- stored expressions

    def store(self, place: Place, depth: int) -> str:
        number = self.chance.randrange(len(BUFFERS))
        how = self.one_of(("(SETQQ {} {})", "(SETQ {} '{})", "(SETQ {} (QUOTE {}))", "(RULE {} {})", "(SETQ {} {})"))
        target = BUFFERS[number]
        if target.casefold() in map(str.casefold, place.readable):
            return self.leaf(place)
        value = how == "(SETQ {} {})"
        return how.format(target, self.expression(place if value else Place(level=number), depth))

    def rule(self, place: Place, depth: int) -> str:
        number = self.chance.randrange(len(RULES))
        return f"(RULE {RULES[number]} {self.expression(Place(level=len(BUFFERS) + number), depth)})"

    def remembering(self, place: Place, depth: int) -> str:
        """A form that remembers from tick to tick, in a rule of its own unless something stored is being written."""
        if self.chance.randrange(8) == 0:
            how = self.one_of(("MAX", "MIN", "MIN 1", "NEWEST"))
            return f"(RULE {self.one_of(RULES)} (SHARE {self.one_of(USER)} {how}))"
        if place.level == 99 or self.chance.randrange(3) == 0:
            number = self.chance.randrange(len(RULES))
            inside = Place(level=len(BUFFERS) + number)
            return f"(RULE {RULES[number]} {self.remembers(inside, depth)})"
        return self.remembers(place, depth)

    def remembers(self, place: Place, depth: int) -> str:
        name, arguments, rest = self.one_of(REMEMBERING)
        return f"({name} {self.several(place, depth, arguments, arguments + rest)})"

    def about_rule(self, place: Place, depth: int) -> str:
        name = self.one_of(RULES + BUFFERS)
        if self.chance.randrange(4) == 0:
            return f"(LEASE {name} {self.expression(place, depth)})"
        return f"({self.one_of(('ACTIVATE', 'DEACTIVATE', 'FORGET'))} {name})"

    def defun(self, place: Place, depth: int) -> str:
        name, count = self.one_of(OPERATORS)
        names = tuple(self.chance.sample(LOCALS, count))
        inside = Place(readable=names, assignable=names, level=len(BUFFERS) if self.chance.randrange(3) else 0)
        return f"(DEFUN {name} ({' '.join(names)}) {self.several(inside, depth, 1, 2)})"

    def area(self, place: Place, depth: int) -> str:
        """An area, or where the robot is in one; its name is that of an operator without parameters."""
        name = OPERATORS[0][0]
        if self.chance.randrange(3) == 0:
            inside = Place(level=len(BUFFERS) if self.chance.randrange(3) else 0)
            pairs = [(self.expression(inside, min(depth, 1)), self.chance.uniform(1, 20)) for _ in range(4)]
            sizes = [f"{first} {second!r}" for first, second in pairs]
            return f"(AREA {name} {' '.join(sizes) if self.chance.randrange(2) else f'{pairs[0][0]} {sizes[1]}'})"
        return f"({self.one_of(('INSIDE', 'TO-EDGE'))} {name})" if place.level == 99 else self.leaf(place)

    def operator(self, place: Place, depth: int) -> str:
        if place.level < 99:
            return self.leaf(place)
        name, count = self.one_of(OPERATORS)
        if self.chance.randrange(12) == 0:
            return f"(FORGET {name})"
        return f"({name} {self.several(place, depth, count, count)})"

    # ---- groups, chance, speaking, the body

    def group(self, place: Place, depth: int) -> str:
        return f"({self.one_of(('JOIN', 'LEAVE', 'IN', 'IN'))} {self.one_of(GROUPS)})"

    def prob(self, place: Place, depth: int) -> str:
        return f"(PROB {self.expression(place, depth)})"

    def dice(self, place: Place, depth: int) -> str:
        sides = (f"({self.several(place, depth, 2, 2)})" for _ in range(self.chance.randint(1, 3)))
        return f"(DICE {' '.join(sides)})"

    def random(self, place: Place, depth: int) -> str:
        return f"({self.one_of(('RANDOM', 'GAUSS'))} {self.several(place, depth, 2, 2)})"

    def act(self, place: Place, depth: int) -> str:
        return f"({self.one_of(ACTS)})" if self.chance.randrange(4) else f"(PING {self.several(place, depth, 0, 1)})"

    def report(self, place: Place, depth: int) -> str:
        label = self.one_of(('"here"', '""', ""))
        return f"({self.one_of(('REPORT', 'PRINT'))} {label} {self.several(place, depth, 0 if label else 1, 3)})"

    def tell(self, place: Place, depth: int) -> str:
        mark = self.one_of(("", "`", "'"))
        hops = self.one_of(("", "", " :hops 3"))
        return f"(TELL {mark}(SETQ {self.one_of(ACTUATORS)} (+ 1 ,{self.expression(place, depth)})){hops})"

    def body(self, place: Place, depth: int) -> str:
        if self.chance.randrange(2):
            return str(self.one_of(("(ST)", '(TK "hello")', "(MUTE)", "(LOOSE)")))
        name, count = self.one_of((("VM", 2), ("SONAR", 1), ("GIVE", 1)))
        return f"({name} {self.several(place, depth, count, count)})"

    def stranger(self, place: Place, depth: int) -> str:
        """A function that no robot has, or an assignment to a name that nobody declared."""
        if self.chance.randrange(2):
            return f"(warble {self.several(place, depth, 0, 2)})"
        return f"(SETQ {self.one_of(STRANGERS)} {self.expression(place, depth)})"
