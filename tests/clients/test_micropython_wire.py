"""clients/micropython reads and signs the vectors of docs/wire.md, and drops what other robots drop."""

from __future__ import annotations

import json
from collections.abc import Iterator
from math import inf
from pathlib import Path
from typing import Any

import pytest

from clients import board
from sleepcast.channel.envelope import encode
from sleepcast.channel.keys import KeyChange, KeyPair, Role
from sleepcast.channel.message import Kind, Message

ROOT = Path(__file__).resolve().parents[2]
VECTORS: dict[str, list[dict[str, Any]]] = json.loads((ROOT / "docs" / "wire-vectors.json").read_text(encoding="utf-8"))
DOORS = [door for door in VECTORS["doors"] if door["robot"]]
KINDS = ["command", "ask", "stop", "release", "heartbeat", "answer", "report", "digest", "request"]
NEVER = 2**63 - 1
ROOM = "256k"
"""Of memory: the datagrams come as lines of text here."""
UNREAD = {5: "not for us", 6: "not for us", 8: "passed"}
"""Kinds that this robot drops unread, and what others do with them: it repairs nobody, so it needs no requests."""

DESK, SCOUT = KeyPair("desk", Role.COMMANDER, bytes(32)), KeyPair("r9", Role.ROBOT, bytes([9] * 32))
GONE = KeyPair("anna", Role.COMMANDER, bytes([8] * 32))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    board.needed()
    return board.build(tmp_path_factory.mktemp("board"))


def row(key: KeyPair) -> dict[str, Any]:
    """Of a trust file."""
    return {"owner": key.public.owner, "role": key.public.role, "public": key.public.public.hex()}


def write_keys(folder: Path, trust: list[dict[str, Any]]) -> None:
    (folder / "trust.json").write_text(json.dumps({"format": 1, "keys": trust}), encoding="utf-8")
    (folder / "robot.key").write_text(
        json.dumps({"format": 1, "owner": "r3", "role": "robot", "secret": bytes(range(1, 33)).hex()}), encoding="utf-8"
    )


@pytest.fixture
def receiver(folder: Path) -> Iterator[board.Talk]:
    """One that trusts the desk."""
    write_keys(folder, [row(DESK)])
    with board.Talk(board.start(folder, "receiver", heap=ROOM)) as talk:
        yield talk


def micro(seconds: float | None) -> int:
    return NEVER if seconds is None else round(seconds * 1e6)


def test_it_reads_every_message_of_the_vectors(receiver: board.Talk) -> None:
    for vector in VECTORS["messages"]:
        message, content = vector["message"], ""
        for number, datagram in enumerate(vector["datagrams"]):
            found = receiver.ask({"read": datagram})
            times = [micro(message["issued"]), micro(message["deadline"])]
            parts = [number, len(vector["datagrams"])]
            assert found["numbers"] == [message["epoch"], message["sequence"], *times, *parts], vector["about"]
            assert found["kind"] == (9 if message["standing"] else KINDS.index(message["kind"]))
            assert found["names"] == [vector["fleet"], message["sender"]]
            content += str(found["piece"])
        if len(content) < 20_000:  # longer ones do not fit into one line here
            said = receiver.ask({"content": content})
            assert (said["text"], said["keys"]) == (message["text"], sorted(message["body"])), vector["about"]


def test_it_drops_what_is_no_message(receiver: board.Talk) -> None:
    for vector in VECTORS["refused"]:
        assert receiver.ask({"read": vector["datagram"]}) == {}, vector["about"]


@pytest.mark.parametrize("door", [pytest.param(door, id=door["about"]) for door in DOORS])
def test_it_lets_in_what_other_robots_let_in(folder: Path, door: dict[str, Any]) -> None:
    write_keys(folder, door["trust"])
    vouched = {bytes.fromhex(each) for each in door["vouched"]}
    with board.Talk(board.start(folder, "receiver", heap=ROOM)) as receiver:
        nonce = door.get("nonce", "")
        receiver.ask({"fleet": door["fleet"], "now": round(door["now"] * 1000), "nonce": nonce})
        for step in door["steps"]:
            kind = int(step["datagram"][44:46] or "0", 16)
            wanted = step["found"]
            became = receiver.ask({"datagram": step["datagram"]})["became"]
            if wanted != became and kind in UNREAD:
                assert (wanted, became) == (UNREAD[kind], "not allowed"), step["about"]
            elif wanted != became and vouched:  # it keeps no list of what is vouched for
                assert became == "revoked key", step["about"]
                assert wanted in ("passed", "repeated"), step["about"]
            else:
                assert became == wanted, step["about"]


DIGEST, ASK, RELEASE, BEAT = Kind.DIGEST, Kind.ASK, Kind.RELEASE, Kind.HEARTBEAT


