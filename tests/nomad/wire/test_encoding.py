"""The wire: requests out of bytes, in three layouts, in whatever pieces they come."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.nomad.wire.encoding import HEADER, MAX_WORDS, Layout, Parser, Request, encode, encode_request

LAYOUTS = list(Layout)
CONNECT = Request(102, (1, 8_000), 2)
words = st.lists(st.integers(-(2**31), 2**31 - 1), max_size=30).map(tuple)
requests = st.lists(st.tuples(st.sampled_from([10, 12, 15, 19, 39, 300, 400, -1, 32_767]), words), max_size=8)


def requests_of(parser: Parser) -> list[Request]:
    return list(iter(parser.next, None))


def in_pieces(parser: Parser, data: bytes, cuts: list[int]) -> list[Request]:
    """What comes of the bytes, cut at these places."""
    places = sorted({cut % (len(data) + 1) for cut in cuts})
    found = []
    for begin, end in zip([0, *places], [*places, len(data)], strict=True):
        parser.feed(data[begin:end])
        found += requests_of(parser)
    return found


@given(st.sampled_from(LAYOUTS), requests, st.lists(st.integers(0, 2000), max_size=20))
def test_requests_come_through_in_every_layout_and_in_any_pieces(
    layout: Layout, sent: list[tuple[int, tuple[int, ...]]], cuts: list[int]
) -> None:
    wanted = [CONNECT, *(Request(kind, numbers, len(numbers)) for kind, numbers in sent)]
    data = b"".join(encode_request(layout, each.type, each.words) for each in wanted)
    parser = Parser()
    assert in_pieces(parser, data, cuts) == wanted
    assert (parser.layout, parser.buffered) == (layout, 0)


@given(st.binary(max_size=2000), st.lists(st.integers(0, 2000), max_size=20))
def test_any_bytes_give_the_same_requests_however_they_are_cut(data: bytes, cuts: list[int]) -> None:
    whole, cut = Parser(), Parser()
    assert in_pieces(whole, data, []) == in_pieces(cut, data, cuts)
    assert (whole.layout, whole.buffered) == (cut.layout, cut.buffered)
    assert whole.buffered <= len(data)


@pytest.mark.parametrize(
    ("first", "layout"),
    [
        ("00660002 00000001 00005a5e", Layout.FOUR),
        ("00660002 00000000 00000001 00000000 00001f21", Layout.EIGHT_TAIL),
        ("00660002 00000001 00000000 00004f37 00000000", Layout.EIGHT_HEAD),
        ("00650002 00000009 00005a5e", Layout.FOUR),
    ],
)
def test_the_first_request_shows_the_layout(first: str, layout: Layout) -> None:
    parser = Parser()
    parser.feed(bytes.fromhex(first))
    request = parser.next()
    assert request is not None
    assert (parser.layout, request.size, parser.buffered) == (layout, 2, 0)


def test_a_32_bit_client_that_asks_for_robot_0_is_told_apart_by_time_alone() -> None:
    parser = Parser()
    parser.feed(encode_request(Layout.FOUR, 102, (0, 77)))
    assert parser.next() is None
    assert parser.undecided
    parser.decide()
    assert parser.next() == (102, (0, 77), 2)


def test_a_64_bit_client_is_not_taken_for_one_though_its_bytes_come_slowly() -> None:
    parser = Parser()
    data = encode_request(Layout.EIGHT_TAIL, 102, (3, 77))
    parser.feed(data[:12])
    assert parser.next() is None
    parser.feed(data[12:])
    assert (parser.next(), parser.layout) == ((102, (3, 77), 2), Layout.EIGHT_TAIL)


def test_requests_before_the_client_has_shown_its_layout_are_read_as_32_bit() -> None:
    parser = Parser()
    parser.feed(encode_request(Layout.FOUR, 12, (1, 2, 3)) + encode_request(Layout.EIGHT_TAIL, 102, (1, 2)))
    assert requests_of(parser) == [(12, (1, 2, 3), 3), (102, (1, 2), 2)]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_message_that_is_too_long_is_read_past_and_told_when_it_is_over(layout: Layout) -> None:
    parser = Parser()
    parser.feed(encode_request(layout, 102, (1, 1)))
    parser.next()
    width = 4 if layout is Layout.FOUR else 8
    parser.feed(HEADER.pack(19, 65_535))
    for _ in range(65_535):
        assert parser.next() is None
        parser.feed(bytes(width))
        assert parser.buffered <= width
    parser.feed(encode_request(layout, 15))
    assert requests_of(parser) == [(19, (), 65_535), (15, (), 0)]


def test_the_longest_message_that_is_kept() -> None:
    parser = Parser()
    parser.feed(encode_request(Layout.FOUR, 19, range(MAX_WORDS)) + encode_request(Layout.FOUR, 19, [0] * 4097))
    first, second = requests_of(parser)
    assert (len(first.words), second) == (MAX_WORDS, (19, (), 4097))


def test_a_reply_to_a_64_bit_client_has_its_values_first() -> None:
    for layout in (Layout.EIGHT_TAIL, Layout.EIGHT_HEAD):
        assert encode(layout, 102, (7771,)) == bytes.fromhex("00660001 00001e5b 00000000")
    assert encode(Layout.FOUR, 102, (7771,)) == encode(None, 102, (7771,)) == bytes.fromhex("00660001 00001e5b")
