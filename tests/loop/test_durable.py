"""Stored, then answered: by minds in bodies and by swarms, on disks that are slow, full or broken."""

from __future__ import annotations

import os
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from durable_cases import Do, try_all
from loop.test_crew import DESK, Field
from loop.test_real import TICK, Desk, Run
from sleepcast.channel import Kind, Message
from sleepcast.channel.keyring import TrustKeeper, load_trust, save_trust
from sleepcast.channel.keys import KeyChange, PublicKey, Trust
from sleepcast.channel.message import KEYS, LEASE, Role
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import SleepcastError
from sleepcast.loop.durable import KeysFirst
from sleepcast.loop.real import EmbodiedMind, run_robots
from sleepcast.node.store import Store
from small_worlds import simulator

ROBOTS_HERE = 4
LEASED: dict[str, object] = {LEASE: {"do": "take", "group": "bravo", "seconds": 60.0}}
NEW = PublicKey("bert", Role.OPERATOR, b"b" * 32)


class Disk(Store):
    """A store whose writes can be held up, and fail. written: how many were attempted; within: called in each."""

    written, fails = 0, False
    within: Callable[[], None] = staticmethod(lambda: None)

    def write(self) -> bool:
        self.written += 1
        self.within()
        if self.fails:
            assert self._connection is not None
            self._connection.execute("PRAGMA query_only = 1")
        return super().write()


def query_only(disk: Disk, refuses: bool) -> None:
    """Whether the disk refuses to be written."""
    assert disk._connection is not None
    disk._connection.execute(f"PRAGMA query_only = {int(refuses)}")


def kill(disk: Disk) -> None:
    """Let go of a store as a process does that is killed: nothing more is written."""
    assert disk._connection is not None
    assert disk._lock is not None
    disk._connection.close()
    os.close(disk._lock)


