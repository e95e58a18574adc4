"""The wire's page is enough: a receiver written from it alone agrees with ours on all vectors and on a live channel."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import pytest

from channel import independent
from channel.air import DESK, ROBOTS, Air
from channel.independent import (
    Known,
    MalformedError,
    Receiver,
    is_good,
    key_id,
    names_and_piece,
    part_of,
    text_and_body,
)
from channel.test_envelope import unwritten
from sleepcast.channel import Kind, message
from sleepcast.channel.admission import Admission
from sleepcast.channel.drops import DropReason
from sleepcast.channel.keys import KeyChange, PublicKey, Trust
from sleepcast.channel.message import Role
from sleepcast.core.clock import ManualClock

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "wire.md").read_text(encoding="utf-8")
FIELDS = [
    value
    for key, value in vars(message).items()
    if key.isupper() and isinstance(value, str) and value != message.NOT_STORED  # a fault, no field
]
"""Fields of a message's body."""
VECTORS: dict[str, list[dict[str, Any]]] = json.loads((ROOT / "docs" / "wire-vectors.json").read_text(encoding="utf-8"))


def name(vector: dict[str, Any]) -> str:
    return str(vector["about"])


def test_it_knows_nothing_of_sleepcast() -> None:
    tree = ast.parse(Path(independent.__file__).read_text(encoding="utf-8"))
    found = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    found |= {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {module.split(".")[0] for module in found} == {"__future__", "dataclasses", "hashlib", "nacl", "struct"}


@pytest.mark.parametrize("vector", VECTORS["messages"], ids=name)
def test_it_reads_every_message(vector: dict[str, Any]) -> None:
    public, told = bytes.fromhex(vector["public"]), vector["message"]
    parts = [part_of(bytes.fromhex(datagram)) for datagram in vector["datagrams"]]
    assert all(is_good(public, part) and part.key == key_id(public) == bytes.fromhex(vector["key"]) for part in parts)
    assert [(part.number, part.parts) for part in parts] == [(number, len(parts)) for number in range(len(parts))]
    pieces = [names_and_piece(part) for part in parts]
    assert {(fleet, sender) for fleet, sender, _ in pieces} == {(vector["fleet"], told["sender"])}
    text, body = text_and_body(b"".join(piece for _, _, piece in pieces))
    assert (text, body) == (told["text"], unwritten(told["body"]))
    for part in parts:
        deadline = None if part.deadline == independent.NEVER else part.deadline / 1e6
        found = (part.kind, part.stands, part.epoch, part.sequence, part.issued / 1e6, deadline)
        assert found == tuple(told[key] for key in ("kind", "standing", "epoch", "sequence", "issued", "deadline"))


@pytest.mark.parametrize("vector", VECTORS["refused"], ids=name)
def test_it_refuses_what_is_no_message(vector: dict[str, Any]) -> None:
    with pytest.raises(MalformedError):
        part_of(bytes.fromhex(vector["datagram"]))


@pytest.mark.parametrize("vector", VECTORS["doors"], ids=name)
def test_it_and_our_door_take_in_the_same_and_drop_the_rest_for_the_same_reasons(vector: dict[str, Any]) -> None:
    known = [Known(key["owner"], key["role"], bytes.fromhex(key["public"]), key["revoked"]) for key in vector["trust"]]
    vouched = {bytes.fromhex(print_) for print_ in vector["vouched"]}
    keys = {key_id(key.public): key for key in known}
    nonce = bytes.fromhex(vector.get("nonce", ""))
    theirs = Receiver(vector["fleet"], vector["robot"], round(vector["now"] * 1e6), keys, vouched, nonce)
    trust = Trust(PublicKey(key.owner, Role(key.role), key.public, key.revoked) for key in known)
    trust.take(KeyChange(vouch=frozenset(vouched)))
    ours = Admission(trust, vector["fleet"], ManualClock(vector["now"]), robot=vector["robot"])
    ours.nonce = nonce
    for step in vector["steps"]:
        datagram, counts, passed = bytes.fromhex(step["datagram"]), ours.counts.copy(), ours.passed
        ours.enter(datagram)
        dropped = [str(reason) for reason in ours.counts - counts]
        found = "passed" if ours.passed > passed else dropped[0] if dropped else "kept"
        assert (found, theirs.take(datagram)) == (step["found"], step["found"]), step["about"]


def test_there_is_a_vector_of_every_kind_every_key_and_every_reason() -> None:
    told = [vector["message"] for vector in VECTORS["messages"]]
    assert {each["kind"] for each in told} == set(Kind)
    keys = {key for each in told for key in each["body"]}
    assert keys >= {*FIELDS} - {"do", "group", "seconds", "to"}
    reasons = {step["found"] for vector in VECTORS["doors"] for step in vector["steps"]} - {"passed", "kept"}
    by_others = {DropReason.MALFORMED, DropReason.TOO_MANY, DropReason.NO_ROOM, DropReason.HELD_BACK}
    assert reasons == set(DropReason) - by_others


def test_the_page_names_every_key_and_every_reason() -> None:
    for key in FIELDS:
        assert f"`{key}`" in PAGE, f"docs/wire.md does not say what {key!r} is"
    for word in (*message.LeaseAction, *message.Inspection):
        assert f"`{word}`" in PAGE
    for reason in DropReason:
        assert f"*{reason}*" in PAGE


def test_it_follows_a_live_channel() -> None:
    air = Air(3, seed=1, loss=0.5)
    keys = {
        key_id(key.public.public): Known(key.public.owner, key.public.role, key.public.public, False)
        for key in (DESK, ROBOTS)
    }
    receiver = Receiver("lab", True, 0, keys, set())
    send = air._send

    def overheard(who: int, datagram: bytes, now: float) -> None:
        receiver.now = round(now * 1e6)
        assert receiver.take(datagram) in ("passed", "repeated", "kept")
        send(who, datagram, now)

    air._send = overheard  # type: ignore[method-assign]
    sent = []
    for number in range(20):
        sent.append(f"(SETQ v{number} {'9' * number * 80})")
        air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text=sent[-1], standing=number % 3 == 0)
        air.run(0.1)
    air.run(5.0)
    found = {part.sequence: text for _, part, text, _ in receiver.passed if part.kind == "command"}
    assert [found[number] for number in sorted(found)] == sent
    assert {part.kind for _, part, _, _ in receiver.passed} >= {"command", "digest", "request"}
