"""What a feature of the page consists of: what a page may ask, what the desk answers, and what must be there for that.

A feature is a module in `features/`. Each of its questions is a class; a function under `@answers` answers it, and the
function's own annotations say the rest: the first parameter's is a protocol of what a source (a simulated swarm, a
recording, robots on the air, Nomads, or the open page itself) must have, the second's the question.

    @answers(then=run_again)
    def glance(source: WithValues, asked: Glance) -> FleetGlance: ...

A source in which anything of the protocol is missing, or None, does not support the question. Then `registry` refuses
it, in one place and with one sentence.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable
from contextvars import ContextVar
from typing import Any, Generic, Protocol, TypeAlias, TypeVar, get_type_hints

import msgspec

from sleepcast.console.incoming import AT_ONCE, PageMessage
from sleepcast.console.marks import clock_time
from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass

Answer: TypeAlias = msgspec.Struct | msgspec.Raw | None
Reply: TypeAlias = Answer | Awaitable[Answer]
Function = TypeVar("Function", bound=Callable[..., Reply])

NOT_HERE_AT_ALL = "This is not supported for these robots."
NO_ROBOTS = "This is a recording: it has no robots that could receive a command."


class Then(Protocol):
    """Another time than now, at which a page looks. time: s of the run."""

    time: float

    @property
    def tick(self) -> int: ...

    def again(self, asked: PageMessage) -> Awaitable[msgspec.Raw]:
        """What the desk would have answered then. Raises SleepcastError."""


@dataclass(frozen=True, slots=True)
class Handler:
    """How one question is answered.

    asked: its class
    needs: what a source must have
    answer: answers it
    then: answers for another time than now; None, or what gives None, for what is a matter of now
    lacking: what is said where a source has not what it takes; "" for what the source itself says then
    recording: the same where that is a recording
    package: that adds it, "" for sleepcast itself
    """

    asked: type[PageMessage]
    needs: frozenset[str]
    answer: Callable[[Any, Any], Reply]
    then: Callable[[Any, Any, Then], Reply] | None
    lacking: str
    recording: str
    package: str = ""


HANDLERS: dict[type[PageMessage], Handler] = {}
"""All questions that may be asked; `registry` imports every one."""
APART: ContextVar[dict[type[PageMessage], Handler] | None] = ContextVar("apart", default=None)
"""Where questions are put instead whose modules are imported now: those of a package that may still turn out to be
wrong, or come too late."""


def refuse_twice(tag: object, module: str, others: Iterable[type[PageMessage]]) -> None:
    """Raises MisuseError for a tag that another question has. module: whose question has it."""
    for other in others:
        if tag == other.__struct_config__.tag:
            raise MisuseError(f'the tag "{tag}" is that of two questions, of {other.__module__} and of {module}')


def answers(
    *, then: Callable[[Any, Any, Then], Reply] | None = None, lacking: str = "", recording: str = ""
) -> Callable[[Function], Function]:
    """Let the function below answer a question; see the module, and for the rest `Handler`."""

    def register(function: Function) -> Function:
        source, asked, *_ = get_type_hints(function).values()
        apart = APART.get()
        handlers = HANDLERS if apart is None else apart
        refuse_twice(asked.__struct_config__.tag, function.__module__, (*AT_ONCE, *HANDLERS, *handlers))
        handlers[asked] = Handler(asked, members_of(source), function, then, lacking, recording)
        return function

    return register


BEGINNINGS: list[tuple[frozenset[str], Callable[[Any], None]]] = []
"""What begins with a desk, each with what the desk must have for it."""


def begins(function: Callable[[Any], None]) -> Callable[[Any], None]:
    """Let the function below begin something with every desk that has what its parameter's protocol wants."""
    BEGINNINGS.append((members_of(next(iter(get_type_hints(function).values()))), function))
    return function


def has(source: object, needs: frozenset[str]) -> bool:
    """Whether a source has all of this."""
    return all(getattr(source, name, None) is not None for name in needs)


def members_of(protocol: type) -> frozenset[str]:
    """The names that a protocol wants."""
    own = [base for base in protocol.__mro__ if base not in (object, Protocol, Generic)]
    names = {name for base in own for name in (*vars(base).get("__annotations__", ()), *vars(base))}
    return frozenset(name for name in names if not name.startswith("_"))


# ---- at another time than now


def run_again(source: object, asked: PageMessage, then: Then) -> Awaitable[msgspec.Raw]:
    """It is found by running again up to that time."""
    return then.again(asked)


def only_now(source: object, asked: PageMessage, then: Then) -> Answer:
    """Refused: it changes the run."""
    raise MisuseError(
        f"This page looks at {clock_time(then.time)}, and commands act on the live run. "
        "Go back to live (F8), then do it."
    )
