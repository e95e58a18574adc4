"""What digests and requests say, in the bodies of their messages, and how it is read of those that may say anything.

have     a digest's list of streams, each with the number of its latest standing command
want     a request's list of streams, each with the numbers of commands that are missing
parts    a request's list of commands of which some parts have come, each with the numbers of the others
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeVar

from sleepcast.channel.delivery_state import StreamId
from sleepcast.channel.envelope import MAX_PARTS
from sleepcast.channel.sequencer import MAX_STREAMS

MAX_ASKED = 24
"""Commands of which parts are looked at in one request."""

Value = TypeVar("Value")


def streams_in(body: dict[str, object], what: str, kind: type[Value]) -> list[tuple[StreamId, Value]]:
    """Streams, each with a value, as digests and requests have them; what is no such thing is left out."""
    found = []
    listed = body.get(what)
    for each in listed[:MAX_STREAMS] if isinstance(listed, list) else ():
        match each:
            case [bytes() as key, int() as epoch, value] if isinstance(value, kind):
                found.append(((key, epoch), value))
    return found


def wanted_parts(body: dict[str, object]) -> list[tuple[StreamId, int, list[int]]]:
    """Parts that are wanted of commands; what is no such thing is left out."""
    found = []
    listed = body.get("parts")
    for each in listed[:MAX_ASKED] if isinstance(listed, list) else ():
        match each:
            case [bytes() as key, int() as epoch, int() as number, list() as said]:
                numbers = [part for part in said[:MAX_PARTS] if isinstance(part, int)]
                found += [((key, epoch), number, numbers)] if numbers else []
    return found


def request(missing: Iterable[tuple[StreamId, int, Sequence[int]]]) -> dict[str, object]:
    """A body that asks for these commands, or for those of their parts that are named."""
    whole: dict[StreamId, list[int]] = {}
    some: list[object] = []
    for name, number, parts in missing:
        if parts:
            some.append([*name, number, [*parts]])
        else:
            whole.setdefault(name, []).append(number)
    want: list[object] = [[*name, numbers] for name, numbers in whole.items()]
    return {what: listed for what, listed in (("want", want), ("parts", some)) if listed}
