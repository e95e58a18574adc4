"""Keys on disk: secret halves in files that only their owner can read, and trust files that anybody may read.

    KEYS/desk.key        the secret half of the key of `desk`
    KEYS/trust.json      the keys that this machine trusts
    KEYS/in-use.json     the keys that are used by default

All are JSON, so that people and other programs can read and write them. A secret that others can read is refused.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from math import inf
from pathlib import Path
from stat import S_IMODE
from typing import TypeVar

import msgspec

from sleepcast.channel.keys import FINGERPRINT_BYTES, ID_BYTES, KeyChange, KeyPair, KeyRefusal, PublicKey, Trust
from sleepcast.channel.message import Role
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError, SleepcastError, did_you_mean
from sleepcast.core.files import config_folder, replace_file

_FORMAT = 1
MAX_BYTES = 8 * 1024 * 1024
"""Bytes of a trust file: enough for as many keys as `Trust` takes."""
TRUST_FILE = "trust.json"
USED_FILE = "in-use.json"
DEVELOPMENT_TRUST = "development-trust.json"
"""Changes of trust that were received while the development keys were in use."""
DEVELOPMENT_DESK, _DEVELOPMENT_ROBOTS = "development-desk", "development-robots"
"""Names of the default keys, which programs of one machine use among themselves."""
TRY_AGAIN = 5.0
"""Seconds after which a failed write of a robot's trust is tried again."""
_SAFE = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.")


class KeyFileError(MisuseError):
    """A key file that cannot be used."""


class KeyFileLostError(SleepcastError):
    """A key file that cannot be written."""


class SecretFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A key with its secret half (32 bytes as hexadecimal digits)."""

    format: int
    owner: str
    role: Role
    secret: str


class TrustedKey(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A key in a trust file; see PublicKey."""

    owner: str
    role: Role
    public: str
    revoked: bool = False


class TrustFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The keys that a party trusts. gone: ids of revoked keys that are not otherwise known; vouched: fingerprints of
    datagrams of revoked keys that still count; see `Trust`."""

    format: int
    keys: list[TrustedKey]
    gone: list[str] = []
    vouched: list[str] = []


class UsedKeys(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Owners of the keys that desks and robots use by default; None for the development key."""

    format: int
    desk: str | None = None
    robots: str | None = None

    def of(self, *, robot: bool) -> str | None:
        """For a robot, or for a desk."""
        return self.robots if robot else self.desk


File = TypeVar("File", SecretFile, TrustFile, UsedKeys)


def keys_folder() -> Path:
    """The folder of this user's keys."""
    return config_folder() / "keys"


def load_trust(file: Path) -> Trust:
    """The keys in a trust file. Raises KeyFileError."""
    content = _decoded(file, TrustFile, "a trust file")
    try:
        trust = Trust(PublicKey(key.owner, key.role, half(key.public), key.revoked) for key in content.keys)
        vouched, gone = _listed(content.vouched, FINGERPRINT_BYTES), _listed(content.gone, ID_BYTES)
        trust.take(KeyChange((), vouched, gone))
    except KeyRefusal as error:
        raise KeyFileError(f"{file}: {error}") from None
    return trust


def _listed(written: list[str], count: int) -> frozenset[bytes]:
    decoded = frozenset(map(half, written))
    if any(len(each) != count for each in decoded):
        raise KeyRefusal(f"something of {count} bytes is written as {2 * count} hexadecimal digits")
    return decoded


def save_trust(trust: Trust, file: Path) -> None:
    """Write a trust file. Raises KeyFileLostError; the file is unchanged then."""
    keys = [TrustedKey(key.owner, key.role, key.public.hex(), key.revoked) for key in trust.keys]
    gone, vouched = sorted(key.hex() for key in trust.gone), sorted(print_.hex() for print_ in trust.vouched)
    _save(file, TrustFile(_FORMAT, keys, gone, vouched), private=False)


def add_trust(trust: Trust, file: Path) -> None:
    """Add all of `trust` to a trust file, keeping what others have written meanwhile. Raises KeyFileError and
    KeyFileLostError."""
    with _alone(file):
        known = file.exists()
        stored = load_trust(file) if known else Trust()
        if stored.merge(trust) or not known:
            save_trust(stored, file)


