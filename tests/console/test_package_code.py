"""A package that hangs holds up neither STOP nor the page, is told by its name, and is left out until it is back."""

from __future__ import annotations

import asyncio
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cli.calling import LONGEST
from console.test_registry import BarePage
from packages import install
from sleepcast.console import package_code, page_parts, registry
from sleepcast.console.driver import FrameSource
from sleepcast.console.feature import HANDLERS, NOT_HERE_AT_ALL
from sleepcast.console.outgoing import Alive, Done
from sleepcast.console.package_code import thread_of
from sleepcast.console.page_parts import added_parts
from sleepcast.console.session import PageSession
from sleepcast.core.clock import WallClock
from sleepcast.core.errors import MisuseError

PART = """
from pathlib import Path
from typing import Protocol
from sleepcast.console.page_parts import Done, PageMessage, PagePart, Serial, answers

PAGE = PagePart(Path(__file__).parent, "slow.js")

class Sleep(PageMessage, tag="slow_sleep"):
    serial: Serial
class SleepLater(PageMessage, tag="slow_later"):
    serial: Serial
class Bed(Protocol):
    def sleep(self) -> None: ...

@answers()
def sleep(source: Bed, asked: Sleep) -> Done:
    source.sleep()
    return Done(asked.serial, "awake")

@answers()
async def sleep_later(source: Bed, asked: SleepLater) -> Done:
    source.sleep()
    return Done(asked.serial, "awake")
"""
QUESTIONS = ["slow_sleep", "slow_later"]


class Bed(SimpleNamespace):
    """What a page shows, in which a package sleeps until it is woken."""

    recorded, lacks = False, NOT_HERE_AT_ALL

    def __init__(self) -> None:
        super().__init__(woken=threading.Event(), slept=threading.Event(), stopped=asyncio.Event())

    def sleep(self) -> None:
        self.woken.wait(LONGEST)
        self.slept.set()

    def hello(self) -> Alive:
        return Alive()

    def news(self, watched: int) -> tuple[()]:
        return ()

    def stop(self, by: str = "") -> None:
        self.stopped.set()


class BedPage(BarePage):
    max_waiting = 4

    @property
    def source(self) -> FrameSource:
        return FrameSource()


class FakeSocket:
    """A page that says what it is given, and keeps what it hears."""

    def __init__(self) -> None:
        self.said = asyncio.Queue[dict[str, str]]()
        self.receive = self.said.get

    def say(self, text: str) -> None:
        self.said.put_nowait({"type": "websocket.receive", "text": text})

    async def send_text(self, text: str) -> None: ...


@pytest.fixture(autouse=True)
def questions() -> Iterator[None]:
    """Those of this test are gone after it, and so is the thread of its package."""
    before = dict(HANDLERS)
    yield
    HANDLERS.clear()
    HANDLERS.update(before)
    sys.modules.pop("slow_page", None)
    thread_of.cache_clear()


@pytest.fixture
def slow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "slow.js").write_text("")
    install(tmp_path, monkeypatch, "slow-bots", "[sleepcast.pages]\nslow = slow_page:PAGE\n", slow_page=PART)
    assert [name for name, _ in added_parts(pytest.fail)] == ["slow"]


def ask(tag: str, bed: Bed) -> Any:
    return registry.answer(registry.decode(f'{{"type": "{tag}", "serial": 3}}'), bed)


@pytest.mark.usefixtures("slow")
@pytest.mark.parametrize("tag", QUESTIONS)
def test_stop_is_heard_while_an_answer_waits(tag: str) -> None:
    async def scene() -> None:
        bed, socket = Bed(), FakeSocket()
        page = asyncio.create_task(PageSession(socket, BedPage(bed), WallClock()).run())  # type: ignore[arg-type]
        socket.say(f'{{"type": "{tag}", "serial": 3}}')
        socket.say('{"type": "stop"}')
        stopped = asyncio.create_task(bed.stopped.wait())
        await asyncio.wait({page, stopped}, timeout=LONGEST, return_when=asyncio.FIRST_COMPLETED)
        assert stopped.done(), page
        assert not bed.slept.is_set()
        bed.woken.set()
        page.cancel()
        await asyncio.wait({page})

    asyncio.run(scene())


@pytest.mark.usefixtures("slow")
@pytest.mark.parametrize("tag", QUESTIONS)
def test_a_package_that_hangs_is_left_out_until_it_is_back(tag: str, monkeypatch: pytest.MonkeyPatch) -> None:
    async def scene() -> None:
        bed = Bed()
        with monkeypatch.context() as patched:
            patched.setattr(package_code, "ANSWER_WITHIN", 0.05)
            with pytest.raises(MisuseError, match=r"The package slow-bots has not answered within 0\.05 s"):
                await ask(tag, bed)
        for each in QUESTIONS:
            with pytest.raises(MisuseError, match="The package slow-bots hangs: what it adds is left out until"):
                ask(each, bed)
        bed.woken.set()
        await asyncio.wrap_future(thread_of("slow-bots").begin(bool))
        for each in QUESTIONS:
            answer = ask(each, bed)
            assert (answer if isinstance(answer, Done) else await answer).note == "awake"

    asyncio.run(scene())


def test_a_part_whose_import_hangs_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("slow", "quick"):
        (tmp_path / f"{name}.js").write_text("")
    text = f"from slow_bed import BED\nBED.sleep()\n{PART}"
    install(tmp_path, monkeypatch, "slow-bots", "[sleepcast.pages]\nslow = slow_page:PAGE\n", slow_page=text)
    quick = PART.replace("slow", "quick")
    install(tmp_path, monkeypatch, "quick-bots", "[sleepcast.pages]\nquick = quick_page:PAGE\n", quick_page=quick)
    bed, said = Bed(), list[str]()
    monkeypatch.setitem(sys.modules, "slow_bed", SimpleNamespace(BED=bed))  # type: ignore[arg-type]
    monkeypatch.setattr(page_parts, "LOAD_WITHIN", 2.0)
    assert [name for name, _ in added_parts(said.append)] == ["quick"]
    assert said == ['page "slow" of the package slow-bots is not loaded after 2 s; the page opens without it']
    known = set(HANDLERS)
    bed.woken.set()
    thread_of("slow-bots").begin(bool).result(LONGEST)
    assert bed.slept.is_set()
    assert set(HANDLERS) == known, "it comes too late"
