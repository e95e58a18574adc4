"""Features of the page: each stands in one file, is answered by what supports it, and else refused in one sentence."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from console.asking import put
from sleepcast.console import registry
from sleepcast.console.dialogue import Dialogue
from sleepcast.console.driver import FrameSource
from sleepcast.console.feature import HANDLERS, NO_ROBOTS, NOT_HERE_AT_ALL, answers
from sleepcast.console.features.accounts import Outcomes
from sleepcast.console.features.lease import ChangeLease
from sleepcast.console.features.picture import GetPicture
from sleepcast.console.features.spread import GetSpread, SpreadSource
from sleepcast.console.features.wink import Wink
from sleepcast.console.incoming import Drawn, PageMessage, Release, Stop
from sleepcast.core.errors import MisuseError

NOTHING: Any = SimpleNamespace(recorded=False, lacks=NOT_HERE_AT_ALL)
RECORDING: Any = SimpleNamespace(recorded=True, lacks=NO_ROBOTS)


@pytest.mark.parametrize(
    ("source", "question", "sentence"),
    [
        (NOTHING, Wink(1, 0), NOT_HERE_AT_ALL),
        (RECORDING, Wink(1, 0), NO_ROBOTS),
        (NOTHING, GetPicture(1), "There is no picture of this map."),
        (SimpleNamespace(**vars(NOTHING), picture=None, at_once=True), GetPicture(1), "no picture of this map"),
        (NOTHING, ChangeLease(1, "take", "bravo"), "Leases are for robots on the air"),
        (RECORDING, ChangeLease(1, "take", "bravo"), NO_ROBOTS),
        (RECORDING, Outcomes(1, "desk-1.1"), "A recording stores how many robots obeyed a command, not which ones."),
    ],
)
def test_what_a_source_does_not_support_is_refused_in_one_sentence(
    source: Any, question: PageMessage, sentence: str
) -> None:
    with pytest.raises(MisuseError, match=sentence):
        registry.answer(question, source)


def test_the_page_itself_is_asked_before_its_desk() -> None:
    page = SimpleNamespace(picture=lambda: b"page", at_once=True)
    desk: Any = SimpleNamespace(**vars(NOTHING), picture=lambda: b"desk", at_once=True)
    assert registry.answer(GetPicture(1), desk, page).png == b"page"  # type: ignore[union-attr]
    assert put(desk, GetPicture, 1).png == b"desk"


def test_no_question_is_answered_twice() -> None:
    def again(source: SpreadSource, asked: GetSpread) -> None: ...

    with pytest.raises(
        MisuseError, match=r'the tag "spread" is that of two questions, of sleepcast.console.features.spread and of '
    ):
        answers()(again)


class Halted(PageMessage, tag="stop"):
    """A question of a package that would be taken for STOP."""


def test_nobody_else_takes_the_tag_of_stop() -> None:
    def halted(source: SpreadSource, asked: Halted) -> None: ...

    with pytest.raises(MisuseError, match='the tag "stop" is that of two questions'):
        answers()(halted)


class StoppedDesk(SimpleNamespace):
    """A desk that knows STOP and RELEASE, and nothing else."""

    recorded, lacks = False, NOT_HERE_AT_ALL

    def stop(self, by: str = "") -> None:
        self.said.append(f"stop {by}".strip())

    def release(self, by: str = "") -> None:
        self.said.append(f"release {by}".strip())


class BarePage(Dialogue[Any]):
    @property
    def source(self) -> FrameSource:
        raise NotImplementedError


def test_stop_and_release_pass_by_the_registry(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever becomes of the features, and at whatever time a page looks."""
    assert not {Stop, Release, Drawn} & set(HANDLERS)
    desk = StoppedDesk(said=[])
    page = BarePage(desk)

    def broken(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(registry, "answer", broken)
    assert page.answer(registry.decode('{"type": "stop"}')) is None
    assert page.answer(registry.decode('{"type": "release"}')) is None
    assert desk.said == ["stop", "release"]