@contextmanager
def _alone(file: Path) -> Iterator[None]:
    """Lock a file for writing: several programs of one machine may write it at once. Without locks where the system has
    none."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with file.with_name(f".{file.name}.lock").open("ab") as lock:
            with suppress(ImportError):
                import fcntl

                fcntl.flock(lock, fcntl.LOCK_EX)
            yield
    except OSError as error:
        raise KeyFileLostError(f"cannot write {file}: {error.strerror or error}. Nothing was replaced") from None


class TrustKeeper:
    """Writes the changes of a robot's trust into its trust file, in any thread; see `loop.durable`. A failed write is
    told once, and tried again later. clock: s."""

    def __init__(self, trust: Trust, file: Path, clock: Clock, say: Callable[[str], None]) -> None:
        self._trust, self._file, self._clock, self._say = trust, file, clock, say
        self._waits, self._try_at, self._said = False, -inf, ""

    def __call__(self, trust: Trust) -> None:
        """The trust has changed."""
        self._waits, self._try_at = True, -inf

    @property
    def lasts(self) -> bool:
        """Whether every change is written."""
        return not self._waits

    @property
    def due(self) -> bool:
        """Whether there is something to be written now."""
        return self._waits and self._clock.now() >= self._try_at

    def write(self) -> bool:
        """Write, and return whether every change is written."""
        try:
            add_trust(self._trust, self._file)
        except SleepcastError as error:  # it counts all the same, until we end
            self._try_at = self._clock.now() + TRY_AGAIN
            if str(error) != self._said:
                self._said = str(error)
                self._say(self._said)
        else:
            self._waits, self._said = False, ""
        return self.lasts


def load_key(file: Path) -> KeyPair:
    """The key pair in a file. Raises KeyFileError, also for a file that others can read."""
    content = _decoded(file, SecretFile, "the secret half of a key", private=True)
    try:
        return KeyPair(content.owner, content.role, half(content.secret))
    except KeyRefusal as error:
        raise KeyFileError(f"{file}: {error}") from None


def save_key(key: KeyPair, file: Path) -> None:
    """Write the secret half of a key where only this user can read it. Raises KeyFileLostError."""
    _save(file, SecretFile(_FORMAT, key.public.owner, key.public.role, key.seed.hex()), private=True)


def key_file(folder: Path, owner: str) -> Path:
    """The file of `owner`'s key. Raises KeyFileError for a name that cannot be a file name."""
    name = owner.removesuffix("*") or "all"
    if not set(name) <= _SAFE or name.startswith("."):
        raise KeyFileError(f"a key file has its owner's name: use letters, digits, - and _, not {owner!r}")
    return folder / f"{name}.key"


def find_key(folder: Path, owner: str) -> KeyPair:
    """This user's key of `owner`. Raises KeyFileError if there is none."""
    file = key_file(folder, owner)
    if not file.exists():
        names = sorted(each.stem for each in folder.glob("*.key"))
        have = f"there are {', '.join(names)}" if names else "there is none yet"
        raise KeyFileError(
            f"no key {owner!r} in {folder}{did_you_mean(owner, names)}: {have}; sleepcast keys new {owner} makes it"
        )
    return load_key(file)


def used_keys(folder: Path) -> UsedKeys:
    """This user's default keys. Raises KeyFileError."""
    file = folder / USED_FILE
    return _decoded(file, UsedKeys, "which keys are in use") if file.exists() else UsedKeys(_FORMAT)


def use_key(folder: Path, key: PublicKey) -> None:
    """Make a key this user's default: for robots if it is a robot's, for desks otherwise. Raises KeyFileError and
    KeyFileLostError."""
    which = "robots" if key.role is Role.ROBOT else "desk"
    _save(folder / USED_FILE, msgspec.structs.replace(used_keys(folder), **{which: key.owner}), private=False)


def use_development_keys(folder: Path) -> None:
    """Make the development keys the default again. Raises KeyFileLostError."""
    _save(folder / USED_FILE, UsedKeys(_FORMAT), private=False)


def retire_key(folder: Path, owner: str, new: KeyPair) -> Path:
    """Replace this user's key of `owner` by `new`; returns the file to which the old one is moved. Raises KeyFileError
    if there is none, and KeyFileLostError."""
    old, file = find_key(folder, owner), key_file(folder, owner)
    aside = file.with_name(f"{file.stem}.{old.id.hex()}.retired")
    save_key(old, aside)
    save_key(new, file)
    return aside


def development_keys(folder: Path) -> tuple[KeyPair, KeyPair]:
    """The desk's and the robots' key of one machine, created on first use.

    Anybody who can read this user's files can command robots that trust them; they are for trying things out. Raises
    KeyFileError and KeyFileLostError.
    """
    return (
        _made(folder / f"{DEVELOPMENT_DESK}.key", "desk", Role.COMMANDER),
        _made(folder / f"{_DEVELOPMENT_ROBOTS}.key", "*", Role.ROBOT),
    )


def _made(file: Path, owner: str, role: Role) -> KeyPair:
    if not file.exists():
        with _alone(file):  # of programs that start together, one makes it
            if not file.exists():
                save_key(KeyPair.new(owner, role), file)
    return load_key(file)


def _decoded(file: Path, kind: type[File], what: str, *, private: bool = False) -> File:
    try:
        with file.open("rb") as opened:
            mode = S_IMODE(os.fstat(opened.fileno()).st_mode)
            data = opened.read(MAX_BYTES + 1)
    except OSError as error:
        raise KeyFileError(f"cannot read {file}: {error.strerror}; wanted {what}") from None
    if private and os.name == "posix" and mode & 0o077:
        raise KeyFileError(
            f"{file} can be read by others, so it is not secret: chmod 600 it, and better make a new key"
        )
    if len(data) > MAX_BYTES:
        raise KeyFileError(f"{file} has more than {MAX_BYTES} bytes: wanted {what}")
    try:
        content = msgspec.json.decode(data, type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise KeyFileError(f"{file} is not {what}: {error}") from None
    if content.format > _FORMAT:
        raise KeyFileError(
            f"{file} is of format {content.format}, and this sleepcast reads {_FORMAT}: take a newer one"
        )
    return content


def half(digits: str) -> bytes:
    """Half of a key as bytes. Raises KeyRefusal if these are not hexadecimal digits."""
    try:
        return bytes.fromhex(digits)
    except ValueError:
        raise KeyRefusal(f"a key is written in hexadecimal digits, not as {digits!r}") from None


def _save(file: Path, content: SecretFile | TrustFile | UsedKeys, *, private: bool) -> None:
    data = msgspec.json.format(msgspec.json.encode(content), indent=1) + b"\n"
    try:
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        replace_file(file, data, private=private)
    except OSError as error:
        raise KeyFileLostError(f"cannot write {file}: {error.strerror or error}. Nothing was replaced") from None