class StoredField(Field):
    """A crew of a few whose minds are stored."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, robots=ROBOTS_HERE)
        self.said: list[str] = []
        self._store(folder)

    def _store(self, folder: Path) -> None:
        self.disk = Disk(folder / "crew.store", self.clock, self.said.append)
        for member in self.crew.members:
            self.disk.adopt(member.node, None)
            member.keeper = self.disk
        self.crew.keeper = self.disk

    def live_again(self, folder: Path) -> None:
        """Another process, with the same store."""
        self._leave()
        self.life += 1
        self._begin(simulator(folder), ROBOTS_HERE)
        self._store(folder)

    def outcomes(self) -> dict[object, int]:
        found = [message.body for message in self.heard if message.kind is Kind.ANSWER]
        outcomes = [body["outcome"] if not body["fault"] else f"{body['outcome']}: {body['fault']}" for body in found]
        return {outcome: outcomes.count(outcome) for outcome in outcomes}

    def _leave(self) -> None:
        self.crew.durability.close()
        self.receiver.close()
        for member in self.crew.members:
            member.session.close()

    def close(self) -> None:
        self._leave()
        self.disk.close()
        self.bystander.close()
        self.desk.close()


@pytest.fixture
def field(tmp_path: Path) -> Iterator[StoredField]:
    with closing(StoredField(tmp_path)) as found:
        yield found


class Ears:
    """Whoever hears an answer looks into the store of its robot at once. early: answers that were not stored."""

    def __init__(self, field: StoredField) -> None:
        self.early: list[object] = []
        self._file = field.disk.file
        for member in field.crew.members:
            member.session.send = self._before(member.session.send)  # type: ignore[method-assign]

    def _before(self, send: Callable[[Message], None]) -> Callable[[Message], None]:
        def heard(message: Message) -> None:
            if message.kind is Kind.ANSWER and not message.body["fault"]:
                with closing(sqlite3.connect(f"{self._file.as_uri()}?mode=ro", uri=True)) as connection:
                    query = "SELECT count(*) FROM journal WHERE robot = ? AND command = ?"
                    which = message.sender, message.body["command"]
                    if connection.execute(query, which).fetchone() != (1,):
                        self.early.append(message.body)
            send(message)

        return heard


@pytest.mark.parametrize("ticking", [True, False])
def test_what_a_swarm_answers_is_stored(field: StoredField, ticking: bool) -> None:
    field.run(0.5)
    ears = Ears(field)
    field.say(kind=Kind.STOP)
    field.run(0.3, ticking=ticking)
    field.say(kind=Kind.RELEASE)
    field.run(0.3, ticking=ticking)
    assert field.outcomes() == {"stopped": ROBOTS_HERE, "released": ROBOTS_HERE}
    field.say("(RULE a 1)", standing=True)
    field.desk.send(Message("desk", 1, 1, Kind.COMMAND, field.clock.now() - 1_000.0, body=LEASED))
    field.run(0.5)
    assert field.outcomes() == {
        "stopped": ROBOTS_HERE,
        "released": ROBOTS_HERE,
        "matched": ROBOTS_HERE,
        "not matched": ROBOTS_HERE,
    }
    assert ears.early == []


def test_while_a_disk_writes_other_stops_are_heard_and_nothing_else(field: StoredField) -> None:
    field.run(0.5)
    r0, body = field.crew.members[0].node, field.crew.simulator.robots[0]
    heard, written = threading.Event(), threading.Event()
    usual = field.crew.hear_stops

    def hear_stops() -> None:
        if not heard.is_set():
            assert body.stopped, "the body goes before the disk"
            assert field.outcomes() == {}, "and the answer comes after it"
            r0.receive(Message("elsewhere", 1, 1, Kind.RELEASE, 0.0, body={"ends": [["desk", 1, 1]]}))
            field.say("(JOIN crew)")
            field.say(kind=Kind.STOP)
            usual()
            heard.set()

    def within() -> None:
        if not written.is_set():
            assert heard.wait(20.0)
            written.set()

    field.crew.durability._hear_stops = hear_stops
    field.disk.within = within
    field.say(kind=Kind.STOP)
    field.run(0.02, ticking=False)
    assert body.stopped
    field.run(0.1, ticking=False)
    assert field.outcomes()["stopped"] == 2 * ROBOTS_HERE
    assert r0.groups == frozenset()
    field.run(0.5)
    assert r0.groups == {"crew"}


def test_a_swarm_whose_disk_refuses_stops_and_says_so(field: StoredField) -> None:
    field.run(0.5)
    field.disk.fails = True
    field.say(kind=Kind.STOP)
    field.run(0.5)
    assert all(body.stopped for body in field.crew.simulator.robots[:ROBOTS_HERE])
    assert field.outcomes() == {"stopped: not stored": ROBOTS_HERE}
    field.say("x", kind=Kind.ASK)
    field.say("(JOIN crew)")
    field.run(0.5)
    assert field.outcomes() == {
        "stopped: not stored": ROBOTS_HERE,
        "answer": ROBOTS_HERE,
        "matched: not stored": ROBOTS_HERE,
    }
    assert not field.disk.file.with_name("crew.store.marker").exists(), "so the next life begins stopped"


def test_a_body_that_does_not_rest_says_that_too(field: StoredField) -> None:
    node = field.crew.members[3].node

    def broken() -> None:
        raise SleepcastError("the brake is broken")

    node.memory.variables.stop = broken  # type: ignore[method-assign]
    field.disk.fails = True
    field.say(kind=Kind.STOP)
    field.run(0.2)
    assert field.outcomes() == {"stopped: not stored": ROBOTS_HERE - 1, "stopped: the brake is broken; not stored": 1}


def a_change_of_keys(field: StoredField, folder: Path) -> Path:
    """A change of keys goes out to robots with a trust file."""
    file, trust = folder / "trust.json", field.receiver.delivery.admission.trust
    save_trust(trust, file)
    keeper = TrustKeeper(trust, file, field.clock, field.said.append)
    trust.keep, field.crew.keeper = keeper, KeysFirst(keeper, field.disk)
    for member in field.crew.members:
        member.keeper, member.node.keys_last = field.crew.keeper, lambda: keeper.lasts
    body: dict[str, object] = {KEYS: KeyChange((NEW,)).written()}
    field.desk.send(Message("desk", 1, 1, Kind.COMMAND, field.clock.now() - 1_000.0, standing=True, body=body))
    return file


def test_keys_are_stored_before_the_store_says_that_they_came(field: StoredField, tmp_path: Path) -> None:
    field.run(0.5)
    file = a_change_of_keys(field, tmp_path)
    trusted: list[bool] = []
    field.disk.within = lambda: trusted.append(load_trust(file).find(NEW.id) is not None)
    field.run(0.5)
    assert field.outcomes() == {"matched": ROBOTS_HERE}
    assert trusted
    assert all(trusted)


def test_keys_that_cannot_be_stored_count_and_their_answer_says_so(field: StoredField, tmp_path: Path) -> None:
    field.run(0.5)
    file = a_change_of_keys(field, tmp_path)
    file.unlink()
    file.mkdir()
    field.run(0.5)
    field.say(kind=Kind.STOP)
    field.run(0.2)
    assert field.outcomes() == {"matched: not stored": ROBOTS_HERE, "stopped": ROBOTS_HERE}, (
        "a STOP is not among the keys"
    )
    assert field.receiver.delivery.admission.trust.find(NEW.id)
    assert [sentence for sentence in field.said if "cannot" in sentence] == field.said
    assert len(field.said) == 1, "which is tried again, and told once"
    file.rmdir()
    field.run(6.0)
    assert load_trust(file).find(NEW.id)


class Stops(Desk):
    """A desk from which STOPs come while the disk writes."""

    def __init__(self, **due: str) -> None:
        super().__init__(**due)
        self.sudden: list[Message] = []
        self.next: list[Message] = []

    def receive(self) -> list[Message]:
        found, self.next = self.next, []
        return found + super().receive()

    def stops(self) -> list[Message]:
        found, self.sudden = self.sudden, []
        return found


def test_a_robots_disk_holds_up_no_stop(tmp_path: Path) -> None:
    desk = Stops(at3="(DRIVE 2m/s 0)", at5="(JOIN crew)")
    run, said = Run(tmp_path, desk), list[str]()
    disk = Disk(tmp_path / "r0.store", ManualClock(5.0), said.append)
    disk.adopt(run.node, None)

    def within() -> None:
        """The disk is not done before the body has stopped."""
        if run.watch.ticks == 5 and not run.body.stopped:
            desk.sudden = [Message("desk", 0, 77, Kind.STOP, 0.0)]
            until = time.monotonic() + 20.0
            while not run.body.stopped:
                assert time.monotonic() < until
                time.sleep(0.001)
            assert [message.body["outcome"] for message in desk.heard] == ["matched"], "answers wait for it"

    disk.within = within
    mind = EmbodiedMind(run.node, run.body, run.clock, desk, run.watch, disk, run.clock.now())
    run_robots([mind], run.clock, tick=TICK, going=run.going(8), sleep=run.sleep)
    disk.close()
    assert [message.body["outcome"] for message in desk.heard] == ["matched", "stopped", "matched"]
    assert said == []


# ---- the cases that small computers are tried with as well


class Crewed:
    """A swarm to which all is done that `durable_cases` says: its desk, its air and its files stay."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.field, self._changes = folder, StoredField(folder), 0
        self._keep()

    def _keep(self) -> None:
        field, trust = self.field, self.field.receiver.delivery.admission.trust
        self.trust_file = self.folder / "trust.json"
        field.crew.keeper = KeysFirst(TrustKeeper(trust, self.trust_file, field.clock, field.said.append), field.disk)
        trust.keep = keys = field.crew.keeper.keys
        for member in field.crew.members:
            member.keeper, member.node.keys_last = field.crew.keeper, lambda: keys.lasts

    def say(self, do: Do) -> tuple[object, object]:
        self.field.heard.clear()
        if do is Do.KEYS:
            self._changes += 1
            change = KeyChange((PublicKey(f"a{self._changes}", Role.OPERATOR, bytes([self._changes]) * 32),))
            body: dict[str, object] = {KEYS: change.written()}
            now = self.field.clock.now() - 1_000.0
            self.field.desk.send(Message("desk", 1, 1, Kind.COMMAND, now, standing=True, body=body))
        else:
            self.field.say(kind=Kind.STOP if do is Do.STOP else Kind.RELEASE)
        self.field.run(0.3)
        found = [message.body for message in self.field.heard if message.kind is Kind.ANSWER]
        latest = max(found, key=lambda body: int(str(body["command"]).partition(".")[2]))  # others were sent again
        answers = [body for body in found if body["command"] == latest["command"]]
        ((outcome, fault),) = {(body["outcome"], body["fault"]) for body in answers}
        assert len(answers) == len(self.field.crew.members)
        return outcome, fault

    def refuse(self) -> None:
        query_only(self.field.disk, True)
        self.trust_file.rename(self.trust_file.with_suffix(".aside"))
        self.trust_file.mkdir()

    def mend(self) -> None:
        query_only(self.field.disk, False)
        self.trust_file.rmdir()
        self.trust_file.with_suffix(".aside").rename(self.trust_file)

    def restart(self) -> bool:
        kill(self.field.disk)
        self.field.live_again(self.folder)
        self._keep()
        (stopped,) = {member.node.stopped for member in self.field.crew.members}
        return stopped

    def close(self) -> None:
        self.field.close()


