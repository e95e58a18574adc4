"""The mission of a run on the page: its commands with their times, what became of each, and who plays it.

The run plays it and pages only show how far it is, so it goes out once however many pages are open. It is sent as a
person would send it, with the same checks: a command that is doubted waits for somebody, and time with it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import Protocol

import msgspec

from sleepcast.channel import Message
from sleepcast.console.account_table import CommandRow
from sleepcast.console.feature import answers, only_now
from sleepcast.console.incoming import PageMessage, Place, Serial
from sleepcast.console.outgoing import DeskMessage
from sleepcast.simulator import Order
from sleepcast.simulator.scenario.mission import Wanted, instruction

NO_MISSION = "This run has no mission: its scenario names none."
STOPPED = "STOP ended it. Release STOP, then play the rest."


class Play(PageMessage):
    """Send the commands of the run's mission at their times, or (not on) do so no longer."""

    serial: Serial
    on: bool = True


class SendLine(PageMessage):
    """Send a command of the mission now, by its index in it. again: although it was sent; confirmed: it is meant as it
    stands, whatever is doubted."""

    serial: Serial
    line: Place
    again: bool = False
    confirmed: bool = False


class SkipLine(PageMessage):
    """Play the mission without this command."""

    serial: Serial
    line: Place


class ShownWanted(msgspec.Struct, frozen=True):
    """What shall have become of a command when the run ends. number: how many it is now, None where nobody knows."""

    text: str
    met: bool = False
    number: int | None = None


class ShownLine(msgspec.Struct, frozen=True):
    """A command of a mission.

    at: its time, s
    words: what stands before its text, "" for nothing
    kind: as a prompt has it; "" for what cannot be typed there
    wanted: what shall have become of it
    sent: when it was sent, s, None for not yet
    command: its id then
    left_out: whether somebody wants to go on without it
    """

    at: float
    text: str
    words: str
    kind: str = msgspec.field(name="sort")
    wanted: list[ShownWanted]
    sent: float | None = None
    command: str = ""
    left_out: bool = False


class MissionNews(DeskMessage, tag="mission"):
    """The mission of the run.

    lines: its commands
    playing: whether the rest goes out at its times
    problem: the index of the line that was not sent, -1 for none
    message: why, or why it is not played any more
    doubt: whether it may be sent as it stands
    """

    lines: list[ShownLine]
    playing: bool = False
    problem: int = -1
    message: str = msgspec.field(default="", name="said")
    doubt: bool = False


class Played(DeskMessage):
    """The answer to `Play`, `SendLine` and `SkipLine`: what happens now, in a sentence; "" where it is seen."""

    serial: int
    message: str = msgspec.field(default="", name="said")


class MissionPlayer(Protocol):
    """Plays the mission of one run. Orders are named by their indices. hold: lets time stand still until somebody has
    decided about a problem."""

    hold: Callable[[], None]

    @property
    def orders(self) -> Sequence[Order]: ...
    @property
    def playing(self) -> bool: ...
    @property
    def left_out(self) -> frozenset[int]: ...
    @property
    def problem(self) -> int:
        """See `MissionNews`."""

    @property
    def message(self) -> str: ...
    @property
    def doubt(self) -> bool: ...

    def sent(self) -> Mapping[int, Message]:
        """The message of each order that was sent."""

    def play(self) -> str:
        """From now on, send each at its time; gives what a person should know. Raises MisuseError if all were sent."""

    def halt(self, why: str) -> None:
        """Play it no longer."""

    def send(self, number: int, *, confirmed: bool, again: bool) -> None:
        """Send one now. again: although it was sent. Raises SleepcastError."""

    def skip(self, number: int) -> None:
        """Go on without it."""


def counted_commands(player: MissionPlayer) -> set[str]:
    """The ids of the commands that were sent and of which the mission says what shall become."""
    return {message.id for number, message in player.sent().items() if player.orders[number].wanted}


def shown_mission(
    player: MissionPlayer, rows: Mapping[str, CommandRow], time: float = inf, began: float = 0.0
) -> MissionNews:
    """The mission as a page shows it.

    rows: the accounts of commands, by id
    time: of what was sent, only what was sent by then, s of the page's time
    began: when that began, s of the desk's clock
    """
    sent = {number: each for number, each in player.sent().items() if each.issued - began <= time}
    lines = []
    for number, order in enumerate(player.orders):
        message = sent.get(number)
        row = None if message is None else rows.get(message.id)
        line = instruction(order)
        words = line._replace(text="(").written()[:-1].strip() if line.text else ""
        typed = line.text and line.only is None and line.but is None and line.within is None
        lines.append(
            ShownLine(
                order.time,
                line.text or line.kind,
                words,
                line.kind if typed else "",
                [_shown(wanted, row) for wanted in order.wanted],
                None if message is None else message.issued - began,
                "" if message is None else message.id,
                number in player.left_out,
            )
        )
    return MissionNews(lines, player.playing, player.problem, player.message, player.doubt)


def _shown(wanted: Wanted, row: CommandRow | None) -> ShownWanted:
    if row is None:
        return ShownWanted(str(wanted))
    number: int = getattr(row, wanted.count.replace(" ", "_"))
    return ShownWanted(str(wanted), wanted.met(number), number)


class GovernedTime(Protocol):
    """Time that may be held up until a person has decided, and that the first command lets begin."""

    def begin(self) -> None: ...

    def set_pace(self, running: bool | None = None, factor: float | None = None) -> None: ...


class MissionSource(Protocol):
    """A run with a mission. held: whether time stands still until somebody has decided about a command of it."""

    held: bool

    @property
    def mission(self) -> MissionPlayer: ...
    @property
    def driver(self) -> GovernedTime: ...


@answers(then=only_now, lacking=NO_MISSION)
def play(source: MissionSource, asked: Play) -> Played:
    """Play the mission, or no longer."""
    problem, message = source.mission.problem, ""
    if asked.on:
        message = source.mission.play()
    else:
        source.mission.halt("")
    _go_on(source, problem, played=asked.on)
    return Played(asked.serial, message)


@answers(then=only_now, lacking=NO_MISSION)
def send_line(source: MissionSource, asked: SendLine) -> Played:
    """Send one of its commands now."""
    problem = source.mission.problem
    source.mission.send(asked.line, again=asked.again, confirmed=asked.confirmed)
    source.driver.begin()
    _go_on(source, problem)
    return Played(asked.serial)


@answers(then=only_now, lacking=NO_MISSION)
def skip_line(source: MissionSource, asked: SkipLine) -> Played:
    """Go on without one of its commands."""
    problem = source.mission.problem
    source.mission.skip(asked.line)
    _go_on(source, problem)
    return Played(asked.serial)


def _go_on(source: MissionSource, problem: int, *, played: bool = False) -> None:
    """Let time run again if it was held for a problem that there is no more, or since the mission is played."""
    decided = source.held and problem >= 0 > source.mission.problem
    if decided or played:
        source.held = False
        source.driver.set_pace(running=True)
