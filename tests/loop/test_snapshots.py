"""Snapshots of whole swarms: going on from one is never having stopped, to the last bit; anything else is refused."""

from __future__ import annotations

import errno
import json
import math
import os
import subprocess
import sys
import zlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np
import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from sleepcast.core import serial
from sleepcast.core.errors import SleepcastError
from sleepcast.loop import SnapshotError, Swarm, load, resume, save, snapshot
from sleepcast.loop.snapshots import FORMAT, KIND, SnapshotFile, SnapshotLostError
from sleepcast.simulator import Changes, Scenario, find_scenario, scenario_names
from small_worlds import small
from swarms import ORDERS, desk_of, drive, seen, station_of, swarm_of

FRESH = """
import json, os, sys
from pathlib import Path
from sleepcast.loop import load, resume
from sleepcast.simulator.engine import choose
from swarms import drive, seen, station_of
choose(threads=1)
for line in sys.stdin:
    if os.fork() == 0:
        file, ticks, threads = json.loads(line)
        swarm = resume(load(Path(file)), threads=threads or None, desk=station_of)
        drive(swarm, ticks)
        with open(1, "w", closefd=False) as whole:  # not cut where a signal comes, as without a buffer
            print(json.dumps(seen(swarm)), file=whole)
        os._exit(0)
    if os.wait()[1]:
        print(json.dumps("it failed"), flush=True)
"""
"""A process that has loaded the libraries and nothing else; each line is answered by a process made from it."""
TESTS = Path(__file__).resolve().parent.parent
LAST = max(ORDERS) + 12
THICK = (14, 1), (29, 2), (33, 0)
"""Moments in the thick of it (commands, answers and pings on their way, leases, a STOP that is latched), by tick, and
on how many threads to go on from there; 0 for as many as there are cores. An ordinary run tries one a scenario."""
FEW = 30
"""Robots of those scenarios that may have any number."""
NOISY = ('[radio]\ndelay = "0s"', '[radio]\ndelay = "0.15s"\njitter = "0.4s"\nloss = "10%"\nduplication = "20%"')


def few(name: str) -> Scenario:
    """A scenario of the gallery with few robots."""
    whole = find_scenario(name)
    return whole if whole.robots.groups or whole.robots.count < FEW else find_scenario(name, Changes(robots=FEW))


@pytest.fixture(scope="module")
def fresh() -> Iterator[subprocess.Popen[str]]:
    path = os.pathsep.join([str(TESTS), *filter(None, [os.environ.get("PYTHONPATH")])])
    with subprocess.Popen(
        [sys.executable, "-c", FRESH],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
    ) as started:
        yield started
        assert started.stdin is not None
        started.stdin.close()


def in_another_process(fresh: subprocess.Popen[str], file: Path, ticks: int, threads: int) -> object:
    assert fresh.stdin is not None
    assert fresh.stdout is not None
    print(json.dumps([str(file), ticks, threads]), file=fresh.stdin, flush=True)
    return json.loads(fresh.stdout.readline())


def as_json(swarm: Swarm) -> object:
    return json.loads(json.dumps(seen(swarm)))


@pytest.mark.parametrize(
    ("name", "moments"),
    [
        pytest.param(name, moments, marks=pytest.mark.nightly if len(moments) > 1 else (), id=f"{name}-{len(moments)}")
        for number, name in enumerate(scenario_names())
        for moments in (THICK, THICK[number % 3 : number % 3 + 1])
    ],
)
def test_a_scenario_of_the_gallery_goes_on_in_another_process(
    name: str, moments: Sequence[tuple[int, int]], fresh: subprocess.Popen[str], tmp_path: Path
) -> None:
    """At the ticks of these moments, and each on so many threads. At night, a swarm of which no snapshot was taken has
    come to the same; `test_a_bad_radio_goes_on_from_every_tick` shows so in every run."""
    swarm, done, files = swarm_of(few(name), seed=4), 0, list[Path]()
    for ticks, _ in moments:
        drive(swarm, ticks - done)
        done = ticks
        files.append(tmp_path / f"{ticks}.snap")
        save(snapshot(swarm), files[-1])
    drive(swarm, LAST - done)
    wanted = as_json(swarm)
    for (ticks, threads), file in zip(moments, files, strict=True):
        assert in_another_process(fresh, file, LAST - ticks, threads) == wanted
    if len(moments) > 1:
        whole = swarm_of(few(name), seed=4)
        drive(whole, LAST)
        assert as_json(whole) == wanted


