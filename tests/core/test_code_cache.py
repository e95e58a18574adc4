"""Native code that is kept: whole or not at all, bounded, and never from where somebody else could have put it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from sleepcast.core import code_cache
from sleepcast.core.code_cache import CodeCache, processor, version_of


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CodeCache:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    return CodeCache("rules")


def test_what_was_saved_is_loaded(cache: CodeCache) -> None:
    assert cache.load("a") is None
    assert cache.holding("a") is None
    assert cache.save("a", b"code")
    assert cache.save("a", b"newer")
    assert cache.load("a") == b"newer"
    assert cache.holding("a") == cache.folders[0]
    assert CodeCache("kernels").load("a") is None
    folder = cache.folders[0]
    assert folder.stat().st_mode & 0o777 == 0o700
    assert [file.name for file in folder.iterdir()] == ["a"]


@pytest.mark.parametrize("damage", ["cut", "emptied", "flipped", "renamed"])
def test_a_damaged_piece_is_none(cache: CodeCache, damage: str) -> None:
    cache.save("a", b"code" * 1_000)
    file = cache.folders[0] / "a"
    data = bytearray(file.read_bytes())
    if damage == "flipped":
        data[1_000] ^= 4
    elif damage == "renamed":  # it is whole, but it is not what its name says
        cache.save("b", b"other")
        data = bytearray((cache.folders[0] / "b").read_bytes())
    file.write_bytes(data[: {"cut": 500, "emptied": 0}.get(damage)])
    assert cache.load("a") is None
    assert cache.save("a", b"code")
    assert cache.load("a") == b"code"


def test_code_is_not_taken_from_where_somebody_else_can_write(cache: CodeCache, tmp_path: Path) -> None:
    """Nor is any put there: it goes to the other folder."""
    cache.save("a", b"code")
    folder, other = cache.folders
    folder.chmod(0o770)
    assert cache.load("a") is None
    assert cache.save("b", b"code")
    assert (other / "b").exists()
    assert cache.load("b") == b"code"
    folder.chmod(0o700)
    (folder / "a").chmod(0o602)
    assert cache.load("a") is None
    (folder / "a").unlink()
    (tmp_path / "elsewhere").write_bytes((other / "b").read_bytes())
    (folder / "a").symlink_to(tmp_path / "elsewhere")
    assert cache.load("a") is None
    os.mkfifo(folder / "c")  # nobody waits for somebody to write
    assert cache.load("c") is None


def test_a_folder_that_leads_elsewhere_is_not_followed(cache: CodeCache, tmp_path: Path) -> None:
    folder = cache.folders[0]
    cache.save("a", b"code")
    folder.rename(tmp_path / "moved")
    folder.symlink_to(tmp_path / "moved")
    assert cache.load("a") is None


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
def test_another_users_folder_is_not_used(cache: CodeCache) -> None:
    cache.save("a", b"code")
    folder = cache.folders[0]
    os.chown(folder, 65_534, 65_534)
    assert cache.load("a") is None
    os.chown(folder, 0, 0)
    os.chown(folder / "a", 65_534, 65_534)
    assert cache.load("a") is None


def test_without_a_folder_nothing_is_kept_and_nothing_fails(cache: CodeCache, tmp_path: Path) -> None:
    (tmp_path / "caches").write_text("a file where the folder should be")
    (tmp_path / "temporary").rmdir()
    (tmp_path / "temporary").write_text("another one")
    assert not cache.save("a", b"code")
    assert cache.load("a") is None
    assert cache.holding("a") is None


FULL = """
import resource
from sleepcast.core.code_cache import CodeCache

