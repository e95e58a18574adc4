"""How far the compiler is: a count that is asked while somebody waits."""

from __future__ import annotations

from threading import Event

import pytest
from rich.progress import Progress

from sleepcast.api import progress
from sleepcast.api.progress import counting, counting_column


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> Event:
    found = Event()
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    monkeypatch.setattr(progress, "_somebody_sees", lambda: True)
    monkeypatch.setattr(Progress, "start", lambda line: found.set())
    return found


def test_who_waits_sees_a_count(started: Event) -> None:
    with counting("kernel", lambda: 0, 88):
        assert started.wait(60.0)


@pytest.mark.parametrize(("quiet", "seen", "count"), [(True, True, 0), (False, False, 0), (False, True, 88)])
def test_nobody_is_shown_what_nobody_sees_or_what_is_done_already(
    started: Event, monkeypatch: pytest.MonkeyPatch, quiet: bool, seen: bool, count: int
) -> None:
    monkeypatch.setattr(progress, "_somebody_sees", lambda: seen)
    asked = Event()

    def counted() -> int:
        asked.set()
        return count

    with counting("kernel", counted, 88, quiet=quiet):
        assert quiet or not seen or asked.wait(60.0)
    assert not started.is_set()


def test_the_count_is_never_more_than_what_there_is() -> None:
    line = Progress()
    line.add_task("")
    (task,) = line.tasks
    assert str(counting_column("kernel", lambda: 7, 88).render(task)) == "kernel 7 of 88"
    assert str(counting_column("kernel", lambda: 97, 88).render(task)) == "kernel 88 of 88"
