"""What stands in each pane of the terminal desk: lines that fit, in words and letters, with colour only besides.

Everything that robots and other operators said is untrusted, and printed so that no terminal obeys it.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from prompt_toolkit.utils import get_cwidth

from sleepcast.channel import Kind
from sleepcast.cli.account import FEW
from sleepcast.cli.describe import answer_text
from sleepcast.core.ages import age, ago
from sleepcast.core.errors import printable
from sleepcast.core.units import value_in_words
from sleepcast.language import Variable
from sleepcast.language.vocabulary import unit_of
from sleepcast.station.account import Account, spread_in_words
from sleepcast.station.roster import of_robots
from sleepcast.station.sent import Command

if TYPE_CHECKING:
    from sleepcast.cli.tui.commands import Spot
    from sleepcast.cli.tui.session import TuiSession
    from sleepcast.station.remote import RemoteMind

Line = list[tuple[str, str]]
"""Pieces of a line, each with its style."""

LOST = 10.0
"""Seconds after which a robot that was not heard is shown as lost, unless telemetry is requested more rarely."""
WIDE = 48
"""Columns of the list of robots from which on their names may be long."""
MAX_LINES = 3
"""Lines for what became of one command."""
OUTCOMES = "-MNFUHW"
"""A robot's answer, by its code in a column of outcomes."""


def title(session: TuiSession, width: int, channel: str) -> Line:
    """Who is at the desk, on which channel, and the time."""
    now = time.strftime("%H:%M:%S", time.localtime(session.station.now))
    delivery = session.station.session.delivery
    left = f" sleepcast desk  {delivery.name} ({delivery.role})  {delivery.admission.fleet} on {channel}"
    return [("class:title", _filled(left, width - len(now) - 2) + f" {now} ")]


def safety(session: TuiSession, width: int) -> Line:
    """Whether STOP holds, and who is stopped; always in the same place."""
    latch, minds = session.latch, session.telemetry.minds
    stopped = sum(mind.stopped for mind in minds.values())
    if latch is None:
        text = f"{stopped} {_of_all(session)} report stopped"
        if standing := minds.standing():
            text += f"; {standing}"
        if not stopped:
            text = "STOP: F9 or Ctrl-X"
        return [("class:warned" if stopped else "", _filled(f" {text}", width))]
    account = session.station.accounting(latch.id)
    when = ago(session.station.now - latch.message.issued)
    if latch.kind is Kind.STOP:
        return [("class:stop", _filled(f" STOP {when}: {_stopped(session, account, 1)}", width))]
    return [("class:warned", _filled(f" RELEASE {when}: released {account.n_matched}, {_silence(account)}", width))]


def _of_all(session: TuiSession) -> str:
    """The robots that are counted."""
    size = session.station.fleet_size
    return of_robots(max(size, len(session.station.roster)), size > 0)


def _silence(account: Account) -> str:
    lost = f"not stored {account.n_not_stored}, " if account.n_not_stored else ""
    fault = f"fault {account.n_fault}, " if account.n_fault else ""
    return f"{lost}{fault}{account.silence(FEW)}"


# ---- robots


def robots(session: TuiSession, width: int, height: int, first: int) -> list[Line]:
    """The robots from the place `first` on, a line each: state, name, answer to the last command, age, groups."""
    roster, shared = session.station.roster, session.station.shared_names
    names = session.listed(roster)[first : first + height]
    latest = next(reversed(session.station.commands()), None)
    silent = None if latest is None else latest.silent
    lost_after, room = _lost_after(session), 16 if width >= WIDE else 8
    lines = []
    for name in names:
        heard, mind = roster[name], session.mind(name)
        since = float("inf") if heard is None else session.station.now - heard
        lost = since > lost_after
        letters = ("2" if name in shared else "?" if mind is None else _state(mind)) + ("L" if lost else " ")
        style = "class:warned" if lost or mind is None or name in shared else "class:stopped" if mind.stopped else ""
        code = _outcome(latest, silent, name)
        cells = [_value(session, name, each).rjust(room - 8) for each in session.shown]
        cells += [",".join(sorted(mind.telemetry.groups))] if mind is not None and mind.telemetry.groups else []
        told = "never" if heard is None else age(since).replace(" ", "")
        text = f"{clipped(printable(name), room):<{room}} {code} {told:>5}  {'  '.join(cells)}"
        answered = "class:warned" if code in "F-UH" else ""
        lines.append([(style, f"{letters} "), (answered, clipped(printable(text), width - 3))])
    return lines or _plain("no robot heard yet: are robots up, on this channel, with these keys?", width)


