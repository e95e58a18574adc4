"""The desk behind a page whose robots are on the air: they come and go, are asked of themselves, and time is real."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from typing import NamedTuple, NoReturn, Protocol

import numpy as np
from numpy.typing import NDArray

from sleepcast.console import outgoing
from sleepcast.console.backend import Backend
from sleepcast.console.driver import Driver
from sleepcast.console.features.lease import ChangeLease
from sleepcast.console.features.names import names_of
from sleepcast.console.features.why import Explained, Why, show_why
from sleepcast.console.frames import SILENT
from sleepcast.console.operators import OperatorsDesk
from sleepcast.console.view import KeptRule, MindView, SwarmView
from sleepcast.core.ages import ago
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError, SleepcastError, printable
from sleepcast.core.records import dataclass
from sleepcast.language import Explanation
from sleepcast.station import Command
from sleepcast.station.asking import AwaitedRelease
from sleepcast.station.network import NetworkStation
from sleepcast.station.prepared import Prepared
from sleepcast.station.remote import TelemetryClient
from sleepcast.station.roster import of_robots

LISTEN = 0.02
"""Seconds between two looks at the air: a robot's answer is on the page before anybody could say it is late."""
AT_LEAST_EVERY = 0.5
"""Seconds after which a new frame is drawn even without telemetry: the clock goes on."""
LONGEST_WHY = 3.0
"""Seconds for which a robot is waited for that is to say why."""
MAX_NOTICES = 2
"""Sentences on what else is going on."""
NOT_SENT = "not reported"
"""The last value of a rule on a robot, which is not in its telemetry."""


@dataclass(frozen=True, slots=True)
class PendingExplanation:
    """A question to a robot why it did what it did."""

    station: NetworkStation
    telemetry: TelemetryClient
    asked: Command
    robot: str

    def answer(self) -> Explanation | None:
        """What it said, None while it has said nothing. Raises SleepcastError for what it cannot say."""
        return self.telemetry.explanation(self.asked, self.robot)

    def waited(self, seconds: float) -> bool:
        """Whether everything has been heard that came within so many seconds."""
        return self.station.listened >= self.asked.message.issued + seconds


class SafetyOrder(NamedTuple):
    """A STOP (or a RELEASE) of another operator. issued: when, s of the station's clock."""

    sender: str
    stop: bool
    issued: float


class FleetOnAir(SwarmView, Protocol):
    """A swarm on the air. asking: whether robots are asked of themselves time and again."""

    asking: bool

    def hear(self) -> bool:
        """Hear what has come, and ask for more if it is time; whether there is any news."""

    def orders(self) -> Iterator[SafetyOrder]:
        """What other operators said of STOP, the latest first."""

    def stopped(self, since: float) -> int:
        """How many robots report stopped, of those whose telemetry is of later (station's clock)."""

    def moving(self, since: float) -> int:
        """How many of those say that they still move."""

    def standing(self) -> str:
        """Robots that stand although there may have been no STOP, and why, in a sentence; "" if there are none."""

    def states(self, robot: str) -> list[str]:
        """Why this one rests, if it says so, in words."""

    def notices(self) -> list[str]:
        """What else is going on that a person should know of, as sentences."""

    def silent(self) -> NDArray[np.bool_]:
        """Robots with stale telemetry."""

    def age(self, robot: str) -> float | None:
        """Age of a robot's telemetry in s, None if there is none."""

    def ask_why(self, robot: str, command: str) -> PendingExplanation:
        """Ask a robot how it evaluated a command."""

    def awaited_release(self) -> AwaitedRelease:
        """A RELEASE, once robots have told whose STOPs hold."""


COLOURS = "On the air, robots do not report what they show with COLOUR."
SENSES = (
    "On the air, {} reports its variables, not what its sonars and its bumper sense: look at Values, "
    "or send a question (ask), such as (SONAR 1) where robots have sonars."
)


class RealPace:
    """Time on the wall (a `PaceControl`), which nobody holds: a pause only means that robots are asked no more."""

    def __init__(self, fleet: FleetOnAir) -> None:
        self._fleet = fleet
        self.factor = 1.0

    @property
    def paused(self) -> bool:
        return not self._fleet.asking

    @paused.setter
    def paused(self, paused: bool) -> None:
        self._fleet.asking = not paused

    @property
    def achieved(self) -> float:
        """Seconds in a second."""
        return 1.0

    def keep_up(self, budget: float) -> int:
        """Nothing is due."""
        return 0


class NetworkDriver(Driver):
    """Listens to the air, and draws what robots tell. attend: called time and again."""

    def __init__(self, fleet: FleetOnAir, clock: Clock, attend: Callable[[], None]) -> None:
        super().__init__(fleet, RealPace(fleet), clock)
        self._fleet, self._attend = fleet, attend

    async def run(self) -> None:
        """Listen until cancelled. Raises what the channel raises."""
        news, drawn_at = True, -AT_LEAST_EVERY
        while True:
            news = self.advance(0.0) or news
            now = self._clock.now()
            if now >= self._frame_due and (news or now - drawn_at >= AT_LEAST_EVERY):
                self.draw()
                news, drawn_at = False, now
                self.wait_a_frame(now)
            await asyncio.sleep(LISTEN)

    @property
    def held_up(self) -> str:
        """Nobody holds time on the wall: a pause only means that robots are asked no more."""
        return ""

    def advance(self, budget: float) -> bool:
        """Hear what has come, then attend: after a hold-up, answers may have come in time that are heard late."""
        news = self._fleet.hear()
        self._attend()
        return news

    def expedite(self) -> None:
        """Draw at once: what robots tell of a STOP comes when it comes."""
        self._frame_due = self._clock.now()
        self.draw()

    def flags(self) -> bytes:
        """Those that other swarms have, and who is silent."""
        flags = np.frombuffer(super().flags(), np.uint8)
        return np.where(self._fleet.silent(), flags | np.uint8(SILENT), flags).tobytes()

    def set_pace(self, running: bool | None = None, factor: float | None = None) -> None:
        """Ask robots of themselves, or no more; real time has one speed."""
        super().set_pace(running)


