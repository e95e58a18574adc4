"""Keys: who may say what. Robots obey keys that they know, never names or addresses.

A key pair belongs to one party: an operator's desk, or a robot. Its public half, with the name and the role that go
with it, stands in the trust file of everybody who is to believe it. Signatures are Ed25519 (RFC 8032) by PyNaCl; a
key's id is the first eight bytes of the SHA-256 of its public half.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from types import MappingProxyType

from nacl.bindings import crypto_sign_BYTES
from nacl.exceptions import BadSignatureError
from nacl.signing import SigningKey, VerifyKey

from sleepcast.channel.message import MAX_NAME, Kind
from sleepcast.channel.roles import Role as Role
from sleepcast.errors import MisuseError, did_you_mean

SEED_BYTES = PUBLIC_BYTES = 32
SIGNATURE_BYTES = crypto_sign_BYTES
ID_BYTES = 8
MAX_KEYS = 16_384
"""Keys in one trust file: one for each of ten thousand robots, and their operators."""


ANYBODY = frozenset({Kind.STOP, Kind.REQUEST, Kind.DIGEST})
ASKING = ANYBODY | {Kind.ASK}
COMMANDING = ASKING | {Kind.COMMAND, Kind.RELEASE, Kind.HEARTBEAT}
MAY: Mapping[Role, frozenset[Kind]] = MappingProxyType(
    {
        Role.OBSERVER: ASKING,
        Role.OPERATOR: COMMANDING,
        Role.COMMANDER: COMMANDING,
        Role.ROBOT: ANYBODY | {Kind.COMMAND, Kind.ANSWER, Kind.REPORT},
    }
)
"""The kinds of messages that each role may send."""


class KeyRefusal(MisuseError):
    """A key, a name or a role that cannot be taken."""


@dataclass(frozen=True, slots=True)
class PublicKey:
    """A key that is known. owner: the name that its messages carry; one that ends in `*` stands for every name that
    begins so (many robots of one process). public: 32 bytes. revoked: nothing signed with it counts any more.

    Raises KeyRefusal for a public half of another length, for a name of another length than 1 to `MAX_NAME`, and for
    many names where only a robot may have them.
    """

    owner: str
    role: Role
    public: bytes
    revoked: bool = False

    def __post_init__(self) -> None:
        if len(self.public) != PUBLIC_BYTES:
            raise KeyRefusal(f"a public key has {PUBLIC_BYTES} bytes, this one of {self.owner!r} {len(self.public)}")
        if not 0 < len(self.owner) <= MAX_NAME:
            raise KeyRefusal(f"the owner of a key has a name of 1 to {MAX_NAME} characters, not {self.owner!r}")
        if self.owner.endswith("*") and self.role is not Role.ROBOT:
            raise KeyRefusal(f"only robots may share a key, as {self.owner!r} says: an {self.role} has one name")

    @property
    def id(self) -> bytes:
        return key_id(self.public)

    def is_of(self, name: str) -> bool:
        """Whether messages that carry this name may be signed with this key."""
        return name.startswith(self.owner[:-1]) if self.owner.endswith("*") else name == self.owner

    def signed(self, content: bytes, signature: bytes) -> bool:
        """Whether this is the key's signature (64 bytes) of this content."""
        try:
            VerifyKey(self.public).verify(content, signature)
        except BadSignatureError:
            return False
        return True


class KeyPair:
    """A key with its secret half, `seed` (32 bytes). See PublicKey for the rest."""

    def __init__(self, owner: str, role: Role, seed: bytes) -> None:
        if len(seed) != SEED_BYTES:
            raise KeyRefusal(f"the secret half of a key has {SEED_BYTES} bytes, this one of {owner!r} {len(seed)}")
        self.seed = seed
        self._secret = SigningKey(seed)
        self.public = PublicKey(owner, role, bytes(self._secret.verify_key))
        self.id = self.public.id

    @staticmethod
    def new(owner: str, role: Role) -> KeyPair:
        """A key that nobody has had before."""
        return KeyPair(owner, role, bytes(SigningKey.generate()))

    def sign(self, content: bytes) -> bytes:
        """The signature of `content`, 64 bytes."""
        return self._secret.sign(content).signature


class Trust:
    """The keys that a party believes, by id. Raises KeyRefusal for more than `MAX_KEYS`."""

    def __init__(self, keys: Iterable[PublicKey] = ()) -> None:
        self._keys: dict[bytes, PublicKey] = {}
        for key in keys:
            self.add(key)

    def __len__(self) -> int:
        return len(self._keys)

    @property
    def keys(self) -> tuple[PublicKey, ...]:
        """All of them, in the order in which they came."""
        return tuple(self._keys.values())

    def find(self, key: bytes) -> PublicKey | None:
        """The key with this id."""
        return self._keys.get(key)

    def add(self, key: PublicKey) -> None:
        """Believe a key. One that was revoked stays so."""
        known = self._keys.get(key.id)
        if known is None and len(self._keys) >= MAX_KEYS:
            raise KeyRefusal(f"at most {MAX_KEYS} keys fit into one trust file: take out those that are revoked")
        self._keys[key.id] = replace(key, revoked=True) if known is not None and known.revoked else key

    def revoke(self, owner: str) -> tuple[PublicKey, ...]:
        """Believe no key of `owner` any more; gives them. Raises KeyRefusal if there is none."""
        found = tuple(replace(key, revoked=True) for key in self._keys.values() if key.owner == owner)
        if not found:
            names = sorted({key.owner for key in self._keys.values()})
            raise KeyRefusal(f"no key of {owner!r} is trusted{did_you_mean(owner, names)}")
        self._keys.update((key.id, key) for key in found)
        return found


def key_id(public: bytes) -> bytes:
    """The id of a key by its public half."""
    return sha256(public).digest()[:ID_BYTES]