def _state(mind: RemoteMind) -> str:
    """A letter: S of one that is stopped, s of one that is and still moves, o of another."""
    rest = mind.rest_state()
    return ("S" if rest is None or rest.at_rest else "s") if mind.stopped else "o"


def robots_title(session: TuiSession) -> str:
    """How many there are, and in which state."""
    roster, minds = session.station.roster, session.telemetry.minds
    stopped = sum(mind.stopped for mind in minds.values())
    late = session.station.now - _lost_after(session)
    lost = sum(heard is None or heard < late for heard in roster.values())
    shown = f"; {', '.join(session.shown)}" if session.shown else ""
    size = session.station.fleet_size
    lost += max(0, size - len(roster))
    unheard = f" of {size}" if size > len(roster) else ""
    failing = session.station.failures.left(session.station.names, minds)
    shown += "".join(f"; ! {printable(session.station.failures.names[key])} fails on {len(on)}" for key, on in failing)
    return f"Robots {len(roster)}{unheard}: S {stopped}, L {lost}{', by age' if session.by_age else ''}{shown}"


def _lost_after(session: TuiSession) -> float:
    """Seconds after which a robot that was not heard counts as lost."""
    return max(LOST, 2.5 * session.period) if session.look_every else LOST


def _outcome(command: Command | None, silent: NDArray[np.bool_] | None, name: str) -> str:
    """The letter of a robot's answer to a command; a blank if it was not asked. silent: who was and did not answer."""
    index = None if command is None else command.answers.names.index_of(name)
    if command is None or silent is None or index is None:
        return " "
    codes = command.answers.codes
    if index < len(codes) and codes[index]:
        return OUTCOMES[codes[index]]
    return "-" if index < len(silent) and silent[index] else " "


def _value(session: TuiSession, robot: str, name: str) -> str:
    mind, binding = session.mind(robot), session.telemetry.minds.vocabulary.bindings.get(name.casefold())
    if mind is None or not isinstance(binding, Variable):
        return "?"
    value = mind.values[binding.slot]
    return value_in_words(value, unit_of(name, session.telemetry.minds.vocabulary)).replace(" ", "")


# ---- commands


def commands(session: TuiSession, width: int, height: int) -> list[Line]:
    """What was sent, the latest first, with its outcome."""
    lines: list[Line] = []
    for command in reversed(session.station.commands()):
        if len(lines) >= height:
            break
        lines += _command(session, command, width)
    return lines[:height] or _plain("no command sent yet: type an expression below; F1 for help", width)


def _command(session: TuiSession, command: Command, width: int) -> Iterator[Line]:
    when = time.strftime("%H:%M:%S", time.localtime(command.message.issued))
    kind = "" if command.kind is Kind.COMMAND else f"{command.kind.name} "
    standing = "standing " if command.message.standing else ""
    text = " ".join(command.message.text.split())
    yield [("class:when", f"{when} "), ("bold", clipped(printable(f"{standing}{kind}{text}"), width - 9))]
    account = session.station.accounting(command.id)
    style = "class:warned" if account.n_fault or account.n_silent or account.n_not_stored else ""
    became = _stopped(session, account, FEW) if command.kind is Kind.STOP else _became(command, account)
    for line in _folded(printable(became), width - 2)[:MAX_LINES]:
        yield [(style, f"  {line}")]
    for name in account.fault[:1]:
        fault = printable(f"  fault on {name}: {account.answers[name].fault or ''}")
        yield [("class:wrong", clipped(fault, width))]


def _became(command: Command, account: Account) -> str:
    if command.kind is Kind.COMMAND:
        return account.sentence()
    if command.kind is Kind.ASK:
        values = account.values
        spread = f" {spread_in_words(values, account.unit)}," if values is not None else ""
        return f"answered {account.n_matched},{spread} {_silence(account)}"
    return f"released {account.n_matched}, {_silence(account)}"


def _stopped(session: TuiSession, account: Account, most: int) -> str:
    """How many have accepted a STOP, who of them is not at rest, at most so many by name, and who is silent."""
    rest = account.rest.sentence(session.station.vocabulary, most) if account.rest and account.n_matched else ""
    return f"stopped {account.n_matched}, {_silence(account)}{rest and f'; {rest}'}"


