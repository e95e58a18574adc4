"""Reading: what datagrams say, each worked out once, however many parties of this process hear it.

The same command comes several times, and reaches every robot of a swarm in one process: its layout, its signature and
its words are the same for all of them. What each makes of it - whether it knows the key, whether it is late or was
heard before - is a matter of its own door.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import NamedTuple

from sleepcast.channel.envelope import Part, Piece, look, read_message, read_piece
from sleepcast.channel.keys import PublicKey
from sleepcast.channel.message import Message

MAX_READ = 8_192
"""Datagrams of which it is remembered what they say: as many as may wait for one party, some ten megabytes."""


class Entered(NamedTuple):
    """A message that came in, and the bytes that it was: nobody but its sender could have made them."""

    message: Message
    datagrams: tuple[bytes, ...]


@dataclass(slots=True)
class Read:
    """What is known of a datagram. checked: the public half of the key with which its signature was compared, and
    whether it was good; piece, message: read only once it was."""

    part: Part
    checked: tuple[bytes, bool] = (b"", False)
    piece: Piece | None = None
    message: Message | None = None


class Reader:
    """See the module. Nothing that no signature vouches for is read further than `look` does."""

    def __init__(self) -> None:
        self._known: OrderedDict[bytes, Read] = OrderedDict()

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
