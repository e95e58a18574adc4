"""`sleepcast keys`: who may command, and whom this machine believes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from sleepcast.cli.streams import complain, put

if TYPE_CHECKING:
    from sleepcast.channel.keys import PublicKey, Trust

ROLES = ("observer", "operator", "commander", "robot")
FOLDER = click.option(
    "--keys", "folder", type=click.Path(path_type=Path), help="Where keys lie, if not in your settings."
)
TRUST = click.option(
    "--trust", "file", type=click.Path(path_type=Path), help="The trust file, if not the one beside your keys."
)
JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON instead.")


@click.group("keys", short_help="Make keys, and say whom robots and desks believe.")
def keys() -> None:
    """Robots obey keys that they know. A key has an owner, whose name its messages carry, and a role: an observer asks,
    an operator commands, a commander also says whom to trust, a robot answers. Anybody who is trusted may stop.

    \b
    Examples:
      sleepcast keys new desk --role commander
      sleepcast keys list
      sleepcast keys trust 03a107bff3ce10be1d70dd18e74bc09967e4d6309ba50d5f1ddc8664125531b8 \\
          --owner anna --role operator
      sleepcast keys revoke anna
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
    from sleepcast.channel.keyring import key_file, save_key
    from sleepcast.channel.keys import KeyPair, Role
    from sleepcast.errors import MisuseError

    folder, file, trust = _opened(folder, file)
    secret = key_file(folder, owner)
    if secret.exists():
        raise MisuseError(f"{secret} exists, and a key that is replaced is lost: move it away, or take another name")
    pair = KeyPair.new(owner, Role(role))
    trust.add(pair.public)
    save_key(pair, secret)
    _keep(trust, file)
    if as_json:
        put(json.dumps({**_as_dict(pair.public), "secret_file": str(secret), "trust_file": str(file)}))
        return 0
    put(f"{role} {owner}: key {pair.id.hex()}")
    put(f"secret half: {secret} (keep it to yourself)")
    put("To let others believe it, run on their machines:")
    put(f"  sleepcast keys trust {pair.public.public.hex()} --owner '{owner}' --role {role}")
    return 0


@keys.command("list", short_help="Whom this machine believes.")
@FOLDER
@TRUST
@JSON
def list_(folder: Path | None, file: Path | None, as_json: bool) -> int:
    """List the keys of a trust file, and for which of them the secret half lies here.

    \b
    Example:
      sleepcast keys list
    """
    folder, file, trust = _opened(folder, file)
    own = _own(folder)
    if as_json:
        put(json.dumps([{**_as_dict(key), "own": key.id in own} for key in trust.keys]))
        return 0
    if not trust.keys:
        complain(f"nobody is trusted in {file}: sleepcast keys new makes a key, sleepcast keys trust takes one in")
    width = max((len(key.owner) for key in trust.keys), default=0)
    for key in trust.keys:
        notes = [note for note, there in (("yours", key.id in own), ("REVOKED", key.revoked)) if there]
        put("  ".join((f"{key.owner:<{width}}", f"{key.role:<9}", key.id.hex(), *notes)))
    return 0


@keys.command("trust", short_help="Believe somebody's public key.")
@click.argument("public")
@click.option("--owner", required=True, help="The name that its messages carry.")
@click.option("--role", type=click.Choice(ROLES), required=True, help="What it may do.")
@FOLDER
@TRUST
def trust_(public: str, owner: str, role: str, folder: Path | None, file: Path | None) -> int:
    """Take the PUBLIC half of a key (64 hexadecimal digits) into the trust file.

    \b
    Example:
      sleepcast keys trust 03a107bff3ce10be1d70dd18e74bc09967e4d6309ba50d5f1ddc8664125531b8 \\
          --owner anna --role operator
    """
    from sleepcast.channel.keyring import half
    from sleepcast.channel.keys import PublicKey, Role

    _, file, trust = _opened(folder, file)
    key = PublicKey(owner, Role(role), half(public))
    trust.add(key)
    _keep(trust, file)
    put(f"{role} {owner}: key {key.id.hex()} is trusted in {file}")
    return 0


@keys.command("revoke", short_help="Believe an owner's keys no more.")
@click.argument("owner")
@FOLDER
@TRUST
def revoke(owner: str, folder: Path | None, file: Path | None) -> int:
    """Believe no key of OWNER any more, whatever it signs. This holds for whoever reads this trust file.

    \b
    Example:
      sleepcast keys revoke anna
    """
    _, file, trust = _opened(folder, file)
    gone = trust.revoke(owner)
    _keep(trust, file)
    put(f"{owner}: {', '.join(key.id.hex() for key in gone)} revoked in {file}")
    return 0


def _opened(folder: Path | None, file: Path | None) -> tuple[Path, Path, Trust]:
    """The folder of keys, the trust file, and whom it believes: nobody while there is none."""
    from sleepcast.channel.keyring import TRUST_FILE, keys_folder, load_trust
    from sleepcast.channel.keys import Trust

    folder = folder or keys_folder()
    file = file or folder / TRUST_FILE
    return folder, file, load_trust(file) if file.exists() else Trust()


def _keep(trust: Trust, file: Path) -> None:
    from sleepcast.channel.keyring import save_trust

    save_trust(trust, file)


def _own(folder: Path) -> set[bytes]:
    """Ids of the keys whose secret halves lie here."""
    from sleepcast.channel.keyring import KeyFileError, load_key

    found = set()
    for file in sorted(folder.glob("*.key")):
        try:
            found.add(load_key(file).id)
        except KeyFileError as error:
            complain(str(error))
    return found


def _as_dict(key: PublicKey) -> dict[str, object]:
    return {
        "owner": key.owner,
        "role": str(key.role),
        "key": key.id.hex(),
        "public": key.public.hex(),
        "revoked": key.revoked,
    }
