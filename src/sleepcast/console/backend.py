"""The model behind every page of a simulated swarm: answers to questions, and news.

It puts the station's words and the driver's pictures into the shapes of the wire. All pages share one desk: they see
the same, and each may command.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from itertools import islice
from math import inf, isnan
from typing import Any, ClassVar

import msgspec

from sleepcast.channel.desks import desk_of
from sleepcast.channel.simulated_radio import RadioCounts
from sleepcast.console import outgoing, registry
from sleepcast.console.account_table import AccountTable, CommandRow
from sleepcast.console.driver import Driver
from sleepcast.console.feature import NOT_HERE_AT_ALL
from sleepcast.console.features.alerts import AlertBoard
from sleepcast.console.features.field import Field, Fielded, FieldMaps
from sleepcast.console.features.mission import STOPPED, MissionNews, MissionPlayer, counted_commands, shown_mission
from sleepcast.console.features.names import names_of
from sleepcast.console.features.plots import Plots, ScenarioMeasure
from sleepcast.console.features.send import Send, SendKind
from sleepcast.console.features.sight import SightView
from sleepcast.console.features.why import Explained, Why, show_why
from sleepcast.console.outgoing import ShownName
from sleepcast.console.past import Past
from sleepcast.console.sensing import BodyView
from sleepcast.console.timeline import commands_of
from sleepcast.console.values import TelemetryValues, Values
from sleepcast.console.view import KeptRule, MindView, ObstacleEditor, Picture, Scene, SwarmView
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.core.tasks import together
from sleepcast.core.units import value_in_words
from sleepcast.language import Variable
from sleepcast.language.reading_units import report_in_words
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, FROZEN, MARKED, SLEEPING, SUPPORT, TIME_SLOT, unit_of
from sleepcast.loop.swarm import Witness
from sleepcast.simulator import KERNELS, kernel_count
from sleepcast.station import Command, NoExplanationError, Station
from sleepcast.station.account import answer_in_words
from sleepcast.station.prepared import Prepared, Terms
from sleepcast.station.rest import stopped_in_words

STOP_AGAIN = 0.5
"""Seconds in which one more STOP adds nothing to the one that holds; the station itself repeats it."""
MAX_REPORTS = 20
"""Reports of the watched robot that a page shows."""
_LEFT_OUT = frozenset(quantity.name for quantity in (*SUPPORT[ACTIVE0 + 1 : ACTIVE0 + BUFFERS], *SUPPORT[TIME_SLOT:]))
"""Variables that the page shows elsewhere: the active flags with the rules, the time in its bar."""
_KINDS = ("sensor", "actuator", "user", "support")


class Backend:
    """See the module. Its questions raise SleepcastError, with a sentence for the person who asked.

    swarm, station: on the page, and the first operator's desk
    driver: lets the swarm run
    began: the time of the station's clock with which that of the page begins
    measures: of the scenario
    past: what is kept of the run, None for nothing
    mission: plays that of the scenario, None if it has none
    """

    recorded: ClassVar[bool] = False
    lacks: ClassVar[str] = NOT_HERE_AT_ALL

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
        self.mission, self.held = mission, False
        if mission is not None:
            mission.hold = self.hold
        self.swarm, self.station, self.clock = swarm, station, clock
        self.began, self._first_names = began, swarm.scene.names
        desks: list[Station] = getattr(swarm, "desks", None) or [station]
        self._desks = {desk.operator: desk for desk in desks}
        self.accounts = AccountTable(station, swarm, began, desks[1:])
        self._stopped_at = -STOP_AGAIN
        self.kept: dict[type[Any], Any] = {}
        """What features keep for all pages, by its class."""
        self.at_once = False
        """Whether answers come at once whatever they take, where nothing can be done beside."""
        self.values: Values = TelemetryValues(swarm, station)
        self.plots = Plots(self.values, clock, measures)
        driver.watchers.append(self.plots.sample)
        self._fields = FieldMaps(swarm.field, clock)
        self._pending: tuple[tuple[str, bool, SendKind, str], Prepared] | None = None
        """The latest command that is not sent yet, since its sender was asked about it."""
        self.winks: dict[str, float] = {}
        """When each robot was asked to blink, s of the page's time."""
        self.alerts = AlertBoard(self.values, clock)
        driver.watchers.append(self.alerts.look)
        if past is not None:
            self.alerts.marked = lambda firing: past.marks.add(
                firing.at, "alert", f"{firing.text}: {firing.count:,} robots"
            )
        registry.begin(self)

    def hello(self) -> outgoing.Hello:
        """What a page needs first."""
        scene = self.swarm.scene
        return outgoing.Hello(
            scene,
            len(scene.names),
            names_of(self.swarm),
            operators=getattr(self.swarm, "operators", None) or msgspec.UNSET,
        )

    async def live(self) -> None:
        """Let time pass, and do what is to be done aside, until cancelled."""
        if self.past is None:
            await self.driver.run()
        else:
            await together(self.driver.run(), self.past.live())

    # ---- what features need

    @property
    def scene(self) -> Scene:
        """What does not change while the swarm runs."""
        return self.swarm.scene

    @property
    def facts(self) -> Station:
        """What is known of the robots."""
        return self.station

    @property
    def editor(self) -> ObstacleEditor | None:
        """What changes the obstacles, None where nobody may."""
        return self.swarm.editor

    @property
    def add_robot(self) -> Callable[[str, float | None, float | None], str] | None:
        """Adds a robot of a type at x, y, m, and gives its name; None where none can be added."""
        return getattr(self.swarm, "add_robot", None)

    @property
    def picture(self) -> Picture | None:
        """The picture of the map, None if there is none."""
        return self.swarm.picture

    @property
    def overhear(self) -> Callable[[Witness], RadioCounts] | None:
        """Lets a witness hear every message of the swarm, and gives the counts of copies; None where nobody can."""
        return getattr(self.swarm, "overhear", None)

    @property
    def sight(self) -> Callable[[int], SightView] | None:
        """Tells what the robot with this index sees; None where nobody can."""
        return getattr(self.swarm, "sight", None)

    def known_names(self) -> list[ShownName]:
        """The names that a text may use, with the ranges of their values."""
        return names_of(self.swarm)

    # ---- sending

    def send(self, asked: Send) -> outgoing.Sent:
        """Broadcast a text. count, confirmed: where the station asks for confirmation, see `Station.commit`."""
        desk = self.desk_of(asked.by)
        if asked.kind == "ask":
            sent = desk.ask(asked.text)
        else:
            commit = self._send_in_stages if asked.kind == "stages" else desk.commit
            sent = commit(self._prepared(asked), count=asked.count, confirmed=asked.confirmed)
            self._pending = None
            if len(self._desks) > 1:
                desk.hold(True)  # who sends is there, so that what is driven goes on
        self.driver.begin()
        return outgoing.Sent(asked.serial, sent.id)

    def desk_of(self, operator: str) -> Station:
        """The desk of an operator, "" for the first. Raises MisuseError for one who has none here."""
        return desk_of(operator, self._desks, [*self._desks.values()])

    def _prepared(self, asked: Send) -> Prepared:
        """The command, as a page was asked about it before, if it was."""
        what = (asked.text, asked.everybody, asked.kind, asked.by)
        if self._pending is None or self._pending[0] != what:
            terms = Terms(standing=asked.kind == "standing", everybody=asked.everybody, anyway=asked.confirmed)
            self._pending = what, self.desk_of(asked.by).prepare(asked.text, terms)
        return self._pending[1]

    def hold(self) -> None:
        """Time stands still until somebody has decided about a command of the mission."""
        self.held = True
        self.driver.hold()

    def mission_news(self, rows: Mapping[str, CommandRow] | None = None, time: float = inf) -> Iterator[MissionNews]:
        """The mission, if there is one. rows: accounts of its commands by their ids, None for those of now. time: as of
        then, s of the page's time."""
        if self.mission is None:
            return
        if rows is None:
            rows = self.accounts.rows_of(counted_commands(self.mission))
        yield shown_mission(self.mission, rows, time, self.began)

    def _send_in_stages(self, prepared: Prepared, *, count: int | None, confirmed: bool) -> Command:
        """Refused."""
        raise MisuseError("Only what goes over the air can be sent in stages.")

    def halt(self) -> None:
        """Nothing goes out in stages here."""

    def stop(self, by: str = "") -> None:
        """Stop every body. While a STOP holds that was given a moment ago, one more changes nothing. by: the operator
        as whom; where nobody is called so, the first one stops."""
        now = self.clock.now()
        if not self.driver.latched or now - self._stopped_at >= STOP_AGAIN:
            self._stopped_at = now
            self._desks.get(by, self.station).stop()
        if self.mission is not None:
            self.mission.halt(STOPPED)
        self._latch(True)

    def release(self, by: str = "") -> None:
        """End STOP, whoever gave it, as this operator."""
        self.desk_of(by).release_all()
        self._latch(False)

    def _latch(self, latched: bool) -> None:
        self.driver.latched = latched
        self.driver.expedite()

    # ---- afterwards

    def explain(self, asked: Why) -> Explained | Awaitable[Explained | msgspec.Raw]:
        """How a robot evaluated a command."""
        try:
            explanation = self.accounts.desk_for(asked.command or "").why(self.name_of(asked.robot), asked.command)
        except NoExplanationError:
            if self.past is None:
                raise
            sent = (each.message.issued for each in self.accounts.commands() if each.id == asked.command)
            return self.past.why_now(next(sent, 0.0), asked)
        return Explained(asked.serial, show_why(explanation))

    def outcomes(self, command: str, time: float = inf) -> bytes:
        """What had become of a command at a time (s of the page's time) on each robot."""
        return self.accounts.outcomes(command, self.began + time, self._names_at(time))

    def replies(self, command: str, robots: Sequence[int], time: float = inf) -> list[str]:
        """What these robots had answered to a question at a time, s of the page's time. Raises MisuseError for what is
        no question, and for a robot that there is not."""
        then = self._names_at(time)
        names = [self._name_in(then, robot) for robot in robots]
        asked = next((each for each in self.accounts.commands() if each.id == command), None)
        if asked is not None and asked.kind != "ask":
            raise MisuseError(f"{command} was no question, so robots did not answer it with a value.")
        desk = self.accounts.desk_for(command)
        unit = desk.accounting(command).unit
        return [answer_in_words(answer, unit) for answer in desk.answers(command, names, self.began + time)]

    def failed(self, rule: str, time: float = inf) -> bytes:
        """On which robots a rule ("": any rule) failed at a time, s of the page's time."""
        then = self.accounts.failing.now if self.past is None or time == inf else self.past.timeline.failures_at(time)
        return then.robots(rule, len(self.scene.names))

    def members(self, group: int) -> bytes:
        """Who is in the group with this code."""
        return self.driver.groups.members(self.swarm.minds, group).tobytes()

    def field(self, asked: Field) -> Fielded:
        """A field as it is now."""
        return self._fields.answer(asked, self.swarm.tick)

    def sense(self, robot: int) -> BodyView:
        """What the body of the robot with this index senses."""
        name = self.name_of(robot)
        body = self.swarm.sensing(robot)
        if body is None:
            raise MisuseError(f"{name} does not tell the desk what its body senses.")
        return body

    def commands(self, serial: int | None = None, time: float = inf) -> outgoing.Commands:
        """The account of every command as it was at a time, s of the page's time."""
        if self.past is not None and time < inf:
            return commands_of(self.past.timeline, time, serial)
        return outgoing.Commands(self.accounts.rows(self.driver.held_up), serial)

    def _names_at(self, time: float) -> tuple[str, ...]:
        """The names of the robots at a time, s of the page's time, by place."""
        return self.swarm.scene.names if self.past is None or time == inf else self.past.timeline.names_at(time)

    def name_of(self, robot: int) -> str:
        return self._name_in(self.swarm.scene.names, robot)

    def _name_in(self, names: Sequence[str], robot: int) -> str:
        if not 0 <= robot < len(names):
            raise MisuseError(f"there is no robot number {robot}: they are numbered from 0 to {len(names) - 1}")
        if not names[robot]:
            raise MisuseError(f"the robot that was number {robot} on the map is gone.")
        return names[robot]

    # ---- unasked

    def news(self, watched: int) -> Iterator[outgoing.DeskMessage]:
        """Everything that may have changed; `watched`: the index of the robot that the page looks at, or -1."""
        if self.driver.preparing:
            yield outgoing.Compiling(min(kernel_count(), KERNELS), KERNELS)
        yield self.commands()
        yield from self.mission_news()
        yield outgoing.Failing(self.accounts.failing.now.rules, self.swarm.recent)
        groups = self.driver.groups
        shown = zip(groups.names, groups.counts, groups.shown, strict=True)
        yield outgoing.Groups([outgoing.ShownGroup(*group) for group in shown])
        obstacles = self.swarm.obstacles()
        if obstacles is not None:
            editor = self.swarm.editor
            version = editor.version if editor else None
            yield outgoing.Obstacles(obstacles.obstacles, version, obstacles.tall)
        names = self.swarm.scene.names
        if names is not self._first_names or (self.past is not None and self.past.timeline.names.times):
            yield outgoing.Roll(names)  # whoever has looked at the past, before a fork too, has those of then
        yield self.plots.shown()
        yield self._safety()
        self.alerts.look()  # while time stands still there are no pictures
        yield self.alerts.shown()
        if 0 <= watched < len(names) and names[watched]:
            yield self._robot(watched)

    def _safety(self) -> outgoing.Safety:
        stop = self.accounts.stop()
        self.driver.latched = stop is not None  # a program may have sent it past the page
        if stop is None:
            return outgoing.Safety(False, "")
        return outgoing.Safety(True, self.accounts.stop_sentence(stop, self.driver.held_up))

    def _robot(self, index: int) -> outgoing.WatchedRobot:
        name = self.name_of(index)
        mind = self.swarm.minds[name]
        groups = [key if (group := mind.declared(key)) is None else group.name for key in sorted(mind.groups)]
        states, exhausted, crashed = self._states(mind), self.swarm.exhausted(), self.swarm.crashed()
        if exhausted is not None and exhausted[index]:
            states.append(f"no {' or '.join(self.swarm.scene.supplies)} left")
        if crashed is not None and crashed[index]:
            states.append("crashed")
        values = [
            self._show_value(variable, value) for variable, value in mind.variables() if variable not in _LEFT_OUT
        ]
        values.sort(key=lambda value: _KINDS.index(value.kind))
        rules = [self._show_rule(rule) for rule in mind.rules()]
        latest = [report for _, report in self.latest_reports(MAX_REPORTS, name)]
        return outgoing.WatchedRobot(index, groups, states, values, rules, latest)

    def latest_reports(self, most: int, robot: str = "") -> list[tuple[str, outgoing.ShownReport]]:
        """The latest reports of one robot, "" for all, newest first, each with the name of its robot."""
        reports = (report for report in reversed(self.station.reports) if robot in ("", report.robot))
        return [
            (
                each.robot,
                outgoing.ShownReport(
                    each.heard - self.began, report_in_words(each.body.get("label"), each.body.get("values"))
                ),
            )
            for each in islice(reports, most)  # a report's body is what a robot sent: any of it may be missing
        ]

    def _states(self, mind: MindView) -> list[str]:
        """What the robot is, in words."""
        flags = ((FROZEN, "frozen"), (SLEEPING, "sleeping"), (MARKED, "marked"))
        stopped = [stopped_in_words(mind.rest_state(), self.swarm.vocabulary)] if mind.stopped else []
        return stopped + [word for slot, word in flags if mind.values[slot] > 0.0]

    def _show_rule(self, rule: KeptRule) -> outgoing.ShownRule:
        value = "never ran" if isnan(rule.last_value) else value_in_words(rule.last_value, rule.unit)
        return outgoing.ShownRule(rule.name, rule.text, rule.active, value, rule.last_fault, rule.priority)

    def _show_value(self, name: str, value: float) -> outgoing.ShownValue:
        vocabulary = self.swarm.vocabulary
        binding = vocabulary.bindings.get(name.casefold())
        kind = binding.kind.value if isinstance(binding, Variable) else "user"
        return outgoing.ShownValue(name, value_in_words(value, unit_of(name, vocabulary)), kind)
