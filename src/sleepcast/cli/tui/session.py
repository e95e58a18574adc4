"""The terminal desk without a terminal: the addressees of a text, who would obey it, what was reported.

A session never waits. `tick` hears what has come and looks at the robots when that is due; keys call the rest.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING

from sleepcast.channel import Kind
from sleepcast.channel.message import natural_order
from sleepcast.cli.account import FEW
from sleepcast.cli.streams import still_open
from sleepcast.cli.tui.commands import (
    AS_WRITTEN,
    EVERYBODY,
    HELP,
    QUESTIONS,
    Addressee,
    CommandType,
    ForecastText,
    PendingText,
    Spot,
    marked_finding,
)
from sleepcast.core.errors import MisuseError, SleepcastError, counted, did_you_mean, printable
from sleepcast.core.time_of_day import instant_of
from sleepcast.language import Checked, ReadError, read
from sleepcast.language.functions import MAX_WAIT
from sleepcast.language.vocabulary import Variable
from sleepcast.station.asking import AwaitedRelease
from sleepcast.station.network import ANSWERS_A_SECOND, NetworkStation
from sleepcast.station.staging import Stages
from sleepcast.station.validation import (
    NO,
    UNKNOWN,
    YES,
    CountNeededError,
    DoubtError,
    NotConfirmedError,
    chosen_in_words,
)

if TYPE_CHECKING:
    from sleepcast.station.network import NetworkStation
    from sleepcast.station.remote import RemoteMind, TelemetryClient
    from sleepcast.station.sent import Command

LOOKS_A_SECOND = 200.0
"""Robots that tell of themselves in a second at most: 60 kB on the air; of a larger fleet, more seldom."""
SHARE = 0.1
"""Of the time that goes into previews at most: a keystroke and STOP come first."""
QUICK = 0.02
"""Seconds of one preview that are not noticed."""
AGAIN_WITHIN = 3.0
"""Seconds within which a key that asks to be pressed twice is pressed again."""
HELD = 0.7
"""Seconds after a key within which the same one may only be held down: terminals send it again after half a second,
and then many times a second."""
STOP_AGAIN = 0.5
"""Seconds in which one more STOP adds nothing to the one that holds."""
WHY_PATIENCE = 5.0
"""Seconds for a robot to explain itself."""
MAX_NAMES = 6
"""Variables that the list of robots shows besides the rest."""


class TuiSession:
    """See the module.

    look_every: seconds between two looks, 0 for none but those that are asked for.
    message: the latest sentence for the person.
    wrong: whether that reports an error.
    page: a text that is read instead of the panes.
    shown: variables that the list of robots shows.
    by_age: whether that list begins with those heard longest ago.
    at: the instant at which the next command is obeyed, s of Unix time, None for as soon as it is heard.
    """

    def __init__(self, station: NetworkStation, telemetry: TelemetryClient, look_every: float) -> None:
        self.station, self.telemetry = station, telemetry
        self.look_every = look_every
        self.to, self.type = AS_WRITTEN, CommandType.ONCE
        self.message, self.wrong = "", False
        self.page: list[str] = []
        self.shown: list[str] = []
        self.by_age = False
        self.at: float | None = None
        self.pending: PendingText | None = None
        self.staging: StagedCommand | None = None
        self.leaving = False
        self._own: list[Addressee] = []
        self._listed: list[str] = []
        station.holding = True  # somebody sits here: robots that are driven go on
        self._asked_why: tuple[Command, str] | None = None
        self._doubted: tuple[PendingText, float] | None = None
        """What waits to be entered once more, and when it was entered last."""
        self._pressed: tuple[str, float] = ("", -inf)
        self._releasing: AwaitedRelease | None = None
        self._foreseen: tuple[tuple[str, Addressee, CommandType, int] | None, ForecastText] = (None, ForecastText())
        self._rested = -inf

    # ---- time

    def tick(self) -> None:
        """Hear what has come, and do what is due."""
        try:
            self.station.pump()
            if self.look_every and self.telemetry.is_due(self.period):
                self.look()
            self._hear_why()
            self._continue_stages()
            if self._releasing is not None and self._releasing.attend():
                self._releasing = None
        except SleepcastError as error:
            self.complain(str(error))

    def _continue_stages(self) -> None:
        """Go on with what is sent in stages."""
        if self.staging is None:
            return
        before = self.staging.message
        try:
            self.staging.tick()
        except SleepcastError:
            self.staging = None
            raise
        if self.staging.message != before:
            self.say(self.staging.message)
        if self.staging.over:
            self.staging = None

    def due(self) -> float:
        """Seconds until `tick` has something to do, unless something comes in before."""
        releasing = inf if self._releasing is None else self._releasing.until
        return min(self.station.due(), self.station.session.delivery.due(), releasing) - self.station.now

    @property
    def period(self) -> float:
        """Seconds between two looks: longer for a large fleet."""
        return max(self.look_every, len(self.station.roster) / LOOKS_A_SECOND)

    def look(self) -> None:
        """Ask all robots to tell of themselves."""
        self.station.stale_after = max(self.station.stale_after, 2.5 * self.period)
        self.telemetry.look()

    # ---- to whom

    def addressees(self) -> list[Addressee]:
        """All addressees of a text, in the order in which Tab goes through them."""
        minds = self.telemetry.minds
        groups = sorted({name for mind in minds.values() for name in mind.telemetry.groups}, key=str.casefold)
        return [AS_WRITTEN, EVERYBODY, *(Addressee(name, f"(IN {name})") for name in groups), *self._own]

    def next_addressee(self) -> None:
        """Address the next one."""
        known = self.addressees()
        self.to = known[(known.index(self.to) + 1) % len(known)] if self.to in known else known[0]

    def address(self, text: str) -> None:
        """To a robot, a group or all robots of which a test is true; "" as it is written. Raises ReadError and
        MisuseError."""
        known = {each.label.casefold(): each for each in self.addressees()}
        if text.casefold() in known:
            self.to = known[text.casefold()]
            return
        if text in self.station.roster:
            self.to = Addressee(text, robot=text)
        elif text.startswith("("):
            read(text)
            self.to = Addressee(" ".join(text.split()), test=text)
        else:
            names = [*self.station.roster, *known]
            raise MisuseError(
                f"{text} is neither a robot nor a group{did_you_mean(text, names)}; a test is in parentheses"
            )
        self._own.append(self.to)

    def next_type(self) -> None:
        """Once, in stages, standing, ask, and again."""
        types = list(CommandType)
        self.type = types[(types.index(self.type) + 1) % len(types)]

    # ---- before sending

    def forecast(self, text: str) -> ForecastText:
        """What can be said of a text that is being typed; where finding out takes long, that it is counted, or what was
        said of the same text a second before."""
        text = text.strip()
        if not text or text.startswith(":") or self.pending is not None:
            return ForecastText()
        question = text, self.to, self.type, int(self.station.now)
        asked, latest = self._foreseen
        if asked == question:
            return latest
        began = time.perf_counter()
        if began < self._rested:
            return latest if asked is not None and asked[:3] == question[:3] else ForecastText("counting")
        latest = self._forecast(text)
        took = time.perf_counter() - began
        self._rested = began + took / SHARE if took > QUICK else -inf
        self._foreseen = question, latest
        return latest

    def _forecast(self, text: str) -> ForecastText:
        missing = still_open(text)
        if missing > 0:
            waits = f"{missing} parenthes{'is is' if missing == 1 else 'es are'} open"
            counted = self._counted(text + ")" * missing)
            return ForecastText(f"{counted} ({waits})" if counted else waits)
        try:
            checked = self.station.check(text, only=self._only(self.to))
        except ReadError as error:
            return ForecastText(spot=Spot(error.reason, text, error.start, error.end, True))
        return ForecastText(self._counted(text, checked), marked_finding(checked))

    def _counted(self, text: str, checked: Checked | None = None) -> str:
        """Who would obey, in a sentence; "" for a text that no robot could run. checked: the text, if it was."""
        if self.type is CommandType.ASK:
            count = 1 if self.to.robot else max(self.station.fleet_size, len(self.station.roster))
            return f"a question to {counted(count, 'robot')}"
        try:
            wrapped = self.to.wrapped(text, self.type)
            if checked is None or checked.text != wrapped:
                checked = self.station.check(wrapped, only=self._only(self.to))
            preview = self.station.preview(checked)
        except SleepcastError:
            return ""
        codes = preview.codes
        if self.to.robot:
            index = list(preview.names).index(self.to.robot)
            codes = codes[index : index + 1]
        yes, no, unknown = int((codes == YES).sum()), int((codes == NO).sum()), int((codes >= UNKNOWN).sum())
        unknown += 0 if self.to.robot else preview.nameless
        reason = next(iter(preview.reasons), "")
        why = f" ({reason})" if unknown and reason and not self.to.robot else ""
        who = ", EVERYBODY" if preview.everybody and not self.to.robot else ""
        would = "would obey" if preview.most is None else f"would bid, {chosen_in_words(preview.most)}"
        return f"{would}: yes {yes}, no {no}, unknown {unknown}{why}{who}"

    @staticmethod
    def _only(to: Addressee) -> list[str] | None:
        return [to.robot] if to.robot else None

    # ---- sending

    def enter(self, text: str) -> bool:
        """What Enter does with a text; gives whether it is dealt with, so that the prompt can be emptied."""
        text, pending = text.strip(), self.pending
        self.message, self.pending = "", None
        doubted, self._doubted = self._doubted, None
        try:
            if pending is not None:
                self._answer(pending, text)
            elif text.startswith(":"):
                self._obey(text)
            elif text:
                self._send(self._request(text, doubted))
        except NotConfirmedError as error:
            self.complain(f"{error}. To send it to all, press Shift-Tab and then Enter")
            return False
        except DoubtError as error:
            self.complain(f"{error.why}. Press Enter once more to send it as it stands")
            return False
        except SleepcastError as error:
            self.complain(str(error))
            return pending is not None
        return True

    def _request(self, text: str, doubted: tuple[PendingText, float] | None) -> PendingText:
        """What is entered now: if it is what was doubted, that once more, confirmed unless the key is held down."""
        request = PendingText(text, self.type, self.to, at=self.at)
        if doubted is None or doubted[0] != request:
            return request
        return replace(doubted[0], confirmed=self.station.now - doubted[1] >= HELD)

    def _answer(self, pending: PendingText, text: str) -> None:
        """A number of robots was asked for, and something is typed."""
        if text == str(pending.may):
            self._send(replace(pending, count=pending.may))
        else:
            self.say("not sent")

    def _send(self, request: PendingText) -> None:
        if self.staging is not None:
            raise MisuseError("a command is still sent in stages: wait until that is over, or stop the robots")
        try:
            self._check_typed(request)
            if request.type is CommandType.ASK:
                self.station.ask(request.wrapped, only=self._only(request.to), anyway=request.confirmed)
                return
            request = replace(
                request, prepared=request.prepared or self.station.prepare(request.wrapped, request.terms)
            )
            self._commit(request)
        except DoubtError:
            self._doubted = replace(request, confirmed=False), self.station.now
            raise
        except CountNeededError as error:
            self.pending = replace(request, may=error.may)
            may = counted(error.may, "robot")
            self.say(f"{error.why}: {may} may obey. Type {error.may} to send it, anything else not to")

    def _check_typed(self, request: PendingText) -> None:
        """Places are those of what was typed, without what is put before it."""
        if not request.to.test or request.prepared is not None:
            return
        checked = self.station.check(request.text)
        checked.required()
        if checked.doubts and not request.confirmed and request.type is not CommandType.ASK:
            raise DoubtError.of(checked)

    def _commit(self, request: PendingText) -> None:
        prepared = request.prepared
        assert prepared is not None
        if request.type is CommandType.STAGED and not request.to.robot:
            stages = Stages(self.station, prepared, count=request.count, confirmed=request.confirmed)
            self.staging = StagedCommand(self.station, stages)
            self.say(self.staging.message)
        else:
            self.station.commit(prepared, count=request.count, confirmed=request.confirmed)
        self.at = None

    def stop(self) -> None:
        """Stop every robot, now."""
        self.pending, self.staging, self._releasing, self.message = None, None, None, ""
        latch = self.latch
        if latch is not None and latch.kind is Kind.STOP and self.station.now - latch.message.issued < STOP_AGAIN:
            return  # a key that is held down: the one that was just sent is sent again by itself
        try:
            self.station.stop()
        except SleepcastError as error:
            self.complain(str(error))

    def release(self) -> None:
        """End STOP, if the key was pressed twice, not held down."""
        if not self._twice("release", "press it once more to release every robot from STOP", HELD):
            return
        try:
            self._releasing = AwaitedRelease(self.station, self.telemetry)
        except SleepcastError as error:
            self.complain(str(error))

    def leave(self) -> None:
        """End; twice where robots have not confirmed yet that they are stopped."""
        latch = self.latch
        silent = latch.n_silent if latch is not None and latch.kind is Kind.STOP else 0
        warning = f"STOP is still sent to {counted(silent, 'robot')}: leave once more to give up"
        if not silent or self._twice("leave", warning):
            self.leaving = True

    def _twice(self, key: str, sentence: str, pause: float = 0.0) -> bool:
        """Whether a key was pressed before. pause: s between the two at least."""
        now = self.station.now
        pressed, self._pressed = self._pressed, (key, now)
        if pressed[0] == key and pause <= now - pressed[1] <= AGAIN_WITHIN:
            self._pressed = ("", -inf)
            self.message = ""
            return True
        self.say(sentence)
        return False

    @property
    def latch(self) -> Command | None:
        """The last STOP or RELEASE of this desk."""
        return next((each for each in reversed(self.station.commands()) if each.kind in LATCHES), None)

    # ---- what is asked of the desk itself

    def _obey(self, text: str) -> None:
        name, _, rest = text[1:].partition(" ")
        rest = rest.strip()
        match name:
            case "to":
                self.address(rest)
            case "show":
                self.shown = self._variables(rest.split())
            case "why":
                self._ask_why(rest)
            case "at":
                self.at = None if rest == "now" else instant_of(rest, self.station.now, MAX_WAIT)
            case "hold":
                self._hold(rest)
            case "look":
                self.look()
            case "help":
                self.help()
            case "quit" | "q":
                self.leave()
            case _:
                known = ", ".join(f":{each}" for each in QUESTIONS)
                raise MisuseError(f"unknown :{name}{did_you_mean(name, QUESTIONS)}: there are {known}")

    def _variables(self, names: Sequence[str]) -> list[str]:
        bindings = self.telemetry.minds.vocabulary.bindings
        for name in names:
            if not isinstance(bindings.get(name.casefold()), Variable):
                raise MisuseError(f"no robot tells {name}{did_you_mean(name, bindings)}")
        return list(names[:MAX_NAMES])

    def _hold(self, rest: str) -> None:
        if rest not in ("on", "off"):
            raise MisuseError(":hold on lets driven robots go on while this desk is open; :hold off lets them stop")
        self.station.holding = rest == "on"
        self.say(f"heartbeats to driven robots are {rest}")

    def help(self) -> None:
        """Show the keys."""
        self.page = HELP.strip().split("\n")

    def _ask_why(self, rest: str) -> None:
        robot, _, command = rest.partition(" ")
        latest = next((each.id for each in reversed(self.station.commands()) if each.kind is Kind.COMMAND), None)
        self._asked_why = self.telemetry.ask_why(robot, command.strip() or latest), robot
        self.say(f"asking {robot} why")

    def _hear_why(self) -> None:
        if self._asked_why is None:
            return
        asked, robot = self._asked_why
        try:
            explanation = self.telemetry.explanation(asked, robot)
        except SleepcastError:
            self._asked_why = None
            raise
        if explanation is not None:
            self._asked_why, self.message = None, ""
            self.page = explanation.render().split("\n")
        elif self.station.listened > asked.message.issued + WHY_PATIENCE:
            self._asked_why = None
            self.complain(f"{robot} does not answer")

    # ---- what the person is shown

    def say(self, sentence: str) -> None:
        """Tell the person something."""
        self.message, self.wrong = sentence, False

    def hush(self) -> None:
        """Another text is typed: forget the sentence about the one before."""
        if self.pending is None and self.staging is None:
            self.message = ""

    def complain(self, sentence: str) -> None:
        """Tell the person what went wrong."""
        self.message, self.wrong = sentence, True

    # ---- the list of robots

    def listed(self, roster: Mapping[str, float | None]) -> list[str]:
        """The names on a roster, as a person counts, or those first that were heard longest ago."""
        if self.by_age:
            return sorted(roster, key=lambda name: roster[name] or 0.0)
        if len(self._listed) != len(roster):  # names only come, and sorting thousands for each picture takes long
            self._listed = sorted(roster, key=natural_order)
        return self._listed

    def mind(self, robot: str) -> RemoteMind | None:
        """A robot's telemetry."""
        return self.telemetry.minds.get(robot)


