"""What robots know outlives them: each command is evaluated once, whenever the process ends."""

from __future__ import annotations

import gzip
import shutil
import sqlite3
import subprocess
import sys
from collections import Counter
from contextlib import closing
from pathlib import Path
from random import Random

import pytest

from channel.air import DESK
from node.afloat import NOTES, TICK, Afloat, KilledError, Living, World
from sleepcast.channel import Kind, Message
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.core.clock import ManualClock
from sleepcast.mind.auction import GrantMessage
from sleepcast.mind.instants import EqualClocks
from sleepcast.node.node import Node
from sleepcast.node.state import mind_of
from sleepcast.node.store import InUseError, Store, StoreError

OF_0_2_0 = Path(__file__).resolve().parent.parent / "of_0_2_0"


def rules(robot: Living) -> list[tuple[str, str, bool]]:
    return [(rule.name, rule.text, rule.active) for rule in robot.node.rules()]


@pytest.mark.parametrize("seed", [1, 2])
def test_every_command_is_evaluated_once_whatever_happens(tmp_path: Path, seed: int) -> None:
    fleet = Afloat(4, tmp_path, seed, loss=0.3, twice=0.1, delay=0.06)
    sent: dict[str, Message] = {}
    numbers: dict[str, int] = {}
    first = fleet.post("(DEFVAR total 0)", standing=True)
    for number in range(1, 80):
        standing = number % 5 == 0
        text = f"(SETQ total (+ total {number}))" if standing else f"(NOTE {number})"
        message = fleet.post(text, standing=standing)
        sent[message.id], numbers[message.id] = message, number
        fleet.run(0.1, deaths=0.5)
    fleet.run(12.0)
    for robot in fleet.robots:
        assert robot.store.new_epoch(robot.name) > 0
        journal = robot.journal()
        times = Counter(command for command, _, _, _ in journal)
        assert times[first.id] == 1
        assert set(times.values()) == {1}, "each was evaluated once"
        outcomes = {command: (outcome, time) for command, _, time, outcome in journal}
        stood = [numbers[id] for id, message in sent.items() if message.standing]
        assert robot.node.evaluate("total").value == sum(stood), "each rule has done once what it does"
        done = Counter(robot.world.done)
        assert set(done.values()) <= {1}, "nothing was done twice"
        for id, message in sent.items():
            outcome, time = outcomes.get(id, ("never came", 0.0))
            if message.standing:
                assert outcome == "matched"
            elif outcome == "matched":
                assert numbers[id] in done
                assert time <= message.deadline
            else:
                assert outcome in ("interrupted", "late", "never came")
        assert robot.said == []


def test_who_was_off_for_fifty_changes_of_two_desks_has_the_same_rules(tmp_path: Path) -> None:
    fleet = Afloat(5, tmp_path, seed=7, loss=0.3, twice=0.1, delay=0.05)
    other = fleet.air.another_desk()
    fleet.run(0.5)
    away = fleet.robots[2]
    away.die()
    away.wakes = fleet.air.clock.now() + 60.0
    for number in range(50):
        desk = other if fleet.chance.random() < 0.4 else fleet.air.desk
        name = f"r{fleet.chance.randrange(6)}"
        change = fleet.chance.choice((f"(RULE {name} {number})", f"(DEACTIVATE {name})", f"(FORGET {name})"))
        fleet.post(f"(RULE {name} {number})" if number < 10 else change, standing=True, desk=desk)
        fleet.run(fleet.chance.random() * 0.1)
    fleet.run(away.wakes - fleet.air.clock.now() + 5.0)
    assert away.party.on
    assert rules(fleet.robots[0])
    assert all(rules(robot) == rules(fleet.robots[0]) for robot in fleet.robots)


def one(folder: Path) -> tuple[Afloat, Living]:
    fleet = Afloat(1, folder, seed=3)
    fleet.run(0.2)
    return fleet, fleet.robots[0]


