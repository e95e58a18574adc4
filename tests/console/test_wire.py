"""The WebSocket of the running program: who may open it, what it answers, and what it bears."""

from __future__ import annotations

import http.client
import json
import struct
import time
from contextlib import ExitStack, suppress

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from console.running import PATIENCE, Page, Program, number, open_page
from sleepcast.console.connection import MAX_DROPPED, MAX_MALFORMED, MESSAGES_AT_ONCE, TOO_MUCH
from sleepcast.console.incoming import MAX_BYTES
from sleepcast.console.server import MAX_PAGES

FULL = "(WHEN (> battery 60%) (JOIN crew))"


def get(program: Program, path: str, **headers: str) -> tuple[int, str, dict[str, str]]:
    connection = http.client.HTTPConnection(program.host, timeout=PATIENCE)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    found = answer.status, answer.read().decode(), {name.lower(): value for name, value in answer.getheaders()}
    connection.close()
    return found


def test_of_robots_at_rest_only_the_time_is_sent(page: Page) -> None:
    first = page.frame()
    for _ in range(20):
        last = page.frame()
    assert page.sizes[0] == len(first) == len(last) == 32 + 14 * 20
    assert page.sizes[5:].count(32) >= len(page.sizes[5:]) - 2
    assert struct.unpack_from("<d", last, 16) > struct.unpack_from("<d", first, 16)


