"""Who may tell this robot what: whether a message is for it, whether its sender's role goes so far, and whether
somebody else has the lease of a group that it is in.

Which key said what is a matter of the channel; a refusal here is an answer, so that its sender hears the reason.
"""

from __future__ import annotations

from math import inf

from sleepcast.channel.bodies import AGE
from sleepcast.channel.message import Kind, Message
from sleepcast.language.machine import Program
from sleepcast.language.parts import rules

COMMANDER = "commander"
"""The role that may change rules, as keys name it."""


class Authority:
    """One robot's. Times are s of its mind."""

    def __init__(self) -> None:
        self._stopped = -inf
        """When the latest STOP that was heard was issued."""

    def note_stop(self, message: Message) -> None:
        """A STOP has been heard."""
        self._stopped = max(self._stopped, message.issued)

    def may_release(self, message: Message) -> bool:
        """Whether a RELEASE was decided after the latest STOP: one that is sent again, or late, ends no later one."""
        age = message.body.get(AGE, 0.0)
        return message.issued - (age if isinstance(age, float | int) else inf) >= self._stopped

    def objection(self, message: Message, program: Program) -> str:
        """Why a command is not to be evaluated, "" if it may be."""
        if message.kind is not Kind.COMMAND or message.role in ("", COMMANDER):
            return ""
        if rules(program.root):
            return f"only a commander's key may change rules, and that of {message.sender} is of role {message.role}"
        return ""
