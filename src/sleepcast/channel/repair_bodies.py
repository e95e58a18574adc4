"""The bodies of digests and requests, as the wire has them.

have     a digest's list of streams, each with the number of its latest standing command
bases    whether its sender knows standing commands that say which of those before them still count
most     how many of the next ones the digest's sender takes at once; without it `BATCH` of each stream
want     a request's list of streams, each with the numbers of missing commands
parts    a request's list of commands of which some parts have come, each with the numbers of the others
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeVar

from sleepcast.channel.envelope import MAX_PARTS
from sleepcast.channel.sequencer import MAX_STREAMS, StreamId

MAX_ASKED = 24
"""Commands in one request of which parts are resent."""

Value = TypeVar("Value")


def streams_in(body: dict[str, object], what: str, kind: type[Value]) -> list[tuple[StreamId, Value]]:
    """The streams with their values in the body of a digest or request; malformed entries are left out."""
    streams = []
    listed = body.get(what)
    for each in listed[:MAX_STREAMS] if isinstance(listed, list) else ():
        match each:
            case [bytes() as key, int() as epoch, value] if isinstance(value, kind):
                streams.append(((key, epoch), value))
    return streams


def wanted_parts(body: dict[str, object]) -> list[tuple[StreamId, int, list[int]]]:
    """The wanted parts of commands in the body of a request; malformed entries are left out."""
    wanted = []
    listed = body.get("parts")
    for each in listed[:MAX_ASKED] if isinstance(listed, list) else ():
        match each:
            case [bytes() as key, int() as epoch, int() as number, list() as parts]:
                numbers = [part for part in parts[:MAX_PARTS] if isinstance(part, int)]
                wanted += [((key, epoch), number, numbers)] if numbers else []
    return wanted


def request(missing: Iterable[tuple[StreamId, int, Sequence[int]]]) -> dict[str, object]:
    """The body of a request for these commands, or for the named parts of them."""
    whole: dict[StreamId, list[int]] = {}
    some: list[object] = []
    for name, number, parts in missing:
        if parts:
            some.append([*name, number, [*parts]])
        else:
            whole.setdefault(name, []).append(number)
    want: list[object] = [[*name, numbers] for name, numbers in whole.items()]
    return {what: listed for what, listed in (("want", want), ("parts", some)) if listed}