class TestDoor:
    def test_the_printed_address_gives_the_page(self, program: Program) -> None:
        status, text, headers = get(program, f"/?token={program.token}")
        assert (status, headers["content-type"]) == (200, "text/html; charset=utf-8")
        assert "<title>sleepcast</title>" in text

    @pytest.mark.parametrize("path", ["/", "/?token=", "/?token=wrong", "/?token=%ff%fe", "/?token=%c3%a9"])
    def test_another_address_gets_a_sentence(self, program: Program, path: str) -> None:
        status, text, _ = get(program, path)
        assert status == (200 if path == "/" else 403)
        assert "main.js" not in text
        assert "Open the address that was printed" in text
        assert program.token not in text

    def test_another_host_is_refused_even_with_the_token(self, program: Program) -> None:
        # A name of someone else's that was made to lead here (DNS rebinding).
        assert get(program, f"/?token={program.token}", Host="evil.example")[0] == 403

    def test_nothing_may_be_loaded_from_elsewhere(self, program: Program) -> None:
        for path in (f"/?token={program.token}", "/static/main.js", "/static/style.css", "/nothing"):
            headers = get(program, path)[2]
            policy = dict(part.strip().split(" ", 1) for part in headers["content-security-policy"].split(";"))
            assert policy["default-src"] == "'none'"
            assert policy["script-src"] == policy["style-src"] == "'self'"
            assert policy["connect-src"] == f"'self' ws://{program.host}"
            assert "unsafe" not in headers["content-security-policy"]
            assert headers["x-content-type-options"] == "nosniff"
            assert headers["referrer-policy"] == "no-referrer"

    def test_no_file_outside_the_page_is_served(self, program: Program) -> None:
        for path in ("/static/../app.py", "/static/%2e%2e/app.py", "/static/..%2fapp.py", "/app.py", "/static/"):
            assert get(program, path)[0] in (404, 405), path

    @pytest.mark.parametrize("origin", [None, "http://evil.example", "null", "https://{host}", "http://localhost:1"])
    def test_a_foreign_origin_opens_no_socket(self, program: Program, origin: str | None) -> None:
        changed = origin and origin.format(host=program.host)
        with pytest.raises(InvalidStatus, match="403"), open_page(program, origin=changed):
            pass

    def test_a_wrong_token_opens_no_socket(self, program: Program, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(Program, "token", "wrong")
        with pytest.raises(InvalidStatus, match="403"), open_page(program):
            pass

    def test_so_many_pages_and_no_more(self, program: Program) -> None:
        def open_one(pages: ExitStack) -> None:
            """Open one more page: the server sees a moment later that others are closed."""
            deadline = time.monotonic() + PATIENCE
            while True:
                try:
                    pages.enter_context(open_page(program))
                    return
                except InvalidStatus:
                    assert time.monotonic() < deadline

        with ExitStack() as pages:
            for _ in range(MAX_PAGES):
                open_one(pages)
            with pytest.raises(InvalidStatus, match="403"), open_page(program):
                pass
        with ExitStack() as pages:
            open_one(pages)


class TestTalk:
    def test_says_first_what_there_is_to_see(self, page: Page) -> None:
        hello = page.news["hello"]
        scene = hello["scene"]
        assert (scene["title"], scene["noun"], hello["count"]) == ("a small world", "rovers", 20)
        assert (scene["area"], scene["unit"], len(scene["names"])) == ([0, 0, 1000, 1000], "km", 20)
        assert scene["places"] == [{"name": "house", "x": 500, "y": 400, "key": "house"}]
        assert scene["commands"][0]["text"] == FULL
        assert {"battery", "GOTO", "AND"} <= {name["name"] for name in hello["names"]}

    def test_previews_sends_and_accounts(self, page: Page) -> None:
        seen = page.ask("preview", text=FULL)
        assert seen["type"] == "previewed"
        assert seen["yes"] + seen["no"] + seen["unknown"] == 20
        sent = page.ask("send", text=FULL)
        assert sent["type"] == "sent"

        def answered(news: dict[str, list[dict[str, int | str]]]) -> bool:
            return any(row["id"] == sent["command"] and row["silent"] == 0 for row in news["rows"])

        rows = page.wait_for("commands", answered)["rows"]
        row = next(row for row in rows if row["id"] == sent["command"])
        assert row["matched"] + row["not_matched"] == 20
        why = page.ask("why", robot=0, command=sent["command"])["why"]
        assert why["text"] == FULL
        assert page.until("groups", lambda news: bool(news["groups"]))["groups"][0]["name"] == "crew"

    def test_what_the_station_refuses_comes_back_as_its_sentence(self, page: Page) -> None:
        assert "every robot that hears it would obey" in page.ask("send", text="(MARK)")["reason"]
        assert "not closed" in page.ask("send", text="(MARK")["reason"]
        assert "no command" in page.ask("outcomes", command="x")["reason"]

    def test_news_of_a_robot_come_for_whoever_watches_it(self, page: Page) -> None:
        page.tell("watch", robot=3)
        news = page.wait_for("robot")
        assert news["robot"] == 3
        assert any(value["name"] == "battery" for value in news["values"])
        page.tell("watch", robot=7)
        assert page.wait_for("robot", lambda found: found["robot"] != 3)["robot"] == 7
        page.tell("pace", running=False)
        page.tell("drawn", number=number(page.frames[-1]))
        while page.frame()[1] & 1:
            pass
        page.tell("watch", robot=-1)
        page.ask("names")
        page.tell("watch", robot=7)
        assert page.wait_for("robot")["robot"] == 7  # though nothing is new: who asks again has forgotten it
        page.tell("pace", running=True)

    def test_time_can_be_paused_stepped_and_run(self, page: Page) -> None:
        page.tell("pace", running=False)
        while page.frame()[1] & 1:
            pass
        stood = page.frames[-1][12:16]
        page.tell("step")
        assert int.from_bytes(page.frame()[12:16], "little") == int.from_bytes(stood, "little") + 1
        page.tell("pace", running=True, factor=5)
        assert page.frame()[1] & 1


class TestFrames:
    def test_a_slow_page_skips_frames_and_delays_nothing(self, program: Program) -> None:
        with open_page(program) as page:
            while not page.frames:
                page.receive()
            old = number(page.frames[-1])
            with open_page(program) as other:  # this page draws nothing, while another one sees ten pictures
                while number(other.frame()) < old + 10:
                    pass
            before = len(page.frames)
            page.ask("preview", text=FULL)
            assert len(page.frames) == before
            page.tell("drawn", number=old)
            while len(page.frames) == before:
                page.receive()
            assert number(page.frames[-1]) >= old + 10

    def test_two_pages_see_the_same_frames(self, program: Program) -> None:
        with open_page(program) as first, open_page(program) as second:
            seen: dict[int, bytes] = {}
            both = 0
            deadline = time.monotonic() + PATIENCE
            while both < 10:
                assert time.monotonic() < deadline
                for page in (first, second):
                    frame = page.frame()
                    both += number(frame) in seen
                    assert seen.setdefault(number(frame), frame) == frame

    def test_pings_are_in_the_frames_of_the_moment(self) -> None:
        with Program("demo", "braitenberg", "--robots", "8", "--speed", "20") as vehicles, open_page(vehicles) as page:
            assert not page.frame()[2]
            sent = page.ask("send", text="(WHEN (EQ myCaste 3) (RULE here (WHEN (PROB 0.5) (PING 3))))")
            assert sent["type"] == "sent", sent
            heard = 0
            deadline = time.monotonic() + PATIENCE
            while heard < 10:
                assert time.monotonic() < deadline
                frame = page.frame()
                if not frame[2]:
                    continue
                heard += 1
                assert len(frame) == 32 + 15 * 8
                codes = frame[-8:]
                assert any(codes)
                assert not any(codes[:4])  # the eyes were not asked to
                assert set(codes[4:]) <= {0, 4}


class TestBearing:
    def test_what_is_no_message_is_answered_and_survived(self, page: Page) -> None:
        for wrong in ("", "{", "[1, 2]", '{"type": "fire"}', '{"type": "stop", "x": 1}', "x" * 5000, "\u0000"):
            page.socket.send(wrong)
            assert "not a message of this page" in page.wait_for("refused")["reason"]
        page.socket.send(b"\xff\x00\xfe")
        assert "not a message of this page" in page.wait_for("refused")["reason"]
        page.socket.send('{"type": "preview", "serial": 41, "txt": "5"}')
        assert page.wait_for("refused")["serial"] == 41
        assert page.ask("preview", text="(MARK)")["yes"] == 20

    def test_a_message_of_the_greatest_length_is_read_and_a_longer_one_is_not(self, program: Program) -> None:
        with open_page(program) as page:
            longest = "; " + "\u0001" * 16_380 + "\n5"  # every character of it is six in JSON
            assert page.ask("preview", text=longest)["type"] == "previewed"
            with suppress(ConnectionClosed):  # the end may come before all of it is out
                page.socket.send(json.dumps({"type": "preview", "serial": 9, "text": "x" * (MAX_BYTES + 1)}))
            with pytest.raises(ConnectionClosed):
                page.drain()
        assert_served(program)

    def test_a_page_that_talks_nonsense_is_shut_out(self, program: Program) -> None:
        with open_page(program) as page:
            for _ in range(MAX_MALFORMED + 1):
                page.socket.send("nonsense")
            with pytest.raises(ConnectionClosed) as closed:
                page.drain()
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == TOO_MUCH
        assert_served(program)

    def test_a_flood_is_refused_but_never_a_stop(self, program: Program) -> None:
        with open_page(program) as page:
            for _ in range(int(MESSAGES_AT_ONCE) + MAX_DROPPED - 200):  # a slow server forgives some, as time goes by
                page.tell("watch", robot=-1)
            page.tell("stop")
            page.wait_for("safety", lambda news: news["latched"] and "all 20" in news["sentence"])
            assert "too many messages at once; this one was not read" in page.refused
            seen = len(page.frames)
            page.tell("drawn", number=number(page.frames[-1]))
            while len(page.frames) == seen:  # nor are there no more pictures
                page.receive()
            time.sleep(0.2)  # a few messages are allowed again
            page.tell("release")
            page.wait_for("safety", lambda news: not news["latched"])

    def test_a_flood_without_end_is_shut_out_and_others_are_served(self, program: Program) -> None:
        with open_page(program) as other:
            with open_page(program) as page, suppress(ConnectionClosed):  # the end may come while it still talks
                for _ in range(2 * (MAX_DROPPED + int(MESSAGES_AT_ONCE))):
                    page.tell("watch", robot=-1)
                page.drain()
            assert page.socket.close_code == TOO_MUCH
            assert other.ask("preview", text="(MARK)")["yes"] == 20


def assert_served(program: Program) -> None:
    with open_page(program) as page:
        assert page.ask("preview", text="(MARK)")["yes"] == 20


def test_the_program_says_nothing_of_all_this(program: Program) -> None:
    """Whatever the tests above did to it, a person at the terminal has seen no traceback."""
    assert program.end() == 130
    assert program.said.count("\n") <= 4, program.said
    assert "Traceback" not in program.said
