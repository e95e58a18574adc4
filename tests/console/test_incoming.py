"""What the page may say: exact shapes; everything else is refused with a sentence, whatever it is."""

from __future__ import annotations

import json
from contextlib import suppress

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.console.incoming import PageMessage, PageMessageError, serial_in
from sleepcast.console.registry import decode, messages

GOOD = {
    "preview": {"serial": 1, "text": "(MARK)"},
    "spread": {"serial": 1, "text": "(> fuel 50%)", "at": 8},
    "pick": {"serial": 1, "marks": "Bw=="},
    "addalert": {"serial": 1, "text": "(< fuel 20%)", "above": 3},
    "mutealert": {"serial": 1, "alert": 1, "muted": True},
    "removealert": {"serial": 1, "alert": 1},
    "fired": {"serial": 1, "firing": 2},
    "wink": {"serial": 1, "robot": 3},
    "cancel": {"serial": 1, "by": "anna"},
    "send": {"serial": 1, "text": "(MARK)", "everybody": True},
    "halt": {},
    "lease": {"serial": 1, "deed": "take", "group": "bravo", "seconds": 30.0},
    "names": {"serial": 1},
    "glance": {"serial": 1},
    "radio": {"serial": 1, "after": 12.5, "thinned": 1},
    "phrase": {"serial": 3, "text": "(MARK)"},
    "understand": {"serial": 4, "text": "all robots stop"},
    "why": {"serial": 1, "robot": 0, "command": "desk-1.1"},
    "outcomes": {"serial": 1, "command": "desk-1.1"},
    "failed": {"serial": 1, "rule": "guard"},
    "replies": {"serial": 1, "command": "desk-1.1", "robots": [3, 0]},
    "members": {"serial": 1, "group": 3},
    "sense": {"serial": 1, "robot": 3},
    "sight": {"serial": 1, "robot": 3},
    "field": {"serial": 1, "name": "scent"},
    "build": {"serial": 1, "corners": [(0.0, 0.0), (1.0, 0.0), (0.5, 2.5)]},
    "shift": {"serial": 1, "version": 2, "place": 3, "across": 1.5, "up": -1.0},
    "clear": {"serial": 1, "version": 2, "place": 3},
    "undo": {"serial": 1, "change": 4, "again": True},
    "addrobot": {"serial": 1, "kind": "scout", "x": 2.0, "y": 3.5},
    "picture": {"serial": 1},
    "commands": {"serial": 1},
    "rows": {"serial": 1, "columns": ["fuel"], "sort": 0, "where": "(> x 5)", "first": 7, "count": 40, "again": True},
    "range": {"serial": 1, "first": 3, "count": 100_000},
    "csv": {"serial": 1, "piece": 2, "robots": [5, 3]},
    "plot": {"serial": 1, "kind": "time", "x": "fuel", "where": "(IN bravo)", "what": "quantiles"},
    "unplot": {"serial": 1, "number": 4},
    "plotted": {"serial": 1, "number": 4, "after": 17.5, "thinned": 2},
    "stop": {},
    "release": {},
    "pace": {"running": False, "factor": 2.5},
    "seek": {"time": 12.5},
    "look": {"time": 12.5},
    "fork": {"serial": 1, "time": 12.5},
    "ghosts": {"on": False},
    "step": {},
    "watch": {"robot": -1},
    "drawn": {"number": 7},
    "scenarios": {"serial": 1},
    "setup": {"serial": 1, "scenario": "bravo"},
    "drafttest": {"serial": 1},
    "counttrue": {"serial": 1, "text": "(IN bravo)"},
    "savetest": {
        "serial": 1,
        "tick": 5,
        "name": "rescue",
        "held": {"desk-1.1": [{"count": "matched", "how": "at least", "number": 3}]},
        "goals": [{"text": "(IN bravo)", "how": "exactly", "number": 3}],
        "exact": True,
    },
    "renew": {"serial": 1, "scenario": "bravo", "seed": "9", "robots": 200, "values": {"near": 5.0}},
    "play": {"serial": 1, "on": False},
    "sendline": {"serial": 1, "line": 2, "again": True},
    "skipline": {"serial": 1, "line": 2},
}


