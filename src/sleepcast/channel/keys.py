"""Keys, roles and trust: who may send what. Robots obey keys that they know, never names or addresses.

A key pair belongs to one party: an operator's desk, or a robot. Its public half, with its owner's name and role, stands
in the trust file of everybody who is to trust it. Signatures are Ed25519 (RFC 8032) by PyNaCl; a key's id is the first
eight bytes of the SHA-256 of its public half.

Trust only grows: keys are added, keys are revoked for good, and some standing commands of a revoked key are vouched
for. So changes may arrive in any order, and more than once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import field, replace
from hashlib import sha256
from os import urandom
from types import MappingProxyType

from nacl.bindings import crypto_sign, crypto_sign_BYTES, crypto_sign_open, crypto_sign_seed_keypair
from nacl.exceptions import BadSignatureError

from sleepcast.channel.message import KEYS, MAX_NAME, Kind, Message, Role
from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.records import dataclass

_SEED_BYTES = _PUBLIC_BYTES = 32
SIGNATURE_BYTES = crypto_sign_BYTES
ID_BYTES = 8
MAX_KEYS = 16_384
"""Keys in one trust file: one for each of ten thousand robots, and their operators."""
MAX_VOUCHED = 20_000
"""Fingerprints of vouched datagrams: as many as a party stores standing commands."""
MAX_CHANGES = 1_000
"""Keys, or fingerprints, in one change: as many as fit into one message."""
FINGERPRINT_BYTES = 12
"""Bytes of the SHA-256 of a datagram: enough that no other datagram with the same value can be found."""


_ANYBODY = frozenset({Kind.STOP, Kind.REQUEST, Kind.DIGEST})
_ASKING = _ANYBODY | {Kind.ASK}
COMMANDING = _ASKING | {Kind.COMMAND, Kind.RELEASE, Kind.HEARTBEAT}
MAY: Mapping[Role, frozenset[Kind]] = MappingProxyType(
    {
        Role.OBSERVER: _ASKING,
        Role.OPERATOR: COMMANDING,
        Role.COMMANDER: COMMANDING,
        Role.ROBOT: _ANYBODY | {Kind.COMMAND, Kind.ANSWER, Kind.REPORT},
    }
)
"""The kinds of messages that each role may send."""


class KeyRefusal(MisuseError):
    """A key, a name or a role that cannot be used."""


@dataclass(frozen=True, slots=True)
class PublicKey:
    """A known key.

    owner: the sender's name in its messages; a name that ends in `*` stands for every name that begins so (many robots
        of one process; robots only)
    role: what its owner may do
    public: 32 bytes
    revoked: nothing signed with it counts any more

    Raises KeyRefusal for a public half or a name of the wrong length, and for `*` with another role than robot.
    """

    owner: str
    role: Role
    public: bytes
    revoked: bool = False

    def __post_init__(self) -> None:
        if len(self.public) != _PUBLIC_BYTES:
            raise KeyRefusal(f"a public key has {_PUBLIC_BYTES} bytes, this one of {self.owner!r} {len(self.public)}")
        if not 0 < len(self.owner) <= MAX_NAME:
            raise KeyRefusal(f"the owner of a key has a name of 1 to {MAX_NAME} characters, not {self.owner!r}")
        if self.owner.endswith("*") and self.role is not Role.ROBOT:
            raise KeyRefusal(f"only robots may share a key, as {self.owner!r} says: an {self.role} has one name")

    @property
    def id(self) -> bytes:
        return key_id(self.public)

    def is_of(self, name: str) -> bool:
        """Whether this key may sign messages under this name."""
        return name.startswith(self.owner[:-1]) if self.owner.endswith("*") else name == self.owner

    def signed(self, content: bytes, signature: bytes) -> bool:
        """Whether this is the key's signature (64 bytes) of the content."""
        if len(signature) != SIGNATURE_BYTES:
            return False
        try:
            crypto_sign_open(signature + content, self.public)
        except BadSignatureError:
            return False
        return True


class KeyPair:
    """A key with its secret half, `seed` (32 bytes). See `PublicKey` for the rest."""

    def __init__(self, owner: str, role: Role, seed: bytes) -> None:
        if len(seed) != _SEED_BYTES:
            raise KeyRefusal(f"the secret half of a key has {_SEED_BYTES} bytes, this one of {owner!r} {len(seed)}")
        self.seed = seed
        public, self._secret = crypto_sign_seed_keypair(seed)
        self.public = PublicKey(owner, role, public)
        self.id = self.public.id

    @staticmethod
    def new(owner: str, role: Role) -> KeyPair:
        """A new random key."""
        return KeyPair(owner, role, urandom(_SEED_BYTES))

    def sign(self, content: bytes) -> bytes:
        """The signature of `content`, 64 bytes."""
        return crypto_sign(content, self._secret)[:SIGNATURE_BYTES]


