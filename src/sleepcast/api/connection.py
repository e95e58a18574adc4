"""How a party gets onto the air: its channel, fleet and keys, and where journals and stores lie."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from hashlib import sha256
from pathlib import Path
from random import Random, SystemRandom
from typing import TYPE_CHECKING
from urllib.parse import quote

from sleepcast.core.errors import MisuseError
from sleepcast.core.files import data_folder
from sleepcast.core.records import dataclass

if TYPE_CHECKING:
    from sleepcast.channel.keys import KeyPair, Trust
    from sleepcast.channel.reliable import ReliableDelivery
    from sleepcast.channel.session import ChannelSession, Multiplexer, Receiver
    from sleepcast.loop.durable import Keeper
    from sleepcast.node.node import Node
    from sleepcast.node.store import Store
    from sleepcast.station.journal.file import DeferredJournal
    from sleepcast.station.network import NetworkStation
    from sleepcast.station.remote import TelemetryClient
    from sleepcast.station.roster import Expectation

FLEET = "sleepcast"
"""Whose messages are heard, unless another fleet is named."""
CHANNEL = "udp://239.255.83.76:47123?interface=lo"
"""Unless another one is said: multicast that stays on this machine."""


@dataclass(frozen=True, slots=True)
class AirOptions:
    """How a party gets onto the air. None stands for what is usual.

    channel: its address.
    fleet: its name.
    key: the owner of ours; None for the one in use, or the development key of this machine.
    trust: the file of those who are believed; None for the one beside the keys, or for the development keys alone.
    folder: where keys lie; None for the one in the user's settings.
    within: time for answers, s; None: by the roster.
    journal: its file; None for the fleet's own.
    skew: how much others' clocks may be wrong, s.
    rate: signatures of one key that are checked in a second.
    expect: how many robots there are, or the file of their names; None for what is stored of this channel and fleet.
    """

    channel: str
    fleet: str
    key: str | None
    trust: Path | None
    folder: Path | None
    within: float | None = None
    journal: Path | None = None
    skew: float | None = None
    rate: float | None = None
    expect: str | None = None


def expectation(air: AirOptions) -> Expectation:
    """Which robots there are, by what was given with this command, or is stored. Raises ExpectationError."""
    from sleepcast.station.roster import FleetFile, read_expectation

    return FleetFile(air.channel, air.fleet).read() if air.expect is None else read_expectation(air.expect)


@contextmanager
def station_for(
    air: AirOptions, say: Callable[[str], None], *, strict: bool = False, expected: Expectation | None = None
) -> Iterator[NetworkStation]:
    """An operator's desk on this channel, which remembers at its end who was heard. Raises what the channel raises, and
    ExpectationError.

    say: takes sentences that the person must know.
    strict: whether warnings are errors.
    expected: which robots there are; None for `expectation`.
    """
    with observing_station(air, say, strict=strict, expected=expected) as (station, _):
        yield station


@contextmanager
def observing_station(
    air: AirOptions, say: Callable[[str], None], *, strict: bool = False, expected: Expectation | None = None
) -> Iterator[tuple[NetworkStation, TelemetryClient]]:
    """The same, with a client that requests telemetry and stores it."""
    from sleepcast.core.clock import UnixClock
    from sleepcast.core.errors import printable
    from sleepcast.station.cache import CacheError, PeerCache, TelemetryCache
    from sleepcast.station.network import ABOVE, NetworkStation
    from sleepcast.station.remote import RemoteMinds, TelemetryClient
    from sleepcast.station.roster import NOBODY_SAID
    from sleepcast.station.validation import SendPolicy

    if expected is None:
        try:
            expected = expectation(air)
        except MisuseError as error:
            if air.expect is not None:
                raise
            expected = NOBODY_SAID
            say(f"{error}. Until then silence is counted among robots heard so far")
    contacts, minds, seen = PeerCache.of(air.fleet), RemoteMinds(), TelemetryCache.of(air.fleet)
    commanded = seen.restore(minds, UnixClock().now())
    with (
        closing(session_for(air, None, robot=False, say=say)) as session,
        closing(open_journal(air.journal, air.fleet)) as journal,
    ):
        station = NetworkStation(
            session,
            UnixClock(),
            minds.vocabulary,
            minds,
            heard=contacts.heard,
            journal=journal,
            policy=SendPolicy(ABOVE, irreversible=True, strict=strict, doubts=True),
            within=air.within,
            expected=expected,
        )
        station.commanded.note(commanded)
        minds.conflicts = station.conflicts
        telemetry = TelemetryClient(station, minds)
        station.listeners.append(telemetry.hear)
        try:
            yield station, telemetry
        finally:
            station.conclude()
            for sentence in (*station.notices(), *filter(None, [station.trouble])):
                say(printable(sentence))
            try:
                contacts.save({name: at for name, at in station.roster.items() if at is not None})
                seen.save(minds, station.now, station.commanded.latest)
            except CacheError as error:
                say(str(error))


def session_for(
    air: AirOptions,
    name: str | None,
    *,
    robot: bool,
    say: Callable[[str], None],
    store: Store | None = None,
    multiplexer: Multiplexer | None = None,
) -> ChannelSession:
    """A session on this channel. Raises what the channel raises.

    name: of the sender; None for the key's owner.
    robot: whether it is a robot's, or an operator's.
    say: takes a sentence about development keys.
    store: of a robot; an operator gets one, in which the sequence goes on, and which is closed with the session.
    multiplexer: of a robot whose process has several.
    """
    from sleepcast.channel.admission import ROBOT_KINDS
    from sleepcast.channel.message import Kind
    from sleepcast.channel.session import ChannelSession
    from sleepcast.channel.transports import open_transport
    from sleepcast.channel.transports.transport import listen_for
    from sleepcast.core.clock import UnixClock

    key, trust = chosen_keys(air, robot, say)
    if not robot:
        store = operator_store(air.fleet, key.public.owner, say)
    delivery = _delivery(air, key.public.owner if name is None else name, key, trust, store, robot=robot)
    if multiplexer is not None:
        port, answers = multiplexer.port(ROBOT_KINDS), multiplexer.answers
        return ChannelSession(port, delivery, UnixClock(), _chance(), answers=answers)
    transport = open_transport(air.channel)
    listen_for(transport, ROBOT_KINDS if robot else Kind)
    session = ChannelSession(transport, delivery, UnixClock(), _chance())
    if not robot and store is not None:
        session.ends.append(store.close)
    return session


def multiplexer_for(air: AirOptions) -> Multiplexer:
    """What several robots of one process share on this channel. Raises what the channel raises."""
    from sleepcast.channel.drops import DropCounter
    from sleepcast.channel.session import Multiplexer
    from sleepcast.channel.transports import open_transport
    from sleepcast.core.clock import UnixClock

    return Multiplexer(open_transport(air.channel), DropCounter(UnixClock()))


def sessions_for(
    air: AirOptions, names: Sequence[str], say: Callable[[str], None], store: Store | None = None
) -> tuple[Multiplexer, Receiver, list[ChannelSession]]:
    """Sessions of robots with these names, and the receiver for all of them, on one multiplexer. Raises what the
    channel raises.

    say: takes a sentence about development keys.
    store: of these robots.
    """
    from sleepcast.channel.admission import ROBOT_KINDS
    from sleepcast.channel.session import ChannelSession, Multiplexer, Receiver, receiver_name
    from sleepcast.channel.transports import open_transport
    from sleepcast.core.clock import UnixClock

    key, trust = chosen_keys(air, True, say)
    deliveries = [_delivery(air, name, key, trust, store, robot=True) for name in names]
    listening = deliveries[0]
    if len(names) > 1:
        listening = _delivery(air, receiver_name(names), key, trust, store, robot=True)
    if store is not None:
        store.listen(listening)
    multiplexer, clock = Multiplexer(open_transport(air.channel), listening.admission.drops), UnixClock()
    listening.admission.conflicts.hold({delivery.name: delivery.epoch for delivery in deliveries})
    answers = multiplexer.answers
    receiver = Receiver(multiplexer.port(ROBOT_KINDS), listening, clock, names=names, answers=answers)
    sessions = [
        ChannelSession(multiplexer.port(()), delivery, clock, _chance(), listens=False, answers=answers)
        for delivery in deliveries
    ]
    for session in sessions:
        session.conflicts = listening.admission.conflicts
    return multiplexer, receiver, sessions


def _delivery(
    air: AirOptions,
    name: str,
    key: KeyPair,
    trust: Trust,
    store: Store | None,
    *,
    robot: bool,
) -> ReliableDelivery:
    """The delivery of a party of this name. Raises MisuseError if the key is not its own."""
    from sleepcast.channel.admission import Admission
    from sleepcast.channel.reliable import ReliableDelivery
    from sleepcast.core.clock import UnixClock, epoch_at

    if not key.public.is_of(name):
        raise MisuseError(f"the key of {key.public.owner!r} cannot speak for {name!r}: take another with --key")
    clock, chance = UnixClock(), _chance()
    admission = Admission(trust, air.fleet, clock, robot=robot, rate=air.rate, skew=air.skew)
    if store is None:  # its epoch begins later than all before, so that its numbers are news
        return ReliableDelivery(name, epoch_at(clock.now()), key, admission, chance)
    if robot:
        return ReliableDelivery(name, store.new_epoch(name), key, admission, chance)
    epoch, first = store.numbers(name)
    delivery = ReliableDelivery(name, epoch, key, admission, chance, first=first, keep=store.keep)
    store.adopt_operator(delivery)
    return delivery


def _chance() -> Random:
    return Random(SystemRandom().getrandbits(64))


def chosen_keys(air: AirOptions, robot: bool, say: Callable[[str], None]) -> tuple[KeyPair, Trust]:
    """Our key, and the keys that we trust. Changes of trust that are heard on the air go into the trust file."""
    from sleepcast.channel.keyring import (
        DEVELOPMENT_TRUST,
        TRUST_FILE,
        TrustKeeper,
        add_trust,
        development_keys,
        find_key,
        keys_folder,
        load_trust,
        used_keys,
    )
    from sleepcast.channel.keys import Trust
    from sleepcast.core.clock import UnixClock
    from sleepcast.core.errors import SleepcastError

    folder = air.folder or keys_folder()
    file = air.trust or folder / TRUST_FILE
    owner = used_keys(folder).of(robot=robot) if air.key is None else air.key
    if owner is None and air.trust is None:
        file = folder / DEVELOPMENT_TRUST
        desk, robots = development_keys(folder)
        say(f"development keys of this machine, in {folder}: to try things out; anybody who can read them can command")
        pair, trust = (robots if robot else desk), load_trust(file) if file.exists() else Trust()
        trust.merge(Trust((desk.public, robots.public)))
    else:
        pair = development_keys(folder)[robot] if owner is None else find_key(folder, owner)
        trust = load_trust(file)

    def keep(trust: Trust) -> None:
        try:
            add_trust(trust, file)
        except SleepcastError as error:  # it counts all the same, until we end
            say(str(error))

    trust.keep = TrustKeeper(trust, file, UnixClock(), say) if robot else keep
    return pair, trust


def keeper_for(nodes: Sequence[Node], delivery: ReliableDelivery, store: Store | None) -> Keeper | None:
    """What stores what these robots know and whom they trust.

    delivery: what receives for them.
    """
    from sleepcast.channel.keyring import TrustKeeper
    from sleepcast.loop.durable import KeysFirst

    keys = delivery.admission.trust.keep
    if not isinstance(keys, TrustKeeper):
        return store
    for node in nodes:
        node.keys_last = lambda: keys.lasts
    return KeysFirst(keys, store)


MAX_NAME_BYTES = 200
"""Bytes of a file's name for a fleet, so that the names of its archives fit into 255."""

