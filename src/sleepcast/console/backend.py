"""The model behind every page of a simulated swarm: answers to questions, and news.

It puts the station's words and the driver's pictures into the shapes of the wire. All pages share one desk: they see
the same, and each may command.
"""

from __future__ import annotations

from collections.abc import Awaitable, Iterator, Mapping, Sequence
from itertools import islice
from math import inf, isnan
from typing import NoReturn

import msgspec

from sleepcast.console import incoming, outgoing
from sleepcast.console.account_table import AccountTable, CommandRow
from sleepcast.console.alerts import AlertBoard, Alerted
from sleepcast.console.completion import names_of
from sleepcast.console.driver import Driver
from sleepcast.console.explanation import show_why
from sleepcast.console.fields import FieldMaps, field_of
from sleepcast.console.ground import pictured
from sleepcast.console.histogram import Spread, spread
from sleepcast.console.incoming import AlertMessage, Sort
from sleepcast.console.mission import (
    NO_MISSION,
    STOPPED,
    MissionNews,
    MissionPlayer,
    Played,
    counted_commands,
    shown_mission,
)
from sleepcast.console.past import Past
from sleepcast.console.picking import Picked, picked
from sleepcast.console.plots import Plots, ScenarioMeasure
from sleepcast.console.sentences import Interpreter, Phrased, Understood
from sleepcast.console.values import TelemetryValues, Values
from sleepcast.console.view import KeptRule, MindView, ObstacleEditor, SwarmView
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError, and_more
from sleepcast.core.tasks import together
from sleepcast.core.units import value_in_words
from sleepcast.language import Checked, Finding, ReadError, Variable
from sleepcast.language.reading_units import report_in_words
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, FROZEN, MARKED, SLEEPING, SUPPORT, TIME_SLOT, unit_of
from sleepcast.simulator import KERNELS, kernel_count
from sleepcast.station import NO, UNKNOWN, YES, Command, NoExplanationError, Preview, Report, Station
from sleepcast.station.account import answer_in_words
from sleepcast.station.prepared import Prepared, Terms
from sleepcast.station.rest import stopped_in_words

STOP_AGAIN = 0.5
"""Seconds in which one more STOP adds nothing to the one that holds; the station itself repeats it."""
MOST_REPORTS = 20
"""Reports of the watched robot that a page shows."""
MOST_REASONS = 5
"""Reasons for unknown robots that a preview names."""

WINK_SECONDS = 5.0
"""For which a robot blinks: somebody who looks round finds it."""
WINK = (
    "(PROGN (DEFVAR winked) (SETQ winked marked) "
    f"(RULE wink (IF (WITHIN 0s {WINK_SECONDS:g}s) (SETQ marked (< (MOD time 1s) 0.5s)) "
    "(PROGN (SETQ marked winked) (DEACTIVATE wink)))))"
)
"""What a robot is sent that is to blink."""

_LEFT_OUT = frozenset(quantity.name for quantity in (*SUPPORT[ACTIVE0 + 1 : ACTIVE0 + BUFFERS], *SUPPORT[TIME_SLOT:]))
"""Variables that the page shows elsewhere: the active flags with the rules, the time in its bar."""
_KINDS = ("sensor", "actuator", "user", "support")


