"""`sleepcast keys` on the air: who is obeyed from then on, by robots that were there and by one that comes later."""

from __future__ import annotations

import json
import shutil
import signal
import time
from contextlib import closing
from pathlib import Path

import pytest

from cli.calling import LONGEST, called_here, called_warm
from cli.test_swarm import account, at_rest, channel, swarm
from sleepcast.api.connection import FLEET, AirOptions, keeper_for, session_for
from sleepcast.channel.keyring import KeyFileLostError, add_trust, key_file, load_trust, save_key, save_trust
from sleepcast.channel.keys import KeyChange, KeyPair, Trust
from sleepcast.channel.message import Kind, Role

__all__ = ["channel"]  # a fixture


def keys(home: Path) -> Path:
    """The folder of a user who has made keys."""
    folder, trust = home / ".config" / "sleepcast" / "keys", Trust()
    for owner, role in (("desk", "commander"), ("chief", "commander"), ("anna", "operator"), ("*", "robot")):
        pair = KeyPair.new(owner, Role(role))
        trust.add(pair.public)
        save_key(pair, key_file(folder, owner))
    save_trust(trust, folder / "trust.json")
    return folder


def test_keys_end_and_are_renewed_on_the_air(channel: str, tmp_path: Path) -> None:
    folder = keys(tmp_path)
    elsewhere = tmp_path / "elsewhere"
    shutil.copytree(folder, elsewhere)

    def matched(text: str, key: str, *options: str) -> object:
        return account(channel, "send", text, "--key", key, "--blind", *options)["n_matched"]

    with swarm(2, channel, "--key", "*"):
        assert matched("(RULE old 1)", "desk", "--standing", "--all") == 2
        ended = account(channel, "keys", "revoke", "anna", "--key", "chief")
        assert (ended["matched"], ended["silent"]) == (["r1", "r2"], [])
        assert matched("(WHEN (> id 0) (JOIN bravo))", "anna") == 0
        before = load_trust(folder / "trust.json").keys[0]
        assert account(channel, "keys", "rotate", "desk")["n_matched"] == 2
        assert load_trust(folder / "trust.json").find(before.id) != before
        late = ("--name-prefix", "late", "--keys", str(elsewhere), "--trust", str(elsewhere / "trust.json"))
        with swarm(1, channel, "--key", "*", *late):
            until = time.monotonic() + LONGEST
            while sum(key.revoked for key in load_trust(elsewhere / "trust.json").keys) < 2:
                assert time.monotonic() < until
                time.sleep(0.05)
            while "late1" not in str(account(channel, "ask", "id", "--key", "desk")["matched"]):
                assert time.monotonic() < until
        there = load_trust(elsewhere / "trust.json")
        assert {key.owner for key in there.keys if key.revoked} == {"desk", "anna"}
        assert len(there.vouched) >= 2, "the rule of the old key, and what it said of the new one"


def test_no_key_goes_farther_on_the_wire_than_it_may(channel: str, tmp_path: Path) -> None:
    folder = keys(tmp_path)
    for owner, role in (("watch", "observer"), ("rogue", "robot")):
        assert called_warm("keys", "new", owner, "--role", role).status == 0

    def speak(owner: str, *said: tuple[Kind, str, bool]) -> None:
        """Without asking, as our own programs do, whether one may."""
        with closing(
            session_for(AirOptions(channel, FLEET, owner, None, folder), None, robot=False, say=print)
        ) as session:
            for kind, text, standing in said:
                session.delivery.post(kind, time.time(), text=text, standing=standing)
            session.flush()

    def stopped() -> list[bool]:
        return [robot["stopped"] for robot in account(channel, "watch", "--once", "--key", "desk")["robots"]]

    standing, release = (Kind.COMMAND, "(RULE bad (JOIN bad))", True), (Kind.RELEASE, "", False)
    command = (Kind.COMMAND, "(WHEN (> id 0) (JOIN bad))", False)
    with swarm(2, channel, "--key", "*", *at_rest(tmp_path)) as robots:
        assert account(channel, "stop", "--key", "watch")["n_matched"] == 2
        refused = called_warm("release", "--key", "watch", "--channel", channel)
        assert (refused.status, refused.out) == (2, "")
        assert "watch is an observer" in refused.err
        speak("watch", command, standing, release)
        speak("rogue", standing, release)
        speak("anna", standing)
        assert stopped() == [True, True]
        assert account(channel, "release", "--key", "desk")["n_matched"] == 2
        assert account(channel, "keys", "revoke", "anna", "--key", "chief")["n_matched"] == 2
        assert account(channel, "stop", "--key", "anna", "--seconds", "1")["n_matched"] == 0
        speak("anna", command, release)
        assert stopped() == [False, False]
        asked = account(channel, "ask", "(IF (IN bad) 1 0)", "--key", "desk")
        assert (asked["n"], asked["max"]) == (2, 0.0)
        robots.send_signal(signal.SIGINT)
        _, told = robots.communicate(timeout=LONGEST)
    assert "not allowed" in told, told
    assert "revoked key" in told, told


