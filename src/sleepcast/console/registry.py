"""All features of the page: it collects the modules in `features/`, reads what a page asks, and has it answered.

Those of other pages are collected when such a page is served. What no source supports is refused here, and nowhere
else. What packages answer runs in threads of theirs (`package_code`). STOP and RELEASE do not come by here: `dialogue`
hands them to the desk at once.
"""

from __future__ import annotations

from asyncio import CancelledError
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import ClassVar, Protocol, TypeVar, Union

import msgspec

from sleepcast.console import features
from sleepcast.console.connection import encode
from sleepcast.console.feature import (
    APART,
    BEGINNINGS,
    HANDLERS,
    NOT_HERE_AT_ALL,
    Answer,
    Handler,
    Reply,
    Then,
    has,
    refuse_twice,
)
from sleepcast.console.incoming import AT_ONCE, PageMessage, read
from sleepcast.console.package_code import thread_of
from sleepcast.core.errors import MisuseError, SleepcastError

Loaded = TypeVar("Loaded")


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
    return read(_decoder(messages()), data)


@lru_cache(maxsize=1)  # they change only while packages are loaded
def _decoder(kinds: tuple[type[PageMessage], ...]) -> msgspec.json.Decoder[PageMessage]:
    return msgspec.json.Decoder(Union[(*kinds,)])


Questions = Mapping[type[PageMessage], Handler]
"""Those that a package adds."""


def apart(load: Callable[[], Loaded]) -> tuple[Loaded, Questions]:
    """What this loads, with the questions of the modules that it imports, which nobody can ask yet."""
    found: dict[type[PageMessage], Handler] = {}
    before = APART.set(found)
    try:
        return load(), found
    finally:
        APART.reset(before)


def add(questions: Questions, package: str) -> None:
    """Let the questions of a package be asked. Raises MisuseError, and lets none of them be asked, where one has the
    tag of another, or no message could be read any more, not even STOP."""
    before = dict(HANDLERS)
    try:
        for asked, handler in questions.items():
            refuse_twice(asked.__struct_config__.tag, asked.__module__, (*AT_ONCE, *HANDLERS))
            HANDLERS[asked] = replace(handler, package=package)
        _decoder(messages())
    except BaseException as error:
        HANDLERS.clear()
        HANDLERS.update(before)
        if isinstance(error, MisuseError | KeyboardInterrupt):
            raise
        raise MisuseError(f"its questions cannot be read: {type(error).__name__}: {error}") from error


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
    source = next((each for each in (page, desk) if has(each, handler.needs)), None)
    if then is not None and handler.then is not None:
        answered = _called(handler, handler.then, source, asked, then)
        if answered is not None:
            return answered
    if source is None:
        own = handler.recording if desk.recorded else ""
        raise MisuseError(own or handler.lacking or desk.lacks)
    return _called(handler, handler.answer, source, asked)


def _called(handler: Handler, function: Callable[..., Reply], *arguments: object) -> Reply:
    """What a handler's function answers. One of another package has a thread of its own, and its mistakes cost a page
    no more than this answer."""
    if getattr(function, "__module__", "").startswith("sleepcast."):
        return function(*arguments)
    thread = thread_of(handler.package or handler.answer.__module__)
    try:
        reply = thread.answer(partial(_checked, function, *arguments))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # SystemExit would end the program, and with it the page's STOP
        raise _failed(handler, error) from error
    return _called_later(handler, reply) if isinstance(reply, Awaitable) else reply


def _checked(function: Callable[..., Reply], *arguments: object) -> Reply:
    """What a function answers, if a page can be sent that."""
    reply = function(*arguments)
    return _checked_later(reply) if isinstance(reply, Awaitable) else _sendable(reply)


async def _checked_later(reply: Awaitable[Answer]) -> Answer:
    return _sendable(await reply)


async def _called_later(handler: Handler, reply: Awaitable[Answer]) -> Answer:
    try:
        return await reply
    except (KeyboardInterrupt, CancelledError, GeneratorExit):
        raise
    except BaseException as error:
        raise _failed(handler, error) from error


def _sendable(answer: Answer) -> Answer:
    """An answer that a page can be sent. Raises TypeError for anything else."""
    if not isinstance(answer, msgspec.Struct | msgspec.Raw | None):
        raise TypeError(f"an answer is a DeskMessage, no {type(answer).__name__}")
    if answer is not None:
        encode(answer)
    return answer


def _failed(handler: Handler, error: BaseException) -> SleepcastError:
    if isinstance(error, SleepcastError):
        return error
    return MisuseError(f"{handler.answer.__module__} has failed: {type(error).__name__}: {error}")


def begin(desk: Source) -> None:
    """Begin what features do from the start, whether anybody asks or not."""
    for needs, function in BEGINNINGS:
        if has(desk, needs):
            function(desk)
