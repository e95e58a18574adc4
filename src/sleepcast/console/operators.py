"""Who commands: this desk's own role, the other operators that are heard, leases of groups, and sending in stages.

Only robots know who holds a lease; the desk shows what it asked for and what they said, and what other operators were
heard to do.
"""

from __future__ import annotations

import msgspec

from sleepcast.channel import Kind, Message
from sleepcast.channel.message import LeaseAction, Role
from sleepcast.console.outgoing import DeskMessage
from sleepcast.core.errors import MisuseError, SleepcastError, printable
from sleepcast.core.records import dataclass
from sleepcast.station import Command
from sleepcast.station.leases import describe_request, doubt_of, lease_body
from sleepcast.station.network import NetworkStation
from sleepcast.station.prepared import Prepared
from sleepcast.station.staging import StagedSending

GRACE = 1.0
"""Seconds after the time for answers for which those to a stage are still taken."""
RENEWALS = 3.0
"""A lease that is kept is renewed so often within its time, so that losing one message does not end it."""
MAX_ACTIONS = 20
"""Things that other operators did, which a page shows."""
LONGEST = 120
"""Characters of a command of theirs that are shown."""


class ShownOperator(msgspec.Struct, frozen=True):
    """Another operator, by name. role: of the key that we trust, "" if there is none. at: when last heard, s of the
    page's time, None if never."""

    name: str
    role: str
    at: float | None = None


class ShownLease(msgspec.Struct, frozen=True):
    """A lease that this desk asked for.

    until: s of the page's time
    agreed: robots that answered and did not refuse
    refused: a reason that a robot gave, or ""
    """

    group: str
    until: float
    agreed: int
    refused: str = ""


class ShownAction(msgspec.Struct, frozen=True):
    """What another operator did, at: s of the page's time."""

    at: float
    text: str


class Operators(DeskMessage):
    """Who commands.

    may: what this desk's role allows, in words
    staging: how far a staged sending has come, "" if there was none
    active: whether it goes on
    """

    name: str
    role: str
    may: str
    others: list[ShownOperator]
    leases: list[ShownLease]
    actions: list[ShownAction] = msgspec.field(name="deeds")
    staging: str = ""
    active: bool = False


MAY = {
    Role.OBSERVER: "may ask and STOP",
    Role.OPERATOR: "may command, ask and STOP",
    Role.COMMANDER: "may command, change rules, take leases by force, ask and STOP",
    Role.ROBOT: "speaks as a robot",
}


@dataclass(slots=True)
class _Lease:
    """A lease of ours.

    seconds: for which it was asked
    sent: when it was asked for last
    command: that did
    """

    group: str
    seconds: float
    sent: float
    command: Command


class OperatorsDesk:
    """See the module. began: s of the station's clock with which the page's time begins. `attend` is called time and
    again."""

    def __init__(self, station: NetworkStation, began: float) -> None:
        self._station, self._began = station, began
        self._leases: dict[str, _Lease] = {}
        self._staged: StagedSending | None = None
        self._ended = ""
        """Why a staged sending was ended that had gone well so far."""

    # ---- in stages

    def send_in_stages(self, prepared: Prepared, *, count: int | None = None, confirmed: bool = False) -> Command:
        """Send to one robot, then to a tenth, then to all; gives the first command. Raises what `Station.commit`
        raises, and MisuseError while another one is under way."""
        if self._staged is not None and self._staged.current is not None:
            raise MisuseError("Another command is being sent in stages: wait for its end, or stop it there.")
        self._staged = StagedSending(self._station, prepared, GRACE, count=count, confirmed=confirmed)
        self._ended = "you stopped it"
        return self._staged.first

    def halt(self) -> None:
        """Send no further stage."""
        if self._staged is not None:
            self._staged.halt()

    def _staging(self) -> tuple[str, bool]:
        """How far it has come, and whether it goes on."""
        staged = self._staged
        if staged is None:
            return "", False
        asked = [stage.account.asked for stage in staged.done]
        if staged.current is not None:
            return f"In stages: stage {len(asked) + 1} is sent, and its answers are awaited.", True
        last = staged.done[-1]
        if last.last and last.good:
            return f"In stages: all {len(asked)} stages are done, for {sum(asked):,} robots.", False
        account = last.account
        why = self._ended if last.good else f"faults: {account.n_fault:,}, silent: {account.n_silent:,}"
        return f"In stages: ended with stage {len(asked)} ({why}); the other robots were sent nothing.", False

    # ---- leases

    def lease(self, action: str, group: str, seconds: float, to: str) -> tuple[Command, str]:
        """Ask robots about the lease of a group; one that was taken is renewed until it is given back. Gives a doubt
        about the group's name as well, "" for none. Raises LeaseError, and RoleError for what our key may not do."""
        lease_action, key = LeaseAction(action), group.casefold()
        sent = self._station.lease(lease_action, group, seconds, to)
        if lease_action in (LeaseAction.GIVE, LeaseAction.GRANT):
            self._leases.pop(key, None)
        else:
            self._leases[key] = _Lease(group, seconds, self._station.now, sent)
        return sent, doubt_of(group, self._station.learned)

    def attend(self) -> None:
        """Go on with what goes out in stages, and renew leases in time."""
        if self._staged is not None:
            try:
                self._staged.attend()
            except SleepcastError as error:
                self._ended = f"the next one was refused: {error}"
        now = self._station.now
        for lease in self._leases.values():
            if now - lease.sent >= lease.seconds / RENEWALS:
                body = lease_body(LeaseAction.TAKE, lease.group, lease.seconds)
                lease.sent, lease.command = now, self._station.post(Kind.COMMAND, body=body)

    # ---- what a page shows

    def shown(self) -> Operators:
        """Who commands, as it is now."""
        station, role = self._station, self._station.session.delivery.role
        staging, active = self._staging()
        return Operators(
            station.operator,
            role.value,
            MAY[role],
            self._others(),
            [self._lease(lease) for lease in self._leases.values()],
            [
                ShownAction(each.issued - self._began, _in_a_line(each))
                for each in list(reversed(station.news))[:MAX_ACTIONS]
            ],
            staging,
            active,
        )

    def _others(self) -> list[ShownOperator]:
        heard: dict[str, float] = {message.sender: message.issued - self._began for message in self._station.news}
        trusted = {key.owner: key.role.value for key in self._station.session.delivery.admission.trust.keys}
        roles = {name: role for name, role in trusted.items() if role != Role.ROBOT and name != self._station.operator}
        return [
            ShownOperator(printable(name), roles.get(name, ""), heard.get(name)) for name in sorted({*roles, *heard})
        ]

    def _lease(self, lease: _Lease) -> ShownLease:
        account = self._station.accounting(lease.command.id)
        refused = next(iter(account.faults.values()), "")
        agreed = len(lease.command.answers) - account.n_fault
        return ShownLease(lease.group, lease.sent - self._began + lease.seconds, agreed, printable(refused))


def _in_a_line(message: Message) -> str:
    """What another operator did, in one line."""
    text = describe_request(message) or f"{message.sender}: {message.text or message.kind.name}"
    line = printable(" ".join(text.split()))
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 1]}…"
