"""The server: ports that cannot be had, addresses that others reach, and a clean end."""

from __future__ import annotations

import asyncio
import os
import re
import signal
import socket
import subprocess
import sys
from contextlib import closing, suppress
from http.client import HTTPConnection
from pathlib import Path

import pytest
import uvicorn

import forkserver
from arriving import AGES, arriving, nothing_left_open, turns
from console.running import PATIENCE, Program, open_page
from sleepcast.console import server
from sleepcast.console.lobby import Lobby, LobbyServer, protocol_in
from sleepcast.console.server import DEFAULT_PORT, PortError, listen
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import MisuseError
from sleepcast.core.hosts import is_loopback
from small_worlds import write


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write(tmp_path).parent


class TestPort:
    def test_a_port_in_use_is_named_and_another_is_offered(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as other:
            port = other.getsockname()[1]
            with pytest.raises(PortError, match=rf"port {port} of 127.0.0.1 is in use.*--port \d+ \(--port 0 finds"):
                listen("127.0.0.1", port)

    def test_the_highest_port_offers_one_that_exists(self) -> None:
        assert f"--port {DEFAULT_PORT}" in server._why_not("127.0.0.1", 65_535, OSError(98, "in use"))

    def test_a_port_for_the_mighty_is_refused_in_words(self) -> None:
        assert "take one above 1023" in server._why_not("127.0.0.1", 80, PermissionError(13, "Permission denied"))

    def test_an_address_that_is_not_ours_is_refused_in_words(self) -> None:
        with pytest.raises(PortError, match=r"cannot listen on 192\.0\.2\.1 port 0: "):
            listen("192.0.2.1", 0)

    def test_the_program_says_it_and_fails(self, folder: Path) -> None:
        with socket.create_server(("127.0.0.1", 0)) as other:
            port = str(other.getsockname()[1])
            command = [sys.executable, "-m", "sleepcast", "run", folder, "--page", "--no-browser", "--port", port]
            done = forkserver.run(command, capture_output=True, text=True)
        assert done.returncode == 1
        assert done.stderr.startswith(f"port {port} of 127.0.0.1 is in use")
        assert "Traceback" not in done.stderr


class TestHost:
    @pytest.mark.parametrize("host", ["127.0.0.1", "127.3.2.1", "localhost", "::1"])
    def test_loopback_is_known(self, host: str) -> None:
        assert is_loopback(host)

    @pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.5", "::", "robots.example", ""])
    def test_everything_else_needs_to_be_meant(self, host: str) -> None:
        assert not is_loopback(host)
        with pytest.raises(MisuseError, match="add --insecure on a network of your own"):
            server._check_host(host, insecure=False)
        server._check_host(host, insecure=True)

    def test_with_insecure_others_are_served_too_and_still_need_the_token(self, folder: Path) -> None:
        with Program("run", folder, "--page", "--host", "0.0.0.0", "--insecure") as program:
            assert "0.0.0.0" not in program.address, "no browser can open that"
            with open_page(program) as page:
                page.frame()
            port = program.host.rpartition(":")[2]
            program.address = f"http://127.0.0.1:{port}/?token={program.token}"
            with open_page(program) as page:
                page.frame()

    def test_a_name_that_somebody_lets_point_here_reaches_nothing(self, folder: Path) -> None:
        """DNS rebinding: the request comes to an address of ours, for a host of the attacker's."""
        hosts = ("--allow-host", "Robots.local", "--allow-host", "proxy.lab:80")
        with Program("run", folder, "--page", "--host", "0.0.0.0", "--insecure", *hosts) as program:
            port = program.host.rpartition(":")[2]

            def status(host: str, to: str = "127.0.0.1") -> int:
                with closing(HTTPConnection(to, int(port), timeout=60.0)) as asked:
                    asked.request("GET", f"/?token={program.token}", headers={"Host": host})
                    return asked.getresponse().status

            assert status(program.host, program.host.rpartition(":")[0]) == 200
            ours = ("127.0.0.1", "localhost", "robots.local", "ROBOTS.local")
            assert [status(f"{host}:{port}") for host in ours] == [200] * 4
            assert status("proxy.lab:80") == 200
            strangers = ("evil.example", "proxy.lab", "192.0.2.7", "0.0.0.0")
            assert [status(f"{host}:{port}") for host in strangers] == [403] * 4
            assert status("robots.local") == 403

    def test_what_is_no_name_is_refused(self) -> None:
        with pytest.raises(MisuseError, match="wanted a name"):
            server.hosts_of("0.0.0.0", ["http://robots.local/"])


class TestEnd:
    def test_ctrl_c_ends_it_cleanly_though_a_page_is_open(self, folder: Path) -> None:
        with Program("run", folder, "--page") as program, open_page(program) as page:
            page.frame()
            assert program.end() == 130
            assert program.said.strip().endswith("Ctrl-C ends it.")

    def test_sigterm_ends_it_too(self, folder: Path) -> None:
        with Program("run", folder, "--page") as program:
            assert program.wait(signal.SIGTERM) == 143
            assert "Traceback" not in program.said


class TestBrowser:
    def test_a_browser_is_opened_where_there_is_a_screen(self, folder: Path, tmp_path: Path) -> None:
        seen = tmp_path / "seen"
        browser = tmp_path / "browser"
        browser.write_text(f'#!/bin/sh\necho "$1" > {seen}\n')
        browser.chmod(0o755)
        assert "Opened in your browser" in first_words(folder, BROWSER=str(browser), DISPLAY=":0")
        assert re.match(r"http://127\.0\.0\.1:\d+/\?token=", seen.read_text())

    def test_without_a_screen_the_address_is_printed(self, folder: Path) -> None:
        assert "Open this address in a browser" in first_words(folder, BROWSER="true", DISPLAY="")

    def test_a_browser_that_cannot_be_opened_only_means_the_address(self, folder: Path) -> None:
        said = first_words(folder, BROWSER="/nowhere/at/all", DISPLAY=":0", PATH="/nowhere")
        assert "Open this address in a browser" in said


def first_words(folder: Path, **environment: str) -> str:
    """What the program says at its start, browser wanted."""
    bare = {name: value for name, value in os.environ.items() if name != "WAYLAND_DISPLAY"}
    command = [sys.executable, "-m", "sleepcast", "run", folder, "--page", "--port", "0"]
    with forkserver.Popen(
        command, env=bare | environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        assert process.stdout is not None
        said = ""
        while "Ctrl-C" not in said:
            line = process.stdout.readline()
            assert line, said
            said += line
        process.send_signal(signal.SIGINT)
        rest = process.stdout.read()
    assert process.returncode == 130
    assert "Traceback" not in rest
    return said


@pytest.mark.parametrize("age", AGES)
def test_whoever_arrives_as_the_server_ends_is_hung_up_on(age: int) -> None:
    async def nothing(scope: object, receive: object, send: object) -> None:
        """An application that nobody asks."""

    async def scene() -> None:
        reads = protocol_in(Lobby(ManualClock(), print))
        config = uvicorn.Config(nothing, http=reads, lifespan="off", log_level="error", timeout_graceful_shutdown=1)
        config.load()
        ending = LobbyServer(config)
        ending.lifespan = config.lifespan_class(config)
        listener = listen("127.0.0.1", 0)
        await ending.startup([listener])
        with arriving(listener.getsockname()[1]) as client:
            await turns(age)
            await ending.shutdown([listener])
            with suppress(ConnectionResetError):
                async with asyncio.timeout(PATIENCE):
                    assert await asyncio.get_running_loop().sock_recv(client, 1) == b""

    with nothing_left_open():
        asyncio.run(scene())
