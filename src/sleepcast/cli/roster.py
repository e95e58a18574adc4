"""`sleepcast roster`: which robots were heard on the air, and when, and which belong to the fleet."""

from __future__ import annotations

import json
import time
from typing import TYPE_CHECKING

import click

from sleepcast.api.connection import CHANNEL, FLEET
from sleepcast.cli.streams import put
from sleepcast.core.ages import ago
from sleepcast.core.errors import MisuseError, did_you_mean, printable

if TYPE_CHECKING:
    from sleepcast.station.cache import PeerCache
    from sleepcast.station.roster import FleetFile

HEARD, NONE = "heard", "none"
"""Values of --expect besides a number and a file: the robots that were heard, and none."""


@click.command("roster")
@click.option("--fleet", default=FLEET, show_default=True, help="The fleet.")
@click.option("--channel", metavar="URI", default=CHANNEL, show_default=True, help="The channel, for --expect.")
@click.option(
    "--expect",
    metavar="N|FILE|heard|none",
    help="Robots of the fleet, for every desk from now on: their number, a file of their names, those that "
    "were heard, or none known.",
)
@click.option("--forget", metavar="NAMES", help="Remove these robots from the roster, e.g. r1,r2; `all` for all.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def roster(fleet: str, channel: str, expect: str | None, forget: str | None, as_json: bool) -> int:
    """List the robots of a fleet that were ever heard from here, and when each was last heard. A robot on this list
    that does not answer counts as silent: STOP is repeated for it, and every account names it. Remove a robot that is
    gone for good with --forget; it returns to the list as soon as it is heard.

    A robot that was never heard from here is not counted, unless you say which robots there are: --expect stores
    that for this channel and fleet, and every desk and command then counts robots that do not answer as silent. STOP is
    repeated until each of them has confirmed it.

    \b
    Examples:
      sleepcast roster
      sleepcast roster --forget r7,r12
      sleepcast roster --expect 100
      sleepcast roster --expect fleet.txt
    """
    from sleepcast.station.cache import PeerCache
    from sleepcast.station.roster import FleetFile

    contacts, fleet_file = PeerCache.of(fleet), FleetFile(channel, fleet)
    if forget is not None:
        names = sorted(contacts.heard) if forget == "all" else forget.replace(",", " ").split()
        for name in names:
            if name not in contacts.heard:
                known = did_you_mean(name, contacts.heard)
                raise MisuseError(f"no robot {name!r:.80} was ever heard in the fleet {fleet!r}{known}")
        contacts.forget(names)
    if expect is not None:
        _expect(expect, contacts, fleet_file)
    expected = fleet_file.read()
    now = time.time()
    heard = sorted(contacts.heard.items(), key=lambda each: -each[1])
    if as_json:
        listing = {"fleet": fleet, "robots": [{"name": name, "heard": now - at} for name, at in heard]}
        put(json.dumps(listing | {"expected": expected.size or None, "names": expected.names}))
        return 0
    put(f"{len(heard)} robots were heard in the fleet {printable(fleet)}")
    for name, at in heard:
        put(f"  {printable(name)}  {ago(now - at)}")
    missing = [name for name in expected.names if name not in contacts.heard]
    for name in missing:
        put(f"  {printable(name)}  never heard")
    nameless = expected.size - len(heard) - len(missing)
    if nameless > 0:
        put(f"  {nameless} more that were never heard")
    sentence = f"{expected.size} are expected" if expected else "nobody has said how many there are (--expect)"
    put(f"{sentence} on {printable(channel)}")
    return 0


def _expect(given: str, contacts: PeerCache, fleet_file: FleetFile) -> None:
    """Store which robots belong to the fleet. Raises ExpectationError, FleetFileLostError."""
    from sleepcast.channel.message import natural_order
    from sleepcast.station.roster import Expectation, read_expectation

    if given == NONE:
        fleet_file.remove()
    else:
        fleet_file.write(
            Expectation.of(sorted(contacts.heard, key=natural_order)) if given == HEARD else read_expectation(given)
        )