def test_a_robot_goes_on_with_what_it_had_learned(tmp_path: Path) -> None:
    fleet, robot = one(tmp_path)
    told = (
        *("(DEFVAR n 3)", "(JOIN crew)", "(DEFUN twice (x) (* 2 x))", "(RULE count (SETQ n (+ n 1)))"),
        *("(RULE rest (twice n))", "(DEACTIVATE rest)", "(SETQQ E7 (twice 4))", "(LEASE count 100)", "(MARK)"),
    )
    for text in told:
        fleet.post(text)
    fleet.run(1.5)
    before = robot.node.evaluate("n").value
    robot.die()
    fleet.run(2.0)
    robot.begin()
    assert before - 1.0 / 0.05 <= robot.node.evaluate("n").value <= before, "what rules do is kept once a second"
    assert robot.node.evaluate("(AND (IN crew) marked (= (twice 4) 8) (= E7 8))").value == 1.0
    assert rules(robot) == [
        ("E7", "(twice 4)", False),
        ("count", "(SETQ n (+ n 1))", True),
        ("rest", "(twice n)", False),
    ]
    (lease,) = (rule.lease for rule in robot.node.rules() if rule.name == "count")
    assert 94.0 < lease < 98.0, "it went on while the robot was away"
    assert robot.said == []


def hire(fleet: Afloat, robot: Living) -> Message:
    """Let a robot join a group and get a rule for as long as it is chosen."""
    poll = fleet.post("(BEST 1 1 TRUE (PROGN (JOIN crew) (RULE shine (MARK))))")
    fleet.run(0.3)
    assert robot.node.auctions is not None
    (bid,) = (each.bid for each in robot.node.auctions.bidding._open)
    grants = GrantMessage(poll.sequence, True, {robot.name: max(bid.beats)}, ())
    fleet.air.desk.delivery.post(Kind.REQUEST, fleet.air.clock.now(), body=grants.body())
    fleet.run(0.3)
    return poll


def test_what_a_robot_is_by_a_lease_ends_with_its_life_and_a_bid_does_too(tmp_path: Path) -> None:
    fleet, robot = one(tmp_path)
    poll = hire(fleet, robot)
    assert robot.node.evaluate("(IN crew)").value == 1.0
    assert rules(robot) == [("shine", "(MARK)", True)]
    later = fleet.post("(BEST 1 1 TRUE (NOTE 3))")
    fleet.run(0.3)
    robot.die()
    robot.begin()
    fleet.run(0.3)
    assert robot.node.evaluate("(IN crew)").value == 0.0
    assert rules(robot) == []
    assert [(m.body["command"], m.body["outcome"]) for m in robot.answers] == [
        (poll.id, "matched"),
        (later.id, "fault"),
    ]
    assert robot.world.done == []
    assert mind_of(robot.node).endings == ()


def test_what_waits_for_an_instant_outlives_a_robot_and_what_came_meanwhile_is_told(tmp_path: Path) -> None:
    fleet, robot = one(tmp_path)
    robot.node.timing.clocks = EqualClocks()
    soon, later = fleet.post("(AFTER-ISSUE 1s (NOTE 1))"), fleet.post("(AFTER-ISSUE 4s (NOTE 2))")
    fleet.run(0.3)
    assert [m.body["waiting"] for m in robot.answers] == [True, True]
    robot.die()
    fleet.air.run(1.0)
    robot.begin()
    robot.node.timing.clocks = EqualClocks()
    fleet.run(4.0)
    assert robot.world.done == [2.0]
    first, second = robot.answers[2:]
    assert (first.body["command"], first.body["outcome"]) == (soon.id, "fault")
    assert str(first.body["fault"]).startswith("its instant came while the robot was restarted")
    assert (second.body["command"], second.body["outcome"]) == (later.id, "matched")
    assert mind_of(robot.node).waiting == ()


def test_a_rule_that_a_later_command_has_changed_outlives_the_lease_and_a_restart(tmp_path: Path) -> None:
    fleet, robot = one(tmp_path)
    hire(fleet, robot)
    fleet.post("(RULE shine (UNMARK))")
    fleet.run(0.3)
    robot.die()
    robot.begin()
    fleet.run(0.3)
    assert robot.node.evaluate("(IN crew)").value == 0.0
    assert rules(robot) == [("shine", "(UNMARK)", True)]