class Backend:
    """See the module. began: the time of the station's clock with which that of the page begins. measures: of the
    scenario. past: what is kept of the run, None for nothing. mission: plays that of the scenario, None if it has none.
    Its questions raise SleepcastError, with a sentence for the person who asked."""

    def __init__(
        self,
        swarm: SwarmView,
        station: Station,
        driver: Driver,
        clock: Clock,
        *,
        began: float = 0.0,
        measures: Sequence[ScenarioMeasure] = (),
        past: Past | None = None,
        mission: MissionPlayer | None = None,
    ) -> None:
        self.driver, self.past = driver, past
        self._mission, self._held = mission, False
        if mission is not None:
            mission.hold = self._hold
        self._swarm, self._station, self._clock = swarm, station, clock
        self._began = began
        self._ledger = AccountTable(station, swarm, began)
        self._interpreter = Interpreter(swarm)
        self._stopped_at = -STOP_AGAIN
        self.at_once = False
        """Whether answers come at once whatever they take, where nothing can be done beside."""
        self.values: Values = TelemetryValues(swarm, station)
        self.plots = Plots(self.values, clock, measures)
        driver.watchers.append(self.plots.sample)
        self._fields = FieldMaps(swarm.field, clock)
        self._pending: tuple[tuple[str, bool, Sort], Prepared] | None = None
        """The latest command that is not sent yet, since its sender was asked about it."""
        self._winks: dict[str, float] = {}
        """When each robot was asked to blink, s of the page's time."""
        self.alerts = AlertBoard(self.values, clock)
        driver.watchers.append(self.alerts.look)
        if past is not None:
            self.alerts.marked = lambda firing: past.marks.add(
                firing.at, "alert", f"{firing.text}: {firing.count:,} robots"
            )

    def hello(self) -> outgoing.Hello:
        """What a page needs first."""
        scene = self._swarm.scene
        return outgoing.Hello(scene, len(scene.names), names_of(self._swarm))

    async def live(self) -> None:
        """Let time pass, and do what is to be done aside, until cancelled."""
        if self.past is None:
            await self.driver.run()
        else:
            await together(self.driver.run(), self.past.live())

    def seek(self, time: float) -> NoReturn:
        """Refused: what lives cannot go back."""
        raise MisuseError("Time cannot go back in a running swarm: record the run, and replay it.")

    # ---- before sending

    def preview(self, serial: int, text: str) -> outgoing.Previewed:
        """What is wrong in `text`, and who would obey it now."""
        try:
            checked = self._station.check(text)
        except ReadError as error:
            found = outgoing.ShownFinding("error", error.reason, error.start, error.end, str(error))
            return outgoing.Previewed(serial, [found])
        findings = [_show_finding(finding, text) for finding in checked.findings]
        findings += [outgoing.ShownFinding("warning", line, 0, 0, line) for line in and_more(checked.more)]
        if checked.errors and checked.by:
            findings.append(outgoing.ShownFinding("error", checked.by, 0, 0, checked.by))
        if checked.program is None:
            return outgoing.Previewed(serial, findings, checked.cost)
        return self._previewed(serial, checked, findings, self._station.preview(checked))

    def _previewed(
        self, serial: int, checked: Checked, findings: list[outgoing.ShownFinding], found: Preview
    ) -> outgoing.Previewed:
        return outgoing.Previewed(
            serial,
            findings,
            checked.cost,
            True,
            found.count(YES),
            found.count(NO),
            found.count(UNKNOWN),
            found.everybody,
            found.oldest,
            list(found.reasons.items())[:MOST_REASONS],
            found.codes[
                : len(self._swarm.scene.names)
            ].tobytes(),  # others that speak on the channel are not on the map
        )

    def names(self, serial: int) -> outgoing.Named:
        """The names that a text may use, with the ranges of their values."""
        return outgoing.Named(serial, names_of(self._swarm))

    def spread(self, serial: int, text: str, at: int) -> Spread:
        """How what the number at an offset is compared with is spread over the robots."""
        return spread(self._station, serial, text, at)

    def pick(self, serial: int, marks: bytes) -> Picked | Awaitable[Picked]:
        """The test that holds for exactly the marked robots."""
        return picked(self._station, serial, marks, len(self._swarm.scene.names), at_once=self.at_once)

    def phrase(self, serial: int, text: str) -> Phrased:
        """What an expression says, as a sentence."""
        return self._interpreter.phrase(serial, text)

    def understand(self, serial: int, text: str) -> Understood:
        """The expression that a sentence means."""
        return self._interpreter.understand(serial, text)

    def alert(self, wish: AlertMessage) -> Alerted:
        """Add, mute or remove an alert, or tell whom one was about."""
        return self.alerts.answer(wish)

    # ---- sending

    def send(
        self,
        serial: int,
        text: str,
        everybody: bool,
        sort: Sort = "once",
        count: int | None = None,
        confirmed: bool = False,
    ) -> outgoing.Sent:
        """Broadcast `text`. count, confirmed: where the station asks for confirmation, see `Station.commit`."""
        if sort == "ask":
            sent = self._station.ask(text)
        else:
            prepared = self._prepared(text, everybody, sort, confirmed)
            put = self._send_in_stages if sort == "stages" else self._station.commit
            sent = put(prepared, count=count, confirmed=confirmed)
            self._pending = None
        self.driver.begin()
        return outgoing.Sent(serial, sent.id)

    def _prepared(self, text: str, everybody: bool, sort: Sort, confirmed: bool) -> Prepared:
        """The command, as a page was asked about it before, if it was."""
        what = (text, everybody, sort)
        if self._pending is None or self._pending[0] != what:
            terms = Terms(standing=sort == "standing", everybody=everybody, anyway=confirmed)
            self._pending = what, self._station.prepare(text, terms)
        return self._pending[1]

    def mission_wish(self, wish: incoming.Play | incoming.SendLine | incoming.SkipLine) -> Played | outgoing.Sent:
        """Play the mission or not, or decide about one of its commands."""
        mission = self._mission
        if mission is None:
            raise MisuseError(NO_MISSION)
        problem, said = mission.problem, ""
        match wish:
            case incoming.Play(_, on):
                said = mission.play() if on else ""
                if not on:
                    mission.halt("")
            case incoming.SendLine(_, line, again, confirmed):
                mission.send(line, again=again, confirmed=confirmed)
                self.driver.begin()
            case incoming.SkipLine(_, line):
                mission.skip(line)
        decided = self._held and problem >= 0 > mission.problem
        if decided or (isinstance(wish, incoming.Play) and wish.on):
            self._held = False
            self.driver.set_pace(running=True)
        return Played(wish.serial, said)

    def _hold(self) -> None:
        """Time stands still until somebody has decided about a command of the mission."""
        self._held = True
        self.driver.hold()

    def mission(self, rows: Mapping[str, CommandRow] | None = None, time: float = inf) -> Iterator[MissionNews]:
        """The mission, if there is one. rows: accounts of its commands by their ids, None for those of now. time: as of
        then, s of the page's time."""
        if self._mission is None:
            return
        if rows is None:
            rows = self._ledger.rows_of(counted_commands(self._mission))
        yield shown_mission(self._mission, rows, time, self._began)

    def _send_in_stages(self, prepared: Prepared, *, count: int | None, confirmed: bool) -> Command:
        """Refused."""
        raise MisuseError("Only what goes over the air can be sent in stages.")

    def halt(self) -> None:
        """Nothing goes out in stages here."""

    def lease(self, serial: int, deed: str, group: str, seconds: float, to: str) -> outgoing.Sent:
        """Refused: one desk commands this swarm."""
        raise MisuseError("Leases are for robots on the air, which several operators command.")

    def wink(self, serial: int, robot: int) -> outgoing.Sent:
        """Let a robot blink by its mark for a few seconds; then the mark is as it was."""
        name, now = self._name(robot), self._swarm.now()
        if now - self._winks.get(name, -inf) < WINK_SECONDS + 1.0:
            raise MisuseError(f"{name} blinks already.")
        self._winks[name] = now
        return outgoing.Sent(serial, self._station.send(WINK, only=[name], confirmed=True).id)

    def stop(self) -> None:
        """Stop every body. While a STOP holds that was given a moment ago, one more changes nothing."""
        now = self._clock.now()
        if not self.driver.latched or now - self._stopped_at >= STOP_AGAIN:
            self._stopped_at = now
            self._station.stop()
        if self._mission is not None:
            self._mission.halt(STOPPED)
        self._latch(True)

    def release(self) -> None:
        """End STOP."""
        self._station.release()
        self._latch(False)

    def _latch(self, latched: bool) -> None:
        self.driver.latched = latched
        self.driver.hurry()

    # ---- afterwards

    def why(
        self, serial: int, robot: int, command: str
    ) -> outgoing.Explained | Awaitable[outgoing.Explained | msgspec.Raw]:
        """How the robot with this index evaluated a command."""
        try:
            explanation = self._station.why(self._name(robot), command)
        except NoExplanationError:
            if self.past is None:
                raise
            sent = (each.message.issued for each in self._station.commands() if each.id == command)
            return self.past.why_now(next(sent, 0.0), incoming.Why(serial, robot, command))
        return outgoing.Explained(serial, show_why(explanation))

    def outcomes(self, serial: int, command: str, time: float = inf) -> outgoing.Answered:
        """What had become of a command at a time (s of the page's time) on each robot."""
        return outgoing.Answered(serial, self._ledger.outcomes(command, self._began + time))

    def replies(self, serial: int, command: str, robots: Sequence[int], time: float = inf) -> outgoing.Replied:
        """What these robots had answered to a question at a time, s of the page's time. Raises MisuseError for what is
        no question, and for a robot that there is not."""
        names = [self._name(robot) for robot in robots]
        asked = next((each for each in self._station.commands() if each.id == command), None)
        if asked is not None and asked.kind != "ask":
            raise MisuseError(f"{command} was no question, so robots did not answer it with a value.")
        found = self._station.answers(command, names, self._began + time)
        unit = self._station.accounting(command).unit
        return outgoing.Replied(serial, [answer_in_words(answer, unit) for answer in found])

    def failed(self, serial: int, rule: str) -> outgoing.Answered:
        """On which robots a rule ("": any rule) fails now."""
        robots = self._ledger.failing.now.robots(rule, len(self._swarm.scene.names))
        return outgoing.Answered(serial, robots)

    def members(self, serial: int, group: int) -> outgoing.Joined:
        """Who is in the group with this code."""
        return outgoing.Joined(serial, self.driver.groups.members(self._swarm.minds, group).tobytes())

    def build(self, serial: int, corners: Sequence[tuple[float, float]]) -> outgoing.Built:
        """Put up an obstacle."""
        return outgoing.Built(serial, *self._editor().build(corners))

    def shift(self, serial: int, version: int, place: int, across: float, up: float) -> outgoing.Built:
        """Move an obstacle."""
        return outgoing.Built(serial, *self._editor().shift(version, place, across, up))

    def clear(self, serial: int, version: int, place: int) -> outgoing.Built:
        """Take an obstacle away."""
        return outgoing.Built(serial, *self._editor().clear(version, place))

    def undo(self, serial: int, change: int, again: bool) -> outgoing.Undone:
        """Undo a change of the obstacles, or (again) do once more what was undone."""
        self._editor().undo(change, again)
        return outgoing.Undone(serial)

    def _editor(self) -> ObstacleEditor:
        editor = self._swarm.editor
        if editor is None:
            raise MisuseError("The obstacles of this world cannot be changed from here.")
        return editor

    def picture(self, serial: int) -> outgoing.Pictured | Awaitable[outgoing.Pictured]:
        """The picture of the map."""
        return pictured(self._swarm.picture, serial, at_once=self.at_once)

    def field(self, serial: int, name: str) -> outgoing.Fielded:
        """A field as it is now."""
        field_of(self._swarm.scene, name)
        return self._fields.answer(serial, name, self._swarm.tick)

    def sense(self, serial: int, robot: int) -> outgoing.Sensed:
        """What the body of the robot with this index senses."""
        name = self._name(robot)
        found = self._swarm.sensing(robot)
        if found is None:
            raise MisuseError(f"{name} does not tell the desk what its body senses.")
        return outgoing.Sensed(serial, robot, found)

    def commands(self, serial: int | None = None) -> outgoing.Commands:
        """The account of every command."""
        return outgoing.Commands(self._ledger.rows(self.driver.held_up), serial)

    def _name(self, robot: int) -> str:
        names = self._swarm.scene.names
        if not 0 <= robot < len(names):
            raise MisuseError(f"there is no robot number {robot}: they are numbered from 0 to {len(names) - 1}")
        return names[robot]

    # ---- unasked

    def news(self, watched: int) -> Iterator[outgoing.Said]:
        """Everything that may have changed; `watched`: the index of the robot that the page looks at, or -1."""
        if self.driver.preparing:
            yield outgoing.Compiling(min(kernel_count(), KERNELS), KERNELS)
        yield self.commands()
        yield from self.mission()
        yield outgoing.Failing(self._ledger.failing.now.rules, self._swarm.recent)
        groups = self.driver.groups
        shown = zip(groups.names, groups.counts, groups.shown, strict=True)
        yield outgoing.Groups([outgoing.ShownGroup(*group) for group in shown])
        obstacles = self._swarm.obstacles()
        if obstacles is not None:
            editor = self._swarm.editor
            yield outgoing.Obstacles(obstacles, editor.version if editor else None)
        yield self.plots.shown()
        yield self._safety()
        self.alerts.look()  # while time stands still there are no pictures
        yield self.alerts.shown()
        if 0 <= watched < len(self._swarm.scene.names):
            yield self._robot(watched)

    def _safety(self) -> outgoing.Safety:
        stop = self._ledger.stop()
        self.driver.latched = stop is not None  # a program may have sent it past the page
        if stop is None:
            return outgoing.Safety(False, "")
        return outgoing.Safety(True, self._ledger.stop_sentence(stop, self.driver.held_up))

    def _robot(self, index: int) -> outgoing.WatchedRobot:
        mind = self._swarm.minds[self._name(index)]
        declared = ((mind.declared(key), key) for key in sorted(mind.groups))
        values = [self._show_value(name, value) for name, value in mind.variables() if name not in _LEFT_OUT]
        return outgoing.WatchedRobot(
            index,
            [found.name if found is not None else key for found, key in declared],
            [*self._states(mind), *self._lacks(index)],
            sorted(values, key=lambda value: _KINDS.index(value.kind)),
            [self._show_rule(rule) for rule in mind.rules()],
            self._reports(self._name(index)),
        )

    def _reports(self, name: str) -> list[outgoing.ShownReport]:
        found = (report for report in reversed(self._station.reports) if report.robot == name)
        return [_show_report(report, self._began) for report in islice(found, MOST_REPORTS)]

    def _states(self, mind: MindView) -> list[str]:
        """What the robot is, in words."""
        flags = ((FROZEN, "frozen"), (SLEEPING, "sleeping"), (MARKED, "marked"))
        stopped = [stopped_in_words(mind.rest_state(), self._swarm.vocabulary)] if mind.stopped else []
        return stopped + [word for slot, word in flags if mind.values[slot] > 0.0]

    def _lacks(self, index: int) -> list[str]:
        """That the robot has used up what it drives with, in words."""
        exhausted = self._swarm.exhausted()
        there = exhausted is not None and bool(exhausted[index])
        return [f"no {' or '.join(self._swarm.scene.supplies)} left"] * there

    def _show_rule(self, rule: KeptRule) -> outgoing.ShownRule:
        value = "never ran" if isnan(rule.last_value) else value_in_words(rule.last_value, rule.unit)
        return outgoing.ShownRule(rule.name, rule.text, rule.active, value, rule.last_fault, rule.priority)

    def _show_value(self, name: str, value: float) -> outgoing.ShownValue:
        vocabulary = self._swarm.vocabulary
        binding = vocabulary.bindings.get(name.casefold())
        kind = binding.kind.value if isinstance(binding, Variable) else "user"
        return outgoing.ShownValue(name, value_in_words(value, unit_of(name, vocabulary)), kind)


def _show_finding(finding: Finding, text: str) -> outgoing.ShownFinding:
    return outgoing.ShownFinding(finding.severity, finding.message, finding.start, finding.end, finding.render(text))


def _show_report(report: Report, began: float) -> outgoing.ShownReport:
    """A report's body is what a robot sent: any of it may be missing or of another kind."""
    said = report_in_words(report.body.get("label"), report.body.get("values"))
    return outgoing.ShownReport(report.heard - began, said)