LATCHES = frozenset({Kind.STOP, Kind.RELEASE})


PATIENCE = 2.0
"""Seconds after the time for answers for which a stage waits for those that are missing."""


class HaltedError(SleepcastError):
    """A stage went wrong, and nothing comes after it."""


class StagedCommand:
    """A command that is sent stage by stage.

    message: how far it has come, for a person.
    over: whether all stages went well.
    """

    def __init__(self, station: NetworkStation, stages: Stages) -> None:
        self._station, self._stages = station, stages
        self._number, self.over = 0, False
        self._send()

    def _send(self) -> None:
        self._number += 1
        self._sent = self._stages.send()
        self._until = self._station.now + self._sent.addressed / ANSWERS_A_SECOND + PATIENCE
        self.message = f"stage {self._number}: waiting for the answers"

    def tick(self) -> None:
        """Go on if this stage is over. Raises HaltedError if it went wrong."""
        account = self._station.accounting(self._sent.id)
        if account.n_fault:
            name = account.fault[0]
            fault = printable(account.answers[name].fault or "")
            raise HaltedError(f"halted after stage {self._number}: fault on {name}: {fault}")
        if account.complete and self._stages.over:
            self.over = True
            self.message = f"all {self._number} stages went well"
        elif account.complete:
            self._send()
        elif self._station.listened > self._until:
            raise HaltedError(f"halted after stage {self._number}: {account.silence(FEW)}")
