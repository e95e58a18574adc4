"""Snapshots: a whole swarm between two ticks in one file, and a swarm resumed from it, bit for bit.

The file is one msgpack document. Its cover states what it is, the version of this format and of the sleepcast that
wrote it; then follow the parts of the simulator (with the scenario), the fleet, the radio, the loop and the desk,
each compressed separately. It contains no code: programs are stored as text, and compiled again.

A snapshot may come from anywhere. All of it is bounded and checked before a swarm made from it can run.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import msgspec

from sleepcast.channel import Message
from sleepcast.channel.simulated_radio import RadioState
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.files import open_file, replace_file
from sleepcast.core.given_numbers import read_seed
from sleepcast.core.serial import UNREADABLE, SerialError, compressed, plain, room_for, unpack
from sleepcast.core.version import VERSION
from sleepcast.fleet import snapshot as fleets
from sleepcast.fleet.schema import FleetSnapshot
from sleepcast.loop.mission import readable
from sleepcast.loop.population import BriefingState, renumber
from sleepcast.loop.swarm import MAX_MINDS, Desk, Swarm
from sleepcast.simulator import Order
from sleepcast.simulator import snapshot as simulators
from sleepcast.simulator.scenario.mission import BOUNDS, COUNTS, Wanted
from sleepcast.simulator.scenario.population import rooms
from sleepcast.simulator.snapshot import SimulatorState

FORMAT = 2
"""Version of this format; files of a newer one are refused. 1 knew nothing of who may command robots, and who drives
them."""
KIND = "sleepcast snapshot"
MAX_FILE = 4 * 1024**3
"""Bytes of one file: a million robots in the largest world take a quarter of it."""
PARTS = 4
"""Parts that are compressed separately, at one time."""
MAX_ORDERS = 1_000
"""Orders of a mission, and messages waiting to be sent: as many as a mission script may hold."""

_BROKEN = (
    *(ValueError, TypeError, LookupError, ArithmeticError, AttributeError),
    *(AssertionError, RecursionError, MemoryError, SleepcastError),
)
"""Exceptions that untrusted bytes may cause while a swarm is built from them."""


class SnapshotError(MisuseError):
    """Bytes or a file from which no swarm can be resumed."""


class SnapshotLostError(SleepcastError):
    """The snapshot cannot be written."""


class Cover(msgspec.Struct):
    """The first fields of every version of this format."""

    kind: str
    format: int
    version: str


class SnapshotOfOneDesk(Cover):
    """The whole file of format 1. robots: their number, which bounds the rest. desk: None if there was none."""

    robots: int
    simulator: bytes
    fleet: bytes
    radio: bytes
    loop: bytes
    desk: bytes | None


class SnapshotFile(SnapshotOfOneDesk):
    """The whole file. others: the desks of further operators."""

    others: list[bytes]


class GivenOrder(msgspec.Struct):
    """An order as in `LoopState`, what is wanted of it (count, number and bound), and the id of its message."""

    order: tuple[float, str, str]
    wanted: list[tuple[str, int, str]]
    id: str


class LoopState(msgspec.Struct):
    """The loop's own state.

    orders: of the mission, not sent yet: time (s), text and place in its script.
    posted: what the operator has sent since the last tick.
    rest: what runs have left over, see `Carried`.
    wanted: of each of the orders, unless nobody wants anything.
    given: those that were sent and say what shall become of them.
    briefing: what robots that come later are to know.
    """

    orders: list[tuple[float, str, str]]
    posted: list[Message]
    rest: float = 0.0
    wanted: list[list[tuple[str, int, str]]] = []
    given: list[GivenOrder] = []
    briefing: BriefingState | None = None


# ---- taking one


class SwarmCopy:
    """A copy of a swarm between two ticks, which takes little time; a snapshot is made of it afterwards."""

    def __init__(self, robots: int, parts: Sequence[bytes], desks: Sequence[bytes]) -> None:
        self._robots, self._parts, self._desks = robots, parts, desks

    def packed(self, threads: int = 1) -> bytes:
        """The snapshot. On any thread."""
        if threads > 1:
            with ThreadPoolExecutor(threads) as pool:
                simulator, fleet, radio, loop = pool.map(compressed, self._parts)
        else:
            simulator, fleet, radio, loop = map(compressed, self._parts)
        desk, others = next(iter(self._desks), None), list(self._desks[1:])
        return msgspec.msgpack.encode(
            SnapshotFile(KIND, FORMAT, VERSION, self._robots, simulator, fleet, radio, loop, desk, others)
        )


def snapshot(swarm: Swarm) -> bytes:
    """A snapshot of the swarm between two ticks, with its desk; the swarm is not changed.

    Raises SnapshotLostError if the swarm's state is too large, or its last tick was interrupted.
    """
    return copy_of(swarm, desk=swarm.desk).packed(PARTS)


def copy_of(swarm: Swarm, *, desk: Desk | None = None) -> SwarmCopy:
    """A copy of the swarm between two ticks, with what this desk knows; the swarm is not changed.

    Raises SnapshotLostError if the swarm's state is too large, or its last tick was interrupted.
    """
    if not swarm.whole:
        raise SnapshotLostError(
            f"no snapshot was taken: the tick of {swarm.now():g} s was broken off, and only between two ticks can a "
            "swarm be kept so that it goes on as it would have"
        )
    robots = len(swarm.fleet)
    parts = (simulators.state_of(swarm.simulator), fleets.state_of(swarm.fleet), swarm.radio.state(), loop_state(swarm))
    try:
        copies = [plain(part, room_for(robots)) for part in parts]
        desks = [] if desk is None else [desk, *swarm.others]
        return SwarmCopy(robots, copies, [each.state() for each in desks])
    except SerialError as error:
        raise SnapshotLostError(f"the swarm does not fit into a snapshot: {error}") from None


def loop_state(swarm: Swarm) -> LoopState:
    wanted = [_wanted(order) for order in swarm.mission]
    given = [GivenOrder(_plain(order), _wanted(order), number) for order, number in swarm.given]
    orders = [_plain(order) for order in swarm.mission]
    briefing = None if swarm.simulator.population is None else swarm.briefing.state()
    return LoopState(orders, list(swarm.posted), swarm.carried.rest, wanted if any(wanted) else [], given, briefing)


def _plain(order: Order) -> tuple[float, str, str]:
    return order.time, order.text, order.place


def _wanted(order: Order) -> list[tuple[str, int, str]]:
    return [(each.count, each.number, each.bound) for each in order.wanted]


def save(data: bytes, file: Path) -> None:
    """Write a snapshot to a file, which is replaced atomically. Raises SnapshotLostError."""
    try:
        replace_file(file, data)
    except OSError as error:
        reason = error.strerror or str(error)
        raise SnapshotLostError(f"cannot write the snapshot {file}: {reason}. Nothing was replaced") from None


# ---- resuming from one


def load(file: Path) -> bytes:
    """The bytes of a snapshot. Raises SnapshotError for a file that is not one."""
    try:
        with open_file(file) as opened:
            size = os.fstat(opened.fileno()).st_size
            if size > MAX_FILE:
                raise SnapshotError(f"{file} is too large for a snapshot: {size} bytes, at most {MAX_FILE}")
            return opened.readall()
    except OSError as error:
        raise SnapshotError(f"cannot read the snapshot {file}: {error.strerror or error}") from None


def resume(
    data: bytes,
    *,
    seed: int | None = None,
    threads: int | None = None,
    desk: Callable[[Swarm], Desk] | None = None,
    name: str = "the snapshot",
) -> Swarm:
    """Resume a swarm from a snapshot, bit for bit.

    seed: None keeps the swarm's own; another one makes a fork: the same past with another random future.
    threads: for the bodies.
    desk: makes the operator's desk for a swarm, which then gets the state of the old one.
    name: of the snapshot, for errors.

    Raises SnapshotError for bytes that are not a snapshot, of a newer version, or damaged, and MisuseError for a seed
    that is none.
    """
    seed = None if seed is None else read_seed(seed)  # here, where the snapshot is not to blame
    document = _opened(data, name)
    try:
        swarm = _resumed(document, seed, threads)
        if desk is not None:
            swarm.desk = desk(swarm)
            if document.desk is not None:
                swarm.desk.restore(document.desk)
                for other, state in zip(swarm.others, document.others, strict=True):
                    other.restore(state)
    except _BROKEN as error:
        reason = str(error).split("\n")[0] or type(error).__name__
        raise SnapshotError(
            f"{name} is damaged, or sleepcast has not written it: {reason[:300]}. Take another snapshot, or run the "
            "scenario anew"
        ) from error
    return swarm


def _opened(data: bytes, name: str) -> SnapshotFile:
    try:
        cover = msgspec.msgpack.decode(data, type=Cover)
    except UNREADABLE:
        cover = None
    if cover is None or cover.kind != KIND:
        raise SnapshotError(
            f"{name} is not a sleepcast snapshot, or is incomplete: make one with run SCENARIO --snapshot FILE"
        )
    if cover.format > FORMAT:
        raise SnapshotError(
            f"{name} has format {cover.format}, which is newer than this sleepcast, which reads format {FORMAT}: "
            f"update sleepcast (the snapshot was taken by version {cover.version[:40]})"
        )
    try:
        if cover.format == 1:
            first = msgspec.msgpack.decode(data, type=SnapshotOfOneDesk)
            document = SnapshotFile(**msgspec.structs.asdict(first), others=[])
        else:
            document = msgspec.msgpack.decode(data, type=SnapshotFile)
    except UNREADABLE as error:
        raise SnapshotError(f"{name} is damaged: {error}. Take another snapshot, or run the scenario anew") from None
    if not 0 < document.robots <= MAX_MINDS:
        raise SnapshotError(f"{name} says that it holds {document.robots} robots, wanted 1 to {MAX_MINDS}")
    return document


def _resumed(document: SnapshotFile, seed: int | None, threads: int | None) -> Swarm:
    room = room_for(document.robots)
    state = unpack(SimulatorState, document.simulator, room, "the part of the simulator")
    if sum(rooms(simulators.scenario_of(state.scenario))) != document.robots:
        raise SerialError(f"a scenario with another number of robots than {document.robots}")
    fleet = unpack(FleetSnapshot, document.fleet, room, "the part of the minds")
    radio = unpack(RadioState, document.radio, room, "the part of the radio")
    loop = unpack(LoopState, document.loop, room, "the part of the loop")
    if max(len(loop.orders), len(loop.posted), len(loop.given)) > MAX_ORDERS:
        raise SerialError(f"more than {MAX_ORDERS} orders")
    if not abs(loop.rest) <= 0.5:
        raise SerialError(f"{loop.rest} of a tick left over, wanted half of one at most")
    swarm = Swarm(simulators.resume(state, seed, threads))
    go_on(swarm, fleet, radio, loop)
    return swarm


def go_on(swarm: Swarm, fleet: FleetSnapshot, radio: RadioState, loop: LoopState) -> None:
    """Let a swarm go on whose bodies go on already. Raises SerialError."""
    wanted = loop.wanted or [[] for _ in loop.orders]
    swarm.mission = [readable(_order(*each)) for each in zip(loop.orders, wanted, strict=True)]
    swarm.given = [(_order(each.order, each.wanted), each.id) for each in loop.given]
    if swarm.simulator.population is not None:
        renumber(swarm)
    fleets.restore(swarm.fleet, fleet, swarm.now())
    swarm.radio.restore(radio, swarm.simulator.names)
    swarm.posted.extend(loop.posted)
    swarm.carried.rest = loop.rest
    if loop.briefing is not None:
        swarm.briefing.restore(loop.briefing)


def _order(plain: tuple[float, str, str], wanted: list[tuple[str, int, str]]) -> Order:
    for count, _, bound in wanted:
        if count not in COUNTS or bound not in BOUNDS:
            raise SerialError(f"an order that wants {bound[:40]} of {count[:40]}")
    return Order(*plain, tuple(Wanted(*each) for each in wanted))