def test_stop_holds_over_a_death_and_built_in_rules_are_nobodys(tmp_path: Path) -> None:
    fleet, robot = one(tmp_path)
    robot.node.install("keep", "(NOTE 1)")
    fleet.post("(RULE mine (NOTE 2))", standing=True)
    fleet.run(6.0)
    for text in ("(RULE keep (NOTE 3))", "(FORGET keep)", "(DEACTIVATE keep)", "(RULE mine (FOO 1))"):
        fleet.post(text)
    fleet.run(0.3)
    assert [m.body["outcome"] for m in robot.answers] == ["matched", "fault", "fault", "fault", "matched"]
    fleet.post("(ROLLBACK)")
    fleet.run(0.3)
    assert rules(robot) == [("keep", "(NOTE 1)", True), ("mine", "(NOTE 2)", True)]
    fleet.air.desk.delivery.post(Kind.STOP, fleet.air.clock.now())
    fleet.run(0.3)
    robot.die()
    robot.begin()
    assert robot.node.stopped
    assert rules(robot) == [("mine", "(NOTE 2)", True)], "what is built in is given anew to each life"
    done = len(robot.world.done)
    fleet.run(0.3)
    assert len(robot.world.done) == done
    fleet.air.desk.delivery.post(Kind.RELEASE, fleet.air.clock.now())
    fleet.run(0.3)
    assert len(robot.world.done) > done
    assert [outcome for _, kind, _, outcome in robot.journal() if kind != "command"] == ["stopped", "released"]


def test_a_store_that_cannot_be_written_stops_nobody(tmp_path: Path) -> None:
    fleet, robot = one(tmp_path)
    connection = robot.store._connection
    assert connection is not None
    connection.execute("PRAGMA query_only = 1")
    for number in range(5):
        fleet.post(f"(NOTE {number})")
    fleet.run(1.0)
    assert robot.world.done == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert len(robot.said) == 1
    assert "cannot be written: attempt to write a readonly database" in robot.said[0]
    connection.execute("PRAGMA query_only = 0")
    fleet.run(6.0)
    assert robot.said[1:] == [f"{robot.file} is written again, with everything that had to wait"]
    assert [outcome for *_, outcome in robot.journal()] == ["matched"] * 5


FULL = """
import resource, signal, sys
from pathlib import Path
sys.path[:0] = sys.argv[2:]
from node.afloat import Afloat
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
fleet = Afloat(1, Path(sys.argv[1]), seed=4)
fleet.run(0.2)
resource.setrlimit(resource.RLIMIT_FSIZE, (1, 1))
for number in range(5):
    fleet.post(f"(NOTE {number})")
fleet.run(1.0)
robot, = fleet.robots
print(robot.world.done, robot.said)
"""


def test_a_disk_without_room_stops_nobody(tmp_path: Path) -> None:
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(tmp_path), str(root / "src"), str(root / "tests")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "[0.0, 1.0, 2.0, 3.0, 4.0] ['" in done.stdout
    assert "cannot be written" in done.stdout


def test_a_store_where_nothing_can_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("this is no folder")
    said: list[str] = []
    store = Store(tmp_path / "file" / "r1.store", ManualClock(5.0), said.append)
    node = Node("r1", NOTES, body=World(), on_air=True)
    assert store.adopt(node, None) is False
    assert node.stopped, "it may have been stopped in a life of which nothing could be kept"
    assert "r1: its store cannot be written, so a STOP may be forgotten" in store.standing()
    node.receive(Message("desk", 1, 1, Kind.RELEASE, 0.0))
    node.receive(Message("desk", 1, 2, Kind.COMMAND, 0.0, text="(NOTE 1)"))
    if store.before():
        store.write()
    node.think(1, 0.0)
    if store.after():
        store.write()
    store.close()
    assert node.body.done == [1.0]  # type: ignore[union-attr]
    (complaint,) = said
    assert "cannot be written: " in complaint
    assert "after a restart everything since now will have been forgotten" in complaint


def test_what_can_only_be_read_is_read(tmp_path: Path) -> None:
    fleet, robot = one(tmp_path)
    fleet.post("(RULE a 1)", standing=True)
    fleet.run(1.0)
    robot.die()
    fleet.air.desk.on = False
    lock = robot.file.with_name(f"{robot.file.name}.lock")
    lock.unlink()
    lock.mkdir()
    robot.begin()
    assert "cannot be written: Is a directory" in robot.said[0]
    assert rules(robot) == [("a", "1", True)]
    fleet.run(1.0)


