"""Whose orders count on each robot of a fleet, and who drives it: what `mind.authority` decides for one robot, for many
at once. Robots that have equal leases or equal drivers share one value.

Nothing here takes memory or time before the first message of a role, a lease, or a doubt.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sleepcast.channel.message import Message
from sleepcast.columns.values import Index, Rows, Shared
from sleepcast.fleet.state import FleetState
from sleepcast.language.program import Program
from sleepcast.mind.authority import (
    Driving,
    Leases,
    Tells,
    bars_population,
    driver_of,
    entered,
    hatches,
    is_sign,
    minds_leases,
    objection,
)


class FleetAuthority:
    """See the module.

    tells: what others may have these robots do by TELL
    lease: the dead man's, s, inf for none
    doubts: why robots are stopped although no STOP may have come, "" otherwise
    catching_up: see `Node.catch_up`
    """

    def __init__(self, state: FleetState, *, tells: Tells, lease: float) -> None:
        self.tells, self.lease = tells, lease
        self.tells_hatch = False
        """Whether a TELL may have robots come and go."""
        self._state = state
        self._everybody = Rows.run(0, state.count)
        self.leases = Shared(state.count, Leases(), lambda leases: leases.held)
        self.driving = Shared(state.count, Driving())
        self.doubts = Shared(state.count, "")
        self.catching_up = Shared(state.count, False)

    def turn_over(self, parents: Index, children: Index, dead: Index) -> None:
        """Children are under the leases, doubts and drivers of their parents, the dead under none."""
        for shared in (self.leases, self.driving, self.doubts, self.catching_up):
            shared.copy(parents, children)
        gone = Rows.of(dead)
        self.leases.set(gone, Leases())
        self.driving.set(gone, Driving())
        self.doubts.set(gone, "")
        self.catching_up.set(gone, False)

    # ---- who commands

    def objections(self, message: Message, program: Program, rows: Rows, now: float) -> list[tuple[str, Rows]]:
        """Why a command is not to be evaluated on these robots, each reason with its robots; "" with those on which it
        may be."""
        refusal = objection(message, program, self.tells)
        if not refusal and hatches(program):
            refusal = bars_population(message, self.tells_hatch)
        if refusal or not minds_leases(message):
            return [(refusal, rows)]
        touched = entered(program)  # groups that robots enter or leave by it
        reasons: list[tuple[str, Rows]] = []
        for leases, some, _ in self.leases.divide(rows):
            for group, why in leases.closed(message.sender, now):
                members = some if group in touched else self._members(group, some)
                if members.size:
                    reasons.append((why, members))
                    some = some.without(members)
            if some.size:
                reasons.append(("", some))
        return reasons

    def settle(self, message: Message, rows: Rows, now: float) -> Iterator[tuple[str, str, Rows]]:
        """Carry out a message's request about the lease of a group; gives what it comes to: outcome, fault, robots."""
        for leases, some, _ in self.leases.divide(rows):
            changed, group, refusal = leases.after(message, now)
            self.leases.set(some, changed)
            if refusal:
                yield "fault", refusal, some
                continue
            members = self._members(group, some)
            yield "matched", "", members
            yield "not matched", "", some.without(members)

    def _members(self, group: str, rows: Rows) -> Rows:
        members = self._state.groups.get(group)
        return rows.none() if members is None else rows.take(members[rows.index])

    # ---- who drives

    @property
    def idle(self) -> bool:
        """Whether nobody drives any robot, none catches up, and no sign of an operator has come since the last tick."""
        driving, behind = self.driving.common, self.catching_up.common
        return driving is not None and not driving.driver and not driving.heard and behind is False

    def hear(self, message: Message, rows: Rows) -> None:
        """Note a message that counts as a sign of the operator."""
        if is_sign(message):
            self.driving.change(rows, lambda driving: driving.hear(message))

    def unattended(self, rows: Rows, now: float) -> Rows:
        """The driven robots whose operator was not heard for longer than the lease, now that a tick begins."""
        self.driving.change(rows, lambda driving: driving.ticked(now))
        return self.driving.where(rows, lambda driving: driving.is_over(now, self.lease))

    def moves(self, message: Message) -> bool:
        """Whether it matters whose bodies this message moves."""
        return bool(driver_of(message)) or len(self.driving.values) > 1 or self.driving.values[0] != Driving()

    def moved(self, message: Message, rows: Rows, now: float) -> None:
        """This message has moved the bodies of these robots."""
        self.driving.change(rows, lambda driving: driving.move(message, now))

    def let_go(self, rows: Rows) -> None:
        """Nobody drives these any more."""
        self.driving.change(rows, Driving.let_go)

    def driven(self, rows: Rows | None = None) -> Rows:
        """Those of the robots (None: of all) that somebody drives."""
        return self.driving.where(self._everybody if rows is None else rows, lambda driving: bool(driving.driver))

    def walked(self, rows: Rows) -> Rows:
        """Those of the robots whose rules are evaluated one by one: it matters whether they move a driven body, and
        which of them may run."""
        driven, behind = self.driven(rows), self.behind(rows)
        return driven if behind.size == 0 else Rows.of(np.union1d(driven.robots, behind.robots))

    def behind(self, rows: Rows) -> Rows:
        """Those of the robots that catch up."""
        return self.catching_up.where(rows, bool)

    def drivers(self, rows: Rows) -> list[tuple[str, Rows]]:
        """The operators who drive these robots, "" for none, each with the robots."""
        driven: dict[str, list[Rows]] = {}
        for driving, some, _ in self.driving.divide(rows):
            driven.setdefault(driving.driver, []).append(some)
        return [(driver, Rows.together(some)) for driver, some in driven.items()]