@pytest.mark.parametrize("kind", GOOD)
def test_every_message_of_the_page_is_read(kind: str) -> None:
    found = decode(json.dumps({"type": kind, **GOOD[kind]}))
    assert type(found).__struct_config__.tag == kind
    wanted = GOOD[kind] | ({"marks": b"\x07"} if kind == "pick" else {})
    fields = msgspec.to_builtins(found, builtin_types=(bytes,))
    assert {name: fields[name] for name in wanted} == wanted


def test_no_message_was_forgotten_here() -> None:
    """Those of packages are theirs to try."""
    own = [each for each in messages() if each.__module__.startswith("sleepcast.console.")]
    assert set(GOOD) == {each.__struct_config__.tag for each in own}


@pytest.mark.parametrize(
    "wrong",
    [
        "",
        "{",
        "[]",
        "null",
        '"stop"',
        "{}",
        '{"type": "fire"}',
        '{"type": "Stop"}',
        '{"type": "stop", "more": 1}',
        '{"type": "preview", "serial": 1}',
        '{"type": "preview", "serial": 0, "text": "5"}',
        '{"type": "preview", "serial": 1.5, "text": "5"}',
        json.dumps({"type": "rows", "serial": 1, "columns": ["x"] * 13}),
        '{"type": "rows", "serial": 1, "columns": [], "count": 201}',
        '{"type": "plot", "serial": 1, "kind": "pie", "x": "x"}',
        '{"type": "preview", "serial": 1, "text": 5}',
        json.dumps({"type": "preview", "serial": 1, "text": "x" * 16_385}),
        '{"type": "send", "serial": 1, "text": "5", "everybody": 1}',
        '{"type": "seek"}',
        '{"type": "seek", "time": -1}',
        '{"type": "pace", "factor": 0}',
        '{"type": "pace", "factor": -1}',
        '{"type": "pace", "factor": 1e300}',
        '{"type": "pace", "factor": NaN}',
        '{"type": "watch", "robot": -2}',
        '{"type": "drawn", "number": 4294967296}',
        '{"type": "why", "serial": 1, "robot": 0, "command": "' + "x" * 161 + '"}',
        '{"type": "renew", "serial": 1, "seed": "-1"}',
        '{"type": "renew", "serial": 1, "seed": "12345678901234567890"}',
        '{"type": "renew", "serial": 1, "robots": 0}',
        '{"type": "savetest", "serial": 1, "tick": 5, "name": "../rescue"}',
        '{"type": "savetest", "serial": 1, "tick": 5, "name": "a", "goals": [{"text": "x", "how": "~", "number": 1}]}',
        '{"type": "setup", "serial": 1, "scenario": "' + "x" * 501 + '"}',
        b"\xff\xfe",
        b"\x00" * 40,
        "[" * 100_000,
    ],
)
def test_what_is_no_message_is_refused_with_a_sentence(wrong: str | bytes) -> None:
    with pytest.raises(PageMessageError, match="not a message of this page: "):
        decode(wrong)


def test_a_refusal_can_name_the_question() -> None:
    assert serial_in('{"type": "fire", "serial": 12}') == 12
    assert serial_in('{"type": "fire", "serial": -1}') is None
    assert serial_in('{"type": "fire"}') is None
    assert serial_in(b"\xff") is None


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inside: st.lists(inside) | st.dictionaries(st.text(), inside),
    max_leaves=20,
)
shaped = st.builds(
    lambda kind, fields: json.dumps({"type": kind, **fields}),
    st.sampled_from([*GOOD, "", "fire"]),
    st.dictionaries(st.sampled_from(["serial", "text", "robot", "command", "number", "factor", "more"]), json_values),
)


@given(st.text() | st.binary() | shaped)
def test_nothing_at_all_raises_anything_else(data: str | bytes) -> None:
    serial_in(data)
    with suppress(PageMessageError):
        assert isinstance(decode(data), PageMessage)
