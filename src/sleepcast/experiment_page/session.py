"""A session of an experiment's page: one open page, its questions, and what it is sent.

Progress and curves go out when they have changed, no more often than people can follow; curves are computed aside, so
that nothing else waits, and the more they take, the longer the pause after them.
"""

from __future__ import annotations

import asyncio

from starlette.websockets import WebSocket

from sleepcast.console.connection import PageConnection, encode
from sleepcast.console.outgoing import Refused
from sleepcast.core.clock import Clock
from sleepcast.core.tasks import wait_at_most
from sleepcast.experiment_page import messages
from sleepcast.experiments.findings import CurveAxes, SweepFindings

PERIOD = 0.4
"""Seconds between two looks for what is new."""
SHARE = 4.0
"""A pause is at least so many times as long as it took to compute the curves."""


class ExperimentSession:
    """One page; `run` lasts as long as it is open. folder: of the results, for people."""

    def __init__(self, socket: WebSocket, findings: SweepFindings, folder: str, clock: Clock) -> None:
        self._line: PageConnection[messages.Incoming] = PageConnection(socket, messages.decode, (), clock)
        self._findings, self._folder, self._clock = findings, folder, clock
        views = findings.views()
        self._view = CurveAxes(views["x"][0], views["y"][0])
        self._changed = asyncio.Event()
        self._sent: dict[str, bytes] = {}

    async def run(self) -> None:
        """Serve the page until it goes away or breaks the rules."""
        await self._line.say(self._hello())
        others = [asyncio.create_task(work) for work in (self._send_news(), self._line.beat())]
        try:
            await self._line.read(self._answer)
        finally:
            for task in others:
                task.cancel()
            await asyncio.gather(*others, return_exceptions=True)

    def _hello(self) -> messages.ExperimentHello:
        experiment, views = self._findings.experiment, self._findings.views()
        goal = experiment.goal
        return messages.ExperimentHello(
            experiment.scenario,
            self._folder,
            views["x"],
            views["y"],
            views["by"],
            experiment.measures,
            "" if goal is None else f"{'largest' if goal.largest else 'smallest'} {goal.measure}",
            experiment.repeats(),
        )

    async def _answer(self, message: messages.Incoming) -> None:
        views = self._findings.views()
        match message:
            case messages.ChooseCurves(x, y, by):
                if x not in views["x"] or y not in views["y"] or by not in views["by"]:
                    await self._line.say(Refused(f"there is nothing to draw as {y:.80} over {x:.80}"))
                    return
                self._view = CurveAxes(x, y, "" if by == x else by)
                self._sent.pop(messages.DrawnCurves.__name__, None)
                self._changed.set()
            case messages.Runs(serial, x, name):
                await self._line.say(messages.Listed(serial, self._findings.runs_at(self._view, x, name)))

    async def _send_news(self) -> None:
        while True:
            self._changed.clear()
            began, view = self._clock.now(), self._view
            await self._tell(messages.ProgressNews(self._findings.progress()))
            curves = await asyncio.to_thread(self._findings.curves, view)
            if view == self._view:
                await self._tell(messages.DrawnCurves(view.x, view.y, view.by, curves))
            pause = max(PERIOD, SHARE * (self._clock.now() - began))
            await wait_at_most(self._changed, pause)

    async def _tell(self, message: messages.ProgressNews | messages.DrawnCurves) -> None:
        """Send it, unless the page knows it already."""
        data, kind = encode(message), type(message).__name__
        if self._sent.get(kind) != data:
            self._sent[kind] = data
            await self._line.send(data.decode())
