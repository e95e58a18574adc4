"""The past of a recording: its pictures, and the run again from its scenario, its seed and its messages.

States from which it is near to any moment are not in the file. So the run is run again once, from its start to its end,
beside the page, and states are kept on the way.
"""

from __future__ import annotations

from time import perf_counter

from sleepcast.console.adapters.recording import inputs_of
from sleepcast.console.adapters.replay_worker import serve_past
from sleepcast.console.marks import clock_time
from sleepcast.console.past import Past
from sleepcast.console.replay_client import Question, ReplayClient, RerunError, RunMoment
from sleepcast.console.snapshots import Budget
from sleepcast.console.timeline import Timeline
from sleepcast.core.version import VERSION
from sleepcast.simulator.packing import pack
from sleepcast.simulator.recording.recording import Recording

AT_ONCE = 0.2
"""Seconds for which the run is run ahead between two questions."""
NEAR = 3.0
"""Seconds of work that a moment may lie ahead of what was run again: somebody waits so long."""


class RecordedPast(Past):
    """See the module."""

    def __init__(self, recording: Recording, timeline: Timeline) -> None:
        scenario = recording.scenario
        telemetry = max(1, round(scenario.telemetry / scenario.tick))
        super().__init__(timeline, scenario.tick, telemetry, ReplayClient(serve_past), Budget())
        self.inputs = inputs_of(recording)
        self._recording = recording
        self._reached, self._speed, self._trouble = -1, 0.0, ""
        self._differs: int | None = None
        if recording.first and not recording.snapshot:
            self._trouble = (
                "This recording goes on from a snapshot that was too large to be recorded, so it cannot be run again: "
                "what was recorded is all there is."
            )
        for time, row in zip(timeline.rows.times, timeline.rows.values, strict=True):
            self.marks.rows(time, [row])
        for time, marks in zip(timeline.marks.times, timeline.marks.values, strict=True):
            counts = [marks.groups.count(code) for code in range(1, len(marks.names) + 1)]
            self.marks.groups(time, marks.names, counts)
        for time, failures in zip(timeline.failures.times, timeline.failures.values, strict=True):
            self.marks.failing(time, failures.rules)
        self.marks.names(timeline.began, timeline.scene.names)
        for time, names in zip(timeline.names.times, timeline.names.values, strict=True):
            self.marks.names(time, names)
        self.marks.sort()

    @property
    def kept(self) -> str:
        """What is kept, in a sentence."""
        if self._trouble:
            return self._trouble
        if self._differs is not None:
            return self.difference(self._differs)
        last = self.tick_of(self.ended)
        if self._reached < last:
            part = max(0.0, self._reached / last)
            return f"It is being run again, so that every moment can be explained: {part:.0%} done."
        return super().kept

    async def _live(self) -> None:
        """Run ahead to the end, and keep states."""
        try:
            if not self._trouble:
                await self._run_ahead()
        except RerunError as error:
            self._trouble = str(error)
        await super()._live()

    async def _run_ahead(self) -> None:
        recording, last = self._recording, self.tick_of(self.ended)
        nowhere = RunMoment(self.run, 0, recording.snapshot, 0, self.inputs)
        source = (pack(recording.scenario), recording.seed)
        begun = await self._client.ask(Question("begin", nowhere, source=source))
        self.states.add(begun.tick, begun.state)
        self._reached = begun.tick
        while self._reached < last:
            base, state = self.states.before(last) or (begun.tick, begun.state)
            moment = RunMoment(self.run, base, state, last, self.inputs.between(base, last), self._checks(base, last))
            before, began = self._reached, perf_counter()
            reached = await self._client.ask(Question("advance", moment, patience=AT_ONCE))
            self._reached = reached.tick
            self._speed = (reached.tick - before) / max(1e-9, perf_counter() - began)
            if reached.differs is not None:
                self._differs = reached.differs
                return
            if reached.state:
                self.states.add(reached.tick, reached.state)

    def check(self, tick: int) -> None:
        """Raises RerunError where a tick cannot be run again, or not now."""
        if self._trouble:
            raise RerunError(self._trouble)
        if self._differs is not None and tick >= self._differs:
            raise RerunError(self.difference(self._differs))
        if tick - self._reached > NEAR * self._speed:
            done = clock_time(max(0, self._reached) * self.tick)
            raise RerunError(
                f"The recording is still being run again to explain it: {done} of {clock_time(self.ended)} is done."
            )

    def _why_different(self) -> str:
        if self._recording.version != VERSION:
            return f": it was recorded by version {self._recording.version}, and this is version {VERSION}"
        return ": something besides what was recorded has changed this run"
