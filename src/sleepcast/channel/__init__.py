"""The broadcast channel: lossy, shared by all parties, without a list of receivers.

Between processes, a datagram goes through `transports`, `envelope` (bytes), `admission` (verification), `reliable`
(order and repair, with `sequencer` and `repair_timer`) and `session`, in which a mind sends and receives messages. In
a simulated swarm, `simulated_radio` carries the messages themselves. Both give each party a `Channel`;
tests/channel_contract.py says what that promises.
"""

from __future__ import annotations

from typing import Protocol

from sleepcast.channel.message import TO_OPERATOR, Kind, Message, MessageError

__all__ = ["TO_OPERATOR", "Channel", "Kind", "Message", "MessageError"]


class Channel(Protocol):
    """One party's end of a channel. Neither method waits."""

    def send(self, message: Message) -> None:
        """Broadcast a message. The sender does not learn whether anybody receives it."""

    def receive(self) -> list[Message]:
        """The messages received since the last call, in order."""