class Embodied:
    """A mind in a body, as a node and a bridge run it, to which the same is done."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.said, self.clock, self._count = folder, list[str](), ManualClock(100.0), 0
        self.trust, self.trust_file = Trust((DESK.public,)), folder / "trust.json"
        save_trust(self.trust, self.trust_file)
        self._live()

    def _live(self) -> None:
        self.run, self.desk = Run(self.folder, Stops()), Stops()
        self.disk = Disk(self.folder / "r0.store", self.clock, self.said.append)
        self.disk.adopt(self.run.node, None)
        keys = TrustKeeper(self.trust, self.trust_file, self.clock, self.said.append)
        self.trust.keep, self.keeper, self.run.node.keys_last = keys, KeysFirst(keys, self.disk), lambda: keys.lasts

    def say(self, do: Do) -> tuple[object, object]:
        self._count += 1
        kind, body = Kind.STOP if do is Do.STOP else Kind.RELEASE, dict[str, object]()
        if do is Do.KEYS:
            change = KeyChange((PublicKey(f"a{self._count}", Role.OPERATOR, bytes([self._count]) * 32),))
            kind, body = Kind.COMMAND, {KEYS: change.written()}
            self.trust.take(change)
        self.desk.next = [
            Message("desk", 1, self._count, kind, 0.0, standing=do is Do.KEYS, body=body, role="commander")
        ]
        self.desk.heard.clear()
        mind = EmbodiedMind(self.run.node, self.run.body, self.clock, self.desk, self.run.watch, self.keeper, 100.0)
        run_robots([mind], self.clock, tick=TICK, going=self.run.going(self.run.watch.ticks + 3), sleep=self._sleep)
        ((outcome, fault),) = [
            (each.body["outcome"], each.body["fault"]) for each in self.desk.heard if each.kind is Kind.ANSWER
        ]
        return outcome, fault

    def _sleep(self, seconds: float) -> None:
        self.clock.advance(seconds)

    def refuse(self) -> None:
        query_only(self.disk, True)
        self.trust_file.rename(self.trust_file.with_suffix(".aside"))
        self.trust_file.mkdir()

    def mend(self) -> None:
        query_only(self.disk, False)
        self.trust_file.rmdir()
        self.trust_file.with_suffix(".aside").rename(self.trust_file)

    def restart(self) -> bool:
        kill(self.disk)
        self._live()
        return self.run.node.stopped

    def close(self) -> None:
        self.disk.close()


@pytest.mark.parametrize("sort", [Crewed, Embodied])
def test_what_it_answers_is_stored_or_it_says_so(tmp_path: Path, sort: type[Crewed | Embodied]) -> None:
    with closing(sort(tmp_path)) as robot:
        try_all(robot)
