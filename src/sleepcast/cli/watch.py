"""`sleepcast watch`: what robots on the air tell of themselves, as a table that lives."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from sleepcast.api.connection import AirOptions, observing_station
from sleepcast.cli.account import state_as_dict
from sleepcast.cli.air import operator
from sleepcast.cli.options import NegativeNumbersAllowed, every_option
from sleepcast.cli.streams import announce, complain, put
from sleepcast.core.ages import age, ago
from sleepcast.core.errors import MisuseError, did_you_mean, printable

if TYPE_CHECKING:
    from rich.table import Table

    from sleepcast.station.network import NetworkStation
    from sleepcast.station.remote import RemoteMind, TelemetryClient

USUAL = ("x", "y", "heading", "battery", "fuel", "speed")
"""Variables that are shown, of those that there are, unless others are named."""
MAX_SHOWN = 12
"""Variables in one table."""
MAX_ROWS = 10_000
"""Robots in one table that is printed as a whole."""
AROUND = 6
"""Lines of a terminal that the table cannot have: its head, its frame, and what stands under it."""
SHARED = "SHARED NAME"
"""The state of a name that several robots have."""
FLAGS = ("frozen", "sleeping", "marked")
PAUSE = 0.05
"""Seconds between two looks at whether something has come."""


@click.command("watch", cls=NegativeNumbersAllowed)
@click.argument("text", required=False)
@click.option("--show", metavar="NAMES", help=f"Variables, e.g. x,y,fuel (default: {', '.join(USUAL)}, if known).")
@every_option("requests")
@click.option("--once", is_flag=True, help="Print the table once.")
@operator
def watch(text: str | None, show: str | None, every: float, once: bool, air: AirOptions, as_json: bool) -> int:
    """Ask robots for telemetry every second, and show it in a table until Ctrl-C: the age of the latest data, whether
    the robot is stopped, its groups, and the variables that you name. With TEXT, an expression such as (IN bravo), only
    robots for which it is true.

    With --json, one line per update: an object with `time`, `robots` and `notices`.

    \b
    Examples:
      sleepcast watch
      sleepcast watch --show x,y,fuel '(< fuel 30%)'
      sleepcast watch --once --json
    """
    from sleepcast.station.asking import look_around

    with observing_station(air, complain) as (station, telemetry):
        window = Window(station, telemetry, text, None if show is None else show.replace(",", " ").split())
        look_around(station, telemetry)
        if as_json:
            put(json.dumps(window.as_dict()))
            while not once:
                _look(station, telemetry, every)
                announce(json.dumps(window.as_dict()))
        elif once:
            from rich.console import Console

            Console().print(window.table(MAX_ROWS))
        else:
            _live(window, every)
    return 0


def _look(station: NetworkStation, telemetry: TelemetryClient, seconds: float) -> None:
    """Ask for telemetry, and hear what comes for so long."""
    telemetry.look()
    station.wait(seconds)


class Window:
    """What is shown. Raises ReadError and CheckError for the text.

    text: for which robots it must be true; None for all.
    wanted: names of variables; None for the usual ones.
    """

    def __init__(
        self, station: NetworkStation, telemetry: TelemetryClient, text: str | None, wanted: Sequence[str] | None
    ) -> None:
        self.station, self.telemetry, self.text = station, telemetry, text
        self._wanted = wanted
        if wanted is not None and not 0 < len(wanted) <= MAX_SHOWN:
            raise MisuseError(f"--show takes 1 to {MAX_SHOWN} names, not {len(wanted)}")
        if text is not None:
            station.check(text).required()

    def columns(self) -> list[str]:
        """The variables that are shown. Raises MisuseError for one that no robot has, once those that are there have
        sent telemetry."""
        from sleepcast.language import Variable

        names = [name for mind in list(self.telemetry.minds.values())[:1] for name, _ in mind.variables()]
        vocabulary = self.telemetry.minds.vocabulary
        variables = (key for key, binding in vocabulary.bindings.items() if isinstance(binding, Variable))
        known = {*variables, *vocabulary.user_slots}
        if self._wanted is None:
            return [name for name in USUAL if name in known]
        present = self.station.present()
        all_known = present and all(name in self.telemetry.minds for name in present)
        for name in self._wanted if all_known else ():
            if name.casefold() not in known:
                raise MisuseError(f"no robot has a variable {name}{did_you_mean(name, names)}")
        return list(self._wanted)

    def robots(self) -> list[str]:
        """The names of those that are shown, numbers in their order."""
        from sleepcast.channel.message import natural_order

        roster = self.station.roster
        # As a test of a command that does nothing, it is true where it would be obeyed.
        chosen = list(roster) if self.text is None else self.station.preview(f"(WHEN {self.text} 0)").yes
        return sorted(chosen, key=natural_order)

    def as_dict(self) -> dict[str, object]:
        """All of it for a script."""
        now, columns = self.station.now, self.columns()
        heard = self.station.roster
        robots = [self._robot(name, heard[name], columns, now) for name in self.robots()]
        picture = {"time": now, "robots": robots, "notices": self.station.notices()}
        return picture | {"expected": self.station.fleet_size or None, "silent": self.silent()}

    def silent(self) -> int:
        """How many robots have stale telemetry, including expected ones that were never heard."""
        roster, late = self.station.roster, self.station.now - self.station.stale_after
        recent = sum(mind.reported_at >= late for name, mind in self.telemetry.minds.items() if name in roster)
        return max(self.station.fleet_size, len(roster)) - recent

    def _robot(self, name: str, heard: float | None, columns: Sequence[str], now: float) -> dict[str, object]:
        row: dict[str, object] = {"name": name, "heard": None if heard is None else now - heard}
        row |= {"clock": self.station.clocks.ahead(name), "shared": name in self.station.shared_names}
        mind = self.telemetry.minds.get(name)
        if mind is None:
            return row | {"told": None}
        values = {key: None if value != value else value for key, value in _values(mind, columns).items()}
        telemetry = mind.telemetry
        row |= {"told": now - mind.reported_at, "stopped": mind.stopped, "driven": telemetry.driven}
        rest = mind.rest_state()
        row["motion"] = None if rest is None else state_as_dict(rest)
        row |= {"catching_up": telemetry.catching_up, "doubt": mind.doubt}
        row |= {"flags": _flags(mind), "groups": sorted(telemetry.groups)}
        return row | {"rules": len(mind.rules()), "values": values}

    def table(self, most: int) -> Table:
        """The table with so many robots at most."""
        from rich.box import SIMPLE_HEAD
        from rich.table import Table
        from rich.text import Text

        columns, names, now = self.columns(), self.robots(), self.station.now
        heard, table = self.station.roster, Table(box=SIMPLE_HEAD, pad_edge=False)
        table.caption, table.caption_justify = Text(self._caption(len(names), most)), "left"
        table.add_column("robot", no_wrap=True)
        table.add_column("age", justify="right", no_wrap=True)
        table.add_column("state", no_wrap=True)
        table.add_column("groups", no_wrap=True)
        for name in columns:
            table.add_column(f"{name}\n{self._unit(name)}".strip(), justify="right", no_wrap=True)
        for name in names[:most]:
            row = self._row(name, heard[name], columns, now)
            table.add_row(*(Text(printable(cell)) for cell in row))  # a name may look like markup, and is none
        return table

    def _caption(self, count: int, most: int) -> str:
        more = f", {count - most} more than fit here" if count > most else ""
        which = "robots" if self.text is None else "robots for which it is true"
        from sleepcast.station.roster import of_robots

        size, known = self.station.fleet_size, len(self.station.roster)
        unheard = f", {size - known} of them never heard, and nobody knows their names" if size > known else ""
        among = of_robots(max(size, known), size > 0)
        standing = self.telemetry.minds.standing()
        lines = [f"{count} {which}{more}; silent {self.silent()} {among}{unheard}", *filter(None, [standing])]
        return "\n".join(map(printable, (*lines, *self.station.notices())))

    def _row(self, name: str, heard: float | None, columns: Sequence[str], now: float) -> list[str]:
        mind = self.telemetry.minds.get(name)
        shared = [SHARED] * (name in self.station.shared_names)
        if mind is None:
            state = " ".join(shared + ([] if heard is None else [f"heard {ago(now - heard)}"]))
            return [name, "never", state, "", *("" for _ in columns)]
        since = now - mind.reported_at
        late = "silent " if since > self.station.stale_after else ""
        telemetry = mind.telemetry
        words = [_stopped(mind, self._unit("speed") or "m/s")] if mind.stopped else []
        words += ["driven"] * telemetry.driven + ["catching up"] * telemetry.catching_up
        state = " ".join(words + shared + _flags(mind))
        values = _values(mind, columns)
        return [
            name,
            age(since),
            f"{late}{state}",
            ", ".join(sorted(telemetry.groups)),
            *map(self._shown, columns, values.values()),
        ]

    def _unit(self, name: str) -> str:
        """The unit in which people read a variable."""
        from sleepcast.language.vocabulary import unit_of

        return unit_of(name, self.telemetry.minds.vocabulary)

    def _shown(self, name: str, value: float) -> str:
        from sleepcast.core.units import value_in_words

        unit = self._unit(name)
        return "?" if value != value else value_in_words(value, unit).removesuffix(f" {unit}")


def _live(window: Window, every: float) -> None:
    from rich.console import Console
    from rich.live import Live

    console = Console()
    with Live(console=console, auto_refresh=False) as live:
        while True:
            live.update(window.table(max(1, console.height - AROUND)), refresh=True)
            _look(window.station, window.telemetry, every)


def _values(mind: RemoteMind, columns: Sequence[str]) -> dict[str, float]:
    """The variables by the names that were asked for, NaN for unknown."""
    known = {name.casefold(): value for name, value in mind.variables()}
    return {name: known.get(name.casefold(), float("nan")) for name in columns}


def _flags(mind: RemoteMind) -> list[str]:
    values = dict(mind.variables())
    return [flag for flag in FLAGS if values.get(flag, 0.0) > 0.0]


def _stopped(mind: RemoteMind, unit: str) -> str:
    """Whether a stopped robot is at rest, still moves, or does not tell; in few letters."""
    from sleepcast.core.units import value_in_words

    rest = mind.rest_state()
    if rest is None or rest.at_rest:
        return "STOPPED" if rest is None else "AT REST"
    return f"STOPPING {value_in_words(rest.speed, unit, 3)}"
