"""`sleepcast keys`: what is made, who can read it, and what is refused."""

from __future__ import annotations

import json
import stat
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from threading import Barrier, BrokenBarrierError

import pytest

from cli.calling import Called, called_warm
from sleepcast.api.connection import AirOptions
from sleepcast.api.connection import chosen_keys as keys_of
from sleepcast.channel.keyring import development_keys, find_key, keys_folder, load_key, load_trust
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import Role
from sleepcast.cli.keys import commander

PUBLIC = "03a107bff3ce10be1d70dd18e74bc09967e4d6309ba50d5f1ddc8664125531b8"


def keys(folder: Path, *arguments: str) -> Called:
    return called_warm("keys", *arguments, "--keys", str(folder))


def test_a_key_is_made_listed_trusted_elsewhere_and_revoked(tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    made = json.loads(keys(here, "new", "desk", "--role", "commander", "--json").out)
    assert stat.S_IMODE((here / "desk.key").stat().st_mode) == 0o600
    assert load_key(here / "desk.key").public.public.hex() == made["public"]
    assert keys(there, "trust", made["public"], "--owner", "desk", "--role", "commander").status == 0
    listed = json.loads(keys(there, "list", "--json").out)
    assert listed == [
        {
            "owner": "desk",
            "role": "commander",
            "key": made["key"],
            "public": made["public"],
            "revoked": False,
            "own": False,
            "in_use": False,
        }
    ]
    assert keys(there, "revoke", "desk").status == 0
    assert [key.revoked for key in load_trust(there / "trust.json").keys] == [True]
    assert "REVOKED" in keys(there, "list").out


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("new", "desk"), "exists, and a replaced key would be lost"),
        (("new", "../desk"), "letters, digits"),
        (("new", ""), "name of 1 to 64 characters"),
        (("trust", "abc", "--owner", "anna", "--role", "operator"), "hexadecimal digits"),
        (("trust", "abcd", "--owner", "anna", "--role", "operator"), "32 bytes"),
        (("trust", PUBLIC, "--owner", "", "--role", "operator"), "name of 1 to 64 characters"),
        (("revoke", "dusk"), "did you mean desk"),
    ],
)
def test_what_is_refused_changes_nothing(tmp_path: Path, arguments: tuple[str, ...], complaint: str) -> None:
    keys(tmp_path, "new", "desk")
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    refused = keys(tmp_path, *arguments)
    assert (refused.status, refused.out) == (2, "")
    assert complaint in refused.err
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "is not a trust file"),
        (b"[" * 100_000, "is not a trust file"),
        (b'{"format": 1, "keys": [{"owner": "a", "role": "king", "public": ""}]}', "Invalid enum value"),
        (b'{"format": 2, "keys": []}', "take a newer one"),
        (b'{"format": 1, "keys": [{"owner": "a", "role": "robot", "public": "00"}]}', "32 bytes"),
        (b'{"format": 1, "keys": [], "kings": []}', "unknown field"),
        (b'{"format": 1, "keys": [], "gone": ["zz"]}', "hexadecimal digits"),
        (b'{"format": 1, "keys": [], "gone": ["0011"]}', "something of 8 bytes is written as 16 hexadecimal digits"),
        (b'{"format": 1, "keys": [], "vouched": ["00112233445566"]}', "something of 12 bytes"),
    ],
)
def test_a_trust_file_that_is_none_is_named(tmp_path: Path, content: bytes, complaint: str) -> None:
    (tmp_path / "trust.json").write_bytes(content)
    refused = keys(tmp_path, "list")
    assert refused.status == 2
    assert complaint in refused.err
    assert "trust.json" in refused.err


def test_a_secret_that_others_can_read_is_none(tmp_path: Path) -> None:
    keys(tmp_path, "new", "desk")
    (tmp_path / "desk.key").chmod(0o644)
    found = keys(tmp_path, "list")
    assert found.status == 0
    assert "can be read by others" in found.err
    assert "yours" not in found.out


