"""Baselines: standing commands that say which of those before them in their stream still count (`Stream.rebase`).

A newcomer needs the rules that stand, not every command that ever made one. Only the sender may say so, for his own
stream, since a commander's key could make and forget all of it anyway. A party of 0.2.0 knows nothing of this, and gets
all commands as before.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from heapq import merge

from sleepcast.channel.envelope import look, read_message, read_piece
from sleepcast.channel.message import ONLY, Message
from sleepcast.channel.sequencer import MessageStore, Stream

MAX_ONLY = 4_096
"""Numbers of commands that still count in one standing command: some fifteen kilobytes."""


def rebase(stream: Stream, message: Message, store: MessageStore) -> None:
    """Take what a verified standing command says of those before it; a malformed list says nothing."""
    only = message.body.get(ONLY)
    if not message.standing or not isinstance(only, list) or len(only) > MAX_ONLY:
        return
    numbers = [number for number in only if type(number) is int and 0 < number < message.sequence]
    if numbers == only == sorted(set(numbers)):
        stream.rebase(message.sequence, numbers)
        store.rebase(stream)


def is_base(datagrams: Sequence[bytes]) -> bool:
    """Whether a standing command may say which still count; cheap, since there may be thousands of commands."""
    whole = datagrams if len(datagrams) == 1 else [b"".join(read_piece(look(each)).content for each in datagrams)]
    return ONLY.encode() in whole[0]


def message_of(datagrams: Sequence[bytes]) -> Message:
    """The message of datagrams that were verified before."""
    parts = [look(datagram) for datagram in datagrams]
    pieces = [read_piece(part) for part in parts]
    return read_message(parts[-1], pieces[0].sender, b"".join(piece.content for piece in pieces))


def missing_of(stream: Stream, they: int, knows_bases: bool) -> list[int]:
    """The standing commands of a stream that a party misses that has them up to `they`: what says which of them count
    comes first. A party that does not know of that gets all, as it waits for each."""
    if not knows_bases:
        return [number for number in merge(stream.standing, stream.over) if number > they]
    missing = stream.standing[bisect_right(stream.standing, they) :]
    if stream.base in missing:
        missing.remove(stream.base)
        missing.insert(0, stream.base)
    return missing
