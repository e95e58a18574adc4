"""A store that is damaged, gone or old forgets no STOP: the robot stands, or it knows exactly what was written."""

from __future__ import annotations

import os
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import pytest

from node.afloat import NOTES, Afloat, Living, World
from sleepcast.channel import Kind
from sleepcast.core.clock import ManualClock
from sleepcast.node.node import Node
from sleepcast.node.store import Store
from sleepcast.node.store_file import Content, examine

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def folder() -> Iterator[Path]:
    """One in memory, where there is such a place: what is written is not waited for."""
    memory = Path("/dev/shm")
    with TemporaryDirectory(dir=memory if os.access(memory, os.W_OK) else None) as name:
        yield Path(name)


def one(folder: Path) -> tuple[Afloat, Living]:
    """A robot that has learned something, and its desk."""
    fleet = Afloat(1, folder, seed=3)
    fleet.run(0.2)
    for text in ("(DEFVAR n 3)", "(RULE mine (SETQ n 4))", "(JOIN crew)"):
        fleet.post(text, standing="JOIN" not in text)
    fleet.run(1.5)
    return fleet, fleet.robots[0]


def say(fleet: Afloat, kind: Kind) -> None:
    fleet.air.desk.delivery.post(kind, fleet.air.clock.now())
    fleet.run(0.3)


def moves(fleet: Afloat, robot: Living) -> bool:
    """Whether a command reaches its body."""
    done = len(robot.world.done)
    fleet.post("(NOTE 1)")
    fleet.run(1.0)
    return len(robot.world.done) > done


def marker(file: Path) -> Path:
    return file.with_name(f"{file.name}.marker")


def cut(file: Path, size: int) -> None:
    os.truncate(file, size)


def make_folder(file: Path) -> None:
    file.unlink()
    (file / "inside").mkdir(parents=True)


def flip_marker(file: Path) -> None:
    data = bytearray(marker(file).read_bytes())
    data[data.index(b":") + 1] ^= 1
    marker(file).write_bytes(data)


def make_first_format(file: Path) -> None:
    with closing(sqlite3.connect(file)) as connection:
        connection.execute("DROP TABLE seal")
        connection.execute("DROP VIEW journal")
        connection.execute("DROP TABLE arrivals")
        connection.execute("CREATE VIEW journal AS SELECT number, command, kind, time, outcome FROM evaluations")
        connection.execute("PRAGMA user_version = 1")


def other_number(file: Path) -> None:
    with closing(sqlite3.connect(file)) as connection:
        connection.execute("UPDATE streams SET done = done + 1")
        connection.commit()


SPOILT: dict[str, tuple[Callable[[Path], object], bool]] = {
    "was empty (it is empty)": (lambda file: cut(file, 0), True),
    "was damaged (database disk image is malformed)": (lambda file: cut(file, 9_000), True),
    "was damaged (file is not a database)": (lambda file: file.write_bytes(os.urandom(20_000)), True),
    "was damaged ({file} is a text and no store": (lambda file: file.write_text("what to buy\n" * 200), True),
    "was damaged ({file} is no file": (make_folder, True),
    "was damaged (its rows are not those": (other_number, True),
    "is gone, although r0.store.marker speaks of it": (lambda file: file.unlink(), False),
    "has lost its marker": (lambda file: marker(file).unlink(), False),
    "has a damaged marker": (flip_marker, False),
    "is of an older format": (make_first_format, False),
}


@pytest.mark.parametrize("said", SPOILT)
def test_a_robot_whose_store_is_in_doubt_stands_until_release(folder: Path, said: str) -> None:
    fleet, robot = one(folder)
    assert moves(fleet, robot)
    robot.store.close()
    robot.party.on = False
    spoil, aside = SPOILT[said]
    spoil(robot.file)
    damaged = robot.file.read_bytes() if robot.file.is_file() else b""
    for life in range(2):
        robot.begin()
        assert robot.node.stopped
        assert robot.node.doubt.startswith("its store ")
        assert "r0: its store" in robot.store.standing()
        fleet.run(8.0)
        assert [rule.text for rule in robot.node.rules()] == ["(SETQ n 4)"], "kept, or come again from the desk"
        assert not moves(fleet, robot)
        if life == 0:
            (complaint,) = robot.said
            assert f"{robot.file} {said.format(file=robot.file)}" in complaint
            assert (f"set aside as {robot.file.name}.broken-" in complaint) == aside
        robot.die()
    robot.begin()
    say(fleet, Kind.RELEASE)
    assert moves(fleet, robot)
    assert robot.node.doubt == ""
    robot.die()
    robot.begin()
    assert moves(fleet, robot), "and it needs no other RELEASE"
    assert len(robot.said) == 1
    kept = [path for path in folder.iterdir() if ".broken-" in path.name and path.suffix[-4:] not in ("-wal", "-shm")]
    assert len(kept) == aside
    assert not kept or kept[0].is_dir() or kept[0].read_bytes() == damaged


