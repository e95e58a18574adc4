"""Reading: what datagrams say, each worked out once, however many parties of this process hear it.

The same command comes several times, and reaches every robot of a swarm in one process: its layout, its signature and
its words are the same for all of them. What each makes of it - whether it knows the key, whether it is late or was
heard before - is a matter of its own door.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import NamedTuple

import msgspec

from sleepcast.channel.envelope import Part, Piece, look, read_message, read_piece
from sleepcast.channel.keys import PublicKey, Trust
from sleepcast.channel.message import Kind, Message

MAX_READ = 8_192
"""Datagrams of which it is remembered what they say: as many as may wait for one party, some ten megabytes."""
NOBODYS = Message("nobody", 0, 0, Kind.HEARTBEAT, 0.0)


class Entered(NamedTuple):
    """A message that came in, and the bytes that it was: nobody but its sender could have made them."""

    message: Message
    datagrams: tuple[bytes, ...]


class Good(NamedTuple):
    """A datagram that is a whole message, and that a door has let in. trust, version, fleet, robot: of that door, for
    which alone this counts; sender: the stream of numbers
    to which it belongs."""

    trust: Trust
    version: int
    fleet: str
    robot: bool
    sender: tuple[bytes, str, int]
    entered: Entered


@dataclass(slots=True)
class Read:
    """What is known of a datagram. checked: the public half of the key with which its signature was compared, and
    whether it was good; piece, message: read only once it was; good: once it has entered somewhere."""

    part: Part
    checked: tuple[bytes, bool] = (b"", False)
    piece: Piece | None = None
    message: Message | None = None
    good: Good | None = None


class Reader:
    """See the module. Nothing that no signature vouches for is read further than `look` does."""

    def __init__(self) -> None:
        self._known: OrderedDict[bytes, Read] = OrderedDict()
        self._latest: tuple[tuple[Message, float, float] | None, Message] = None, NOBODYS
        """What was last asked of `in_time`, and the answer."""

    def look(self, datagram: bytes) -> Read:
        """What is known of a datagram, see `envelope.look`. Raises EnvelopeError."""
        found = self._known.get(datagram)
        if found is None:
            found = self._known[datagram] = Read(look(datagram))
            if len(self._known) > MAX_READ:
                self._known.popitem(last=False)
        return found

    def signed(self, key: PublicKey, read: Read) -> bool:
        """Whether the datagram bears this key's signature."""
        if read.checked[0] != key.public:
            read.checked = key.public, key.signed(read.part.signed, read.part.signature)
        return read.checked[1]

    def piece(self, read: Read) -> Piece:
        """See `envelope.read_piece`; for a datagram whose signature is good. Raises EnvelopeError."""
        if read.piece is None:
            read.piece = read_piece(read.part)
        return read.piece

    def message(self, read: Read, sender: str, content: bytes, role: str) -> Message:
        """The message whose last part to arrive is this datagram, see `envelope.read_message`. Raises EnvelopeError."""
        if read.part.parts > 1:  # what it says depends on the other parts as well
            return read_message(read.part, sender, content, role)
        if read.message is None or read.message.role != role:
            read.message = read_message(read.part, sender, content, role)
        return read.message

    def in_time(self, message: Message, zero: float, ahead: float) -> Message:
        """The message with its times as those of a mind, which began at `zero`, s of Unix time, and whose sender's
        clock is so many s ahead of ours: a deadline is of its sender's clock."""
        asked, found = self._latest
        if (message, zero, ahead) != asked:
            times = {"issued": message.issued - zero, "deadline": message.deadline + ahead - zero}
            found = msgspec.structs.replace(message, **times)
            self._latest = (message, zero, ahead), found
        return found
