"""Refusals: the sentences that say why a mind does not do what an expression asks for. A refusal changes nothing."""

from __future__ import annotations

from sleepcast.core.model import HostFunction
from sleepcast.language.reader import MAX_TEXT
from sleepcast.language.vocabulary import Variable, VariableKind

UNKNOWN_STORED = "unknown cannot be stored as an expression"
UNKNOWN_LEASE = "a lease of unknown length"
UNKNOWN_TOLD = "an unknown cannot be told"
UNKNOWN_CASTE = "a ping of unknown caste"


def built_in(name: str) -> str:
    """A rule or buffer, or the flag of one, that belongs to the robot itself."""
    return f"{name} is built in: it cannot be changed over the air"


def too_late(name: str) -> str:
    """What an earlier command wants to change."""
    return f"{name} was changed by a command that was sent later"


def no_room(what: str, most: int) -> str:
    return f"no room for another {what}: there are {most}"


def no_rule(key: str) -> str:
    return f"no rule {key}"


def no_variable(name: str) -> str:
    return f"no variable {name}: make it first with (DEFVAR {name})"


def no_operator(name: str, arguments: int) -> str:
    return f"no operator {name} of {arguments} arguments"


def unknown_assigned(variable: Variable) -> str:
    never = "never reaches an actuator" if variable.kind is VariableKind.ACTUATOR else "cannot be assigned to a flag"
    return f"unknown {never} ({variable.name})"


def unknown_asked(function: HostFunction) -> str:
    return f"unknown never reaches the body ({function.name})"


def stopped(function: HostFunction) -> str:
    return f"the robot is stopped: {function.name} waits for RELEASE"


def failed(function: HostFunction, error: Exception) -> str:
    return f"{function.name} failed: {type(error).__name__}: {error}"


def too_long(text: str) -> str:
    return f"a text of {len(text)} characters cannot be sent by TELL: at most {MAX_TEXT} fit"
