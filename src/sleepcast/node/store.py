"""The store: the state of the robots of one process survives its end, even if it is killed at any moment.

Every tick writes at two moments, for all robots of the process together, each in one transaction at most:

    before    the messages from the channel, before they are evaluated; and the progress of each stream
    after     the results, and what the robot has learned

So a command is evaluated once: one that had begun when the process ended is reported as interrupted and not
repeated; a standing one is evaluated again, since none of its effects was stored. Changes that rules make on their
own are written at most once per second. Answers are sent afterwards.

If writing fails - a full disk, a file that has become read-only - the robots continue, report it, and try again. A
robot that may have lost its latest STOP starts stopped and stays so until RELEASE: its store is damaged, missing,
old or cannot be written (`integrity`), or a STOP could not be written to a full disk.
"""

from __future__ import annotations

import os
import sqlite3
from collections import deque
from collections.abc import Callable, Sequence
from math import inf
from pathlib import Path
from random import SystemRandom
from typing import TYPE_CHECKING

import msgspec

from sleepcast.channel.message import Kind, Message
from sleepcast.channel.reliable import KEEP_EVERY, ReliableDelivery
from sleepcast.channel.sequencer import DeliveryState
from sleepcast.core.clock import Clock
from sleepcast.core.serial import SerialError, pack
from sleepcast.mind.limits import MAX_QUEUE, MAX_SEEN
from sleepcast.mind.state import MindState
from sleepcast.node.integrity import NEWBORN, Marker, Seal
from sleepcast.node.store_file import (
    FORMAT,
    MAX_MIND,
    Content,
    Examined,
    InUseError,
    Remembered,
    StoreError,
    WriteBatch,
    connect,
    create,
    examine,
    lock,
    set_aside,
    transaction,
)

if TYPE_CHECKING:  # an operator's store has no robots, and need not wait until minds are loaded
    from sleepcast.node.node import Node

__all__ = ["InUseError", "Store", "StoreError"]

LOOK_EVERY = 1.0
"""Period, s, at which the store checks whether rules have changed something on their own."""
TRY_AGAIN = 5.0
"""Delay, s, before a failed write is tried again."""
APART = 1_000
"""By how much two lives may differ in number where the clock has not gone on: so two robots whose stores are copies of
one begin different lives, and are noticed."""
MAX_BEGUN = 3
"""Process lives in which a standing command is begun: if it ends all of them, it is reported as interrupted."""
MAX_UNWRITTEN = 100_000
"""Evaluations that wait until the disk has room again; older ones are dropped."""
MARK_EVERY = 10.0
"""Period, s, at which the marker is updated after writes, besides STOP and RELEASE."""
LASTING = frozenset({Kind.COMMAND, Kind.STOP, Kind.RELEASE})
"""Kinds of messages that are remembered as evaluated."""
DECISIVE = frozenset({Kind.STOP, Kind.RELEASE})
"""Kinds of messages after which the marker is updated at once."""
INTERRUPTED = "interrupted"
"""The outcome of a command that had begun when the process ended: how far it came is unknown."""


class StoredRobot(msgspec.Struct):
    """One robot of the store.

    known: ids of stored messages, with the number of times their evaluation was begun.
    begun: those begun in this life.
    fingerprint: of the mind when last checked.
    """

    number: int
    node: Node
    delivery: ReliableDelivery | None
    known: dict[str, int] = msgspec.field(default_factory=dict)
    begun: set[str] = msgspec.field(default_factory=set)
    fingerprint: tuple[object, ...] = ()


