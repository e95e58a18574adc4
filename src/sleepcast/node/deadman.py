"""The dead man's lease: who drives a robot by commands must be heard of all the time, or its body comes to rest.

A robot is *driven* from when a person's command that counts once has moved its body, until a rule of its own moves it,
or what stands, or nobody does any more. A robot on a mission of its own is not driven, and needs nobody.
"""

from __future__ import annotations

from math import inf

from sleepcast.channel.message import Kind, Message
from sleepcast.core.errors import MisuseError

LEASE = 1.0
"""Seconds, as the programs of the thesis have it (`conf_tm(1)`), unless another time is said."""
LEAST, MOST = 0.2, 3_600.0
"""Seconds: a heartbeat comes each third of the lease, and one lost must not end it; beyond an hour it is none."""
OFF = "off"
COMMANDING = frozenset({"operator", "commander"})
"""Roles of those whose word keeps a robot going."""


class DeadMan:
    """One robot's. lease: s, inf for none. Times are s of its mind."""

    def __init__(self, lease: float = inf) -> None:
        self.lease = lease
        self._heard, self._latest = False, -inf

    def hear(self, message: Message) -> None:
        """Something has come in, and is heard from now on. What stands may be old, and come from a neighbour."""
        self._heard |= message.role in COMMANDING and not message.standing

    def is_over(self, now: float) -> bool:
        """Whether nobody who may command has been heard for longer than the lease; to be asked at each tick."""
        if self._heard:
            self._heard, self._latest = False, now
        return now - self._latest > self.lease


def drives(message: Message) -> bool:
    """Whether a robot that this message has moved is driven by somebody."""
    return message.kind is Kind.COMMAND and message.role in COMMANDING and not message.standing


def read_lease(text: str) -> float:
    """A lease as a person says it: seconds (`1s`, `0.5`), or `off`. Raises MisuseError."""
    if text.strip().casefold() == OFF:
        return inf
    try:
        found = float(text.strip().removesuffix("s"))
    except ValueError:
        found = 0.0
    if not LEAST <= found <= MOST:
        raise MisuseError(f"a lease of {text!r:.40}: wanted {LEAST:g}s to {MOST:g}s, or {OFF}")
    return found
