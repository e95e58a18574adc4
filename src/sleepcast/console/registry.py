"""All features of the page: it collects the modules in `features/`, reads what a page asks, and has it answered.

Those of other pages are collected when such a page is served. What no source supports is refused here,
and nowhere else. STOP and RELEASE do not come by here: `dialogue` hands them
to the desk at once.
"""

from __future__ import annotations

from asyncio import CancelledError
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib import import_module
from pkgutil import iter_modules
from types import ModuleType
from typing import ClassVar, Protocol, Union

import msgspec

from sleepcast.console import features
from sleepcast.console.connection import encode
from sleepcast.console.feature import BEGINNINGS, HANDLERS, NOT_HERE_AT_ALL, Answer, Handler, Reply, Then, has
from sleepcast.console.incoming import AT_ONCE, PageMessage, read
from sleepcast.core.errors import MisuseError, SleepcastError


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


@contextmanager
def all_or_none() -> Iterator[None]:
    """What registers questions within the block registers all of them; none, if anything is raised, or if no message
    could be read any more, not even STOP."""
    handlers, beginnings = dict(HANDLERS), list(BEGINNINGS)
    try:
        yield
        _decoder(messages())
    except BaseException:
        HANDLERS.clear()
        HANDLERS.update(handlers)
        BEGINNINGS[:] = beginnings
        raise


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
    """What a handler's function answers. The mistakes of another package cost a page no more than this answer."""
    if handler.is_own:
        return function(*arguments)
    try:
        reply = function(*arguments)
        return _called_later(handler, reply) if isinstance(reply, Awaitable) else _sendable(reply)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # SystemExit would end the program, and with it the page's STOP
        raise _failed(handler, error) from error


async def _called_later(handler: Handler, reply: Awaitable[Answer]) -> Answer:
    try:
        return _sendable(await reply)
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
