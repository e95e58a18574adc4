"""Messages: their identity, and the bounds that each keeps."""

from __future__ import annotations

from math import inf, nan

import pytest

from sleepcast.channel import Kind, Message, MessageError
from sleepcast.channel.message import MAX_NAME, MAX_NUMBER, MAX_TEXT
from sleepcast.core.errors import MisuseError


def test_an_id_tells_sender_epoch_and_number() -> None:
    assert Message("desk", 3, 17, Kind.STOP, 0.0).id == "desk-3.17"


def test_a_message_is_good_for_ever_unless_it_says_otherwise() -> None:
    message = Message("desk", 0, 0, Kind.COMMAND, 1.0)
    assert (message.deadline, message.text, message.standing, message.body) == (inf, "", False, {})


def test_a_message_cannot_be_changed() -> None:
    with pytest.raises(AttributeError):
        Message("desk", 0, 0, Kind.COMMAND, 1.0).text = "(ST)"  # type: ignore[misc]


def test_the_greatest_of_everything_fits() -> None:
    Message("d" * MAX_NAME, MAX_NUMBER, MAX_NUMBER, Kind.COMMAND, 0.0, text="x" * MAX_TEXT)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"sender": ""}, "1 to 64 characters, not 0"),
        ({"sender": "d" * 65}, "not 65"),
        ({"sender": "r7\x1b[2J"}, "none that cannot be printed"),
        ({"text": "x" * (MAX_TEXT + 1)}, "at most 16384 characters, this one has 16385"),
        ({"sequence": -1}, "sequence -1"),
        ({"epoch": MAX_NUMBER + 1}, f"0..{MAX_NUMBER}"),
        ({"issued": nan}, "issued nan"),
        ({"deadline": nan}, "deadline nan"),
    ],
)
def test_a_bound_is_kept_and_said(wrong: dict[str, object], said: str) -> None:
    usual: dict[str, object] = {"sender": "desk", "epoch": 0, "sequence": 0, "kind": Kind.COMMAND, "issued": 0.0}
    with pytest.raises(MessageError, match=said.replace(".", r"\.")) as caught:
        Message(**{**usual, **wrong})  # type: ignore[arg-type]
    assert isinstance(caught.value, MisuseError)