class Store:
    """See the module.

    clock: Unix time.
    say: called with a sentence when something goes wrong with the file, and when it is over.
    doubt: why what robots knew before may be lost, "" if it is not.

    Raises StoreError for a file that is in use, not a store, or of a newer format. A damaged one is set aside.
    """

    def __init__(self, file: Path, clock: Clock, say: Callable[[str], None]) -> None:
        self.file, self._clock, self._say = Path(os.path.realpath(file)), clock, say
        self.doubt = ""
        self._robots: dict[str, StoredRobot] = {}
        self._operator: tuple[Remembered, ReliableDelivery] | None = None
        self._listening: tuple[Remembered, ReliableDelivery] | None = None
        self._lock: int | None = None
        self._connection: sqlite3.Connection | None = None
        self._content = Content()
        self._seal = Seal()
        self._marker, self._marked, self._mark_at = Marker(self.file, FORMAT), 0, -inf
        self._unwritten = WriteBatch()
        self._failing = False
        self._remarks: deque[str] = deque()
        """Written by whichever thread writes the file."""
        self._decided: set[Kind] = set()
        """Whether a STOP or RELEASE waits to be written."""
        self._try_at = self._look_at = -inf
        self._open()

    @property
    def lasts(self) -> bool:
        """Whether writing works at present."""
        return self._connection is not None

    # ---- robots

    def new_epoch(self, name: str) -> int:
        """Begin a new epoch of this robot or operator; returns its number, higher than those of all before."""
        before = self._remembered(name)
        # Copies of a store, with clocks that stand still, are to differ.
        later = before.epoch + SystemRandom().randint(1, APART)
        before.epoch = max(int(self._clock.now() * 1000.0), later)
        self._unwritten.lives[before.number] = name, before
        return before.epoch

    def _remembered(self, name: str) -> Remembered:
        robot = self._content.robots.get(name)
        if robot is None:
            number = 1 + max((each.number for each in self._content.robots.values()), default=0)
            robot = self._content.robots[name] = Remembered(number, self._clock.now())
        return robot

    def _heard(self, record: Remembered) -> DeliveryState:
        return DeliveryState(tuple(record.streams), tuple(record.windows), tuple(self._content.standing))

    def listen(self, delivery: ReliableDelivery) -> None:
        """Store the progress of a delivery (whose epoch is its `life`) that receives for all robots here, after
        restoring it."""
        record = self._remembered(delivery.name)
        delivery.restore(self._heard(record), record.since)
        self._listening = record, delivery

    def adopt(self, node: Node, delivery: ReliableDelivery | None) -> bool:
        """Restore a robot and store its state from now on; returns whether it was known. Its delivery (whose epoch is
        its `life`), if any, has received nothing yet, and its mind has learned nothing but what is built in. Raises
        StoreError for an impossible state."""
        from sleepcast.node.state import fingerprint, stand

        if node.name not in self._content.robots:
            self.new_epoch(node.name)
        record = self._content.robots[node.name]
        robot = self._robots[node.name] = StoredRobot(record.number, node, delivery)
        mind, record.mind = record.mind, None
        if mind is not None:
            self._restore(node, mind, record.saved)
        elif self._seal.doubt:
            self._tell(node, stand(node, self._seal.doubt))
        if delivery is not None:
            delivery.restore(self._heard(record), record.since)
        heard = record if self._listening is None else self._listening[0]
        if not heard.streams:
            node.recall(self._dealt_with(record.number))
        for taken in record.taken:
            message = _shifted(taken.message, -node.zero)
            robot.known[message.id] = taken.begun
            if taken.begun and (not message.standing or taken.begun >= MAX_BEGUN):
                node.interrupted(message)
                self._finish(robot, message, INTERRUPTED, self._clock.now())
            else:
                node.receive(message)
        node.evaluated.clear()
        robot.fingerprint = fingerprint(node)
        return mind is not None or bool(heard.streams)

    def _dealt_with(self, number: int) -> list[str]:
        """The latest messages that a robot has evaluated: the present receiver does not know them, because other robots
        shared the process before."""
        if self._connection is None:
            return []
        query = "SELECT command FROM evaluations WHERE robot = ? ORDER BY number DESC LIMIT ?"
        return [command for (command,) in self._connection.execute(query, (number, MAX_SEEN))]

    def _restore(self, node: Node, mind: MindState, saved: float) -> None:
        from sleepcast.node.state import restore

        try:
            lost = restore(mind, node, max(0.0, self._clock.now() - saved))
        except SerialError as error:
            raise StoreError(
                f"{self.file}: {error}; name another file with --store, or take none with --no-store"
            ) from None
        self._tell(node, lost)

    def _tell(self, node: Node, sentences: Sequence[str]) -> None:
        for sentence in sentences:
            self._say(f"{node.name}: {sentence}")

    def standing(self) -> str:
        """A sentence that says which robots are stopped because a STOP may have been lost, and why; "" if none is."""
        doubtful = [robot.node for robot in self._robots.values() if robot.node.doubt]
        if not doubtful:
            return ""
        first, last = doubtful[0], doubtful[-1]
        names = first.name if first is last else f"{first.name} to {last.name} ({len(doubtful)} robots)"
        first.remark(f"stopped until RELEASE: {first.doubt}")
        return f"{names}: {first.doubt}, so a STOP may be forgotten; stopped until RELEASE (sleepcast release)"

    # ---- an operator

    def numbers(self, name: str) -> tuple[int, int]:
        """The epoch of the operator of this name, and the first unused message number in it: numbering continues across
        restarts."""
        record = self._remembered(name)
        if not record.epoch or self.doubt:  # which numbers were used is unknown, so that epoch is not continued
            self.new_epoch(name)
        return record.epoch, record.sequence + 1

    def adopt_operator(self, delivery: ReliableDelivery) -> None:
        """Store an operator's numbers and standing commands from now on, after restoring those of earlier processes."""
        record = self._remembered(delivery.name)
        delivery.restore(self._heard(record), record.since)
        self._operator = record, delivery
        self.keep()

    def keep(self) -> None:
        """Write before an operator sends a standing command, which must be stored before it is sent, and after many
        numbers have been used."""
        self._keep(ahead=2 * KEEP_EVERY)

    def _keep(self, ahead: int) -> None:
        """ahead: how many more numbers may be used before they are stored again."""
        if self._operator is not None:
            record, delivery = self._operator
            self._take_news(record.number, delivery)
            record.sequence = delivery.next_number - 1 + ahead
            self._unwritten.lives[record.number] = delivery.name, record
            self.write()

    # ---- a tick

    def before(self) -> bool:
        """All robots have received their messages, and are about to evaluate them; returns whether to `write` first."""
        self._report()
        begins = bool(self._unwritten.lives)
        if self._listening is not None:
            record, delivery = self._listening
            self._take_news(record.number, delivery)
        for robot in self._robots.values():
            if robot.delivery is not None:
                self._take_news(robot.number, robot.delivery)
            for index, message in enumerate(robot.node.waiting):
                if message.kind is Kind.COMMAND:
                    begins |= self._take(robot, message, index < MAX_QUEUE)
        return begins

    def _take(self, robot: StoredRobot, message: Message, begins: bool) -> bool:
        """Store that a message was taken, and that its evaluation begins or waits for another tick; returns whether
        this must be written before the evaluation."""
        begins = begins and message.id not in robot.begun
        if begins or message.id not in robot.known:
            if begins:
                robot.begun.add(message.id)
            times = robot.known[message.id] = robot.known.get(message.id, 0) + begins
            self._unwritten.taken[robot.number, message.id] = _shifted(message, robot.node.zero), times
        return begins

    def after(self) -> bool:
        """All robots have finished the tick; returns whether to `write` now."""
        self._report()
        now = self._clock.now()
        look = now >= self._look_at
        if look:
            self._look_at = now + LOOK_EVERY
        urgent = look
        for robot in self._robots.values():
            evaluated, did = robot.node.evaluated, False
            while evaluated:
                message, outcome, time = evaluated.popleft()
                if message.kind in LASTING:
                    did = urgent = True
                    self._finish(robot, message, outcome, time + robot.node.zero)
            if did or look:
                self._take_mind(robot, now)
        return urgent and bool(self._unwritten)

    def _take_mind(self, robot: StoredRobot, now: float) -> None:
        """Store what a robot knows if that has changed."""
        from sleepcast.node.state import fingerprint, mind_of

        current = fingerprint(robot.node)
        if current != robot.fingerprint:
            robot.fingerprint = current
            self._unwritten.minds[robot.number] = now, pack(mind_of(robot.node), MAX_MIND)

    def write(self) -> bool:
        """Write what was collected; returns whether it is stored. May be called in another thread, while nothing else
        is."""
        return self._write(self._clock.now())

    def close(self) -> None:
        """Write what is left, and release the file. Messages received but not evaluated are not stored: they are
        received again."""
        self._look_at = self._try_at = -inf
        self._keep(ahead=0)
        if self.after():
            self.write()
        if self._connection is not None:
            if self._robots and not self._failing:
                self._mark(self._clock.now(), at_once=True)
            self._connection.close()
            self._connection = None
        self._unlock()

    def _unlock(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    # ---- collecting what is to be written

    def _take_news(self, number: int, delivery: ReliableDelivery) -> None:
        news, waits = delivery.news(), self._unwritten
        for progress in news.streams:
            waits.streams[number, progress.stream] = progress
        for window in news.windows:
            waits.windows[number, window.key, window.sender, window.epoch] = window
        for each in news.standing:
            waits.standing[each.stream, each.number] = each.datagrams

    def _finish(self, robot: StoredRobot, message: Message, outcome: str, time: float) -> None:
        waits, which = self._unwritten, (robot.number, message.id)
        if message.kind in DECISIVE:
            self._decided.add(message.kind)
            self._try_at = -inf  # it is worth a try, however lately the last one failed
        robot.begun.discard(message.id)
        if robot.known.pop(message.id, None) is not None and waits.taken.pop(which, None) is None:
            waits.finished.add(which)
        arrived = None if message.heard is None else message.heard + robot.node.zero
        waits.evaluated.append((robot.number, message.id, message.kind.value, time, outcome, arrived))
        del waits.evaluated[:-MAX_UNWRITTEN]

    # ---- the file

    def _open(self) -> None:
        examined, failure = Examined(), ""
        try:
            try:
                self._lock = lock(self.file)
            except OSError as error:
                failure = _reason(error)
            examined = examine(self.file)
            self._content = examined.content or Content()
            if not failure:
                self._connection, self._seal = self._connect(examined)
        except StoreError:
            self._unlock()
            raise
        except (sqlite3.Error, OSError) as error:
            failure = _reason(error)
        if failure:
            self._say(
                f"{self.file} cannot be written: {failure}. Nothing is kept there: after a restart everything since "
                "now will have been forgotten"
            )
            self._doubt(examined.doubt or "cannot be written")
        else:
            if examined.doubt:
                self._doubt(examined.doubt)
                self._write(self._clock.now())
            elif self._seal.generation == NEWBORN:
                self._mark(self._clock.now(), at_once=True)  # before it holds anything that could be lost

    def _connect(self, examined: Examined) -> tuple[sqlite3.Connection, Seal]:
        """Open the store for writing: a new one in place of one that is damaged or missing."""
        if examined.content is not None:
            if examined.doubt:
                self._say(f"{self.file} {examined.doubt}. What it says is taken, but a STOP may have come after that")
            return connect(self.file, examined.seal)
        aside = set_aside(self.file, self._clock.now())
        if examined.doubt:
            what = f" ({examined.damage})" if examined.damage else f", although {self._marker.file.name} speaks of it"
            kept = f"It was set aside as {aside.name}, and what" if aside is not None else "What"
            lost = f"{kept} was learned is forgotten: rules come again from the other robots"
            self._say(f"{self.file} {examined.doubt}{what}. {lost}")
        return connect(self.file, create(self.file, examined.doubt and _told(examined.doubt)))

    def _doubt(self, reason: str) -> None:
        """Each robot that was here may have lost a STOP, and is stopped. The store gets a new identity, so that no old
        copy is ever mistaken for it. reason: the problem, as the end of a sentence about the store."""
        self.doubt = _told(reason)
        self._seal.store, self._seal.doubt = Seal().store, self.doubt
        for record in self._content.robots.values():
            if record.mind is not None and not record.mind.stopped:
                record.mind = msgspec.structs.replace(record.mind, stopped=True, doubt=self.doubt)
                self._unwritten.minds[record.number] = record.saved, pack(record.mind, MAX_MIND)

    def _write(self, now: float) -> bool:
        """Write what waits, and update the marker; returns whether it is stored. If a STOP waits and the disk refuses,
        the next life is in doubt."""
        stored = self._connection is not None and self._committed(self._connection, now)
        if stored:
            self._mark(now, at_once=bool(self._decided))
            self._decided.clear()
        elif Kind.STOP in self._decided:
            self._withdraw()
        if self._connection is None:
            self._unwritten = WriteBatch()
        return stored

    def _committed(self, connection: sqlite3.Connection, now: float) -> bool:
        if now < self._try_at:
            return False
        try:
            with transaction(connection, self._seal):
                self._unwritten.write(connection)
        except sqlite3.Error as error:
            self._try_at = now + TRY_AGAIN
            if not self._failing:
                self._failing = True
                self._say(
                    f"{self.file} cannot be written: {_reason(error)}. The robot goes on; after a restart it would "
                    f"have forgotten what comes now. It is tried again every {TRY_AGAIN:g} s"
                )
                self._remarks.append("store cannot be written")
            return False
        self._unwritten = WriteBatch()
        if self._failing:
            self._failing = False
            self._say(f"{self.file} is written again, with everything that had to wait")
            self._remarks.append("store is written again")
        return True

    def _mark(self, now: float, *, at_once: bool) -> None:
        """Update the marker of the store, at once or when it is due."""
        if self._marked == self._seal.generation or (not at_once and now < self._mark_at):
            return
        self._mark_at = now + MARK_EVERY
        try:
            self._marker.write(self._seal)
        except OSError as error:
            if self._marked >= 0:
                self._say(f"{self._marker.file} cannot be written: {_reason(error)}. An old store would not be noticed")
            self._marked = -1
        else:
            self._marked = self._seal.generation

    def _withdraw(self) -> None:
        """A STOP is not in the store: remove its marker, so that robots start stopped."""
        self._decided.clear()
        self._marked = 0
        try:
            self._marker.withdraw()
        except OSError as error:
            sentence = f"a restart would forget this STOP: {self._marker.file} cannot be removed: {_reason(error)}"
            self._say(sentence)
            self._remarks.append("a restart would forget this STOP: its store is read-only")

    def _report(self) -> None:
        """Report to the operators what has been remarked, through one robot of the process."""
        while self._remarks:
            sentence = self._remarks.popleft()
            for robot in self._robots.values():
                robot.node.remark(sentence)
                break


def _shifted(message: Message, seconds: float) -> Message:
    times = {"issued": message.issued + seconds, "deadline": message.deadline + seconds}
    return msgspec.structs.replace(message, **times)


def _told(doubt: str) -> str:
    return f"its store {doubt}"


def _reason(error: Exception) -> str:
    return (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