@pytest.mark.parametrize(
    ("kind", "body", "state", "needed"),
    [
        (DIGEST, {"have": [[DESK.id, 1, 7]]}, {"rules": 6}, True),
        (DIGEST, {"have": [[DESK.id, 1, 7]]}, {"rules": 7}, False),
        (DIGEST, {"have": [[DESK.id, 1, 7]]}, {"rules": 7, "speaks": True}, True),
        (DIGEST, {"have": [[DESK.id, 1, 5]]}, {"rules": 7, "speaks": True}, False),
        (DIGEST, {"have": [[SCOUT.id, 1, 9]]}, {"rules": 7}, False),
        (DIGEST, {"have": [[GONE.id, 1, 9]]}, {"rules": 7}, False),
        (DIGEST, {"have": "nonsense"}, {}, False),
        (ASK, {}, {}, True),
        (ASK, {"again": "desk-1.4", "for": ["r2", "r3"]}, {}, True),
        (ASK, {"again": "desk-1.4", "for": ["r2"]}, {}, False),
        (ASK, {"again": "desk-1.4", "not": ["r3"]}, {}, False),
        (ASK, {"again": "desk-1.4", "for": ["r2"]}, {"driven": True}, True),
        (RELEASE, {}, {}, True),
        (RELEASE, {"for": ["r2", "r3"]}, {}, True),
        (RELEASE, {"for": ["r2"]}, {}, False),
        (RELEASE, {"for": ["r2"]}, {"driven": True}, True),
        (BEAT, {}, {}, False),
        (BEAT, {}, {"driven": True}, True),
    ],
)
def test_it_verifies_only_what_could_change_what_it_does(
    folder: Path, kind: Kind, body: dict[str, object], state: dict[str, Any], needed: bool
) -> None:
    """Of what goes on between others. rules: which standing command of the desk it has; speaks: whether its own digest
    is due; driven: whether it goes on only while an operator is heard."""
    write_keys(folder, [row(DESK), row(SCOUT), {**row(GONE), "revoked": True}])
    key = SCOUT if kind is DIGEST else DESK
    message = Message(key.public.owner, 1, 3, kind, 1_800_000_000.0, 1_800_000_005.0, body=body)
    with board.Talk(board.start(folder, "receiver", heap=ROOM)) as receiver:
        receiver.ask({"fleet": "lab", "now": 1_800_000_001_000, "nonce": ""})
        (datagram,) = encode(message, "lab", key)
        state = {"rules": 0, "speaks": False, "driven": False, "key": DESK.id.hex(), **state}
        reason = receiver.ask({"looked": datagram.hex(), **state})["reason"]
    assert reason == ("" if needed else "not needed")


def desk_says(number: int, text: str, rules: int, **more: object) -> str:
    """A standing command of the desk, as hexadecimal digits. rules: which one comes before it; more: of its body."""
    link = {"after": rules, "sent": None, "until": None, "rules": rules, **more}
    message = Message("desk", 1, number, Kind.COMMAND, 1_800_000_000.0, inf, text, standing=True, body=link)
    (datagram,) = encode(message, "lab", DESK)
    return datagram.hex()


def test_whatever_it_has_to_say_it_verifies_what_others_say(receiver: board.Talk) -> None:
    """It used to sign one message after the other while a command waited, if there was always another one to sign."""
    commands = [desk_says(number, f"(DEFVAR v{number} 0)", number - 1) for number in range(1, 5)]
    receiver.ask({"fleet": "lab", "now": 1_800_000_001_000, "nonce": ""})
    found = receiver.ask({"busy": commands, "most": 20})
    assert found["left"] == 0
    assert found["said"] <= len(commands) + 1


@pytest.mark.parametrize(("told", "wanted"), [(0, [[7]]), (7, [])])
def test_standing_commands_that_others_have_are_asked_for_by_digests_alone(
    receiver: board.Talk, told: int, wanted: list[list[int]]
) -> None:
    """Those come in their order, from the first that is missing; the one that a later command names could only wait.
    told: the latest one that others say they have."""
    now = 1_800_000_001_000
    receiver.ask({"fleet": "lab", "now": now, "nonce": ""})
    link = {"after": 8, "sent": now / 1000, "until": now / 1000 + 60, "rules": 7}
    found = receiver.ask({"follows": link, "key": DESK.id.hex(), "told": told, "now": now})
    assert found["wanted"] == wanted


def test_of_digests_that_differ_it_verifies_each_only_once(receiver: board.Talk) -> None:
    """Of one stream one neighbour has more, of another one another; what both say together is known then."""
    now = 1_800_000_001_000
    receiver.ask({"fleet": "lab", "now": now, "nonce": ""})
    one, other, both = [(1, 9), (2, 3)], [(1, 7), (2, 5)], [(1, 9), (2, 5)]
    found = receiver.ask({"digests": [one, other, one, other, both], "key": DESK.id.hex(), "now": now})
    assert found["matter"] == [True, True, False, False, False]


@pytest.mark.parametrize(
    ("waits", "told", "calm", "said"), [(True, 3, 0, []), (True, 3, 1, [7]), (False, 3, 0, [7]), (True, 0, 0, [7])]
)
def test_it_asks_for_more_standing_commands_once_none_waits(
    receiver: board.Talk, waits: bool, told: int, calm: int, said: list[int]
) -> None:
    """Others would send again what waits; but while somebody forges, it may be that what waits is none, and before
    others have told of more, nothing else would make it ask. told: the latest one that others say they have; calm:
    ticks until forgeries are forgotten; said: kinds of what it says (7: a digest)."""
    now = 1_800_000_001_000
    receiver.ask({"fleet": "lab", "now": now, "nonce": ""})
    commands = [desk_says(1, "(DEFVAR v 0)", 0)] * waits
    found = receiver.ask({"waits": commands, "key": DESK.id.hex(), "told": told, "calm": calm, "now": now})
    assert found == {"said": said, "eager": not said}