def test_a_bad_radio_goes_on_from_every_tick(tmp_path: Path) -> None:
    scenario = small(tmp_path, NOISY, ('motion = "still"', 'motion = "wander"'))
    whole = swarm_of(scenario)
    parts = swarm_of(scenario)
    for _ in range(LAST):
        drive(parts, 1)
        parts = resume(snapshot(parts), desk=station_of)
    drive(whole, LAST)
    assert as_json(parts) == as_json(whole)
    assert whole.radio.counts.lost > 0
    assert whole.radio.counts.duplicated > 0


def test_a_radio_with_little_room_goes_on(tmp_path: Path) -> None:
    scenario = small(
        tmp_path, (NOISY[0], f"{NOISY[1]}\nrate = 2\nqueue = 3"), ('motion = "still"', 'motion = "wander"')
    )
    whole, parts = swarm_of(scenario), swarm_of(scenario)
    for _ in range(0, LAST, 4):
        drive(parts, 4)
        drive(whole, 4)
        parts = resume(snapshot(parts), desk=station_of)
    assert as_json(parts) == as_json(whole)
    assert whole.radio.counts.crowded > 0


def test_one_snapshot_serves_many(tmp_path: Path) -> None:
    swarm = swarm_of(few("flood"))
    drive(swarm, 20)
    data = snapshot(swarm)
    assert snapshot(swarm) == data
    found = []
    for _ in range(3):
        again = resume(data, desk=station_of)
        assert snapshot(again) == data
        drive(again, 20)
        found.append(as_json(again))
    drive(swarm, 20)
    assert found == [as_json(swarm)] * 3


def test_another_seed_is_a_fork_with_the_same_past(tmp_path: Path) -> None:
    swarm = swarm_of(few("crowd"))
    drive(swarm, 12)
    fork = resume(snapshot(swarm), seed=77, desk=station_of)
    assert as_json(fork) == as_json(swarm)
    assert fork.simulator.seed == 77
    drive(swarm, 20)
    drive(fork, 20)
    assert fork.simulator.state_hash() != swarm.simulator.state_hash()
    other = resume(snapshot(fork), desk=station_of)  # goes on with the chance of the fork
    drive(other, 10)
    drive(fork, 10)
    assert as_json(other) == as_json(fork)


def test_other_commands_make_a_fork(tmp_path: Path) -> None:
    swarm = swarm_of(few("bravo"))
    drive(swarm, 12)
    fork = resume(snapshot(swarm), desk=station_of)
    desk_of(fork).send("(PROGN (FORGET shy) (DRIVE 0 0))", everybody=True)
    swarm.run(5)
    fork.run(5)
    assert fork.simulator.state_hash() != swarm.simulator.state_hash()


def test_a_swarm_without_a_desk_goes_on_without_one(tmp_path: Path) -> None:
    swarm = Swarm(swarm_of(few("flood")).simulator)
    swarm.run(2)
    data = snapshot(swarm)
    for desk in (None, station_of):
        other = resume(data, desk=desk)
        other.run(2)
    swarm.run(2)
    assert other.simulator.state_hash() == swarm.simulator.state_hash()
    assert desk_of(other).commands() == []


def test_half_a_tick_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """An error, or Ctrl-C pressed twice, breaks a tick off: who went on from there would go on as nobody else does."""
    swarm = swarm_of(few("crowd"))
    swarm.run(2)
    kept = snapshot(swarm)
    swarm.senders.append(lambda: None)  # so that the tick is no quiet one, whose end may have nothing to take
    with monkeypatch.context() as patch:
        patch.setattr(swarm.fleet, "take_messages", raise_interrupt)
        with pytest.raises(KeyboardInterrupt):
            swarm.step()
    with pytest.raises(SnapshotLostError, match=r"the tick of 2\.1 s was broken off"):
        snapshot(swarm)
    assert resume(kept).whole


