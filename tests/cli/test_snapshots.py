"""`--snapshot` and `--from`: a run that was put away goes on as if it had not been, also recorded and on the page."""

from __future__ import annotations

import json
import resource
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from cli.calling import Called, called_warm
from console.running import Program, open_page
from sleepcast.cli import main
from small_worlds import write

MISSION = """
@1s (WHEN (> battery 50%) (JOIN full))
@2s (WHEN (IN full) (DRIVE 2m/s 10deg/s) (TK "off we go") (REPORT "left with" battery))
@3s (WHEN (IN full) (RULE turn (IF (> x 600m) (ST))))
@8s (WHEN (NOT (IN full)) (RULE stray (WHEN (PROB 5%) (DRIVE 1m/s (RANDOM -1 1)))))
"""
OF_0_2_0 = Path(__file__).resolve().parent.parent / "of_0_2_0"
ALIKE = ("scenario", "seed", "robots", "seconds", "state_hash", "accounting", "measures")


@pytest.fixture
def world(tmp_path: Path) -> Path:
    """A small world with a mission and a bad radio."""
    file = write(tmp_path, ('delay = "0s"', 'delay = "0.4s"\nloss = 0.2'))
    file.write_text('mission = "mission.sleep"\n' + file.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "mission.sleep").write_text(MISSION, encoding="utf-8")
    return tmp_path


def outcome(*arguments: str | Path) -> dict[str, object]:
    done = called_warm("run", *map(str, arguments), "--json")
    told = [line for line in done.err.splitlines() if "after the end" not in line]  # runs end before their missions do
    assert (done.status, told) == (0, [])
    found: dict[str, object] = json.loads(done.out)
    return found


def alike(found: dict[str, object]) -> dict[str, object]:
    return {key: found[key] for key in ALIKE}


def test_a_run_goes_on_as_if_it_had_never_stopped(world: Path) -> None:
    file = world / "half.snap"
    whole = outcome(world, "--seconds", "20")
    first = outcome(world, "--seconds", "20", "--snapshot", file, "--snapshot-at", "2.2s")
    assert alike(first) == alike(whole)
    world.joinpath("scenario.toml").write_text("the file stands alone", encoding="utf-8")
    rest = outcome("--from", file, "--seconds", "17.8", "--threads", "1")
    assert alike(rest) == alike(whole)
    assert rest["started_at_seconds"] == 2.2
    assert outcome("--from", file)["seconds"] == 60.0  # the scenario's own end


def test_another_seed_makes_a_fork(world: Path) -> None:
    file = world / "half.snap"
    outcome(world, "--seconds", "10", "--snapshot", file)
    same, fork, again = (outcome("--from", file, "--seconds", "10", *more) for more in ((), *[("--seed", "9")] * 2))
    assert fork["seed"] == 9
    assert alike(fork) == alike(again)
    assert fork["state_hash"] != same["state_hash"]


