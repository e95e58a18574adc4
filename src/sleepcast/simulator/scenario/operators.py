"""Who may command the robots of a scenario, and what their minds hold against it.

    [operators.anna]
    role = "operator"

    [minds]
    lease = "1s"
    tells = "marks"

    [minds.locked]
    keep_off = "(WHEN (< x 5m) (DRIVE 0 0))"

Where operators are named, robots do what they do on the air: they go by roles and leases, merge the commands of several
operators, and come to rest when the one who drives them is not heard any more. Elsewhere whoever sends may do anything.
"""

from __future__ import annotations

from math import inf

from sleepcast.channel.message import Role, is_robot_name
from sleepcast.channel.message_batch import NameIndex
from sleepcast.core.records import dataclass
from sleepcast.core.settings import Table, checked_name
from sleepcast.core.units import TIME

MAX_OPERATORS = 16
"""Operators of one run: each has a desk, with its account of every command."""
MAX_LOCKED = 16
"""Rules that robots hold from the start: as many as somebody can still take in."""
ROLES = (Role.OPERATOR.value, Role.COMMANDER.value, Role.OBSERVER.value)
TELLS = ("all", "marks", "none")
LEASE, LEAST_LEASE, MAX_LEASE = 1.0, 0.2, 3_600.0
"""Seconds of the dead man's lease: as of nodes."""
OFF = "off"


@dataclass(frozen=True, slots=True)
class ScenarioOperator:
    """Somebody with a desk, by the name that robots know. role: one of `ROLES`."""

    name: str
    role: str


@dataclass(frozen=True, slots=True)
class LockedRule:
    """A rule that each robot holds from the start, and that nobody can change over the radio."""

    name: str
    text: str


@dataclass(frozen=True, slots=True)
class MindSettings:
    """What robots go by where operators are named.

    lease: s for which a driven robot goes on without hearing its operator, inf for ever
    tells: what others may have it do by TELL, as of a node (`--tells`)
    locked: see `LockedRule`
    tells_hatch: whether a TELL may have robots HATCH and DIE
    """

    lease: float = inf
    tells: str = TELLS[0]
    locked: tuple[LockedRule, ...] = ()
    tells_hatch: bool = False


NO_AUTHORITY = MindSettings()
"""Where no operators are named."""


def read_operators(root: Table) -> tuple[ScenarioOperator, ...]:
    """The tables `[operators.NAME]`, in the file's order."""
    operators = []
    for name, table in root.tables("operators", most=MAX_OPERATORS).items():
        if not is_robot_name(name):
            raise root.table("operators").error(name, "an operator's name is one word of at most 64 characters")
        with table:
            operators.append(ScenarioOperator(name, table.text("role", choices=ROLES)))
    return tuple(operators)


def read_minds(root: Table, operators: tuple[ScenarioOperator, ...]) -> MindSettings:
    """The table `[minds]`. Raises SettingsError for what is about operators where none are named: it would mean
    nothing."""
    with root.table("minds") as table:
        tells_hatch = table.flag("tells_hatch", False)
        if not operators:
            if table.values.keys() - {"tells_hatch"}:
                raise root.error("minds", "this is about who may command: name [operators] first")
            return MindSettings(tells_hatch=tells_hatch)
        lease = inf
        if not table.has("lease") or table.values["lease"] != OFF:
            lease = table.number("lease", TIME, LEASE, low=LEAST_LEASE, high=MAX_LEASE)
        tells = table.text("tells", TELLS[0], choices=TELLS)
        with table.table("locked") as rules:
            if len(rules.values) > MAX_LOCKED:
                raise table.error("locked", f"{len(rules.values)} of them; at most {MAX_LOCKED} fit")
            locked = [LockedRule(checked_name(rules, name), rules.text(name, most=16_384)) for name in rules.values]
    return MindSettings(lease, tells, tuple(locked), tells_hatch)


def refuse_robots(root: Table, operators: tuple[ScenarioOperator, ...], robots: NameIndex) -> None:
    """Raise SettingsError for an operator with the name of a robot: by its sender's name a message is known."""
    for operator in operators:
        if operator.name in robots:
            raise root.table("operators").error(operator.name, "a robot is called like this; choose another name")
