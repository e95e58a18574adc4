"""Who may tell this robot what: whether its sender's role goes so far, and whether somebody else has the lease of a
group that it is in.

Which key said what is a matter of the channel; a refusal here is an answer, so that its sender hears the reason. What
a robot's own host says to it, and what is typed at it, comes without a role and is not refused.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from math import inf, isfinite

from sleepcast.channel.bodies import LEASE, age_of
from sleepcast.channel.message import Kind, Message
from sleepcast.channel.roles import Role
from sleepcast.language.machine import Program
from sleepcast.language.parts import label_of, rules, walk
from sleepcast.node.leases import Leases, Wish

MAX_SKEW = 2.0
"""Seconds by which somebody's clock may be wrong, as the channel has it."""
OPERATORS = frozenset({Role.OPERATOR.value, Role.COMMANDER.value})


class Authority:
    """One robot's. Times are s of its mind."""

    def __init__(self) -> None:
        self.leases = Leases()
        self._stopped = self._released = -inf
        """When the latest STOP, and the latest RELEASE, that was obeyed was decided."""

    def may_stop(self, message: Message) -> bool:
        """Whether to obey a STOP: always, but for one that is sent again for others and was decided so long before the
        latest RELEASE that no clocks can be wrong by as much."""
        if age_of(message.body) in (0.0, inf) or _decided(message) > self._released - 2.0 * MAX_SKEW:
            self._stopped = max(self._stopped, message.issued)
            return True
        return False

    def may_release(self, message: Message, now: float) -> bool:
        """Whether to obey a RELEASE: it was decided after the latest STOP, also where it is sent again, or late."""
        if _decided(message) < self._stopped:
            return False
        self._released = max(self._released, min(_decided(message), now))
        return True

    def lease(self, message: Message, now: float) -> tuple[str, str]:
        """Do what a message asks for with the lease of a group: the group's key, and why it is refused, if it is."""
        wish = Wish.of(message.body[LEASE])
        if wish is None:
            return "", "a lease that says nothing which can be meant"
        return wish.group.casefold(), self.leases.settle(wish, message, now)

    def objection(self, message: Message, program: Program, groups: Collection[str], now: float) -> str:
        """Why a command is not to be evaluated on a robot in these groups (their keys), "" if it may be."""
        if message.kind is not Kind.COMMAND or not message.role:
            return ""
        if message.role != Role.COMMANDER and rules(program.root):
            return f"only a commander's key may change rules, and that of {message.sender} is of role {message.role}"
        if message.standing or message.role not in OPERATORS:
            return ""  # what stands is the same on all robots, whoever may command them now
        return self.leases.objection(message.sender, {*groups, *_entered(program)}, now)

    def state(self, now: float) -> dict[str, object]:
        """What must outlive a restart, as plain data with times as seconds from `now`."""
        stopped = now - self._stopped
        return {"stopped": stopped if isfinite(stopped) else None, "leases": self.leases.state(now)}

    def restore(self, state: Mapping[str, object], now: float) -> None:
        """Know what was kept. Raises TypeError and ValueError for what is nothing of the sort."""
        stopped, leases = state.get("stopped"), state.get("leases")
        if isinstance(stopped, float | int):
            self._stopped = now - stopped
        if isinstance(leases, Mapping):
            self.leases.restore(leases, now)


def _decided(message: Message) -> float:
    return message.issued - age_of(message.body)


def _entered(program: Program) -> set[str]:
    """The keys of the groups that a command has robots join or leave."""
    moving = (part for part in walk(program.root) if part.op == "act" and part.name in ("join", "leave"))
    return {label_of(part).casefold() for part in moving}