@dataclass(frozen=True, slots=True)
class KeyChange:
    """A commander's change of keys.

    trust: keys to trust
    vouch: fingerprints of datagrams of revoked keys that still count
    revoke: ids of keys to revoke for good
    """

    trust: tuple[PublicKey, ...] = ()
    vouch: frozenset[bytes] = field(default_factory=frozenset)
    revoke: frozenset[bytes] = field(default_factory=frozenset)

    def written(self) -> dict[str, object]:
        """As the field `message.KEYS` of a message's body; bytes as hexadecimal digits."""
        return {
            "trust": [[key.owner, key.role.value, key.public.hex()] for key in self.trust],
            "vouch": sorted(print_.hex() for print_ in self.vouch),
            "revoke": sorted(key.hex() for key in self.revoke),
        }

    @staticmethod
    def of(message: Message) -> KeyChange:
        """The change of keys in a message. Raises KeyRefusal if its sender may not make it, or if it is malformed."""
        if message.role != Role.COMMANDER:
            raise KeyRefusal("only a commander may change whom to trust")
        if not message.standing or message.text:
            raise KeyRefusal("a command that changes whom to trust must be standing, and have no text")
        match message.body.get(KEYS):
            case {"trust": list() as trust, "vouch": list() as vouch, "revoke": list() as revoke}:
                if max(len(trust), len(vouch), len(revoke)) <= MAX_CHANGES:
                    return KeyChange(
                        tuple(_trusted(each) for each in trust),
                        frozenset(_bytes(each, FINGERPRINT_BYTES) for each in vouch),
                        frozenset(_bytes(each, ID_BYTES) for each in revoke),
                    )
        raise KeyRefusal(
            f"a change of keys has the lists trust, vouch and revoke, of at most {MAX_CHANGES} entries each"
        )

    @staticmethod
    def refusal(message: Message) -> str:
        """Why the change of keys in a message was not made, "" if it was."""
        try:
            KeyChange.of(message)
        except KeyRefusal as error:
            return str(error)
        return ""


def _trusted(written: object) -> PublicKey:
    match written:
        case [str() as owner, str() as role, public] if role in set(Role):
            return PublicKey(owner, Role(role), _bytes(public, _PUBLIC_BYTES))
    raise KeyRefusal("a key to trust has an owner, a role and a public half")


def _bytes(written: object, count: int) -> bytes:
    try:
        decoded = bytes.fromhex(written) if isinstance(written, str) else b""
    except ValueError:
        decoded = b""
    if len(decoded) != count:
        raise KeyRefusal(f"{count} bytes are written as {2 * count} hexadecimal digits, not as {written!r:.80}")
    return decoded


class Trust:
    """The keys that a party trusts, by id. keep: called after every change. Raises KeyRefusal for more than
    `MAX_KEYS`."""

    def __init__(self, keys: Iterable[PublicKey] = (), keep: Callable[[Trust], None] | None = None) -> None:
        self.keep = keep
        self._keys: dict[bytes, PublicKey] = {}
        self._gone: set[bytes] = set()
        """Ids of revoked keys that are not otherwise known."""
        self._vouched: dict[bytes, None] = {}
        for key in keys:
            self.add(key)

    def __len__(self) -> int:
        return len(self._keys)

    @property
    def keys(self) -> tuple[PublicKey, ...]:
        """All of them, in the order in which they were added."""
        return tuple(self._keys.values())

    @property
    def gone(self) -> frozenset[bytes]:
        """Ids of keys that are revoked and not known otherwise."""
        return frozenset(self._gone)

    @property
    def vouched(self) -> tuple[bytes, ...]:
        """Fingerprints of datagrams of revoked keys that still count."""
        return tuple(self._vouched)

    def find(self, key: bytes) -> PublicKey | None:
        """The key with this id."""
        return self._keys.get(key)

    def vouches(self, datagram: bytes) -> bool:
        """Whether a datagram counts although its key is revoked."""
        return bool(self._vouched) and fingerprint(datagram) in self._vouched

    def add(self, key: PublicKey) -> None:
        """Trust a key. One that was revoked stays revoked."""
        known = self._keys.get(key.id)
        if known is None and len(self._keys) >= MAX_KEYS:
            raise KeyRefusal(f"at most {MAX_KEYS} keys fit into one trust file: remove revoked ones")
        revoked = key.revoked or key.id in self._gone or (known is not None and known.revoked)
        self._gone.discard(key.id)
        self._keys[key.id] = replace(key, revoked=revoked)

    def revoke(self, owner: str) -> tuple[PublicKey, ...]:
        """Revoke all keys of `owner`, and return them. Raises KeyRefusal if there is none."""
        keys = tuple(key for key in self._keys.values() if key.owner == owner)
        if not keys:
            names = sorted({key.owner for key in self._keys.values()})
            raise KeyRefusal(f"no key of {owner!r} is trusted{did_you_mean(owner, names)}")
        self.take(KeyChange(revoke=frozenset(key.id for key in keys)))
        return keys

    def take(self, change: KeyChange) -> bool:
        """Apply a commander's change; returns whether it changed anything. A known key keeps its owner and its role.
        What exceeds a bound is left out; the revocation of a known key never is."""
        before = self._state()
        for print_ in sorted(change.vouch - self._vouched.keys())[: MAX_VOUCHED - len(self._vouched)]:
            self._vouched[print_] = None
        for key in change.trust:
            if key.id not in self._keys and len(self._keys) < MAX_KEYS:
                self.add(key)
        for gone in sorted(change.revoke):
            known = self._keys.get(gone)
            if known is not None:
                self._keys[gone] = replace(known, revoked=True)
            elif len(self._gone) < MAX_KEYS:
                self._gone.add(gone)
        changed = self._state() != before
        if self.keep is not None and changed:
            self.keep(self)
        return changed

    def merge(self, other: Trust) -> bool:
        """Add everything that `other` trusts or has revoked; returns whether that was news."""
        revoked = frozenset(key.id for key in other.keys if key.revoked) | other.gone
        return self.take(KeyChange(other.keys, frozenset(other.vouched), revoked))

    def _state(self) -> tuple[int, int, int, int]:
        """Sizes by which a change shows: trust only grows."""
        revoked = sum(key.revoked for key in self._keys.values())
        return len(self._keys), revoked, len(self._gone), len(self._vouched)


def fingerprint(datagram: bytes) -> bytes:
    """The fingerprint by which a datagram is vouched for."""
    return sha256(datagram).digest()[:FINGERPRINT_BYTES]


def key_id(public: bytes) -> bytes:
    """The id of a key, from its public half."""
    return sha256(public).digest()[:ID_BYTES]