def test_what_others_had_is_forgotten_when_keys_change(receiver: board.Talk) -> None:
    """Commands under a revoked key never come; a robot that waited for them would ask for ever."""
    now = 1_800_000_001_000
    receiver.ask({"fleet": "lab", "now": now, "nonce": ""})
    told = {"digests": [[(7, 9)], [(7, 9)]], "key": DESK.id.hex(), "now": now}
    assert receiver.ask(told)["matter"] == [True, False]
    change = desk_says(1, "", 0, keys=KeyChange(revoke=frozenset((GONE.id,))).written())
    assert receiver.ask({"busy": [change], "most": 20})["left"] == 0
    assert receiver.ask(told)["matter"] == [True, False]


def test_stops_of_one_key_push_out_none_of_another_and_hold_until_a_release_names_them(receiver: board.Talk) -> None:
    """As on every node, with less room: what is lost is counted by the mark `?`."""
    receiver.ask({"fleet": "lab", "now": 1_800_000_001_000, "nonce": ""})
    stops = [["anna", 1, 5, "key of anna"], *(["watch", epoch, 1, "key of watch"] for epoch in range(1, 71))]
    before = [["bert", 3, 4]]  # as 0.2.0 stored it
    found = receiver.ask(
        {"before": before, "stops": stops, "releases": [["watch", []], ["anna", []], ["chief", before]]}
    )
    held, left = found["held"], found["left"]
    assert isinstance(held, list)
    assert isinstance(left, list)
    assert ["anna", 1, 5] in held
    assert ["bert", 3, 4] in held
    assert len(held) == 16
    assert found["freed"] == [False, False, False]
    assert {row[0] for row in left} == {"watch", "?"}
    (forgotten,) = (row for row in left if row[0] == "?")
    more = receiver.ask({"stops": [["?", 0, 0, "key"]], "releases": [["chief", left]]})
    assert more["freed"] == [False], "one more STOP came after that RELEASE was sent"
    assert more["left"] == [["?", 0, forgotten[2] + 1]]
    assert more["names"] == f"?-0.{forgotten[2] + 1}"
    assert receiver.ask({"stops": [], "releases": [["chief", more["left"]]]})["freed"] == [True]
    again = receiver.ask({"stops": stops, "releases": [["?", []], ["watch", held]]})
    assert again["freed"] == [False, False], "its number never begins again"


def test_digests_of_one_key_hide_nothing_of_what_another_tells(receiver: board.Talk) -> None:
    now = 1_800_000_001_000
    receiver.ask({"fleet": "lab", "now": now, "nonce": ""})
    honest = {"digests": [[(1, 9)]], "key": DESK.id.hex(), "now": now}
    assert receiver.ask(honest)["matter"] == [True]
    for start in range(100, 400, 30):
        lies = [[(epoch, 7) for epoch in range(start, start + 30)]]
        receiver.ask({"digests": lies, "key": DESK.id.hex(), "now": now, "teller": "aa"})
    assert receiver.ask(honest)["matter"] == [False], "it is still known"


def test_nobody_pushes_out_the_streams_and_numbers_of_others(receiver: board.Talk) -> None:
    now = 1_800_000_001_000
    receiver.ask({"fleet": "lab", "now": now, "nonce": ""})
    begun = [("aa" * 8, 1, True), ("bb" * 8, 1, False), *(("cc" * 8, epoch, False) for epoch in range(70))]
    heard = [("aa" * 8, "anna", 1), ("bb" * 8, "bert", 1), *(("cc" * 8, f"r{number}", 1) for number in range(200))]
    found = receiver.ask({"begun": begun, "begun_by": heard, "now": now})
    for table, room in (("streams", 8), ("heard", 32)):
        keys = found[table]
        assert isinstance(keys, list)
        assert len(keys) == room
        assert {"aa" * 8, "bb" * 8} < {*keys}


def test_it_signs_as_others_do(receiver: board.Talk) -> None:
    vector = next(each for each in VECTORS["messages"] if each["role"] == "operator" and not each["message"]["body"])
    message = vector["message"]
    key = KeyPair(vector["owner"], Role(vector["role"]), bytes.fromhex(vector["seed"]))
    numbers = [message["epoch"], message["sequence"], micro(message["issued"]), micro(message["deadline"])]
    found = receiver.ask(
        {
            "seed": vector["seed"],
            "key": key.id.hex(),
            "kind": KINDS.index(message["kind"]),
            "numbers": numbers,
            "lab": vector["fleet"],
            "sender": message["sender"],
            "text": message["text"],
        }
    )
    assert found["public"] == vector["public"]
    assert found["datagram"] == vector["datagrams"][0]
