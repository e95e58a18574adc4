"""The past of a run: pictures of what was seen, and how to run it again from a kept state for what was not.

Pictures are at hand at once and lie apart in time. Everything else (the very tick, the values and rules of a robot,
why it did with a command what it did) is found by running again, in a process of its own (`replay_client`). What is run
again must lead through the same poses as were seen: else it is not shown, and the page says so.
"""

from __future__ import annotations

import asyncio
from bisect import bisect_right

import msgspec

from sleepcast.console.connection import encode
from sleepcast.console.features.plots import AddPlot
from sleepcast.console.features.why import Why
from sleepcast.console.incoming import PageMessage
from sleepcast.console.marks import Marks, clock_time
from sleepcast.console.replay_client import (
    Question,
    ReplayAction,
    ReplayAnswer,
    ReplayClient,
    RerunError,
    RunMoment,
    digest,
)
from sleepcast.console.snapshots import Budget, SnapshotStore
from sleepcast.console.timeline import Timeline
from sleepcast.core.memory import process_in_words, shown_size
from sleepcast.core.records import dataclass
from sleepcast.loop.rerun import Inputs

LOOK, MAX_LOOKS = 0.02, 250
"""Seconds between two looks whether a tick is over, and how many: five seconds together."""


@dataclass(slots=True)
class AlternateRun:
    """Another run that was the same up to a tick.

    timeline, inputs: of it
    state: at that tick
    differs: the tick of the first difference, None while there is none, or it is looked for
    difference: what it is, in words
    """

    tick: int
    timeline: Timeline
    inputs: Inputs
    state: bytes
    differs: int | None = None
    difference: str = ""


class Sampled(msgspec.Struct, frozen=True):
    """The values of a plot's lines in SI, None for unknown. problem: why there are none."""

    values: list[float | None]
    problem: str = ""