WRITE_PATIENCE = 0.25
"""Seconds that a desk waits for another writer: it has robots to hear, and writes later what it could not."""


def journal_of(fleet: str) -> Path:
    """The file of a fleet's own journal."""
    name = quote(fleet, safe=" ")
    return (
        data_folder() / "journals" / f"{name if len(name) <= MAX_NAME_BYTES else sha256(fleet.encode()).hexdigest()}.db"
    )


def open_journal(journal: Path | None, fleet: str) -> DeferredJournal:
    """A journal for a desk to write to: the file, or that of the fleet."""
    from sleepcast.core.clock import UnixClock
    from sleepcast.station.journal.file import DeferredJournal

    return DeferredJournal(journal or journal_of(fleet), UnixClock(), WRITE_PATIENCE)


MAX_LIVES = 16
"""Processes of one operator at a time whose epochs go on; one more starts a new epoch."""


def open_store(file: Path, say: Callable[[str], None]) -> Store:
    """The store in a file; see `Store`."""
    from sleepcast.core.clock import UnixClock
    from sleepcast.node.store import Store

    return Store(file, UnixClock(), say)


def operator_store(fleet: str, owner: str, say: Callable[[str], None]) -> Store | None:
    """Where an operator's sequence goes on: the first of their stores that no other process uses. None if it must
    begin a new one, because nothing can be written."""
    from sleepcast.node.store import InUseError, StoreError

    for number in range(1, MAX_LIVES + 1):
        try:
            store = open_store(store_file("operators", fleet, f"{owner}-{number}"), say)
        except InUseError:
            continue
        except StoreError as error:
            say(f"{error}. Until then what is sent starts a new epoch: old commands are forgotten")
            return None
        if store.lasts:
            return store
        store.close()
        return None
    return None


def store_file(what: str, fleet: str, name: str) -> Path:
    """The file of a store in this user's data. what: "operators" or "robots"."""
    # A leading point would hide the file, or name a folder.
    return data_folder() / what / f"_{quote(fleet, safe='')}" / f"_{quote(name, safe='')}.store"
