"""The driver: it lets the swarm run, and the page's server breathe in between.

Ticks and the server share one thread and take turns, so nothing has to be locked: the swarm runs for at most a slice,
then everything that has come from pages is served, a STOP among it. How many ticks are due is the pace's business.
Measured with 1,000 robots on two cores against a thread for the swarm and a lock: an answer comes after 4 ms either
way at 30 times real time, and flat out after some 15 ms against 10, while the swarm runs a tenth faster.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Future
from math import inf
from threading import Thread
from typing import TypeVar

from sleepcast.console.frames import pack, repeats
from sleepcast.console.view import PaceControl, SwarmView
from sleepcast.core.clock import Clock
from sleepcast.core.tasks import settle
from sleepcast.fleet.marks import GroupCodes, flags_of

SLICE = 0.004
"""Seconds for which ticks may run before the server is served: unnoticed by people, long against a switch."""
MAX_TURNS = 16
"""Turns of the server after one slice at most. A single tick may take as long as many slices; what a page says passes
through some eight steps until it is answered, one in each turn, and would wait for a tick before each of them."""
FRAME_PERIOD = 1.0 / 32.0
"""Seconds between two frames at least. People are promised 30 a second; a page and its program never keep exactly the
same time, and each frame that comes late is one less."""
HEARD_AFTER = 2
"""Ticks from a STOP that is sent until robots stand: it is on its way in one, and heard in the other."""
AT_START = "for the start"
"""What holds everything up while time has not begun, in words."""

T = TypeVar("T")


class FrameSource:
    """Holds the latest picture for those who wait for it.

    frame: as in `frames`
    number: of that picture, from 1
    changed: number of the latest picture in which robots are not as in the one before
    """

    def __init__(self) -> None:
        self.frame, self.number, self.changed = b"", 0, 0
        self.watchers: list[Callable[[], None]] = []
        """Called with every picture."""
        self._news = asyncio.Event()

    def show(self, frame: bytes) -> None:
        """The next picture is `frame`."""
        self.number += 1
        if not repeats(frame, self.frame):
            self.changed = self.number
        self.frame = frame
        self._news.set()
        self._news = asyncio.Event()
        for watch in self.watchers:
            watch()

    async def frame_after(self, number: int) -> bytes:
        """The latest frame, as soon as there is one younger than the one with this number."""
        while self.number <= number:
            await self._news.wait()
        return self.frame


class Driver(FrameSource):
    """See the module.

    groups: as of the latest picture
    latched: whether STOP holds, for the picture
    prepare: what has to be done, beside the server, before time can run; it may take many seconds
    waits: whether time stands still until somebody lets it run, or sends a command
    """

    def __init__(
        self,
        swarm: SwarmView,
        pace: PaceControl,
        clock: Clock,
        prepare: Callable[[], None] | None = None,
        *,
        waits: bool = False,
    ) -> None:
        super().__init__()
        self._waits, self._first = waits, swarm.tick
        pace.paused = pace.paused or waits
        self.swarm, self.pace = swarm, pace
        self._prepare, self._ready = prepare, prepare is None
        self.groups = GroupCodes()
        self.latched = False
        self._clock = clock
        self._frame_due = clock.now()
        self._heard: float = inf
        self._wake = asyncio.Event()

    async def run(self) -> None:
        """Let time pass until cancelled."""
        self.draw()
        if self._prepare is not None:
            await in_thread(self._prepare)
            self._ready = True
        self.swarm.send_initial_telemetry()
        self.draw()
        while True:
            if self.pace.paused:
                self._wake.clear()
                await self._wake.wait()
                continue
            began = self._clock.now()
            self.advance(SLICE)
            now = self._clock.now()
            if now >= self._frame_due or self.swarm.tick >= self._heard:
                self.wait_a_frame(now)
                self.draw()
            turns = int((self._clock.now() - began) / SLICE)
            for _ in range(min(turns, MAX_TURNS)):
                await asyncio.sleep(0.0)
            if not turns:
                await asyncio.sleep(self._frame_due - self._clock.now())

    @property
    def waiting(self) -> bool:
        """Whether time has not begun, and does with the first command."""
        return self._waits and self.pace.paused and self.swarm.tick == self._first

    @property
    def preparing(self) -> bool:
        """Whether what ticks take is still being compiled."""
        return not self._ready

    @property
    def held_up(self) -> str:
        """Why nothing that is sent reaches robots now, in words; "" while time runs."""
        if self.waiting:
            return AT_START
        return "paused" if self.pace.paused else "" if self._ready else "compiling"

    def begin(self) -> None:
        """A command went out: let time run, if it waits for that."""
        if self.waiting:
            self.set_pace(running=True)

    def advance(self, budget: float) -> bool:
        """Let happen what is due, for at most about `budget` s; whether there may be anything new to see."""
        self.pace.keep_up(budget)
        return True

    def expedite(self) -> None:
        """Draw the tick in which a STOP that goes out now is heard as soon as it is over, and nothing in between: the
        page would still be busy with that. If it takes longer than a frame may, a frame comes before."""
        if self.held_up:
            self.draw()
            return
        self._heard = self.swarm.tick + HEARD_AFTER
        self._frame_due = self._clock.now() + FRAME_PERIOD

    def wait_a_frame(self, now: float) -> None:
        """The next frame is due a period after the one that is drawn at `now`."""
        self._frame_due = max(self._frame_due + FRAME_PERIOD, now)

    def set_pace(self, running: bool | None = None, factor: float | None = None) -> None:
        """Change whether time runs and how fast; None leaves it as it is."""
        if running is not None:
            self.pace.keep_up(0.0)  # lets go of what a pause would have owed
            self.pace.paused = not running
        if factor is not None:
            self.pace.factor = factor
        self._wake.set()
        self.draw()

    def hold(self) -> None:
        """Let time stand still from within a tick: it is the last one, and drawn at once."""
        self.pace.paused = True
        self._frame_due = self._clock.now()

    def step(self) -> None:
        """One tick, and time stands still. There is none while what it takes is being prepared: it would wait for that,
        and nobody could STOP meanwhile."""
        if self._ready:
            self.swarm.step()
        self.set_pace(running=False)

    def flags(self) -> bytes:
        """The flags of each robot."""
        return flags_of(self.swarm.minds, self.swarm.exhausted(), self.swarm.crashed())

    def draw(self) -> None:
        """Make a new frame of what there is now, and tell those who wait for one."""
        if self.swarm.tick >= self._heard:
            self._heard = inf
        swarm, pace = self.swarm, self.pace
        minds = swarm.minds
        frame = pack(
            self.number + 1,
            swarm.tick,
            swarm.now(),
            (pace.factor, pace.achieved),
            (not pace.paused, self.latched, self.preparing, self.waiting),
            swarm.poses(),
            (self.groups.look(minds), self.flags()),
            (swarm.pings(), self.groups.second, swarm.colours()),
        )
        self.show(frame)


async def in_thread(work: Callable[[], T]) -> T:
    """What `work` gives, which is done by a thread of its own; that is left behind by who gives up waiting."""
    done: Future[T] = Future()
    Thread(target=settle, args=(done, work), name="in thread", daemon=True).start()
    return await asyncio.wrap_future(done)