def raise_interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def test_what_came_before_is_not_explained() -> None:
    swarm = swarm_of(few("bravo"))
    desk = desk_of(swarm)
    before = desk.send("(WHEN (> x 5m) (MARK))")
    swarm.run(2)
    other = resume(snapshot(swarm), desk=station_of)
    name = swarm.simulator.names[3]
    assert desk.why(name, before.id)
    with pytest.raises(Exception, match=r"goes on from a snapshot taken at 2 s, which keeps no explanations of before"):
        desk_of(other).why(name, before.id)
    after = desk_of(other).send("(WHEN (> x 5m) (MARK))")
    other.run(1)
    assert desk_of(other).why(name, after.id)


def test_a_robot_with_ten_rules_takes_a_third_of_a_kilobyte() -> None:
    swarm = swarm_of(find_scenario("crowd", Changes(robots=1_000)))
    swarm.run(3)
    assert all(len(mind.rules()) == 10 for mind in swarm.fleet.values())
    assert len(snapshot(swarm)) < 350 * len(swarm.fleet)


def test_files_are_replaced_as_a_whole(tmp_path: Path) -> None:
    file = tmp_path / "swarm.snap"
    for text in (b"one", b"two"):
        save(text, file)
        assert load(file) == text
    assert [each.name for each in tmp_path.iterdir()] == ["swarm.snap"]


# ---- what is no snapshot


def document(data: bytes) -> SnapshotFile:
    return msgspec.msgpack.decode(data, type=SnapshotFile)


@cache
def whole() -> bytes:
    """The snapshot of a small swarm with something of everything in it."""
    with TemporaryDirectory() as folder:
        swarm = swarm_of(small(Path(folder), NOISY, ("count = 20", "count = 5")))
    drive(swarm, 33)
    return snapshot(swarm)


@cache
def opened(part: str) -> tuple[object, list[tuple[tuple[object, ...], object]]]:
    """One part of it as plain data, and the ways to all values in it."""
    body = msgspec.msgpack.decode(zlib.decompress(getattr(document(whole()), part)))
    return body, sorted(leaves(body), key=repr)


def refused(data: bytes) -> str:
    """How it is refused."""
    with pytest.raises(SnapshotError) as caught:
        resume(data, desk=station_of, name="my.snap")
    assert str(caught.value).startswith("my.snap ")
    assert len(str(caught.value)) < 600
    return str(caught.value)


def test_other_bytes_are_refused_in_a_sentence() -> None:
    for data in (b"", b"\x80", b"no snapshot", whole()[:1000], whole()[:-1], whole()[1:], b"\x91" * 100_000):
        assert "is not a sleepcast snapshot, or is incomplete" in refused(data)
    of_another = msgspec.msgpack.encode({"kind": "cake", "format": 1, "version": "1"})
    assert "is not a sleepcast snapshot" in refused(of_another)


def test_a_newer_format_is_refused_whatever_else_is_in_it() -> None:
    newer = msgspec.msgpack.encode({"kind": KIND, "format": FORMAT + 1, "version": "9.9", "new": [1, 2]})
    assert refused(newer) == (
        f"my.snap has format {FORMAT + 1}, which is newer than this sleepcast, which reads format {FORMAT}: update "
        "sleepcast (the snapshot was taken by version 9.9)"
    )


def test_a_document_that_lacks_a_part_is_refused() -> None:
    plain = msgspec.msgpack.decode(whole())
    for name in plain:
        for wrong in ({key: value for key, value in plain.items() if key != name}, plain | {name: [name]}):
            refused(msgspec.msgpack.encode(wrong))
    for robots in (0, -1, 4, 6, 10**9):
        refused(msgspec.msgpack.encode(plain | {"robots": robots}))


PARTS = ("simulator", "fleet", "radio", "loop", "desk")


