"""Stored, then answered: the body stops first, then the disk writes, and only then the answer goes out.

All minds on a real channel go through here, one in a body or thousands in one process: `before` evaluating, what they
took is stored; `after` that they speak, once what they speak of is stored. Disks write in threads, since one may take
seconds; meanwhile only STOPs are heard, which halt bodies at once and are answered with the next commit. So nothing is
delayed by more than one commit, and no robot refuses to stop because of its disk: if writing fails, the answer goes
out all the same, and says so (`NOT_STORED`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, wait
from typing import Protocol, TypeVar

from sleepcast.channel.message import Message, not_stored
from sleepcast.core.records import dataclass
from sleepcast.node.node import Node

WRITERS = 16
"""Stores that are written at a time: each mostly waits for its disk."""
HEAR_EVERY = 0.002
"""Seconds between two looks for STOPs while a disk writes."""


class Keeper(Protocol):
    """Stores what minds know, so that it survives this process."""

    def before(self) -> bool:
        """Messages were received, and are about to be evaluated; returns whether to `write` first."""

    def after(self) -> bool:
        """They have been evaluated; returns whether to `write` now."""

    def write(self) -> bool:
        """Write what was collected, in any thread, while nothing else of this keeper is called; returns whether it
        lasts now."""


class KeysKeeper(Protocol):
    """Stores whom a process trusts."""

    @property
    def due(self) -> bool:
        """Whether there is something to be written now."""

    def write(self) -> bool:
        """As `Keeper.write`."""


@dataclass(slots=True)
class KeysFirst:
    """A keeper of keys and of minds. A change of keys is a command as well: if the store said that it was received, and
    the process ended before its keys were stored, it would be lost. store: None if minds are not stored."""

    keys: KeysKeeper
    store: Keeper | None

    def before(self) -> bool:
        """See `Keeper`."""
        wanted = self.store is not None and self.store.before()
        return self.keys.due or wanted

    def after(self) -> bool:
        """See `Keeper`."""
        return self.store is not None and self.store.after()

    def write(self) -> bool:
        """See `Keeper`; whether keys last, their answer says (`Node.keys_last`)."""
        if self.keys.due:
            self.keys.write()
        return self.store is None or self.store.write()


class Speaker(Protocol):
    """A mind that speaks on a channel. keeper: of what it knows, None if that is not stored."""

    @property
    def node(self) -> Node: ...

    @property
    def keeper(self) -> Keeper | None: ...


Mind = TypeVar("Mind", bound=Speaker)


class Durability:
    """See the module. hear_stops: takes the STOPs that have come, and halts bodies; it takes nothing else, because that
    would be evaluated before it is stored. Threads are started when they are first needed; `close` ends them."""

    def __init__(self, hear_stops: Callable[[], None]) -> None:
        self._hear_stops = hear_stops
        self._threads: Executor | None = None

    def before(self, keepers: Iterable[Keeper]) -> None:
        """Store what is about to be evaluated, as far as it must be stored first."""
        self._write([keeper for keeper in keepers if keeper.before()])

    def after(self, keepers: Iterable[Keeper], minds: Iterable[Mind]) -> list[tuple[Mind, list[Message]]]:
        """Store what came of it, and return what each of these minds may say now: what it has said before this call.
        Answers to STOPs that are heard meanwhile wait for the next call. keepers: at least theirs, each once."""
        spoken = [(mind, mind.node.take_outbox()) for mind in minds if mind.node.outbox]
        lost = self._write([keeper for keeper in keepers if keeper.after()])
        return [
            (mind, [not_stored(message) for message in messages] if id(mind.keeper) in lost else messages)
            for mind, messages in spoken
        ]

    def close(self) -> None:
        """End the threads."""
        if self._threads is not None:
            self._threads.shutdown()
            self._threads = None

    def _write(self, keepers: Sequence[Keeper]) -> set[int]:
        """Write all of these at a time, and hear STOPs until the last is done; returns the ids of those that failed."""
        if not keepers:
            return set()
        if self._threads is None:
            self._threads = ThreadPoolExecutor(WRITERS, "store")
        writes = {self._threads.submit(keeper.write): id(keeper) for keeper in keepers}
        waiting = set(writes)
        while waiting:
            _, waiting = wait(waiting, HEAR_EVERY)
            if waiting:
                self._hear_stops()
        return {keeper for write, keeper in writes.items() if not write.result()}