def test_a_damaged_store_is_set_aside(tmp_path: Path) -> None:
    fleet, robot = one(tmp_path)
    fleet.post("(RULE a 1)", standing=True)
    fleet.run(1.0)
    robot.die()
    with closing(sqlite3.connect(robot.file)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    data = robot.file.read_bytes()
    robot.file.write_bytes(data[:100] + bytes(b ^ 0xFF for b in data[100:]))
    robot.begin()
    (complaint,) = robot.said
    assert "was damaged (" in complaint
    assert f"set aside as {robot.file.name}.broken-" in complaint
    assert rules(robot) == []
    fleet.run(5.0)
    assert rules(robot) == [("a", "1", True)], "it has come again, from the desk"


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        ("PRAGMA user_version = 3", "is a store of format 3, and this sleepcast reads 2: take a newer one"),
        ("PRAGMA application_id = 5", "is an SQLite file, but no store of a robot"),
    ],
)
def test_what_is_no_store_of_ours_is_refused_and_left_alone(tmp_path: Path, spoil: str, complaint: str) -> None:
    fleet, robot = one(tmp_path)
    robot.die()
    with closing(sqlite3.connect(robot.file)) as connection:
        connection.execute(spoil)
    robot.file.with_name(f"{robot.file.name}.marker").unlink()  # which says that it was one of ours
    before = robot.file.read_bytes()
    with pytest.raises(StoreError, match=complaint):
        Store(robot.file, fleet.air.clock, robot.said.append)
    assert robot.file.read_bytes() == before


def test_a_text_is_no_store_and_is_left_alone(tmp_path: Path) -> None:
    file = tmp_path / "notes.txt"
    file.write_text("what to buy\n" * 200)
    with pytest.raises(StoreError, match="is a text and no store of a robot"):
        Store(file, ManualClock(5.0), pytest.fail)
    assert file.read_text() == "what to buy\n" * 200


@pytest.mark.parametrize(
    "spoil",
    [
        "UPDATE streams SET robot = 7",
        "UPDATE standing SET datagrams = x'00'",
        "UPDATE robots SET mind = x'7801ffff'",
        "INSERT INTO taken (robot, command, begun, message) VALUES (1, 'x', 0, x'81a173c0')",
        "DROP TABLE windows",
    ],
)
def test_a_store_with_nonsense_in_it_is_told(tmp_path: Path, spoil: str) -> None:
    fleet, robot = one(tmp_path)
    fleet.post("(RULE a 1)", standing=True)
    fleet.run(1.0)
    robot.die()
    with closing(sqlite3.connect(robot.file)) as connection:
        connection.execute(spoil)
        connection.commit()
    robot.begin()
    assert len(robot.said) == 1
    fleet.run(5.0)
    assert rules(robot) == [("a", "1", True)]


def test_one_process_at_a_time(tmp_path: Path) -> None:
    fleet, robot = one(tmp_path)
    with pytest.raises(InUseError, match="is in use: does a robot of this name run already"):
        Store(robot.file, fleet.air.clock, robot.said.append)


def test_what_a_robot_cannot_have_any_more_is_told(tmp_path: Path) -> None:
    fleet, robot = one(tmp_path)
    fleet.post("(RULE a (NOTE 1))", standing=True)
    fleet.run(1.0)
    robot.die()
    store = Store(robot.file, fleet.air.clock, robot.said.append)
    node = Node(robot.name, NOTES, body=World(), on_air=True)
    node.install("a", "(NOTE 2)")
    assert store.adopt(node, None)
    assert robot.said == [f"{robot.name}: a is built in now, so what it was over the air is forgotten"]
    assert [rule.text for rule in node.rules()] == ["(NOTE 2)"]
    store.close()


def ticks(fleet: Afloat, robot: Living) -> None:
    """For ever, if nothing ends it."""
    while True:
        fleet.air.run(TICK)
        robot.tick()


