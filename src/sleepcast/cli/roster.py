"""`sleepcast roster`: which robots were heard on the air, and when."""

from __future__ import annotations

import json
import time

import click

from sleepcast.cli.air import FLEET
from sleepcast.cli.streams import put
from sleepcast.errors import MisuseError, did_you_mean, printable


@click.command("roster", short_help="List the robots that were heard on the air.")
@click.option("--fleet", default=FLEET, show_default=True, help="Of which fleet.")
@click.option("--forget", metavar="NAMES", help="Miss these robots no more, as r1,r2; `all` for all of them.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def roster(fleet: str, forget: str | None, as_json: bool) -> int:
    """List the robots of a fleet that were ever heard from here, and when each was heard last. Whoever is on this list
    and does not answer counts as silent: STOP is repeated for it, and every account names it. A robot that is gone for
    good is taken off with --forget; it is on the list again as soon as it is heard.

    \b
    Examples:
      sleepcast roster
      sleepcast roster --forget r7,r12
    """
    from sleepcast.station.contacts import Contacts

    contacts = Contacts.of(fleet)
    if forget is not None:
        names = sorted(contacts.heard) if forget == "all" else forget.replace(",", " ").split()
        for name in names:
            if name not in contacts.heard:
                known = did_you_mean(name, contacts.heard)
                raise MisuseError(f"no robot {name!r:.80} was ever heard in the fleet {fleet!r}{known}")
        contacts.forget(names)
    now = time.time()
    heard = sorted(contacts.heard.items(), key=lambda each: -each[1])
    if as_json:
        put(json.dumps({"fleet": fleet, "robots": [{"name": name, "heard": now - at} for name, at in heard]}))
        return 0
    put(f"{len(heard)} robots were heard in the fleet {printable(fleet)}")
    for name, at in heard:
        put(f"  {printable(name)}  {_ago(now - at)}")
    return 0


def _ago(seconds: float) -> str:
    for length, unit in ((86_400.0, "days"), (3_600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * length:
            return f"{seconds / length:.0f} {unit} ago"
    return f"{max(0.0, seconds):.0f} s ago"
