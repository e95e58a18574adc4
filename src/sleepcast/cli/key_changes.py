"""Telling a fleet whom to trust: what `sleepcast keys` says on the air.

A change is a command that stands, by a commander's key: robots that come later hear it too, and every robot answers, so
that the account tells who does not know it yet. When a commander's key ends, what it has said that stands is gathered
from the robots first, as a robot that comes late gathers it, and vouched for: so its rules still reach late-comers, and
nothing else that is signed with it does.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import click

from sleepcast.cli.account import as_dict, told
from sleepcast.cli.air import FLEET, Air, session_for, station_for
from sleepcast.cli.streams import complain, put

if TYPE_CHECKING:
    from sleepcast.channel.keys import KeyChange, KeyPair

GRACE = 1.0
"""Seconds after the time for answers for which they are still taken."""
LISTEN, LONGEST = 1.5, 15.0
"""Seconds without any news after which all standing commands have been gathered, and how long they are at most."""

Command = TypeVar("Command", bound=Callable[..., object])


def on_air_if_asked(command: Command) -> Command:
    """The options that tell the fleet as well: the command gets `channel`, `key`, `fleet` and `as_json`."""
    for option in (
        click.option("--json", "as_json", is_flag=True, help="Print JSON instead."),
        click.option("--fleet", default=FLEET, show_default=True, help="The fleet that is told."),
        click.option("--key", metavar="OWNER", help="The commander's key that says so; else the one in use."),
        click.option("--channel", metavar="URI", help="Tell the robots on this channel, too."),
    ):
        command = option(command)
    return command


def commander(folder: Path, owner: str | None) -> KeyPair:
    """The commander's key that speaks: that of `owner`, or the one in use, or the only one here. Raises MisuseError if
    there is none."""
    from sleepcast.channel.keyring import DEVELOPMENT_DESK, KeyFileError, find_key, load_key, used_keys
    from sleepcast.channel.message import Role
    from sleepcast.core.errors import MisuseError

    if owner is not None:
        found = find_key(folder, owner)
        if found.public.role is not Role.COMMANDER:
            raise MisuseError(f"{owner!r} is an {found.public.role}: only a commander says whom to trust")
        return found
    here = []
    for file in sorted(folder.glob("*.key")):
        try:
            key = load_key(file)
        except KeyFileError as error:
            complain(str(error))
            continue
        if key.public.role is Role.COMMANDER and file.stem == key.public.owner != DEVELOPMENT_DESK:
            here.append(key)
    used = used_keys(folder).desk
    here = [key for key in here if key.public.owner == used] or here
    if len(here) != 1:
        there = f"there are {', '.join(key.public.owner for key in here)}" if here else f"there is none in {folder}"
        raise MisuseError(f"only a commander says whom to trust, and {there}: say with --key whose key speaks")
    return here[0]


def tell(
    air: Air, changes: Iterable[KeyChange], as_json: bool, more: dict[str, object], show: Callable[[str], None] = put
) -> int:
    """Tell the fleet, and show what became of the last of these changes. The exit status is 1 if nobody took it: then
    nobody can hand it on either. more: for the JSON."""
    from sleepcast.channel import Kind
    from sleepcast.channel.payload import KEYS

    with station_for(air, complain) as station:
        for change in changes:
            sent = station.post(Kind.COMMAND, body={KEYS: change.written()}, standing=True)
            station.gather(sent, GRACE)
        found = station.accounting(sent.id)
        if as_json:
            show(json.dumps({**more, **as_dict(sent, found)}))
        else:
            for line in told(sent, found):
                show(line)
        if not found.n_matched:
            complain("no robot has taken it, so none will hear of it by itself: say it again when some are on the air")
        return 1 if found.n_fault or not found.n_matched else 0


def endings(gone: Iterable[bytes], standing: Iterable[bytes]) -> list[KeyChange]:
    """The changes that end these keys. standing: datagrams that count all the same; they are vouched for first."""
    from sleepcast.channel.keys import MAX_CHANGES, KeyChange, fingerprint

    prints = sorted(map(fingerprint, standing))
    parts = [frozenset(prints[at : at + MAX_CHANGES]) for at in range(0, len(prints), MAX_CHANGES)]
    return [*(KeyChange(vouch=part) for part in parts), KeyChange(revoke=frozenset(gone))]


def gathered(air: Air, gone: Iterable[bytes]) -> list[bytes]:
    """The datagrams of standing commands of these keys, as the robots on the air have them."""
    with closing(session_for(air, None, robot=True, say=complain)) as session:
        found: list[bytes] = []
        spent = quiet = 0.0
        while quiet < LISTEN and spent < LONGEST:
            session.wait(0.1)
            session.receive()
            before, found = len(found), [each for key in gone for each in session.delivery.standing_of(key)]
            quiet = quiet + 0.1 if len(found) == before else 0.0
            spent += 0.1
    return found