# ---- reports


def reports(session: TuiSession, width: int, height: int) -> list[Line]:
    """Reports of robots and messages of other operators, the latest last."""
    said_by = [
        (report.heard, f"{report.robot}: {answer_text(report.body)}")
        for report in list(session.station.reports)[-height:]
    ]
    news = [
        (each.issued, f"{each.sender} sends {each.text or each.kind.name}")
        for each in list(session.station.news)[-height:]
    ]
    lines = []
    for heard, text in sorted([*said_by, *news])[-height:]:
        when = time.strftime("%H:%M:%S", time.localtime(heard))
        lines.append([("class:when", f"{when} "), ("", clipped(printable(" ".join(text.split())), width - 9))])
    return lines or _plain("no reports yet", width)


# ---- below the prompt


def hint(session: TuiSession, text: str, width: int, height: int, indent: int) -> list[Line]:
    """The forecast of the text that is being typed, or the latest sentence. indent: columns before the text in the
    line above."""
    if session.message:
        style = "class:wrong" if session.wrong else "class:said"
        lines = [line for each in session.message.split("\n") for line in _folded(printable(each), width)]
        return [[(style, line)] for line in lines[:height]]
    forecast = session.forecast(text)
    excerpt: list[Line] = [] if forecast.spot is None else _carets(forecast.spot, width, indent)
    sentence = _plain(printable(forecast.sentence), width) if forecast.sentence else []
    wrong = forecast.spot is not None and forecast.spot.wrong
    return (excerpt + sentence if wrong else [*excerpt[:1], *sentence, *excerpt[1:]])[:height]


def _carets(spot: Spot, width: int, indent: int) -> list[Line]:
    """Carets under the place that is meant, and what is wrong; the text once more, unless it lies right above in one
    line."""
    start = spot.text.rfind("\n", 0, spot.start) + 1
    end = spot.text.find("\n", spot.start)
    line = printable(spot.text[start : len(spot.text) if end < 0 else end])
    at = spot.start - start
    count = max(1, min(spot.end - start, len(line)) - at)
    above: list[Line] = []
    if "\n" in spot.text or indent + len(line) > width:
        cut = max(0, at - width // 3) if at + count > width - 4 else 0
        above, at = [[("", clipped(line[cut:], width))]], at - cut
    else:
        at += indent
    style = "class:wrong" if spot.wrong else "class:warned"
    said_of = printable(f"{'' if spot.wrong else 'warning: '}{spot.message}")
    lines = [clipped(" " * at + "^" * count, width), *_folded(said_of, width)]
    return above + [[(style, each)] for each in lines]


def trouble(session: TuiSession, width: int) -> Line:
    """What is wrong with the journal."""
    return [("class:wrong", _filled(f" JOURNAL: {session.station.trouble}", width))]


def notice(session: TuiSession, width: int) -> Line:
    """The most important notice: wrong clocks, forgeries, keys that are not trusted."""
    notices = session.station.notices()
    return [("class:warned", _filled(f" {printable(notices[0])}" if notices else "", width))]


def keys(width: int) -> Line:
    """The keys, as many as fit."""
    text = " F9 STOP  F7 RELEASE  F1 help  Tab addressee  F3 type  F4 sort by  Ctrl-Q quit"
    return [("class:keys", _filled(text, width))]


# ---- fitting


def clipped(text: str, width: int) -> str:
    """As much of a text as fits into so many columns, with `…` where it goes on."""
    if get_cwidth(text) <= width:
        return text
    start, columns = "", 0
    for character in text:
        columns += get_cwidth(character)
        if columns > width - 1:
            break
        start += character
    return f"{start}…" if width > 0 else ""


def _filled(text: str, width: int) -> str:
    """Just so many columns."""
    text = clipped(printable(text), width)
    return text + " " * max(0, width - get_cwidth(text))


def _plain(text: str, width: int) -> list[Line]:
    return [[("", line)] for line in _folded(text, width)]


def _folded(text: str, width: int) -> Sequence[str]:
    """A text in lines of so many columns, broken between words where that can be."""
    lines, line = [], ""
    for word in text.split(" "):
        longer = f"{line} {word}" if line else word
        if line and get_cwidth(longer) > width:
            lines.append(clipped(line, width))
            line = word
        else:
            line = longer
    return [*lines, clipped(line, width)]
