"""The desks of several operators at one place."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from sleepcast.channel import Kind, Message
from sleepcast.channel.desks import desk_of, sent_by
from sleepcast.core.errors import MisuseError


@dataclass
class Sent:
    message: Message


@dataclass
class Seat:
    """A desk that has sent messages at these times, s."""

    name: str
    times: list[float] = field(default_factory=list)

    def commands(self) -> list[Sent]:
        return [Sent(Message(self.name, 1, number, Kind.STOP, time)) for number, time in enumerate(self.times, 1)]


CHIEF, ANNA = Seat("chief", [1.0, 3.0]), Seat("anna", [2.0, 3.0])


def test_what_all_have_sent_comes_in_the_order_of_its_times() -> None:
    sent = [(each.message.sender, each.message.issued) for each in sent_by([CHIEF, ANNA])]
    assert sent == [("chief", 1.0), ("anna", 2.0), ("chief", 3.0), ("anna", 3.0)]
    assert len(sent_by([ANNA])) == 2
    assert sent_by([]) == []


def test_a_desk_is_found_by_its_operator_and_the_first_by_nobody() -> None:
    names = {"chief": "commander", "anna": "operator"}
    assert desk_of("anna", names, [CHIEF, ANNA]) is ANNA
    assert desk_of("", names, [CHIEF, ANNA]) is CHIEF
    assert desk_of("", (), [CHIEF]) is CHIEF


@pytest.mark.parametrize(
    ("operator", "names", "desks", "wrong"),
    [
        ("ana", ("chief", "anna"), [CHIEF, ANNA], "no operator ana.*did you mean anna.*wanted one of chief, anna"),
        ("anna", (), [CHIEF], "no operator anna: nobody is named in this run"),
        ("anna", ("chief", "anna"), [CHIEF], "nobody sits at the desk of anna"),
        ("", (), [], "nobody sits at the desk of the operator"),
    ],
)
def test_a_desk_that_is_not_there_is_refused(
    operator: str, names: tuple[str, ...], desks: list[Seat], wrong: str
) -> None:
    with pytest.raises(MisuseError, match=wrong):
        desk_of(operator, names, desks)
