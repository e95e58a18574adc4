"""`sleepcast keys`: make keys, choose which keys this machine trusts, and send changes to the fleet on request.

A change that is sent to the fleet is a standing command, by a commander's key: robots that join later hear it too, and
every robot answers, so that the account tells which robots do not know it yet. When a commander's key ends, its
standing commands are first gathered from the robots, as a robot that joins late gathers them, and signed again: its
rules still reach robots that join later, and nothing else that is signed with it does.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import click

from sleepcast.api.connection import FLEET, AirOptions, session_for, station_for
from sleepcast.cli.account import show_account
from sleepcast.cli.streams import complain, put
from sleepcast.core.errors import MisuseError

if TYPE_CHECKING:
    from sleepcast.channel.keys import KeyChange, KeyPair, PublicKey, Trust

GRACE = 1.0
"""Seconds after the time for answers for which they are still taken."""
LISTEN, LONGEST = 1.5, 15.0
"""Seconds without any news after which all standing commands have been gathered, and how long they are at most."""

Command = TypeVar("Command", bound=Callable[..., object])


def on_air_if_asked(command: Command) -> Command:
    """The options that tell the fleet as well: the command gets `channel`, `key`, `fleet` and `as_json`."""
    for option in (
        click.option("--json", "as_json", is_flag=True, help="Print JSON instead."),
        click.option("--fleet", default=FLEET, show_default=True, help="The fleet to tell."),
        click.option("--key", metavar="OWNER", help="The commander's key to sign with (default: the one in use)."),
        click.option("--channel", metavar="URI", help="Also tell the robots on this channel."),
    ):
        command = option(command)
    return command


def commander(folder: Path, owner: str | None) -> KeyPair:
    """The commander's key that speaks: that of `owner`, or the one in use, or the only one here. Raises MisuseError if
    there is none."""
    from sleepcast.channel.keyring import DEVELOPMENT_DESK, KeyFileError, find_key, load_key, used_keys
    from sleepcast.channel.message import Role

    if owner is not None:
        pair = find_key(folder, owner)
        if pair.public.role is not Role.COMMANDER:
            raise MisuseError(f"{owner!r} is an {pair.public.role}: only a commander may change which keys are trusted")
        return pair
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
        raise MisuseError(f"only a commander may change which keys are trusted, and {there}: choose a key with --key")
    return here[0]


def tell(
    air: AirOptions,
    changes: Iterable[KeyChange],
    as_json: bool,
    more: dict[str, object],
    show: Callable[[str], None] = put,
) -> int:
    """Tell the fleet, and show what became of the last of these changes; gives the exit status, 1 if no robot took it:
    then none can hand it on either.

    more: what the JSON holds besides.
    show: prints a line.
    """
    from sleepcast.channel import Kind
    from sleepcast.channel.message import KEYS

    with station_for(air, complain) as station:
        for change in changes:
            sent = station.post(Kind.COMMAND, body={KEYS: change.written()}, standing=True)
            station.gather(sent, GRACE)
        account = station.accounting(sent.id)
        show_account(sent, account, as_json, more=more, show=show)
        if not account.n_matched:
            complain("no robot has received it, so it will not spread by itself: repeat it when robots are on the air")
        return 1 if account.n_fault or not account.n_matched else 0


def endings(gone: Iterable[bytes], standing: Iterable[bytes]) -> list[KeyChange]:
    """The changes that end these keys. standing: datagrams that count all the same; they are vouched for first."""
    from sleepcast.channel.keys import MAX_CHANGES, KeyChange, fingerprint

    prints = sorted(map(fingerprint, standing))
    parts = [frozenset(prints[at : at + MAX_CHANGES]) for at in range(0, len(prints), MAX_CHANGES)]
    return [*(KeyChange(vouch=part) for part in parts), KeyChange(revoke=frozenset(gone))]


def gathered(air: AirOptions, gone: Iterable[bytes]) -> list[bytes]:
    """The datagrams of standing commands of these keys, as the robots on the air have them."""
    with closing(session_for(air, None, robot=True, say=complain)) as session:
        datagrams: list[bytes] = []
        spent = quiet = 0.0
        while quiet < LISTEN and spent < LONGEST:
            session.wait(0.1)
            session.receive()
            before, datagrams = len(datagrams), [each for key in gone for each in session.delivery.standing_of(key)]
            quiet = quiet + 0.1 if len(datagrams) == before else 0.0
            spent += 0.1
    return datagrams


ROLES = ("observer", "operator", "commander", "robot")
FOLDER = click.option(
    "--keys", "folder", type=click.Path(path_type=Path), help="Folder of the keys (default: in your settings)."
)
TRUST = click.option(
    "--trust", "file", type=click.Path(path_type=Path), help="The trust file (default: the one beside your keys)."
)
JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON instead.")


@click.group("keys")
def keys() -> None:
    """Robots obey the keys that they trust. A key has an owner, whose name its messages carry, and a role: an observer
    asks, an operator commands, a commander also changes which keys are trusted, a robot answers. Any trusted key may
    stop robots.

    \b
    Examples:
      sleepcast keys new desk --role commander
      sleepcast keys list
      sleepcast keys trust 03a107bff3ce10be1d70dd18e74bc09967e4d6309ba50d5f1ddc8664125531b8 \\
          --owner anna --role operator
      sleepcast keys revoke anna --channel udp://192.168.1.255:47123
      sleepcast keys rotate desk --channel udp://192.168.1.255:47123
    """


@keys.command("new", short_help="Make a key pair and trust it here.")
@click.argument("owner")
@click.option("--role", type=click.Choice(ROLES), default="operator", show_default=True, help="What it may do.")
@FOLDER
@TRUST
@JSON
def new(owner: str, role: str, folder: Path | None, file: Path | None, as_json: bool) -> int:
    """Make a key pair for OWNER: the secret half goes into a file that only you can read, the public one into the trust
    file. An OWNER that ends in `*` stands for every name that begins so, as many robots of one machine need it.

    \b
    Examples:
      sleepcast keys new desk --role commander
      sleepcast keys new 'scout*' --role robot
    """
    from sleepcast.channel.keyring import key_file, save_key, save_trust
    from sleepcast.channel.keys import KeyPair
    from sleepcast.channel.message import Role

    folder, file, trust = _opened(folder, file)
    secret = key_file(folder, owner)
    if secret.exists():
        raise MisuseError(f"{secret} exists, and a replaced key would be lost: move it away, or choose another name")
    pair = KeyPair.new(owner, Role(role))
    trust.add(pair.public)
    save_key(pair, secret)
    save_trust(trust, file)
    if as_json:
        put(json.dumps({**_as_dict(pair.public), "secret_file": str(secret), "trust_file": str(file)}))
        return 0
    put(f"{role} {owner}: key {pair.id.hex()}")
    put(f"secret half: {secret} (keep it to yourself)")
    put("To let others trust it, run on their machines:")
    put(f"  sleepcast keys trust {pair.public.public.hex()} --owner '{owner}' --role {role}")
    return 0


@keys.command("list", short_help="List the trusted keys.")
@FOLDER
@TRUST
@JSON
def list_(folder: Path | None, file: Path | None, as_json: bool) -> int:
    """List the keys of a trust file, and those whose secret half is on this machine.

    \b
    Example:
      sleepcast keys list
    """
    from sleepcast.channel.keyring import used_keys

    folder, file, trust = _opened(folder, file)
    own, used = _own(folder), used_keys(folder)
    in_use = {key.id for key in trust.keys if key.id in own and key.owner in (used.desk, used.robots)}
    if as_json:
        rows = ({**_as_dict(key), "own": key.id in own, "in_use": key.id in in_use} for key in trust.keys)
        put(json.dumps(list(rows)))
        return 0
    if not trust.keys:
        complain(f"no trusted keys in {file}: sleepcast keys new makes a key, sleepcast keys trust adds one")
    width = max((len(key.owner) for key in trust.keys), default=0)
    for key in trust.keys:
        marks = (("yours", key.id in own), ("in use", key.id in in_use), ("REVOKED", key.revoked))
        notes = [note for note, there in marks if there]
        put("  ".join((f"{key.owner:<{width}}", f"{key.role:<9}", key.id.hex(), *notes)))
    return 0


@keys.command("use", short_help="Choose the default key.")
@click.argument("owner", required=False)
@click.option("--development", is_flag=True, help="Use the development keys of this machine again.")
@FOLDER
def use(owner: str | None, development: bool, folder: Path | None) -> int:
    """Use the key of OWNER, which is on this machine, unless --key names another: for `node` and `swarm` if it is a
    robot's, else for the operator's commands.

    \b
    Examples:
      sleepcast keys use chief
      sleepcast keys use 'r*'
      sleepcast keys use --development
    """
    from sleepcast.channel.keyring import USED_FILE, find_key, keys_folder, use_development_keys, use_key, used_keys

    folder = folder or keys_folder()
    if development == (owner is not None):
        raise MisuseError("name the owner of the key to use, or add --development")
    if owner is None:
        use_development_keys(folder)
        put("The development keys of this machine are in use again")
        return 0
    key = find_key(folder, owner).public
    use_key(folder, key)
    robot, used = key.role == "robot", used_keys(folder)
    who = "node and swarm take" if robot else "the commands of a desk take"
    put(f"{who} the key of {key.owner} ({key.role}) from now on ({folder / USED_FILE})")
    if used.of(robot=not robot) is None:
        others = "desks" if robot else "node and swarm"
        complain(f"{others} still use the development key, and do not know this one; keys use switches them")
    return 0


@keys.command("trust", short_help="Trust a public key.")
@click.argument("public")
@click.option("--owner", required=True, help="Its owner: the sender's name in its messages.")
@click.option("--role", type=click.Choice(ROLES), required=True, help="What it may do.")
@FOLDER
@TRUST
@on_air_if_asked
def trust_(
    public: str,
    owner: str,
    role: str,
    folder: Path | None,
    file: Path | None,
    channel: str | None,
    key: str | None,
    fleet: str,
    as_json: bool,
) -> int:
    """Add the PUBLIC half of a key (64 hexadecimal digits) to the trust file. With --channel a commander's key tells
    the fleet to do so as well.

    \b
    Examples:
      sleepcast keys trust 03a107bff3ce10be1d70dd18e74bc09967e4d6309ba50d5f1ddc8664125531b8 \\
          --owner anna --role operator
      sleepcast keys trust 03a107bff3ce10be1d70dd18e74bc09967e4d6309ba50d5f1ddc8664125531b8 \\
          --owner anna --role operator --channel udp://192.168.1.255:47123
    """
    from sleepcast.channel.keyring import half, save_trust
    from sleepcast.channel.keys import KeyChange, PublicKey
    from sleepcast.channel.message import Role

    folder, file, known = _opened(folder, file)
    added = PublicKey(owner, Role(role), half(public))
    speaker = None if channel is None else commander(folder, key)
    known.add(added)
    save_trust(known, file)
    if channel is None or speaker is None:
        put(json.dumps(_as_dict(added)) if as_json else f"{role} {owner}: key {added.id.hex()} is trusted in {file}")
        return 0
    air = AirOptions(channel, fleet, speaker.public.owner, file, folder)
    return tell(air, [KeyChange(trust=(added,))], as_json, _as_dict(added))


@keys.command("revoke", short_help="Revoke an owner's keys.")
@click.argument("owner")
@click.option("--forget-rules", is_flag=True, help="Robots that join later get none of the rules it sent.")
@FOLDER
@TRUST
@on_air_if_asked
def revoke(
    owner: str,
    forget_rules: bool,
    folder: Path | None,
    file: Path | None,
    channel: str | None,
    key: str | None,
    fleet: str,
    as_json: bool,
) -> int:
    """Stop trusting the keys of OWNER; if there are several, an id selects one. This applies to this trust file; with
    --channel a commander's key tells the fleet as well. Robots that are out of reach or switched off learn it when they
    come back: until then they obey the old key.

    Rules that were sent with the key stay in force, and those that the robots know now still reach robots that join
    later.

    \b
    Examples:
      sleepcast keys revoke anna
      sleepcast keys revoke anna --channel udp://192.168.1.255:47123 --key chief
    """
    from sleepcast.channel.keyring import save_trust
    from sleepcast.channel.keys import KeyChange

    folder, file, known = _opened(folder, file)
    revoked = [each for each in known.keys if each.id.hex() == owner] or known.revoke(owner)
    gone = [each.id for each in revoked]
    if channel is not None:
        speaker = commander(folder, key)
        if speaker.id in gone:
            raise MisuseError(
                f"{speaker.public.owner!r} cannot end its own key: another commander can (--key), and sleepcast keys "
                "rotate takes a new one"
            )
        air = AirOptions(channel, fleet, speaker.public.owner, file, folder)
        commands = any(each.role == "commander" for each in revoked) and not forget_rules
        changes = endings(gone, gathered(air, gone) if commands else ())
        return tell(air, changes, as_json, {"revoked": [each.hex() for each in gone]})
    known.take(KeyChange(revoke=frozenset(gone)))
    save_trust(known, file)
    ids = [each.hex() for each in gone]
    put(json.dumps({"revoked": ids}) if as_json else f"{owner}: {', '.join(ids)} revoked in {file}")
    return 0


@keys.command("rotate", short_help="Replace a key by a new one.")
@click.argument("owner")
@FOLDER
@TRUST
@on_air_if_asked
def rotate(
    owner: str,
    folder: Path | None,
    file: Path | None,
    channel: str | None,
    key: str | None,
    fleet: str,
    as_json: bool,
) -> int:
    """Make a new key pair for OWNER, whose key is on this machine, and stop trusting the old one. With --channel the
    fleet hears it signed by the old key and then the new one if it is a commander's, else by a commander's key.

    \b
    Example:
      sleepcast keys rotate desk --channel udp://192.168.1.255:47123
    """
    from sleepcast.channel.keyring import add_trust, find_key, retire_key
    from sleepcast.channel.keys import KeyChange, KeyPair, Trust
    from sleepcast.channel.message import Role

    folder, file, known = _opened(folder, file)
    old = find_key(folder, owner)
    new_pair = KeyPair.new(owner, old.public.role)
    itself = old.public.role is Role.COMMANDER
    speaker = None if channel is None else old if itself and key is None else commander(folder, key)
    changes = [KeyChange(revoke=frozenset((old.id,)))]
    if channel is not None and speaker is not None:
        air = AirOptions(channel, fleet, speaker.public.owner, file, folder)
        if itself:
            status = tell(air, [KeyChange(trust=(new_pair.public,))], False, {}, complain)
            changes = endings([old.id], gathered(air, [old.id]))
            if status:
                return status
        else:
            changes = [KeyChange(trust=(new_pair.public,), revoke=frozenset((old.id,)))]
    aside = retire_key(folder, owner, new_pair)
    add_trust(Trust((new_pair.public,)), file)
    complain(f"the old key of {owner} lies in {aside}, and is no longer valid")
    if channel is not None and speaker is not None:
        return tell(air, changes, as_json, _as_dict(new_pair.public))
    known.take(KeyChange(revoke=frozenset((old.id,))))
    add_trust(known, file)
    sentence = f"{old.public.role} {owner}: key {new_pair.id.hex()} from now on"
    put(json.dumps(_as_dict(new_pair.public)) if as_json else sentence)
    return 0


def _opened(folder: Path | None, file: Path | None) -> tuple[Path, Path, Trust]:
    """The folder of keys, the trust file, and the keys in it: none while there is no file."""
    from sleepcast.channel.keyring import TRUST_FILE, keys_folder, load_trust
    from sleepcast.channel.keys import Trust

    folder = folder or keys_folder()
    file = file or folder / TRUST_FILE
    return folder, file, load_trust(file) if file.exists() else Trust()


def _own(folder: Path) -> set[bytes]:
    """Ids of the keys whose secret halves lie here."""
    from sleepcast.channel.keyring import KeyFileError, load_key

    ids = set()
    for file in sorted(folder.glob("*.key")):
        try:
            ids.add(load_key(file).id)
        except KeyFileError as error:
            complain(str(error))
    return ids


def _as_dict(key: PublicKey) -> dict[str, object]:
    return {
        "owner": key.owner,
        "role": str(key.role),
        "key": key.id.hex(),
        "public": key.public.hex(),
        "revoked": key.revoked,
    }