cache = CodeCache("rules")
assert cache.save("small", b"code")
resource.setrlimit(resource.RLIMIT_FSIZE, (1_000, 1_000))
assert not cache.save("large", b"code" * 1_000)
assert cache.load("large") is None and cache.load("small") == b"code"
print(sorted(file.name for folder in cache.folders if folder.exists() for file in folder.iterdir()))
"""


def test_a_full_disk_leaves_nothing_half_written(cache: CodeCache, tmp_path: Path) -> None:
    environment = {**os.environ, "TMPDIR": str(tmp_path / "temporary")}
    done = subprocess.run([sys.executable, "-c", FULL], env=environment, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("['small']\n", "")


def test_what_was_not_used_for_longest_goes_first(cache: CodeCache, monkeypatch: pytest.MonkeyPatch) -> None:
    for number, name in enumerate("abcd"):
        cache.save(name, bytes(1_000))
        os.utime(cache.folders[0] / name, (number, number))
    assert cache.load("a") is not None  # it has been used now
    monkeypatch.setattr(code_cache, "MAX_BYTES", 3_500)
    cache.save("e", bytes(1_000))
    assert sorted(file.name for file in cache.folders[0].iterdir()) == ["a", "d", "e"]
    monkeypatch.setattr(code_cache, "MAX_PIECE", 10)
    assert not cache.save("f", bytes(11))


def test_to_keep_a_piece_is_not_to_look_at_all_that_is_kept(cache: CodeCache, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only after a part of what may be kept; a process that begins looks at once, since others have kept code, too."""
    looked, make_room = list[int](), code_cache._make_room
    monkeypatch.setattr(code_cache, "_make_room", lambda directory: looked.append(directory) or make_room(directory))
    monkeypatch.setattr(code_cache, "MAX_BYTES", 100_000)
    for number in range(1_000):  # of 132 bytes each: some 750 fit
        cache.save(str(number), bytes(100))
        assert len(looked) <= 2 + number // 20
    assert 90_000 < sum(file.stat().st_size for file in cache.folders[0].iterdir()) <= 100_000
    looked.clear()
    CodeCache("rules").save("another", bytes(100))
    assert len(looked) == 1


MANY = """
import sys
from sleepcast.core.code_cache import CodeCache

cache, own = CodeCache("rules"), int(sys.argv[1])
for turn in range(300):
    name = str(turn % 3)
    cache.save(name, name.encode() * (1_000 * own + turn))
    found = cache.load(name)
    assert found is not None and set(found) == set(name.encode()), name
"""


def test_processes_that_save_the_same_pieces_at_once_read_whole_ones(cache: CodeCache) -> None:
    processes = [subprocess.Popen([sys.executable, "-c", MANY, str(own)]) for own in (1, 2, 3)]
    assert [process.wait() for process in processes] == [0, 0, 0]
    assert sorted(file.name for file in cache.folders[0].iterdir()) == ["0", "1", "2"]


ENDLESS = """
from sleepcast.core.code_cache import CodeCache

print("up", flush=True)
cache = CodeCache("rules")
while True:
    cache.save("a", bytes(1_000_000))
"""


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGKILL])
def test_an_end_in_the_middle_leaves_a_whole_piece(cache: CodeCache, sent: signal.Signals) -> None:
    cache.save("a", bytes(10))
    for _ in range(3):
        with subprocess.Popen([sys.executable, "-c", ENDLESS], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
            assert run.stdout is not None
            run.stdout.readline()
            while cache.load("a") == bytes(10):
                pass
            run.send_signal(sent)
            run.communicate()
        assert cache.load("a") == bytes(1_000_000)
        if sent == signal.SIGINT:  # who is killed cannot clean up; what is left is taken away when room is made
            assert [file.name for file in cache.folders[0].iterdir()] == ["a"]
        cache.save("a", bytes(10))


def test_code_is_for_this_processor_and_this_version() -> None:
    binding = pytest.importorskip("llvmlite.binding")
    words = [binding.get_process_triple(), binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()]
    assert processor().splitlines() == words
    assert b"version" in version_of("llvmlite")
    assert version_of("no_such_library") == b""


SAID = """
import sys
from sleepcast.core.code_cache import processor
print(processor())
print("llvmlite" in sys.modules)
"""


def test_llvm_is_asked_for_the_processor_once_until_the_computer_is_started_anew(
    cache: CodeCache, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the system does not say when that was, it is asked each time."""
    pytest.importorskip("llvmlite.binding")

    def said() -> list[str]:
        return subprocess.run([sys.executable, "-c", SAID], capture_output=True, text=True, check=True).stdout.split()

    kept, (*words, loaded) = CodeCache("processors"), said()
    assert [*words, loaded] == [*processor().split(), "True"]
    if code_cache._started():
        assert said() == [*words, "False"]
        (name,) = kept.names(code_cache._started())
        kept.save(name, b"of another one")
        assert said() == ["of", "another", "one", "False"]
    for number, expected in (("", words), ("another", words)):
        monkeypatch.setattr(code_cache, "_started", lambda number=number: number)
        assert processor.__wrapped__().split() == expected
    assert len(kept.names("")) == 1 + bool(kept.names("another"))
