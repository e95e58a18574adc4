"""Who may tell this robot what: whether its sender's role goes so far, and whether somebody else has the lease of a
group that it is in.

Which key said what is a matter of the channel; a refusal here is an answer, so that its sender hears the reason. What
a robot's own host says to it, and what is typed at it, comes without a role and is not refused.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from sleepcast.channel.message import Kind, Message, Role
from sleepcast.channel.payload import LEASE
from sleepcast.channel.stop_latch import Latch, Life, mark_of, restored
from sleepcast.language.parts import label_of, rules, walk
from sleepcast.language.program import Program
from sleepcast.mind.lease import LeaseRequest, Leases

OPERATORS = frozenset({Role.OPERATOR.value, Role.COMMANDER.value})


class Authority:
    """One robot's. Times are s of its mind."""

    def __init__(self) -> None:
        self.leases = Leases()
        self.latch = Latch()
        self._since: dict[Life, float] = {}
        """When the latest STOP of each sender that holds came."""

    def may_stop(self, message: Message, now: float) -> bool:
        """Whether to obey a STOP: always, but for one that a RELEASE has ended."""
        found = self.latch.stop(message)
        if found is None:
            return False
        if found.holding != self.latch.holding:
            since = {**self._since, mark_of(message).life: now if message.heard is None else message.heard}
            self._since = {mark.life: since.get(mark.life, now) for mark in found.holding}
        self.latch = found
        return True

    def may_release(self, message: Message) -> bool:
        """Whether to obey a RELEASE: no STOP holds that it does not end."""
        found = self.latch.release(message)
        self.latch = found or self.latch
        return found is not None and not found.holding

    def stops(self, now: float) -> list[list[object]]:
        """The STOPs that hold, each with the seconds since it came; after a restart, those since then."""
        return [[*mark, max(0.0, now - self._since.get(mark.life, 0.0))] for mark in self.latch.holding]

    def lease(self, message: Message, now: float) -> tuple[str, str]:
        """Do what a message asks for with the lease of a group: the group's key, and why it is refused, if it is."""
        wish = LeaseRequest.of(message.body[LEASE])
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
        return {**self.latch._asdict(), "leases": self.leases.state(now)}

    def restore(self, state: Mapping[str, object], now: float) -> None:
        """Know what was kept. Raises TypeError and ValueError for what is nothing of the sort."""
        self.latch = restored(state)
        leases = state.get("leases")
        if isinstance(leases, Mapping):
            self.leases.restore(leases, now)


def _entered(program: Program) -> set[str]:
    """The keys of the groups that a command has robots join or leave."""
    moving = (part for part in walk(program.root) if part.op == "act" and part.name in ("join", "leave"))
    return {label_of(part).casefold() for part in moving}