class Past:
    """See the module.

    timeline: what was seen
    tick: seconds in a tick
    telemetry: ticks between two reports of a robot
    inputs, states: what came from outside, and from where it can be run again; they grow, up to the budget
    run: counts the runs of one page
    """

    def __init__(self, timeline: Timeline, tick: float, telemetry: int, client: ReplayClient, budget: Budget) -> None:
        self.timeline, self.tick, self.budget = timeline, tick, budget
        self.inputs, self.states = Inputs(), SnapshotStore(tick, budget.states)
        self.marks = Marks()
        self.run = 1
        self._telemetry, self._client = telemetry, client
        self.other: AlternateRun | None = None
        """What came in another run after the moment from which this one goes on."""

    @property
    def ended(self) -> float:
        """The time of the last tick, s."""
        return self.timeline.seconds

    def tick_of(self, time: float) -> int:
        """The tick of a time, or the nearest that there was."""
        return round(min(max(time, self.timeline.began), self.ended) / self.tick)

    @property
    def kept(self) -> str:
        """What is kept, in a sentence."""
        pictures, states = self.timeline.poses.times, self.states
        if not pictures:
            return "Nothing is kept yet."
        apart = (pictures[-1] - pictures[0]) / max(1, len(pictures) - 1)
        seen = "1 picture" if len(pictures) == 1 else f"{len(pictures):,} pictures, every {apart:.3g} s,"
        again = "1 state" if len(states) == 1 else f"{len(states):,} states"
        return (
            f"Kept since {clock_time(self.timeline.began)}: {seen} and {again} from which every tick can be run again"
            f"{self._takes()} {process_in_words()}"
        ).rstrip()

    def _takes(self) -> str:
        """How much memory it takes, as the end of a sentence."""
        return f" ({shown_size(self.states.size)}, at most {shown_size(self.budget.states)})."

    async def live(self) -> None:
        """Do what is to be done aside, until cancelled."""
        try:
            await self._live()
        finally:
            self.close()

    def close(self) -> None:
        """Let go of the process that runs it again."""
        self._client.close()

    async def _live(self) -> None:
        await asyncio.Event().wait()

    # ---- what can be asked

    async def look(self, tick: int, robot: int) -> ReplayAnswer:
        """How everything was at a tick, and a robot, -1 for none. Raises RerunError."""
        return await self._ask("look", tick, robot=robot)

    async def state(self, tick: int) -> bytes:
        """The state at a tick, from which a run can go on. Raises RerunError."""
        return (await self._ask("state", tick)).state

    async def answer(self, tick: int, message: PageMessage) -> msgspec.Raw:
        """What the desk would have answered at a tick. Raises RerunError."""
        return msgspec.Raw((await self._ask("answer", tick, message)).message)

    async def sample(self, tick: int, plot: AddPlot) -> Sampled:
        """What a plot over time shows of a tick. Raises RerunError."""
        return msgspec.json.decode((await self._ask("sample", tick, plot)).message, type=Sampled)

    async def why(self, tick: int, asked: Why) -> msgspec.Raw:
        """Why a robot did what it did with a command up to a tick. Raises RerunError."""
        sent = next((at for at, message in self.inputs.posted if message.id == asked.command), None)
        if sent is None:
            raise RerunError("This command was not sent in the part of the run that is kept.")
        if sent > tick:
            raise RerunError(f"This command was sent later, at {clock_time(sent * self.tick)}.")
        if not 0 <= asked.robot < len(self.timeline.scene.names):
            raise RerunError(f"There is no robot number {asked.robot}.")
        return msgspec.Raw((await self._ask("why", tick, asked, since=sent - 1)).message)

    async def why_now(self, issued: float, asked: Why) -> msgspec.Raw:
        """The same up to now, for who asks at once: a command goes on the air with the tick after it was sent. issued:
        when that was, simulated s. Raises RerunError."""
        await self._over(round(issued / self.tick) + 1)
        return await self.why(self.tick_of(self.ended), asked)

    async def _over(self, tick: int) -> None:
        """Wait until a tick is over: in the middle of it, what robots did in it is not known. Raises RerunError where
        it does not end."""
        turns = 0
        while round(self.ended / self.tick) < tick:
            if (turns := turns + 1) > MAX_LOOKS:
                raise RerunError(f"{clock_time(tick * self.tick)} is not over yet: ask again when time has gone on.")
            await asyncio.sleep(LOOK)

    async def _ask(
        self,
        action: ReplayAction,
        tick: int,
        message: PageMessage | None = None,
        *,
        robot: int = -1,
        since: int | None = None,
    ) -> ReplayAnswer:
        """since: the tick after which all must be seen, None for no matter."""
        await self._over(tick)
        self.check(tick)
        moment = self.moment(tick, since)
        marks = self.timeline.marks_at(tick * self.tick)
        data = b"" if message is None else encode(message)
        answer = await self._client.ask(Question(action, moment, robot, data, marks.names))
        if answer.ended:
            raise RerunError("It takes too long to run again up to this moment.")
        if answer.differs is not None:
            raise RerunError(self.difference(answer.differs))
        return answer

    async def compare(self, other: AlternateRun, tick: int) -> None:
        """Find the first difference to an alternate run, which there is up to this tick. Raises RerunError."""
        base = other.tick
        mine, yours = (each.between(base, tick) for each in (self.inputs, other.inputs))
        moments = [RunMoment(self.run, base, other.state, tick, inputs) for inputs in (mine, yours)]
        answer = await self._client.ask(Question("compare", moments[0], other=moments[1]))
        if answer.message:
            other.differs = answer.tick
            at = f"{clock_time(answer.tick * self.tick)} (tick {answer.tick:,})"
            other.difference = f"{at}: {answer.message.decode()}"

    def check(self, tick: int) -> None:
        """Raises RerunError where a tick cannot be run again, or not now."""

    def difference(self, tick: int) -> str:
        """What is said where running again leads elsewhere from a tick on."""
        at = clock_time(tick * self.tick)
        return (
            f"Run again, the robots are not where they were seen from {at} on{self._why_different()}. So nothing is "
            "guessed: only what was kept is shown."
        )

    def _why_different(self) -> str:
        return ": something besides commands and obstacles has changed this run"

    def moment(self, tick: int, since: int | None = None) -> RunMoment:
        """A moment with what is nearest to it. Raises RerunError for one from before what is kept."""
        # A robot's telemetry must have come once, for previews.
        early = tick - self._telemetry if since is None else since
        nearest = self.states.before(early) or self.states.before(tick if since is None else since)
        if nearest is None:
            raise RerunError("This lies before everything that is kept of the run.")
        base, state = nearest
        return RunMoment(self.run, base, state, tick, self.inputs.between(base, tick), self._checks(base, tick))

    def _checks(self, after: int, until: int) -> dict[int, bytes]:
        poses = self.timeline.poses
        half, count = 0.5 * self.tick, len(self.timeline.scene.names)
        first = bisect_right(poses.times, after * self.tick + half)
        last = bisect_right(poses.times, until * self.tick + half)
        return {tick: digest(data, count) for tick, data in poses.values[first:last]}