def test_a_change_that_no_robot_took_is_told_and_the_old_key_stays(channel: str, tmp_path: Path) -> None:
    folder = keys(tmp_path)
    secret = (folder / "desk.key").read_bytes()
    rotated = called_warm("keys", "rotate", "desk", "--channel", channel)
    assert (rotated.status, (folder / "desk.key").read_bytes()) == (1, secret)
    assert "no robot has received it" in rotated.err


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("revoke", "anna"), "choose a key with --key"),
        (("revoke", "anna", "--key", "anna"), "only a commander may change which keys are trusted"),
        (("revoke", "ana", "--key", "chief"), "did you mean anna"),
        (("revoke", "chief", "--key", "chief"), "cannot end its own key"),
        (("rotate", "anna"), "choose a key with --key"),
        (("rotate", "nobody"), "no key 'nobody'"),
        (("trust", "00" * 32, "--owner", "x", "--role", "robot"), "choose a key with --key"),
    ],
)
def test_what_is_refused_changes_nothing(
    channel: str, tmp_path: Path, arguments: tuple[str, ...], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = keys(tmp_path)
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    refused = called_here(capsys, "keys", *arguments, "--channel", channel)
    assert (refused.status, refused.out) == (2, "")
    assert complaint in refused.err
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before


def test_keys_are_renewed_without_a_fleet(channel: str, tmp_path: Path) -> None:
    folder = keys(tmp_path)
    done = called_warm("keys", "rotate", "anna", "--json")
    assert done.status == 0, done.err
    new = json.loads(done.out)["key"]
    listed = json.loads(called_warm("keys", "list", "--json").out)
    assert [(key["revoked"], key["own"], key["key"] == new) for key in listed if key["owner"] == "anna"] == [
        (True, False, False),
        (False, True, True),
    ]
    assert len(list(folder.glob("anna.*.retired"))) == 1
    ended = called_warm("keys", "revoke", new)
    assert (ended.status, new in ended.out) == (0, True)


def test_what_cannot_be_written_down_is_said_and_counts_all_the_same(channel: str, tmp_path: Path) -> None:
    folder, said = keys(tmp_path), list[str]()
    air = AirOptions("memory:unwritable", "lab", "*", None, folder)
    with closing(session_for(air, "r1", robot=True, say=said.append)) as session:
        (folder / "trust.json").unlink()
        (folder / "trust.json").mkdir()
        trust = session.delivery.admission.trust
        trust.take(KeyChange(revoke=frozenset((trust.keys[0].id,))))
        assert trust.keys[0].revoked
        keeper = keeper_for([], session.delivery, None)
        assert keeper is not None
        assert keeper.before()
        keeper.write()
        assert not keeper.before(), "it is tried again, but not at once"
    assert len(said) == 1
    assert "trust.json" in said[0]


def test_what_several_processes_hear_is_kept_together(tmp_path: Path) -> None:
    file = tmp_path / "trust.json"
    pairs = [KeyPair(name, Role.OPERATOR, name.encode() * 32) for name in "abc"]
    save_trust(Trust([pairs[0].public]), file)
    first, second = load_trust(file), load_trust(file)
    first.take(KeyChange((pairs[1].public,), frozenset((b"v" * 12,)), frozenset((pairs[0].id,))))
    second.take(KeyChange((pairs[2].public,), revoke=frozenset((b"unknown!",))))
    add_trust(first, file)
    add_trust(second, file)
    found = load_trust(file)
    assert {key.owner: key.revoked for key in found.keys} == {"a": True, "b": False, "c": False}
    assert (found.vouched, found.gone) == ((b"v" * 12,), frozenset((b"unknown!",)))
    with pytest.raises(KeyFileLostError, match="cannot write"):
        add_trust(found, file / "below")