@settings(max_examples=max(30, settings().max_examples))
@given(data=st.data())
def test_a_changed_byte_is_refused_or_harmless(data: st.DataObject) -> None:
    place = data.draw(st.integers(0, len(whole()) - 1))
    changed = bytearray(whole())
    changed[place] ^= data.draw(st.integers(1, 255))
    try:
        found = resume(bytes(changed), desk=station_of)
    except SnapshotError:
        return
    # What is left is the version in words; everything else has a check sum.
    assert document(snapshot(found)) == document(whole())


def leaves(found: object, path: tuple[object, ...] = ()) -> Iterator[tuple[tuple[object, ...], object]]:
    """Every plain value in a decoded part, with the way to it."""
    if isinstance(found, dict):
        for key, value in found.items():
            yield from leaves(value, (*path, key))
    elif isinstance(found, list):
        for index, value in enumerate(found):
            yield from leaves(value, (*path, index))
    else:
        yield path, found


def put(found: object, path: tuple[object, ...], value: object) -> object:
    """The same with another value at the end of the way."""
    if not path:
        return value
    if isinstance(found, dict):
        return found | {path[0]: put(found[path[0]], path[1:], value)}
    assert isinstance(found, list)
    index = path[0]
    assert isinstance(index, int)
    return [*found[:index], put(found[index], path[1:], value), *found[index + 1 :]]


WORSE = (
    0,
    -1,
    1,
    2,
    2**31,
    2**63 - 1,
    -(2**63),
    0.5,
    math.nan,
    math.inf,
    -math.inf,
    1e308,
    True,
    None,
    "",
    "x" * 70_000,
)
TEXTS = ("(+ 1", "(SETQQ E5 (E5))", "desk-1.1", "e5", "variable", "operator", "nobody")


@pytest.mark.parametrize("part", PARTS)
@settings(max_examples=max(30, settings().max_examples))
@given(data=st.data())
def test_whatever_stands_in_a_part_it_is_refused_or_runs(part: str, data: st.DataObject) -> None:
    """Parts with right check sums and wrong contents: either a sentence, or a swarm that goes on."""
    spoilt = document(whole())
    body, places = opened(part)
    for _ in range(data.draw(st.integers(1, 3))):
        path, before = data.draw(st.sampled_from(places))
        if isinstance(before, bytes) and before:
            changed = bytearray(before)
            changed[data.draw(st.integers(0, len(before) - 1))] ^= data.draw(st.integers(1, 255))
            body = put(body, path, bytes(changed))
        else:
            body = put(body, path, data.draw(st.sampled_from((*WORSE, *TEXTS))))
        note(f"{path}: {str(before)[:60]}")
    setattr(spoilt, part, zlib.compress(msgspec.msgpack.encode(body)))
    try:
        swarm = resume(msgspec.msgpack.encode(spoilt), desk=station_of)
    except SnapshotError:
        return
    with np.errstate(all="ignore"):
        swarm.run(0.3)
    with suppress(SleepcastError):  # robots may have learned anything, and the desk asks in their names
        seen(swarm)
    snapshot(swarm)


def test_a_huge_part_does_not_fill_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serial, "MIN_ROOM", 1024**2)
    bomb = document(whole())
    bomb.fleet = zlib.compress(bytes(50 * 1024**2), 9)
    assert "has more than" in refused(msgspec.msgpack.encode(bomb))


def test_what_is_no_file_is_not_read(tmp_path: Path) -> None:
    for file, why in (
        (tmp_path, "Is a directory"),
        (tmp_path / "none", "No such file"),
        (Path("/dev/zero"), "no file"),
    ):
        with pytest.raises(SnapshotError, match=why):
            load(file)


def test_a_place_where_nothing_can_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "plain").write_bytes(b"")
    for file in (tmp_path / "folder", tmp_path / "none" / "swarm.snap", tmp_path / "plain" / "x", Path("/dev/null")):
        with pytest.raises(SnapshotLostError, match="cannot write the snapshot"):
            save(b"", file)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["folder", "plain"]


def test_a_full_disk_leaves_the_old_snapshot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "swarm.snap"
    save(b"old", file)

    def full(number: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(SnapshotLostError, match=r"No space left on device\. Nothing was replaced"):
        save(b"new", file)
    assert load(file) == b"old"
    assert [each.name for each in tmp_path.iterdir()] == ["swarm.snap"]
