"""What digests and requests say, and what in them is no use."""

from __future__ import annotations

from sleepcast.channel.repair_bodies import MAX_ASKED, request, streams_in, wanted_parts

ANNA, BERT = (b"a" * 8, 1), (b"b" * 8, 2)


def test_a_request_names_whole_commands_by_stream_and_parts_by_command() -> None:
    body = request([(ANNA, 3, ()), (ANNA, 5, ()), (BERT, 7, (1, 2))])
    assert streams_in(body, "want", list) == [(ANNA, [3, 5])]
    assert wanted_parts(body) == [(BERT, 7, [1, 2])]
    assert request([]) == {}


def test_malformed_entries_are_left_out() -> None:
    body: dict[str, object] = {
        "have": [[*ANNA, 3], [*ANNA, "3"], ["a", 1, 3], [b"a"], 7],
        "parts": [[*ANNA, 1, ["x"]], [*ANNA, 1, [2, "x"]], "parts"],
    }
    assert streams_in(body, "have", int) == [(ANNA, 3)]
    assert wanted_parts(body) == [(ANNA, 1, [2])]
    assert streams_in({"have": 3}, "have", int) == wanted_parts({"parts": 3}) == []


def test_no_request_asks_for_parts_of_too_many() -> None:
    assert len(wanted_parts({"parts": [[*ANNA, number, [1]] for number in range(2 * MAX_ASKED)]})) == MAX_ASKED
