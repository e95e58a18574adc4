"""Makes tests of the session on a page; see `console/session_test`."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence

import numpy as np

from sleepcast.api.fleet import SimulatedFleet
from sleepcast.api.session_test import counts_of, orders_of, session_files
from sleepcast.console.features.session_test import DraftCommand, HeldCount, HeldGoal
from sleepcast.console.past import Past
from sleepcast.core.errors import MisuseError
from sleepcast.language.evaluate import is_true
from sleepcast.loop.rerun import Inputs
from sleepcast.simulator.scenario.mission import Wanted
from sleepcast.station import Account

SIGNS: Mapping[str, str] = {"exactly": "==", "at least": ">=", "at most": "<="}


class PageTests:
    """Makes tests of one run (a `TestMaker`). past: what is kept of it, from its first tick."""

    def __init__(self, fleet: SimulatedFleet, past: Past) -> None:
        self._fleet, self._past = fleet, past

    def draft(self) -> tuple[str, list[DraftCommand]]:
        """A name for the test, and the commands that it would repeat."""
        counts: dict[str, dict[str, int]] = {}

        def note(command: str, account: Account) -> Sequence[Wanted]:
            counts[command] = counts_of(account)
            return ()

        fleet = self._fleet
        if fleet.swarm.simulator.tick < 1:
            raise MisuseError("Nothing has happened yet: let time run first.")
        orders = orders_of(fleet.swarm, fleet.station, self._inputs(), note)
        commands = [
            DraftCommand(command, order.time, order.text, counts[command])
            for order, command in orders
            if command in counts  # of older ones the desk keeps no account
        ]
        return f"{fleet.swarm.simulator.scenario.name}-test", commands

    def _inputs(self) -> Inputs:
        if self._past.timeline.began > 0.0:
            raise MisuseError("A test begins with its scenario, and this run goes on from a snapshot.")
        return self._past.inputs

    def count(self, text: str) -> int:
        """For how many robots an expression is true now."""
        return int(np.count_nonzero(is_true(self._fleet[text])))

    def files(
        self, name: str, held: Mapping[str, Sequence[HeldCount]], goals: Sequence[HeldGoal], exact: bool
    ) -> bytes:
        """The test as a zip file."""

        def hold(command: str, _: Account) -> Sequence[Wanted]:
            return [Wanted(each.count, each.number, each.how) for each in held.get(command, ())]

        for goal in goals:
            self.count(goal.text)
        files = session_files(
            self._fleet.swarm,
            self._fleet.station,
            self._inputs(),
            name,
            hold=hold,
            goals=[f"count {goal.text.strip()} {SIGNS[goal.how]} {goal.number}" for goal in goals],
            exact=exact,
        )
        with io.BytesIO() as packed:
            with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
                for file, text in files.items():
                    archive.writestr(f"{name}/{file}", text)
            return packed.getvalue()
