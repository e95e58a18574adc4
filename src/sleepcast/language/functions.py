"""The built-in functions of the standard dialect: their shapes, and what the arithmetic ones compute.

Three kinds. *Pure* functions take known, finite numbers and return a number; whatever is wrong with the numbers they
say by raising `Undefined` (or Python's own ArithmeticError and ValueError), and the machine turns that, and a result
that is not finite, into a fault and an unknown. *Special forms* decide themselves what of their text is evaluated.
*Acts* change the robot's mind or speak; each is carried out by the `Memory`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from sleepcast.core.records import NamedTuple
from sleepcast.language.numerics import angle

MANY = 100
"""Arguments of one call at most: the bound of the original interpreter (`eval numArgs > 100`)."""
MAX_CORNERS = 48
"""Corners of an area: as many as the arguments of one call have room for."""
PRIORITY = ":priority"
NEIGHBOURS = "neighbours"
"""What robots call the forms that go through their neighbours, when they say which forms they know."""
CHOOSING = "best"
"""What robots call the forms by which some of them are chosen, when they say which forms they know."""
AMONG_ROBOTS = "among robots that are sent this: here there is nobody who collects bids"
"""Why such a form is a fault where it is evaluated like any other."""
WINDOW, LEASE = ":window", ":lease"
"""What may stand behind such a form, each with a time."""
TIMED = "after-issue"
"""What robots call the forms about an instant for all, AFTER-ISSUE and CANCEL, when they say which forms they know."""
MAX_WAIT = 3_600.0
"""Seconds from the issue of a command to its instant, at most: clocks drift apart meanwhile."""
NO_INSTANT = "AFTER-ISSUE counts from the issue of a command that is sent: here nothing is"
"""Why such a form is a fault where it is evaluated like any other."""
MAX_CHOSEN = 64
"""Robots that one of these forms chooses at most: their names fit into a few datagrams."""
MAX_PRIORITY = 9
"""Of a rule, and its negative the least. As many levels as people tell apart."""
MAX_HOPS = 8
"""How often robots may hand on what one of them tells, at most: across a fleet and not for ever."""
MAX_REDUCED = 256
"""Neighbours of one SUM-OVER and the like at most: the nearest ones, so that its cost is known before it runs."""
MAX_EACH = 64
"""Neighbours of one FOR-NEIGHBOURS at most, whose body may do something for each of them."""
MAX_REPEATS = 1_000
"""The literal count of a DOTIMES at most."""

TWO_PI = 2.0 * math.pi


class Undefined(ArithmeticError):
    """The function has no value for these numbers; the text says why."""


class Function(NamedTuple):
    """One built-in.

    arguments: how people write them.
    kind: "pure", "special" or "act".
    rule: how dimensions go.
    """

    name: str
    least: int
    most: int
    arguments: str
    kind: str
    rule: str
    doc: str
    compute: Callable[[Sequence[float]], float] | None = None

    @property
    def usage(self) -> str:
        return f"({self.name} {self.arguments})" if self.arguments else f"({self.name})"


def _add(a: Sequence[float]) -> float:
    total = a[0] if a else 0.0
    for x in a[1:]:
        total += x
    return total


def _subtract(a: Sequence[float]) -> float:
    if len(a) == 1:
        return -a[0]
    total = a[0]
    for x in a[1:]:
        total -= x
    return total


def _multiply(a: Sequence[float]) -> float:
    total = a[0] if a else 1.0
    for x in a[1:]:
        total *= x
    return total


def _divide(a: Sequence[float]) -> float:
    total, rest = (1.0, a) if len(a) == 1 else (a[0], a[1:])
    for x in rest:
        if x == 0:
            raise Undefined("division by zero")
        total /= x
    return total


def _power(a: Sequence[float]) -> float:
    try:
        return math.pow(a[0], a[1])
    except ValueError as error:
        raise Undefined(f"{a[0]:g} to the power {a[1]:g} has no value") from error


def _mod(a: Sequence[float]) -> float:
    if a[1] == 0:
        raise Undefined("division by zero")
    return a[0] % a[1]


def _least(a: Sequence[float]) -> float:
    best = a[0]
    for x in a[1:]:
        best = x if x < best else best
    return best


def _greatest(a: Sequence[float]) -> float:
    best = a[0]
    for x in a[1:]:
        best = x if x > best else best
    return best


def _square_root(a: Sequence[float]) -> float:
    if a[0] < 0:
        raise Undefined(f"square root of {a[0]:g}")
    return math.sqrt(a[0])


def _logarithm(a: Sequence[float]) -> float:
    if a[0] <= 0:
        raise Undefined(f"logarithm of {a[0]:g}")
    return math.log(a[0])


def _distance(a: Sequence[float]) -> float:
    if len(a) == 4:
        dx, dy = a[0] - a[2], a[1] - a[3]
        return math.sqrt(dx * dx + dy * dy)
    dx, dy, dz = a[0] - a[3], a[1] - a[4], a[2] - a[5]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


def _edge_distance(a: Sequence[float]) -> float:
    px, py, x0, y0 = a[0], a[1], a[-2], a[-1]
    nearest, sign = math.inf, -1.0
    for x1, y1 in zip(a[2::2], a[3::2], strict=True):
        dx, dy, from_x, from_y = x1 - x0, y1 - y0, px - x0, py - y0
        t = (from_x * dx + from_y * dy) / (dx * dx + dy * dy or 1.0)
        t = 0.0 if t < 0.0 else 1.0 if t > 1.0 else t
        out_x, out_y = from_x - t * dx, from_y - t * dy
        square = out_x * out_x + out_y * out_y
        nearest = square if square < nearest else nearest
        if (y0 <= py) != (y1 <= py) and (from_x * dy < from_y * dx) == (dy > 0.0):
            sign = -sign  # a ray to the east crosses this side
        x0, y0 = x1, y1
    return sign * math.sqrt(nearest) + 0.0


def _wrap(a: Sequence[float]) -> float:
    turned = a[0] % TWO_PI
    return turned - TWO_PI if turned > math.pi else turned


def _clamp(a: Sequence[float]) -> float:
    value, low, high = a
    if low > high:
        raise Undefined(f"CLAMP from {low:g} to {high:g}: the low end is above the high end")
    return low if value < low else high if value > high else value


def _round(a: Sequence[float]) -> float:
    return float(round(a[0]))


def _chain(holds: Callable[[float, float], bool]) -> Callable[[Sequence[float]], float]:
    def compare(a: Sequence[float]) -> float:
        return 1.0 if all(map(holds, a, a[1:])) else 0.0

    return compare


def _all_different(a: Sequence[float]) -> float:
    return 1.0 if len({x + 0.0 for x in a}) == len(a) else 0.0


def _negation(a: Sequence[float]) -> float:
    return 0.0 if a[0] else 1.0


_EQUAL = _chain(lambda x, y: x == y)

_TABLE = (
    Function("+", 0, MANY, "x ...", "pure", "same", "Sum; 0 of nothing.", _add),
    Function("-", 1, MANY, "x ...", "pure", "same", "Difference; of one number its negative.", _subtract),
    Function("*", 0, MANY, "x ...", "pure", "product", "Product; 1 of nothing.", _multiply),
    Function("/", 1, MANY, "x ...", "pure", "quotient", "Quotient; of one number its inverse.", _divide),
    Function("^", 2, 2, "x power", "pure", "power", "x to a power.", _power),
    Function("MOD", 2, 2, "x divisor", "pure", "same", "Remainder with the sign of the divisor.", _mod),
    Function("ABS", 1, 1, "x", "pure", "same", "Size without the sign.", lambda a: abs(a[0])),
    Function("MIN", 1, MANY, "x ...", "pure", "same", "The smallest.", _least),
    Function("MAX", 1, MANY, "x ...", "pure", "same", "The largest.", _greatest),
    Function("SQRT", 1, 1, "x", "pure", "root", "Square root.", _square_root),
    Function("EXP", 1, 1, "x", "pure", "plain", "e to the power x.", lambda a: math.exp(a[0])),
    Function("LOG", 1, 1, "x", "pure", "plain", "Natural logarithm.", _logarithm),
    Function("SIN", 1, 1, "angle", "pure", "plain", "Sine of an angle in radians.", lambda a: math.sin(a[0])),
    Function("COS", 1, 1, "angle", "pure", "plain", "Cosine of an angle in radians.", lambda a: math.cos(a[0])),
    Function("TAN", 1, 1, "angle", "pure", "plain", "Tangent of an angle in radians.", lambda a: math.tan(a[0])),
    Function("ATAN2", 2, 2, "y x", "pure", "ratio", "Angle of the point (x, y), -pi..pi.", lambda a: angle(*a)),
    Function(
        "FLOOR",
        1,
        1,
        "x",
        "pure",
        "same",
        "The whole number below or at x.",
        lambda a: float(math.floor(a[0])),
    ),
    Function("CEIL", 1, 1, "x", "pure", "same", "The whole number above or at x.", lambda a: float(math.ceil(a[0]))),
    Function("ROUND", 1, 1, "x", "pure", "same", "The nearest whole number, a half to the even one.", _round),
    Function("DIST", 4, 6, "x1 y1 [z1] x2 y2 [z2]", "pure", "same", "Distance between two points.", _distance),
    Function(
        "BEARING",
        4,
        4,
        "x1 y1 x2 y2",
        "pure",
        "ratio",
        "Direction from the first point to the second, -pi..pi, counter-clockwise from the x axis.",
        lambda a: angle(a[3] - a[1], a[2] - a[0]),
    ),
    Function(
        "EDGE-DIST",
        8,
        2 + 2 * MAX_CORNERS,
        "x y x1 y1 x2 y2 x3 y3 ...",
        "pure",
        "same",
        "Distance of the point (x, y) to the edge of a polygon; negative outside.",
        _edge_distance,
    ),
    Function("WRAP", 1, 1, "angle", "pure", "plain", "The same angle within -pi..pi (-pi itself is pi).", _wrap),
    Function("CLAMP", 3, 3, "x low high", "pure", "same", "x, but not below low nor above high.", _clamp),
    Function("=", 1, MANY, "x ...", "pure", "compare", "Whether all are equal.", _EQUAL),
    Function("EQ", 1, MANY, "x ...", "pure", "compare", "The same as =.", _EQUAL),
    Function("/=", 1, MANY, "x ...", "pure", "compare", "Whether no two are equal.", _all_different),
    Function(
        "<",
        1,
        MANY,
        "x ...",
        "pure",
        "compare",
        "Whether each is below the next.",
        _chain(lambda x, y: x < y),
    ),
    Function(
        "<=",
        1,
        MANY,
        "x ...",
        "pure",
        "compare",
        "Whether none is above the next.",
        _chain(lambda x, y: x <= y),
    ),
    Function(
        ">",
        1,
        MANY,
        "x ...",
        "pure",
        "compare",
        "Whether each is above the next.",
        _chain(lambda x, y: x > y),
    ),
    Function(
        ">=",
        1,
        MANY,
        "x ...",
        "pure",
        "compare",
        "Whether none is below the next.",
        _chain(lambda x, y: x >= y),
    ),
    Function("NOT", 1, 1, "x", "pure", "truth", "1 for 0, 0 for any other number.", _negation),
    Function("AND", 0, MANY, "x ...", "special", "truth", "The first that is not true, else the last."),
    Function("OR", 0, MANY, "x ...", "special", "truth", "The first that is true; else unknown if any was, else 0."),
    Function("KNOWN", 1, 1, "x", "special", "truth", "1 if x has a value, 0 if it is unknown."),
    Function(
        "COND",
        0,
        MANY,
        "(test expr ...) ...",
        "special",
        "branches",
        "The first clause whose test is true; else 0.",
    ),
    Function("IF", 2, 3, "test then else", "special", "branches", "then if the test is true, else else."),
    Function("WHEN", 1, MANY, "test expr ...", "special", "branches", "Everything after the test, if it is true."),
    Function("PROGN", 0, MANY, "expr ...", "special", "last", "One after the other; the value of the last."),
    Function("LET", 1, MANY, "((name expr) ...) expr ...", "special", "last", "Names of its own for some values."),
    Function(
        "DOTIMES",
        1,
        MANY,
        "(name count) expr ...",
        "special",
        "truth",
        "Repeats, name running from 0; gives 0.",
    ),
    Function("SETQ", 2, 2, "name expr", "special", "last", "Assigns a variable, or stores into a buffer."),
    Function("SETQQ", 2, 2, "buffer expr", "special", "truth", "Stores expr in a buffer as it stands; gives 0."),
    Function("DEFVAR", 1, 2, "name expr", "special", "last", "Makes a user variable, unless it is there already."),
    Function("QUOTE", 1, 1, "expr", "special", "truth", "expr itself, for SETQ on a buffer and for TELL."),
    Function(
        "QUASIQUOTE",
        1,
        1,
        "expr",
        "special",
        "truth",
        "expr with its ,parts replaced by their values, for TELL.",
    ),
    Function("UNQUOTE", 1, 1, "expr", "special", "truth", "Inside a quasi-quote: the value of expr."),
    Function("RULE", 2, 4, "name expr [:priority n]", "special", "truth", "Stores expr under a name and activates it."),
    Function("ACTIVATE", 1, 1, "name", "special", "truth", "Lets a rule run at every tick."),
    Function("DEACTIVATE", 1, 1, "name", "special", "truth", "Keeps a rule but does not run it."),
    Function("FORGET", 1, 1, "name", "special", "truth", "Removes a rule, a buffer's expression or an operator."),
    Function("LEASE", 2, 2, "name seconds", "special", "truth", "Deactivates a rule after so long, unless renewed."),
    Function(
        "DEFUN",
        3,
        MANY,
        "name (parameter ...) expr ...",
        "special",
        "truth",
        "A new operator, called by value.",
    ),
    Function("JOIN", 1, 1, "group", "special", "truth", "Makes this robot a member."),
    Function("LEAVE", 1, 1, "group", "special", "truth", "Ends the membership."),
    Function("IN", 1, 1, "group", "special", "truth", "1 if this robot is a member, else 0."),
    Function("PROB", 1, 1, "chance", "special", "plain", "1 with this probability, else 0."),
    Function(
        "DICE",
        1,
        MANY,
        "(chance expr) ...",
        "special",
        "branches",
        "One of the expressions by chance; else 0.",
    ),
    Function("RANDOM", 2, 2, "low high", "special", "same", "A number drawn evenly between the two."),
    Function("GAUSS", 2, 2, "mean deviation", "special", "same", "A number from a normal distribution."),
    Function("SLEEP", 0, 0, "", "act", "truth", "Powers down: from now on only messages are evaluated."),
    Function("WAKE", 0, 0, "", "act", "truth", "Ends SLEEP."),
    Function("FREEZE", 0, 0, "", "act", "truth", "Holds the body still; rules are not evaluated."),
    Function("THAW", 0, 0, "", "act", "truth", "Ends FREEZE."),
    Function("MARK", 0, 0, "", "act", "truth", "Sets the selection flag."),
    Function("UNMARK", 0, 0, "", "act", "truth", "Clears the selection flag."),
    Function("ROLLBACK", 0, 0, "", "act", "truth", "Brings back the last rules that ran without a fault."),
    Function("REPORT", 1, MANY, '"label" expr ...', "special", "last", "Tells the operator; gives the last value."),
    Function("PRINT", 1, MANY, '"label" expr ...', "special", "last", "The same as REPORT."),
    Function("TELL", 1, 3, "expr [:hops n]", "special", "truth", "Broadcasts expr to the robots in radio range."),
    Function("PING", 0, 1, "caste", "special", "truth", "Sends a ping that robots near by hear."),
)

FUNCTIONS: dict[str, Function] = {function.name.casefold(): function for function in _TABLE}
"""The built-ins whose names mean nothing else, by key (case-folded name)."""

_WORDS = (
    Function(
        "ONCE", 1, MANY, "test expr ...", "special", "last", "The rest in the tick in which the test becomes true."
    ),
    Function("HELD", 2, 2, "test seconds", "special", "truth", "Whether the test has been true for so long."),
    Function("HYSTERESIS", 3, 3, "x low high", "special", "truth", "True from high on, until x is down to low."),
    Function("EVERY", 1, MANY, "seconds expr ...", "special", "last", "The rest now, and again after each so long."),
    Function(
        "AFTER", 1, MANY, "seconds expr ...", "special", "last", "The rest a single time, so long after the rule came."
    ),
    Function(
        "WITHIN", 2, 2, "from to", "special", "truth", "Whether it is between so long and so long after the rule came."
    ),
    Function("AGE", 1, 1, "x", "special", "number", "Seconds since the value of x changed."),
    Function("SHARE", 2, 3, "variable MAX|MIN|NEWEST [step]", "special", "number", "A value that robots share."),
    Function(
        "AREA",
        4,
        1 + 2 * MAX_CORNERS,
        "name x1 y1 x2 y2 x3 y3 ...",
        "special",
        "truth",
        "Names an area: a polygon by its corners, or a disc by x, y and radius.",
    ),
    Function("INSIDE", 1, 1, "area", "special", "truth", "Whether this robot is in the area."),
    Function("TO-EDGE", 1, 1, "area", "special", "number", "Distance to the edge of the area; negative outside."),
    Function("OF", 2, 2, "n name", "special", "number", "What the neighbour with the id n shows, as it is sensed."),
    Function("SUM-OVER", 2, 2, "(n r [colour]) x", "special", "same", "Sum of x over the neighbours n within r."),
    Function("MEAN-OVER", 2, 2, "(n r [colour]) x", "special", "same", "Mean of x over the neighbours n within r."),
    Function("MIN-OVER", 2, 2, "(n r [colour]) x", "special", "same", "The least x of the neighbours n within r."),
    Function("MAX-OVER", 2, 2, "(n r [colour]) x", "special", "same", "The greatest x of the neighbours n within r."),
    Function("COUNT-OVER", 2, 2, "(n r [colour]) test", "special", "plain", "For how many of them the test is true."),
    Function("BEST-OVER", 2, 2, "(n r [colour]) cost", "special", "plain", "The id of the one with the least cost."),
    Function(
        "FOR-NEIGHBOURS",
        1,
        MANY,
        "(n r [colour]) expr ...",
        "special",
        "truth",
        "The rest once for each neighbour n within r; gives 0.",
    ),
    Function(
        "BEST",
        4,
        8,
        "n cost test command [:window t] [:lease t]",
        "special",
        "truth",
        "The n robots of the least cost, among those whose test is true, obey the command.",
    ),
    Function(
        "QUORUM",
        4,
        8,
        "least most test command [:window t] [:lease t]",
        "special",
        "truth",
        "Robots whose test is true obey the command, if there are at least so many, and at most so many of them.",
    ),
    Function(
        "AFTER-ISSUE",
        2,
        2,
        "time command",
        "special",
        "last",
        "The command at the same instant on all robots, so long after it was sent.",
    ),
    Function("CANCEL", 0, 0, "", "special", "plain", "Discards the sender's commands that wait; gives how many."),
)

WORDS: dict[str, Function] = {function.name.casefold(): function for function in _WORDS}
"""Built-ins whose names give way to any other meaning, because robots and programs were given such names before."""
OVER = frozenset({"sum-over", "mean-over", "min-over", "max-over", "count-over", "best-over"})
"""Forms that make one number of all neighbours."""
EACH = "for-neighbours"
ABOUT_NEIGHBOURS = OVER | {"of", EACH}
"""Words that came together, as `NEIGHBOURS`."""
POPULATION = frozenset({"hatch", "die"})
"""Functions of robots that come and go."""
DEADLY = POPULATION | {"eat"}
"""Functions by which robots come or go, themselves or others: no TELL carries them unless the scenario says so."""
BODY_WORDS = {
    "scan-min": "have no laser scanner",
    "scan-gap": "have no laser scanner",
    "sees": "have no camera",
    "plan": "have no plans",
    **dict.fromkeys(sorted(POPULATION), "neither hatch nor die"),
}
"""Functions of a robot's own software that came after 0.2.0, and what is true of robots without them. Their names give
way, as those of `WORDS` do."""
AUCTIONS = frozenset({"best", "quorum"})
"""Words that came together, as `CHOOSING`."""
INSTANTS = frozenset({"after-issue", "cancel"})
"""Words that came together, as `TIMED`."""
BUILT_IN = FUNCTIONS | WORDS
"""Every built-in."""


# ---- one example of each built-in: what a person types, and its value on a new robot

EXAMPLES: dict[str, tuple[str, str]] = {
    "+": ("(+ 1 2 3)", "6"),
    "-": ("(- 10 3 2)", "5"),
    "*": ("(* 2 3 4)", "24"),
    "/": ("(/ 100 5 2)", "10"),
    "^": ("(^ 2 10)", "1024"),
    "MOD": ("(MOD -7 3)", "2"),
    "ABS": ("(ABS -3)", "3"),
    "MIN": ("(MIN 4 2 8)", "2"),
    "MAX": ("(MAX 4 2 8)", "8"),
    "SQRT": ("(SQRT 16)", "4"),
    "EXP": ("(EXP 0)", "1"),
    "LOG": ("(LOG 1)", "0"),
    "SIN": ("(ROUND (* 100 (SIN 30deg)))", "50"),
    "COS": ("(COS 0)", "1"),
    "TAN": ("(ROUND (TAN 45deg))", "1"),
    "ATAN2": ("(ATAN2 0 1)", "0"),
    "FLOOR": ("(FLOOR -2.5)", "-3"),
    "CEIL": ("(CEIL 2.1)", "3"),
    "ROUND": ("(ROUND 2.5)", "2"),
    "DIST": ("(DIST 0 0 3 4)", "5"),
    "BEARING": ("(BEARING 0 0 1 0)", "0"),
    "EDGE-DIST": ("(EDGE-DIST 1 2 0 0 4 0 4 4 0 4)", "1"),
    "WRAP": ("(WRAP (* 2 PI))", "0"),
    "CLAMP": ("(CLAMP 12 0 10)", "10"),
    "=": ("(= 1km 1000m)", "1"),
    "EQ": ("(EQ 1 2)", "0"),
    "/=": ("(/= 1 2 3)", "1"),
    "<": ("(< 1 2 3)", "1"),
    "<=": ("(<= 1 1 2)", "1"),
    ">": ("(> 60% 50%)", "1"),
    ">=": ("(>= 2 3)", "0"),
    "NOT": ("(NOT (> 1 2))", "1"),
    "AND": ("(AND (> 2 1) 5)", "5"),
    "OR": ("(OR (> 1 2) 5)", "5"),
    "KNOWN": ("(KNOWN UNKNOWN)", "0"),
    "COND": ("(COND ((> 1 2) 10) ((> 2 1) 20) (TRUE 30))", "20"),
    "IF": ("(IF (> 2 1) 10 20)", "10"),
    "WHEN": ("(WHEN (> 2 1) (MARK) 7)", "7"),
    "PROGN": ("(PROGN (MARK) 2)", "2"),
    "LET": ("(LET ((a 3) (b 4)) (* a b))", "12"),
    "DOTIMES": ("(LET ((sum 0)) (DOTIMES (i 5) (SETQ sum (+ sum i))) sum)", "10"),
    "SETQ": ("(LET ((a 1)) (SETQ a (+ a 1)))", "2"),
    "SETQQ": ("(PROGN (SETQQ E5 (+ 1 2)) E5)", "3"),
    "DEFVAR": ("(PROGN (DEFVAR level 80%) (+ level 10%))", "0.9"),
    "QUOTE": ("(PROGN (SETQ E6 (QUOTE (+ 1 2))) E6)", "3"),
    "QUASIQUOTE": ("(TELL (QUASIQUOTE (MARK (UNQUOTE (+ 1 2)))))", "1"),
    "UNQUOTE": ("(LET ((a 2)) (TELL `(DEFVAR leader ,a)))", "1"),
    "RULE": ("(RULE blink (IF marked (UNMARK) (MARK)))", "1"),
    "ACTIVATE": ("(PROGN (SETQQ E7 (MARK)) (ACTIVATE E7))", "1"),
    "DEACTIVATE": ("(PROGN (RULE signal (MARK)) (DEACTIVATE signal))", "1"),
    "FORGET": ("(PROGN (RULE wave (MARK)) (FORGET wave))", "1"),
    "LEASE": ("(PROGN (RULE watch (MARK)) (LEASE watch 10s))", "1"),
    "ONCE": ('(RULE low (ONCE (< time 5s) (REPORT "low")))', "1"),
    "HELD": ("(RULE wait (WHEN (HELD marked 3s) (UNMARK)))", "1"),
    "HYSTERESIS": ("(RULE late (WHEN (HYSTERESIS time 10s 20s) (MARK)))", "1"),
    "EVERY": ("(RULE blink (EVERY 2s (IF marked (UNMARK) (MARK))))", "1"),
    "AFTER": ("(RULE soon (AFTER 10s (MARK)))", "1"),
    "WITHIN": ("(RULE first (IF (WITHIN 0s 5s) (MARK) (UNMARK)))", "1"),
    "AGE": ("(RULE old (WHEN (> (AGE marked) 60s) (UNMARK)))", "1"),
    "SHARE": ("(PROGN (DEFVAR leader id) (RULE elect (SHARE leader MAX)))", "1"),
    "AREA": ("(PROGN (DEFVAR x 3) (DEFVAR y 1) (AREA yard 0m 0m 9m 0m 9m 4m 0m 4m) (TO-EDGE yard))", "1"),
    "INSIDE": ("(PROGN (DEFVAR x 3) (DEFVAR y 4) (AREA pond 0m 0m 7m) (INSIDE pond))", "1"),
    "TO-EDGE": ("(PROGN (DEFVAR x 3) (DEFVAR y 4) (AREA pond 0m 0m 7m) (TO-EDGE pond))", "2"),
    "OF": ("(OF (NEAREST_ID 3m) distance)", "UNKNOWN"),
    "SUM-OVER": ("(SUM-OVER (n 3m) (OF n distance))", "0"),
    "MEAN-OVER": ("(MEAN-OVER (n 3m) (OF n x))", "UNKNOWN"),
    "MIN-OVER": ("(MIN-OVER (n 3m) (OF n distance))", "UNKNOWN"),
    "MAX-OVER": ("(MAX-OVER (n 3m) (OF n distance))", "UNKNOWN"),
    "COUNT-OVER": ("(COUNT-OVER (n 3m) (> (OF n distance) 1m))", "0"),
    "BEST-OVER": ("(BEST-OVER (n 3m) (OF n distance))", "UNKNOWN"),
    "FOR-NEIGHBOURS": ("(LET ((near 0)) (FOR-NEIGHBOURS (n 3m) (SETQ near (+ near 1))) near)", "0"),
    "BEST": ("(BEST 4 (DIST 0 0 3 4) (IN crew) (MARK))", "0"),
    "QUORUM": ("(QUORUM 5 8 (IN crew) (MARK))", "0"),
    "AFTER-ISSUE": ("(AFTER-ISSUE 3s (MARK))", "UNKNOWN"),
    "CANCEL": ("(CANCEL)", "0"),
    "DEFUN": ("(PROGN (DEFUN half (a) (/ a 2)) (half 10))", "5"),
    "JOIN": ("(PROGN (JOIN bravo) (IN bravo))", "1"),
    "LEAVE": ("(PROGN (JOIN bravo) (LEAVE bravo) (IN bravo))", "0"),
    "IN": ("(IN charlie)", "0"),
    "PROB": ("(PROB 100%)", "1"),
    "DICE": ("(DICE (100% 6))", "6"),
    "RANDOM": ("(< (RANDOM 1 6) 7)", "1"),
    "GAUSS": ("(GAUSS 5 0)", "5"),
    "SLEEP": ("(SLEEP)", "1"),
    "WAKE": ("(WAKE)", "1"),
    "FREEZE": ("(FREEZE)", "1"),
    "THAW": ("(THAW)", "1"),
    "MARK": ("(PROGN (MARK) marked)", "1"),
    "UNMARK": ("(PROGN (UNMARK) marked)", "0"),
    "ROLLBACK": ("(WHEN (> 1 2) (ROLLBACK))", "0"),
    "REPORT": ('(REPORT "sum" (+ 1 2))', "3"),
    "PRINT": ('(PRINT "id" id)', "0"),
    "TELL": ("(TELL (WHEN (IN bravo) (MARK)))", "1"),
    "PING": ("(PING)", "1"),
}
"""The expression and its value, by the name of the function."""