def test_where_nothing_can_be_written_a_sentence_says_so(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    refused = keys(tmp_path / "file" / "keys", "new", "desk")
    assert refused.status == 1
    assert "cannot write" in refused.err


ASKED = AirOptions("udp://127.0.0.1:1", "lab", None, None, None)


@pytest.fixture
def owned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of somebody with keys of anna (observer), chief (commander) and r* (robot), none of them in use."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    for owner, role in (("anna", "observer"), ("chief", "commander"), ("r*", "robot")):
        assert called_warm("keys", "new", owner, "--role", role).status == 0
    return keys_folder()


def owner_of(asked: AirOptions, *, robot: bool, say: Callable[[str], object] = lambda said: None) -> str:
    """Whose key is taken."""
    return keys_of(asked, robot, say)[0].public.owner


def test_a_key_that_is_in_use_is_taken_where_no_other_is_named(owned: Path) -> None:
    said: list[str] = []
    for owner in ("chief", "r*"):
        assert called_warm("keys", "use", owner).status == 0
    assert owner_of(ASKED, robot=False, say=said.append) == "chief"
    assert owner_of(ASKED, robot=True, say=said.append) == "r*"
    assert owner_of(replace(ASKED, key="anna"), robot=False, say=said.append) == "anna"
    assert commander(owned, None).public.owner == "chief"
    assert len(keys_of(ASKED, False, said.append)[1].keys) == 3
    assert said == [], "nobody need be told of development keys"


def test_what_is_in_use_is_said_and_what_still_is_a_development_key(owned: Path) -> None:
    taken = called_warm("keys", "use", "chief")
    assert "take the key of chief (commander) from now on" in taken.out
    assert "node and swarm still use the development key" in taken.err
    assert called_warm("keys", "use", "r*").err == ""
    used = {key["owner"]: key["in_use"] for key in json.loads(called_warm("keys", "list", "--json").out)}
    assert used == {"anna": False, "chief": True, "r*": True}


def test_development_keys_can_be_used_again(owned: Path) -> None:
    said: list[str] = []
    assert called_warm("keys", "use", "chief").status == 0
    assert called_warm("keys", "use", "--development").status == 0
    assert owner_of(ASKED, robot=False, say=said.append) == "desk"
    assert "development keys of this machine" in said[0]


def test_no_key_and_one_that_is_not_there_cannot_be_used(owned: Path) -> None:
    assert called_warm("keys", "use").status == 2
    assert called_warm("keys", "use", "bert").status == 2


def test_what_is_in_use_is_not_read_in_a_newer_format(owned: Path) -> None:
    (owned / "in-use.json").write_text('{"format": 2, "desk": "anna"}')
    refused = called_warm("ask", "1", "--channel", "udp://127.0.0.1:1")
    assert (refused.status, "of format 2, and this sleepcast reads 1" in refused.err) == (2, True)


def test_programs_that_start_together_make_the_same_development_keys(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, both, usual = [], Barrier(2), KeyPair.new

    def slow(owner: str, role: Role) -> KeyPair:
        made.append(owner)
        with suppress(BrokenBarrierError):
            both.wait(0.5)  # for another one that makes it, too
        return usual(owner, role)

    monkeypatch.setattr(KeyPair, "new", slow)
    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(development_keys, [tmp_path] * 2)
    assert made == ["desk", "*"]
    assert [key.id for key in first] == [key.id for key in second]


def test_development_keys_are_made_once(tmp_path: Path) -> None:
    desk, robots = development_keys(tmp_path)
    assert (desk.public.role, robots.public.role) == (Role.COMMANDER, Role.ROBOT)
    assert robots.public.is_of("anybody")
    assert [key.id for key in development_keys(tmp_path)] == [desk.id, robots.id]
    assert find_key(tmp_path, "development-desk").id == desk.id