def test_a_rule_that_ends_the_process_is_not_begun_for_ever(tmp_path: Path) -> None:
    fleet, robot = one(tmp_path)
    deadly = fleet.post("(RULE a 1)", standing=True)
    for _ in range(3):
        robot.node.dies = 0
        with pytest.raises(KilledError):
            ticks(fleet, robot)
        robot.die()
        robot.begin()
    fleet.post("(RULE b 2)", standing=True)
    fleet.run(2.0)
    assert next((command, outcome) for command, _, _, outcome in robot.journal()) == (deadly.id, "interrupted")
    assert rules(robot) == [("b", "2", True)]


def test_an_operators_commands_have_one_order_over_his_lives(tmp_path: Path) -> None:
    fleet = Afloat(3, tmp_path, seed=9, loss=0.3, twice=0.1, delay=0.05)
    sent = []
    for life in range(8):
        with closing(Store(tmp_path / "desk.store", fleet.air.clock, pytest.fail)) as store:
            party = fleet.air.another_desk()
            epoch, first = store.numbers("desk")
            party.delivery = ReliableDelivery(
                "desk", epoch, DESK, party.delivery.admission, Random(life), first=first, keep=store.keep
            )
            store.adopt_operator(party.delivery)
            for number in range(3):
                sent.append(fleet.post(f"(NOTE {3 * life + number})", standing=number == 1, desk=party))
                fleet.run(fleet.chance.random() * 0.2)
            party.on = False
    fleet.run(10.0)
    assert len({message.epoch for message in sent}) == 1
    assert [message.body["after"] for message in sent] == [0, *(message.sequence for message in sent[:-1])]
    standing = {float(place) for place, message in enumerate(sent) if message.standing}
    for robot in fleet.robots:
        assert robot.world.done == sorted(set(robot.world.done))
        assert standing <= set(robot.world.done)
        assert len(robot.world.done) >= 0.8 * len(sent)


def test_the_store_of_an_operator_loads_no_minds(tmp_path: Path) -> None:
    told = (
        "import sys\n"
        "from pathlib import Path\n"
        "from sleepcast.core.clock import UnixClock\n"
        "from sleepcast.node.store import Store\n"
        "store = Store(Path(sys.argv[1]), UnixClock(), print)\n"
        "store.numbers('desk')\n"
        "store.close()\n"
        "print([name for name in sys.modules if name in ('sleepcast.node.node', 'sleepcast.robot')])\n"
    )
    command = [sys.executable, "-c", told, str(tmp_path / "store")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_robots_whose_stores_are_copies_begin_different_lives(tmp_path: Path) -> None:
    """Also where no clock goes on: then two robots of one name are told apart, and noticed."""
    clock, file = ManualClock(0.0), tmp_path / "r1.store"
    with closing(Store(file, clock, print)) as store:
        before = store.new_epoch("r1")
        store.write()
    lives = set()
    for number in range(4):
        copy = tmp_path / f"copy{number}.store"
        shutil.copy(file, copy)
        with closing(Store(copy, clock, print)) as store:
            lives.add(store.new_epoch("r1"))
    assert len(lives) > 1
    assert min(lives) > before


def test_a_store_of_0_2_0_is_read_and_written_again(tmp_path: Path) -> None:
    """Of a swarm of two that has a variable, a group, a rule and a lease, and was stopped, released, and stopped."""
    file, said = tmp_path / "of.store", list[str]()
    shutil.copy(OF_0_2_0 / "stopped.store.marker", f"{file}.marker")
    file.write_bytes(gzip.decompress((OF_0_2_0 / "stopped.store.gz").read_bytes()))
    for _ in range(2):  # the second time as today's
        store = Store(file, ManualClock(1.8e9), said.append)
        for name in ("r1", "r2"):
            node = Node(name, NOTES)
            assert store.adopt(node, None)
            (held,) = node.authority.latch.holding
            assert held.named == ["desk", 1795895263595, 20]
            (ended,) = node.authority.latch.ended
            assert ended.life == held.life
            assert ended.number < held.number
            assert node.stopped
            assert node.evaluate("n").value == 3.0
            assert [(rule.name, rule.active) for rule in node.rules()] == [("keep", True)]
            assert node.groups == {"crew"}
        store.keep()
        store.close()
    assert said == []