def test_an_old_copy_is_noticed_and_so_is_a_later_one(folder: Path) -> None:
    fleet, robot = one(folder)
    copies = []
    for kind in (Kind.STOP, Kind.RELEASE, Kind.STOP):
        robot.store.close()
        copies.append(robot.file.read_bytes())
        robot.begin()
        say(fleet, kind)
    robot.store.close()
    for number in (0, 2):  # before the first STOP, and between RELEASE and the second
        robot.file.write_bytes(copies[number])
        robot.begin()
        assert robot.node.doubt == ("its store is an old copy" if number == 0 else "its store is not the one it had")
        assert not moves(fleet, robot)
        robot.store.close()


def test_a_store_whose_log_was_removed_is_old(folder: Path) -> None:
    fleet, _ = one(folder)
    say(fleet, Kind.STOP)
    for ending in ("", "-wal"):
        assert (folder / f"r0.store{ending}").exists()
    killed = folder / "killed"
    killed.mkdir()
    for name in ("r0.store", "r0.store.marker"):
        shutil.copy(folder / name, killed / name)
    node = begun(killed / "r0.store")
    assert node.stopped
    assert node.doubt


def begun(file: Path) -> Node:
    """A robot that begins its life with this store."""
    store = Store(file, ManualClock(2_000.0), lambda said: None)
    node = Node("r0", NOTES, body=World(), on_air=True)
    store.adopt(node, None)
    store._unlock()  # it is killed
    assert store._connection is not None
    store._connection.close()
    return node


def spoilt_at_random(data: bytes, chance: Random) -> bytes:
    """A bit or a byte is another one, a sector is empty, or the end is missing."""
    found, place = bytearray(data), chance.randrange(len(data))
    match chance.randrange(6):
        case 0:
            return data[:place]
        case 1:
            start = place // 512 * 512
            found[start : start + 512] = bytes(len(found[start : start + 512]))
        case 2:
            found[place] = chance.randrange(256)
        case _:
            found[place] ^= 1 << chance.randrange(8)
    return bytes(found)


@pytest.mark.parametrize("closed", [True, False], ids=["closed", "killed"])
@pytest.mark.parametrize("stopped", [True, False], ids=["stopped", "free"])
def test_damage_anywhere_is_noticed_or_changes_nothing(folder: Path, closed: bool, stopped: bool) -> None:
    fleet, robot = one(folder)
    say(fleet, Kind.STOP if stopped else Kind.RELEASE)
    if closed:
        robot.store.close()
    names = [name for name in ("r0.store", "r0.store-wal", "r0.store.marker") if (folder / name).exists()]
    assert len(names) == (2 if closed else 3)
    whole = {name: (folder / name).read_bytes() for name in names}
    chance, trial = Random(7), folder / "trial"
    noticed, written = 0, Content()
    for number in range(121):
        trial.mkdir()
        spoilt = chance.choices(names, [len(whole[name]) for name in names])[0] if number else ""
        for name, data in whole.items():
            (trial / name).write_bytes(spoilt_at_random(data, chance) if name == spoilt else data)
        found = examine(trial / "r0.store")
        node = begun(trial / "r0.store")
        if not number:
            assert found.content is not None
            assert not found.doubt
            written = found.content
        assert node.stopped == (stopped or bool(found.doubt))
        if not found.doubt:
            assert found.content == written, (number, spoilt)
        noticed += bool(found.doubt)
        shutil.rmtree(trial)
    assert noticed > 30, "the rest was in places that hold nothing"


FULL = """
import resource, signal, sys
from pathlib import Path
sys.path[:0] = sys.argv[2:]
from node.test_integrity import Kind, one, say
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
fleet, robot = one(Path(sys.argv[1]))
resource.setrlimit(resource.RLIMIT_FSIZE, (1, 1))
say(fleet, Kind.STOP)
print(robot.said, [answer.body["outcome"] for answer in robot.answers][-1])
"""

