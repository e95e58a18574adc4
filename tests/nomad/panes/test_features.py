"""What the page of Nomads may say beside what every page may: exact shapes, answered by Nomads alone."""

from __future__ import annotations

import json

import msgspec
import pytest

from sleepcast.console.feature import NOT_HERE_AT_ALL
from sleepcast.console.incoming import PageMessage, PageMessageError
from sleepcast.console.registry import answer, collect, decode, messages
from sleepcast.core.errors import MisuseError
from sleepcast.nomad.panes import features

collect(features)

GOOD = {
    "perform": {"serial": 1, "robot": 0, "order": "vm", "numbers": [50, -50], "text": ""},
    "drive": {"robot": 0, "numbers": [50, 50, 0]},
    "click": {"serial": 1, "robot": 0, "x": 1.5, "y": -2.5},
    "load": {"serial": 1, "name": "room.txt", "text": "3 0 0 100 0 0 100"},
    "save": {"serial": 1},
}


class Elsewhere:
    """Any other source."""

    recorded, lacks = False, NOT_HERE_AT_ALL


@pytest.mark.parametrize("kind", GOOD)
def test_every_message_of_the_page_is_read_and_answered_by_nomads_alone(kind: str) -> None:
    asked = decode(json.dumps({"type": kind, **GOOD[kind]}))
    assert isinstance(asked, PageMessage)
    assert type(asked).__struct_config__.tag == kind
    assert all(msgspec.to_builtins(getattr(asked, name)) == value for name, value in GOOD[kind].items())
    with pytest.raises(MisuseError, match="This is not supported for these robots"):
        answer(asked, Elsewhere())


def test_no_message_was_forgotten_here() -> None:
    own = [each for each in messages() if each.__module__.startswith("sleepcast.nomad.")]
    assert set(GOOD) == {each.__struct_config__.tag for each in own}


@pytest.mark.parametrize(
    "wrong",
    [
        '{"type": "perform", "serial": 1, "robot": -1, "order": "st", "numbers": []}',
        '{"type": "perform", "serial": 1, "robot": 0, "order": "vm", "numbers": [2147483648]}',
        '{"type": "drive", "robot": 0, "numbers": [1, 2]}',
        '{"type": "click", "serial": 1, "robot": 0, "x": 1e6, "y": 0}',
        json.dumps({"type": "load", "serial": 1, "name": "a", "text": "#" * 100_001}),
    ],
)
def test_what_is_no_message_is_refused_with_a_sentence(wrong: str) -> None:
    with pytest.raises(PageMessageError, match="not a message of this page: "):
        decode(wrong)