class NetworkBackend(Backend):
    """See the module. Its times are those of the fleet, which begin with the page."""

    def __init__(self, fleet: FleetOnAir, station: NetworkStation, clock: Clock, began: float) -> None:
        self._operators = OperatorsDesk(station, began)
        self._releasing: AwaitedRelease | None = None
        super().__init__(fleet, station, NetworkDriver(fleet, clock, self._attend), clock, began=began)
        self._fleet = fleet
        self._greeting: outgoing.Hello | None = None

    def hello(self) -> outgoing.Hello:
        """What a page needs first, and again as soon as the scene is another one or robots turn out to have colours."""
        scene = self.swarm.scene
        note = COLOURS if "colour" in self.swarm.vocabulary.bindings else ""
        if self._greeting is None or self._greeting.scene is not scene or self._greeting.note != note:
            count = len(scene.names)
            unheard = max(0, self.station.fleet_size - count)
            self._greeting = outgoing.Hello(scene, count, names_of(self.swarm), air=True, unheard=unheard, note=note)
        return self._greeting

    def sense(self, robot: int) -> NoReturn:
        """Refused."""
        raise MisuseError(SENSES.format(self.name_of(robot)))

    def news(self, watched: int) -> Iterator[outgoing.DeskMessage]:
        """Everything that may have changed; the scene, too."""
        yield self.hello()
        yield from super().news(watched)
        yield self._operators.shown()

    def _send_in_stages(self, prepared: Prepared, *, count: int | None, confirmed: bool) -> Command:
        """To one robot, to a tenth, to all."""
        return self._operators.send_in_stages(prepared, count=count, confirmed=confirmed)

    def halt(self) -> None:
        """Send no further stage."""
        self._operators.halt()

    def _attend(self) -> None:
        """Go on with what takes more than a moment."""
        self._operators.attend()
        if self._releasing is not None and self._releasing.attend():
            self._releasing = None
            self._latch(False)

    def stop(self, by: str = "") -> None:
        """Stop every body. A RELEASE that has not gone out yet does not."""
        self._releasing = None
        super().stop()

    def release(self, by: str = "") -> None:
        """End STOP, once robots have told whose STOPs hold."""
        self._releasing = self._fleet.awaited_release()

    def lease(self, asked: ChangeLease) -> outgoing.Sent:
        """Ask robots about the lease of a group."""
        sent, doubt = self._operators.lease(asked.action, asked.group, asked.seconds, asked.to)
        return outgoing.Sent(asked.serial, sent.id, doubt)

    def explain(self, asked: Why) -> Explained | Awaitable[Explained]:
        """The robot is asked."""
        return self._heard_why(asked.serial, self._fleet.ask_why(self.name_of(asked.robot), asked.command))

    async def _heard_why(self, serial: int, question: PendingExplanation) -> Explained:
        while (explanation := question.answer()) is None:
            if question.waited(LONGEST_WHY):
                raise SleepcastError("The robot has not answered the question why.")
            await asyncio.sleep(LISTEN)
        return Explained(serial, show_why(explanation))

    def _safety(self) -> outgoing.Safety:
        """The account of our own STOP; for a STOP of other operators, the telemetry since."""
        own = next((c for c in reversed(self.station.commands()) if c.kind in ("stop", "release")), None)
        other = next(self._fleet.orders(), None)
        safety, since, by = super()._safety(), self.began if own is None else own.message.issued, ""
        if other is not None and other.issued > since:
            safety, since = outgoing.Safety(other.stop, ""), other.issued
            by = f"STOP by {printable(other.sender)}: " if other.stop else ""
        if not safety.sentence:
            stopped, size = self._fleet.stopped(since), self.station.fleet_size
            scope = of_robots(max(size, len(self._fleet.minds)), size > 0)
            moving = f"; {moves:,} of these still move" if (moves := self._fleet.moving(since)) else ""
            sentence = f"{by}{stopped:,} {scope} report stopped{moving}."
            if standing := self._fleet.standing():
                sentence += f" {standing[0].upper()}{standing[1:]}."
            safety = outgoing.Safety(safety.latched or stopped > 0, sentence)
        self.driver.latched = safety.latched
        notices = " ".join(f"{notice[0].upper()}{notice[1:]}." for notice in self._fleet.notices()[:MAX_NOTICES])
        return outgoing.Safety(safety.latched, safety.sentence, printable(notices))

    def _states(self, mind: MindView) -> list[str]:
        age = self._fleet.age(mind.name)
        if age is None:
            return ["has sent no telemetry"]
        old = [f"last telemetry {ago(age)}"] if age > self.station.stale_after else []
        return super()._states(mind) + self._fleet.states(mind.name) + old

    def _show_rule(self, rule: KeptRule) -> outgoing.ShownRule:
        return outgoing.ShownRule(rule.name, rule.text, rule.active, NOT_SENT, rule.last_fault, rule.priority)