def test_a_run_that_goes_on_can_be_recorded_and_verified(world: Path) -> None:
    file, record = world / "half.snap", world / "rest.mcap"
    outcome(world, "--seconds", "2.2", "--snapshot", file)
    plain = outcome("--from", file, "--seconds", "10", "--seed", "5")
    assert alike(outcome("--from", file, "--seconds", "10", "--seed", "5", "--record", record)) == alike(plain)
    found = called_warm("replay", str(record), "--verify", "--json")
    assert found.status == 0, found.err
    said = json.loads(found.out)
    assert said["verified"] == {"same": True, "compared": 3, "differs_from_tick": None}
    assert said["started_at_seconds"] == pytest.approx(2.2)
    assert said["state_hash"] == plain["state_hash"]


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["run"], "no scenario given"),
        (["run", "bravo", "--from", "FILE"], "leave out either bravo or --from"),
        (["demo", "bravo", "--from", "FILE"], "leave out either bravo or --from"),
        (["run", "--from", "FILE", "--robots", "5"], "a snapshot has started"),
        (["run", "--from", "FILE", "--no-walls"], "a snapshot has started"),
        (["run", "bravo", "--snapshot-at", "30s"], "add --snapshot FILE"),
        (["demo", "--snapshot", "x.snap", "--snapshot-at", "30s"], "add --snapshot FILE"),
        (["run", "bravo", "--snapshot", "x.snap", "--snapshot-at", "30 miles"], 'wanted a time such as "30s"'),
        (["run", "bravo", "--snapshot", "x.snap", "--snapshot-at", "soon"], 'wanted a time such as "30s"'),
        (["run", "bravo", "--seconds", "9", "--snapshot", "x.snap", "--snapshot-at", "10"], "goes from 0 s to 9 s"),
        (["run", "bravo", "--snapshot", "none/x.snap"], "there is no folder"),
        (["run", "bravo", "--snapshot", "."], "--snapshot .: not a regular file"),
        (["run", "bravo", "--record", "x", "--snapshot", "./x"], "--record and --snapshot name the same file x"),
        (["run", "bravo", "--journal", "x", "--snapshot", "x"], "--snapshot and --journal name the same file x"),
        (["demo", "--journal", "x", "--record", "x"], "--record and --journal name the same file x"),
        (["run", "--from", "none.snap"], "cannot read the snapshot none.snap: No such file or directory"),
        (["run", "--from", "."], "cannot read the snapshot .: Is a directory"),
        (["run", "--from", "scenario.toml"], "scenario.toml is not a sleepcast snapshot"),
        (["run", "--from", "FILE", "--seconds", "5", "--snapshot", "x.snap", "--snapshot-at", "2s"], "from 3 s to 8 s"),
    ],
)
def test_what_does_not_go_together_is_told(
    world: Path, arguments: list[str], why: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if "FILE" in arguments and "--seconds" in arguments:
        outcome(world, "--seconds", "3", "--snapshot", world / "FILE")
    monkeypatch.chdir(world)
    status = main(arguments)
    out, err = capsys.readouterr()
    assert (status, out) == (2, "")
    assert why in err


def test_a_scenario_that_has_ended_needs_seconds(world: Path) -> None:
    file = world / "end.snap"
    outcome(world, "--snapshot", file)
    done = called_warm("run", "--from", str(file))
    assert done.status == 2
    assert "the snapshot was taken at 60 s, and" in done.err
    assert "say with --seconds for how long to go on" in done.err
    assert outcome("--from", file, "--seconds", "1")["seconds"] == 61.0


def test_a_damaged_snapshot_is_told_with_its_name(world: Path) -> None:
    file = world / "half.snap"
    outcome(world, "--seconds", "3", "--snapshot", file)
    data = file.read_bytes()
    whys = ("is not a sleepcast snapshot, or is incomplete", "is damaged")
    for spoilt, why in zip((data[: len(data) // 2], flipped(data)), whys, strict=True):
        file.write_bytes(spoilt)
        done = called_warm("run", "--from", str(file))
        assert (done.status, done.out) == (2, "")
        assert f"{file} {why}" in done.err
        assert "Traceback" not in done.err


def flipped(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 255]) + data[middle + 1 :]


LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (2_000, resource.RLIM_INFINITY))
import signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
from sleepcast.cli import main
sys.exit(main(sys.argv[1:]))
"""


def limited(*arguments: str) -> Called:
    """A call that may write no more than 2,000 bytes into one file, as on a full disk."""
    command = [sys.executable, "-c", LIMITED, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return Called(done.returncode, done.stdout, done.stderr)


def test_a_full_disk_ends_neither_the_run_nor_the_old_snapshot(world: Path) -> None:
    assert resource.RLIMIT_FSIZE is not None
    file = world / "half.snap"
    file.write_bytes(b"the old one")
    plain = outcome(world, "--seconds", "5")
    done = limited("run", str(world), "--seconds", "5", "--json", "--snapshot", str(file), "--snapshot-at", "3s")
    assert done.status == 1
    assert f"cannot write the snapshot {file}: File too large. Nothing was replaced" in done.err
    assert alike(json.loads(done.out)) == alike(plain)
    assert file.read_bytes() == b"the old one"
    assert not list(world.glob(".*"))


def test_the_page_goes_on_and_keeps_what_came_of_it(world: Path) -> None:
    file, later = world / "half.snap", world / "later.snap"
    outcome(world, "--seconds", "2.5", "--snapshot", file)
    with Program("demo", "--from", file, "--snapshot", later) as program:
        with open_page(program) as page:
            page.until("groups", lambda found: [each["name"] for each in found["groups"]] == ["full"])
            rows = page.until("commands", lambda found: len(found["rows"]) > 2)["rows"]
            assert [row["at"] for row in rows[:3]] == [1.0, 2.0, 3.0]  # the mission goes on
        assert program.end() == 130
    found = outcome("--from", later, "--seconds", "1")
    assert found["seconds"] > 4.0
    assert len(found["accounting"]) >= 3


def test_a_page_that_cannot_be_opened_leaves_everything_as_it_was(world: Path) -> None:
    file, record = world / "half.snap", world / "run.mcap"
    outcome(world, "--seconds", "3", "--snapshot", file)
    before = file.read_bytes()
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        done = called_warm("demo", str(world), "--port", port, "--snapshot", str(file), "--record", str(record))
    assert (done.status, done.out) == (1, "")
    assert done.err.startswith(f"port {port} of 127.0.0.1 is in use")
    assert file.read_bytes() == before
    assert not record.exists(), "else the next attempt would be refused for its name"


def test_a_snapshot_of_0_2_0_goes_on() -> None:
    """Of twenty robots, taken five seconds after a mission of four lines began whose last one is STOP."""
    rest = outcome("--from", OF_0_2_0 / "stopped.snap", "--seconds", "3")
    assert rest["started_at_seconds"] == 5.0
    accounting, measures = rest["accounting"], rest["measures"]
    assert isinstance(accounting, list)
    assert isinstance(measures, dict)
    assert [(each["matched"], each["silent"]) for each in accounting] == [(9, 6), (7, 7), (5, 9), (20, 0)]
    assert (measures["stopped"], measures["groups"]) == (20, {"full": 11})
