"""All features of the page: it collects the modules in `features/`, reads what a page asks, and has it answered.

Those of other pages are collected when such a page is served. What no source supports is refused here,
and nowhere else. STOP and RELEASE do not come by here: `dialogue` hands them
to the desk at once.
"""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import ClassVar, Protocol, Union

import msgspec

from sleepcast.console import features
from sleepcast.console.feature import BEGINNINGS, HANDLERS, NOT_HERE_AT_ALL, Reply, Then, has
from sleepcast.console.incoming import Drawn, PageMessage, Release, Stop, read
from sleepcast.core.errors import MisuseError

AT_ONCE: tuple[type[PageMessage], ...] = (Stop, Release, Drawn)
"""What is no feature: it goes the shortest way."""


def collect(package: ModuleType) -> None:
    """Import all modules of a folder of features, which lets their questions be asked."""
    for module in iter_modules(package.__path__, f"{package.__name__}."):
        import_module(module.name)


collect(features)


class Source(Protocol):
    """Anything that pages show. recorded: whether it is a recording. lacks: what is said of what it does not support,
    unless the feature says more."""

    recorded: ClassVar[bool]
    lacks: ClassVar[str]


def messages() -> tuple[type[PageMessage], ...]:
    """Everything that a page may say."""
    return *AT_ONCE, *HANDLERS


def decode(data: str | bytes) -> PageMessage:
    """The message in `data`. Raises PageMessageError."""
    return read(_decoder(len(HANDLERS)), data)


@lru_cache(maxsize=1)  # questions only come to it while packages are loaded
def _decoder(questions: int) -> msgspec.json.Decoder[PageMessage]:
    return msgspec.json.Decoder(Union[(*AT_ONCE, *HANDLERS)])


def answer(asked: PageMessage, desk: Source, page: object = None, then: Then | None = None) -> Reply:
    """The answer to a question: by the desk, or (first) by the page itself. Raises SleepcastError, with a sentence for
    who asked.

    asked: the question
    desk: of the page
    page: what one page has for itself, None for nothing
    then: another time than now, at which the page looks
    """
    handler = HANDLERS.get(type(asked))
    if handler is None:
        raise MisuseError(NOT_HERE_AT_ALL)
    source = next((each for each in (page, desk) if handler.supported_by(each)), None)
    if then is not None and handler.then is not None:
        answered = handler.then(source, asked, then)
        if answered is not None:
            return answered
    if source is None:
        own = handler.recording if desk.recorded else ""
        raise MisuseError(own or handler.lacking or desk.lacks)
    return handler.answer(source, asked)


def begin(desk: Source) -> None:
    """Begin what features do from the start, whether anybody asks or not."""
    for needs, function in BEGINNINGS:
        if has(desk, needs):
            function(desk)
