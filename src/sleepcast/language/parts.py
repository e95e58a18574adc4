"""Parts: a checked expression, every name turned into the place where it lives.

The checker makes one tree of `Part`s from a form; the machine walks it, the compiler writes Python from it, the
explainer shows it. What a part means is said by its `op`:

    const       number                    var        slot of the robot's values
    local       number of a local name    linked     slot, read from the host's own memory
    absent      a name nobody declared    pure       a pure built-in function
    and or known if cond progn let dotimes           the special forms (`cond` holds `clause` parts: test, then body)
    set_user    slot                      set_local  number of a local name
    write       SETQ of anything else     defvar     slot
    store       an expression into a buffer or rule; the form is data, at most one part (a value to store) is evaluated
    fetch       a buffer or rule, evaluated deeply   call      an operator made by DEFUN
    host        a function of the robot              missing   a function that this robot does not have
    in          group membership          prob dice random gauss
    over        a number from all neighbours, named by `name`: the arguments that say which, then a `clause`, evaluated
                for each, whose id is the local name `slot`; number: of neighbours at most
    each        FOR-NEIGHBOURS, likewise
    auction     BEST or QUORUM, by `name`: the cost, if there is one, and the command; who obeys is decided among robots
    timed       AFTER-ISSUE: the command, which is evaluated at an instant that the message's time of issue decides
    act         everything else that changes the robot's mind or speaks, named by `name`
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from zlib import crc32

from sleepcast.core.model import HostFunction, NeighbourSensor
from sleepcast.core.records import NamedTuple
from sleepcast.language.acts import ACTS
from sleepcast.language.functions import MAX_PRIORITY, PRIORITY, Function
from sleepcast.language.reader import Form, List, Number, Symbol, format_literal, replaced, show
from sleepcast.language.reader import walk as walk_forms
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, Variable

ACTING = frozenset({"set_user", "write", "defvar", "store", "act"})
ASKING = frozenset({"host", "over", "each"})
"""Parts that ask the robot's own software."""
PRIORITIES = range(-MAX_PRIORITY, MAX_PRIORITY + 1)
ONLY_PRIORITY = f"what follows it can only be {PRIORITY} and a whole number from -{MAX_PRIORITY} to {MAX_PRIORITY}"
CHANCY = frozenset({"prob", "dice", "random", "gauss"})


class Part:
    """One node of a checked expression.

    parts: the parts that are evaluated, in order.
    number: a constant's value, or a count.
    slot: in the values, or the number of a local name; of `host` that of the sensor that it reads, -1 for none.
    name: the key of what is named.
    data: what else the op needs, see `checker`.
    watch: for the top-level test of a program, how many leading parts are the test (`and`), or 1 (`if`, `clause`).
    index: the part's own number in its program, outside first, left to right.
    plain, steady, pairwise: what the machine for many robots has found out about it, None before: see there.
    """

    __slots__ = (
        *("data", "form", "index", "name", "number", "op", "parts", "slot", "watch"),
        *("pairwise", "plain", "steady"),
    )

    def __init__(
        self,
        op: str,
        form: Form,
        parts: tuple[Part, ...] = (),
        *,
        number: float = 0.0,
        slot: int = 0,
        name: str = "",
        data: Data = None,
    ) -> None:
        self.op, self.form, self.parts, self.number, self.slot = op, form, parts, number, slot
        self.name, self.data, self.watch, self.index = name, data, 0, 0
        self.plain: bool | None = None
        self.steady: bool | None = None
        self.pairwise: bool | None = None

    @property
    def function(self) -> Function:
        """The built-in of a `pure` part."""
        if not isinstance(self.data, Function):
            raise TypeError(f"a part of op {self.op} has no built-in function")
        return self.data


class Storing:
    """What a `store` part stores: `form` under `key`, or the number it evaluates to if `value`; a rule is activated.
    rank: what RULE gave as `:priority`."""

    __slots__ = ("activate", "form", "key", "rank", "value")

    def __init__(self, key: str, form: Form, *, activate: bool, value: bool = False, rank: int = 0) -> None:
        self.key, self.form, self.activate, self.value, self.rank = key, form, activate, value, rank


class Defining:
    """What DEFUN defines: parameters as written, and the body."""

    __slots__ = ("body", "parameters")

    def __init__(self, parameters: tuple[str, ...], body: tuple[Form, ...]) -> None:
        self.parameters, self.body = parameters, body


class Auction(NamedTuple):
    """What BEST or QUORUM asks for: the two expressions that its robots evaluate, and how many may obey.

    least, most: robots. bid: `(WHEN test cost)`, where a QUORUM costs 0; command: `(WHEN test command)`. window: s for
    which bids are collected; lease: s for which a robot is a member without hearing anything. joins, rules: the keys of
    the groups that the command joins, and of the rules that it makes, each with its text: a member's end with its
    lease.
    """

    name: str
    least: int
    most: int
    bid: str
    command: str
    window: float
    lease: float
    joins: tuple[str, ...]
    rules: tuple[tuple[str, str], ...]


