"""The broadcast channel: lossy, shared by everybody, without a list of receivers.

`message` says what travels; `memory` is the radio of a simulated swarm. Every transport gives each party a
`Channel`; tests/channel_contract.py says what that promises.
"""

from __future__ import annotations

from typing import Protocol

from sleepcast.channel.message import TO_OPERATOR, Kind, Message, MessageError

__all__ = ["TO_OPERATOR", "Channel", "Kind", "Message", "MessageError"]


class Channel(Protocol):
    """One party's end of a channel. Neither method waits."""

    def send(self, message: Message) -> None:
        """Broadcast; whether anybody hears it, the sender cannot know."""

    def receive(self) -> list[Message]:
        """What has come in since the last call, in the order in which it came."""