CLOSED = """
import os, resource, sys
from pathlib import Path
sys.path[:0] = sys.argv[2:]
from node.test_integrity import Node, NOTES, ManualClock, Store, World
if os.getuid() == 0:
    os.setuid(65534)
said = []
store = Store(Path(sys.argv[1]), ManualClock(2_000.0), said.append)
node = Node("r0", NOTES, body=World(), on_air=True)
store.adopt(node, None)
print(node.stopped, node.doubt, said)
"""


def run(program: str, *arguments: object) -> str:
    paths = map(str, (*arguments, ROOT / "src", ROOT / "tests"))
    done = subprocess.run([sys.executable, "-c", program, *paths], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_stop_that_found_no_room_on_the_disk_holds_over_a_restart(folder: Path) -> None:
    said = run(FULL, folder)
    assert "cannot be written" in said
    assert said.strip().endswith("stopped")
    node = begun(folder / "r0.store")
    assert node.stopped
    assert node.doubt == "its store has lost its marker"


def test_a_store_that_may_not_be_read_leaves_the_body_standing(folder: Path) -> None:
    _, robot = one(folder)
    robot.store.close()
    folder.chmod(0o755)
    before = robot.file.read_bytes()
    robot.file.chmod(0)
    try:
        said = run(CLOSED, robot.file)
    finally:
        robot.file.chmod(0o600)
    assert said.startswith("True its store cannot be written")
    assert "Permission denied" in said
    assert robot.file.read_bytes() == before


KILLED = """
# What is lost when a process is killed at any moment of its life, or while it mends a store that was cut.
import os, signal, sys, time
from pathlib import Path
from random import Random
sys.path[:0] = sys.argv[2:]
from node.test_integrity import Kind, Node, NOTES, World, Store
from sleepcast.channel.message import Message
from sleepcast.core.clock import UnixClock

def begin(file):
    store, node = Store(file, UnixClock(), lambda said: None), Node("r0", NOTES, body=World(), on_air=True)
    store.adopt(node, None)
    return store, node

def live(file, cut):
    number = 0
    while True:
        store, node = begin(file)
        if bool(node.doubt) != cut:
            os._exit(4)
        for tick in range(4):
            for kind in (Kind.COMMAND,) if cut else (Kind.STOP, Kind.COMMAND, Kind.RELEASE):
                number += 1
                node.receive(Message("desk", time.time_ns(), number, kind, 0.0, text=f"(RULE a {number})"))
            if store.before():
                store.write()
            node.think(tick, 0.0)
            if store.after():
                store.write()
        store.close()

chance = Random(11)
for trial in range(80):
    file, cut = Path(sys.argv[1]) / f"{trial // 4}.store", trial % 4 == 3
    if cut:
        os.truncate(file, 9000)
    child = os.fork()
    if not child:
        live(file, cut)
    time.sleep(0.05 * chance.random() ** 2)
    os.kill(child, signal.SIGKILL)
    status = os.waitpid(child, 0)[1]
    assert os.WIFSIGNALED(status), os.waitstatus_to_exitcode(status)
    store, node = begin(file)
    assert bool(node.doubt) == cut, (trial, node.doubt)
    store.close()
print("well")
"""


def test_a_kill_at_any_moment_is_no_damage(folder: Path) -> None:
    assert run(KILLED, folder) == "well\n"


def test_who_loses_store_and_marker_on_purpose_begins_anew(folder: Path) -> None:
    fleet, robot = one(folder)
    say(fleet, Kind.STOP)
    robot.die()
    for path in folder.glob("r0.store*"):
        path.unlink()
    fleet.air.desk.on = False
    robot.begin()
    assert not robot.node.stopped
    assert robot.said == []


def test_a_robot_that_was_not_there_when_its_store_was_lost_stands_later(folder: Path) -> None:
    _, robot = one(folder)
    robot.store.close()
    robot.file.write_bytes(b"")
    begun(robot.file)
    store = Store(robot.file, ManualClock(3_000.0), pytest.fail)
    later = Node("r7", NOTES, body=World(), on_air=True)
    store.adopt(later, None)
    assert later.doubt == "its store was empty"
    store.close()


def test_an_operator_with_an_old_store_begins_a_new_life(folder: Path) -> None:
    file, clock, said = folder / "desk.store", ManualClock(1_000.0), list[str]()
    with closing(Store(file, clock, pytest.fail)) as store:
        first = store.numbers("desk")
    old = file.read_bytes()
    with closing(Store(file, clock, pytest.fail)) as store:
        assert store.numbers("desk") == first
        store.new_epoch("desk")
    file.write_bytes(old)
    with closing(Store(file, clock, said.append)) as store:
        assert store.numbers("desk")[0] > first[0]
    assert "is an old copy" in said[0]
