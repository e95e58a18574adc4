"""Stored, then answered: by minds in bodies and by swarms, on disks that are slow, full or broken."""

from __future__ import annotations

import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from loop.test_crew import Field
from loop.test_real import TICK, Desk, Run
from sleepcast.channel import Kind, Message
from sleepcast.channel.keyring import TrustKeeper, load_trust, save_trust
from sleepcast.channel.keys import KeyChange, PublicKey
from sleepcast.channel.message import KEYS, LEASE, Role
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import SleepcastError
from sleepcast.loop.durable import KeysFirst
from sleepcast.loop.real import EmbodiedMind, run_robots
from sleepcast.node.store import Store

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


class StoredField(Field):
    """A crew whose minds are stored."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.said: list[str] = []
        self.disk = Disk(folder / "crew.store", self.clock, self.said.append)
        for member in self.crew.members:
            self.disk.adopt(member.node, None)
            member.keeper = self.disk
        self.crew.keeper = self.disk

    def outcomes(self) -> dict[object, int]:
        found = [message.body for message in self.heard if message.kind is Kind.ANSWER]
        outcomes = [body["outcome"] if not body["fault"] else f"{body['outcome']}: {body['fault']}" for body in found]
        return {outcome: outcomes.count(outcome) for outcome in outcomes}


@pytest.fixture
def field(tmp_path: Path) -> Iterator[StoredField]:
    found = StoredField(tmp_path)
    yield found
    found.crew.durability.close()
    found.disk.close()
    found.bystander.close()
    found.desk.close()
    found.receiver.close()
    for member in found.crew.members:
        member.session.close()


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
    assert field.outcomes() == {"stopped": 20, "released": 20}
    field.say("(RULE a 1)", standing=True)
    field.desk.send(Message("desk", 1, 1, Kind.COMMAND, field.clock.now() - 1_000.0, body=LEASED))
    field.run(0.5)
    assert field.outcomes() == {"stopped": 20, "released": 20, "matched": 20, "not matched": 20}
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
    assert field.outcomes()["stopped"] == 40
    assert r0.groups == frozenset()
    field.run(0.5)
    assert r0.groups == {"crew"}


def test_a_swarm_whose_disk_refuses_stops_and_says_so(field: StoredField) -> None:
    field.run(0.5)
    field.disk.fails = True
    field.say(kind=Kind.STOP)
    field.run(0.5)
    assert all(body.stopped for body in field.crew.simulator.robots[:20])
    assert field.outcomes() == {"stopped: not stored": 20}
    field.say("x", kind=Kind.ASK)
    field.say("(JOIN crew)")
    field.run(0.5)
    assert field.outcomes() == {"stopped: not stored": 20, "answer": 20, "matched: not stored": 20}
    assert not field.disk.file.with_name("crew.store.marker").exists(), "so the next life begins stopped"


def test_a_body_that_does_not_rest_says_that_too(field: StoredField) -> None:
    node = field.crew.members[3].node

    def broken() -> None:
        raise SleepcastError("the brake is broken")

    node.memory.variables.stop = broken  # type: ignore[method-assign]
    field.disk.fails = True
    field.say(kind=Kind.STOP)
    field.run(0.2)
    assert field.outcomes() == {"stopped: not stored": 19, "stopped: the brake is broken; not stored": 1}


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
    assert field.outcomes() == {"matched": 20}
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
    assert field.outcomes() == {"matched: not stored": 20, "stopped": 20}, "a STOP is not among the keys"
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