class Template:
    """What TELL tells: a form whose unquoted places (by their order) are filled with the values of the parts. hops: how
    far it may go, from robot to robot. auction: what it asks for if it is a BEST or QUORUM."""

    __slots__ = ("_pieces", "auction", "form", "hops", "number", "unquoted")

    def __init__(self, form: Form, unquoted: tuple[Form, ...], hops: int = 1, auction: Auction | None = None) -> None:
        self.form, self.unquoted, self.hops, self.auction = form, unquoted, hops, auction
        self.number = 0 if auction is None else crc32(show(form).encode())
        """The same for all that is written alike."""
        self._pieces: list[str] = []

    def text(self, values: Iterable[float]) -> str:
        """What is told with these values, each a known number, in the unquoted places."""
        if not self._pieces:
            form = replaced(self.form, lambda: _PLACE) if self.unquoted else self.form
            self._pieces = show(form).split(_PLACE.text)
        first, *rest = self._pieces
        return first + "".join(format_literal(value) + piece for value, piece in zip(values, rest, strict=True))


_PLACE = Symbol("\0")
"""What stands for a value in a template's text: no text that can be read holds it."""


class Timed(NamedTuple):
    """What AFTER-ISSUE asks for. wait: s from the issue of its message; command: the text that is evaluated then."""

    wait: float
    command: str


class Label:
    """The text that goes with REPORT, PRINT or a labelled host function."""

    __slots__ = ("function", "text")

    def __init__(self, text: str, function: HostFunction | None = None) -> None:
        self.text, self.function = text, function


Data = Function | HostFunction | Variable | Storing | Defining | Template | Auction | Timed | Label | None


def walk(part: Part) -> list[Part]:
    """`part` and every part inside it, outside first, left to right."""
    parts = [part]
    for inside in part.parts:
        parts.extend(walk(inside))
    return parts


def acts(part: Part) -> bool:
    """Whether evaluating `part` can change the robot or speak; what a buffer or an operator does is its own."""
    return any(map(is_acting, walk(part)))


def is_acting(part: Part) -> bool:
    """Whether `part` itself does something, whatever its parts do."""
    if part.op == "host":
        return host_of(part).acts
    return part.op in ACTING


def rules(part: Part) -> bool:
    """Whether evaluating `part` itself can change the robot's rules: which there are, or which of them run."""
    for inside in walk(part):
        if inside.op == "write" and ACTIVE0 < inside.slot < ACTIVE0 + BUFFERS:  # whether a buffer runs
            return True
        if inside.op == "store" or (inside.op == "act" and ACTS[inside.name].rules):
            return True
    return False


def rank_of(behind: Sequence[Form]) -> int | None:
    """The priority of a RULE by what stands behind its expression; None if that is no priority."""
    match behind:
        case []:
            return 0
        case [Symbol(key=key), Number(dimension=None, value=rank)] if key == PRIORITY and rank in PRIORITIES:
            return int(rank)
    return None


def ranked(form: Form) -> Form | None:
    """Where a RULE in `form` has a `:priority`, also one that is quoted or kept for later; None if none has."""
    lists = (each for each in walk_forms(form) if isinstance(each, List) and each.head == "rule")
    return next((each.items[3] for each in lists if len(each.items) > 3), None)


def auction_of(root: Part) -> Auction | None:
    """What a whole command asks for that chooses among robots; None for every other one."""
    inside = root.parts[0].parts if root.op == "cond" and root.parts else ()
    auction = inside[-1].data if inside and inside[-1].op == "auction" else None
    return auction if isinstance(auction, Auction) else None


def timed_of(root: Part) -> Timed | None:
    """What a whole command asks for that waits for an instant; None for every other one."""
    return root.data if isinstance(root.data, Timed) else None


def irreversible(part: Part) -> str:
    """The name of the first form inside `part` that is marked as one that cannot be undone, "" if there is none."""
    for inside in walk(part):
        if inside.op == "host" and host_of(inside).irreversible:
            return host_of(inside).name
        if inside.op == "act" and ACTS[inside.name].irreversible:
            return inside.name.upper()
    return ""


def deciding(part: Part) -> Part | None:
    """The first COND, IF, WHEN or AND of `part`, also inside its PROGNs and LETs."""
    if part.op in ("cond", "if", "and"):
        return part
    inside = part.parts[int(part.number) :] if part.op == "let" else part.parts if part.op in ("progn", "timed") else ()
    return next(filter(None, map(deciding, inside)), None)


def host_of(part: Part) -> HostFunction:
    """The robot's own function of a `host` part."""
    function = part.data.function if isinstance(part.data, Label) else part.data
    if not isinstance(function, HostFunction):
        raise TypeError(f"a part of op {part.op} has no host function")
    return function


def sensor_of(part: Part) -> tuple[HostFunction, NeighbourSensor]:
    """The robot's own function with which an `over` or `each` part finds its neighbours, and how that lists them."""
    function = part.data
    if not isinstance(function, HostFunction) or function.neighbours is None:
        raise TypeError(f"a part of op {part.op} goes through no neighbours")
    return function, function.neighbours


def label_of(part: Part) -> str:
    """The name or text that goes with `part`, as its `Label` says; "" if it has none."""
    return part.data.text if isinstance(part.data, Label) else ""


def written(part: Part) -> str:
    """The name that a declaring part declares, as written."""
    target = part.form.items[1] if isinstance(part.form, List) else part.form
    return target.text if isinstance(target, Symbol) else part.name
