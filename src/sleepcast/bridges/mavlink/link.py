"""One end of a MAVLink 2 link: datagrams in, messages out, and signatures that are checked before anything else.

What is not signed with the link's key is refused, unless the link has no key. Three things differ from pymavlink: a
signature is checked before its timestamp is noted, so that nobody without the key can make a vehicle's own messages
look old; a timestamp of ours is never behind the clock, so that a vehicle which has restarted accepts it; and our
clock alone decides whether a newcomer's timestamp is old, so that one party whose clock is ahead makes no other look
old.
"""

from __future__ import annotations

import hashlib
import socket
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, Protocol

from sleepcast.bridges.address import BodyAddress, BodyError
from sleepcast.core.ages import duration
from sleepcast.core.clock import Clock, UnixClock
from sleepcast.core.errors import MisuseError, listed
from sleepcast.core.extras import installing

if TYPE_CHECKING:
    from pymavlink.dialects.v20.common import MAVLink

EPOCH = 1_420_070_400.0
"""2015-01-01 in Unix time, from which signatures count time in steps of 10 microseconds."""
STEP = 1e-5
MAX_DATAGRAM = 2_048
"""Bytes: more than several messages of MAVLink need."""
AT_ONCE = 200
"""Datagrams taken in one round: four times what a busy vehicle sends in that time."""
MAX_KEY = 4_096
"""Bytes of a file with a phrase."""
SIGNED = 1
"""The flag of a signed message, in its third byte."""
SYSTEM = 5
"""Which byte of a message is the number of the system that sends it."""
AHEAD = 60.0
"""Seconds by which a clock may be ahead of ours before that is told, as many as a newcomer's may be behind."""
MAX_NAMED = 4
"""Systems that a sentence names; more are counted."""
MAX_PEERS, GONE = 8, 10.0
"""Addresses that a listening end sends to, and the seconds after which one that is silent is not one of them any more:
ground stations send a heartbeat every second."""


LINK = {"listen": "no", "key": "", "unsigned": "no"}
"""What can be set of every link, and what holds otherwise."""


class Wire(Protocol):
    """Carries datagrams to the other end, and back."""

    def send(self, data: bytes) -> None: ...

    def receive(self) -> list[tuple[bytes, object]]:
        """Datagrams, and whom they came from."""

    def answer(self, sender: object) -> None:
        """What this sender has said is true: from now on it is at the other end."""

    def close(self) -> None: ...


class UdpWire:
    """UDP to a host and port, or, listening there, to all from whom something true came lately, and at least to the
    last one of them: what is meant for one of two ground stations reaches it, whoever has spoken since. Raises
    OSError."""

    def __init__(self, host: str, port: int, *, listening: bool) -> None:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self._socket = socket.socket(family, kind, protocol)
        self._socket.setblocking(False)
        self._peers: dict[Any, float] = {} if listening else {address: monotonic()}
        """When each was heard, the last one at the end."""
        self._listening = listening
        if listening:
            try:
                self._socket.bind(address)
            except OSError:
                self._socket.close()
                raise
        self.port: int = self._socket.getsockname()[1]

    @property
    def peers(self) -> list[Any]:
        """The addresses at the other end, the one that was heard last at the end."""
        return list(self._peers)

    def send(self, data: bytes) -> None:
        failed: OSError | None = None
        for peer in self._peers:
            try:
                self._socket.sendto(data, peer)
            except (BlockingIOError, ConnectionRefusedError):
                continue  # nobody listens there now; silence tells
            except OSError as error:
                failed = error
        if failed is not None:
            raise failed

    def receive(self) -> list[tuple[bytes, object]]:
        datagrams: list[tuple[bytes, object]] = []
        for _ in range(AT_ONCE):
            try:
                data, sender = self._socket.recvfrom(MAX_DATAGRAM)
            except BlockingIOError:
                break
            except ConnectionRefusedError:
                continue
            if self._listening or sender in self._peers:
                datagrams.append((data, sender))
        return datagrams

    def answer(self, sender: object) -> None:
        now = monotonic()
        self._peers.pop(sender, None)
        self._peers[sender] = now
        for each, heard in tuple(self._peers.items()):
            if now - heard > GONE or len(self._peers) > MAX_PEERS:
                del self._peers[each]

    def close(self) -> None:
        self._socket.close()


def read_key(file: str) -> bytes:
    """The key of the phrase in a file, as ground stations make it of a phrase. Raises BodyError."""
    try:
        with Path(file).expanduser().open("rb") as opened:
            phrase = opened.read(MAX_KEY + 1).strip()
    except OSError as error:
        raise BodyError(f"key={file}: it cannot be read: {error.strerror}") from None
    if not phrase or len(phrase) > MAX_KEY:
        raise BodyError(f"key={file}: wanted a file with one phrase, the same that the vehicle's key was made of")
    return hashlib.sha256(phrase).digest()


def open_link(address: BodyAddress, port: int, system: int, component: int) -> MavlinkConnection:
    """A link over UDP, signed with the key of the address, which has the settings of `LINK`. port: where the address
    names none. Raises BodyError, MisuseError."""
    yes = {name: address.choice(name, ("no", "yes")) == "yes" for name in ("listen", "unsigned")}
    file = address.settings["key"]
    if bool(file) is yes["unsigned"]:
        raise BodyError(
            f"{address.uri!r:.100}: wanted either key=FILE, with the phrase of the vehicle's signing key, or "
            "unsigned=yes, by which everybody who reaches the vehicle can command it"
        )
    key = read_key(file) if file else None
    try:
        wire = UdpWire(address.host, port if address.port is None else address.port, listening=yes["listen"])
    except OSError as error:
        raise BodyError(f"{address.uri!r:.100}: {error.strerror or error}") from None
    try:
        return MavlinkConnection(wire, system, component, key)
    except BaseException:
        wire.close()
        raise


def system_of(address: BodyAddress, otherwise: int = 1) -> int:
    """The number of the vehicle behind an address's #. Raises BodyError."""
    text = address.part or str(otherwise)
    if not (text.isascii() and text.isdigit() and len(text) <= 3 and 1 <= int(text) <= 254):
        raise BodyError(f"{address.uri!r:.100}: vehicles are numbered from 1 to 254, so #{text:.20} is none")
    return int(text)


REASONS = {
    "not signed": "they are not signed; give {} the key, or add unsigned=yes to the address",
    "wrong key": "they are signed with another key than ours",
    "old": "their timestamps are old: they are repeated, or the clock of {} is behind ours by more than a minute",
    "damaged": "they are damaged, or no MAVLink",
}


class Refusals:
    """What was not let in, and whose clocks are ahead, since somebody last asked for the sentences about it."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._systems: dict[str, set[int]] = {}
        self._ahead: dict[int, float] = {}
        self._known_ahead: set[int] = set()

    def __bool__(self) -> bool:
        return bool(self._counts or self._ahead)

    def add(self, reason: str, system: int | None) -> None:
        """Count a message that was refused for one of `REASONS`. system: who has sent it, None if that is unknown."""
        self._counts[reason] += 1
        if system is not None:
            self._systems.setdefault(reason, set()).add(system)

    def compare(self, system: int, ahead: float) -> None:
        """Note by how many seconds the clock of a party with the key is ahead of ours; this is said once."""
        if ahead <= AHEAD:
            self._known_ahead.discard(system)
        elif system not in self._known_ahead:
            self._known_ahead.add(system)
            self._ahead[system] = ahead

    def take(self, whose: str) -> list[str]:
        """The sentences. whose: who is at the other end."""
        sentences = [
            f"{count} messages from {whose} were refused: {REASONS[why].format(whose)}{self._senders(why)}"
            for why, count in self._counts.items()
        ]
        sentences += [
            f"the clock of {whose} (system {system}) is {duration(round(ahead))} ahead of ours; "
            "it is heard all the same"
            for system, ahead in sorted(self._ahead.items())
        ]
        self._counts.clear()
        self._systems.clear()
        self._ahead.clear()
        return sentences

    def _senders(self, reason: str) -> str:
        systems = sorted(self._systems.get(reason, ()))
        if not systems:
            return ""
        return f" (system {listed(systems, MAX_NAMED)})"


class MavlinkConnection:
    """See the module.

    system, component: our own numbers.
    key: None to take and send unsigned messages.
    clock: Unix time.
    """

    def __init__(
        self, wire: Wire, system: int, component: int, key: bytes | None, *, clock: Clock | None = None
    ) -> None:
        self.refused = Refusals()
        self._wire, self._clock = wire, clock or UnixClock()
        self.mav: MAVLink = _codec(self.refused, self._stamp, system, component)
        if key is not None:
            self.mav.signing.secret_key = key
            self.mav.signing.sign_outgoing = True
            self.mav.signing.timestamp = self._stamp()

    def _stamp(self) -> int:
        return int((self._clock.now() - EPOCH) / STEP)

    def send(self, message: Any) -> None:
        """Send a message of pymavlink's. Raises OSError."""
        signing = self.mav.signing
        signing.timestamp = max(signing.timestamp, self._stamp())
        self._wire.send(message.pack(self.mav))
        self.mav.seq = (self.mav.seq + 1) % 256

    def receive(self) -> list[Any]:
        """The messages that have come since the last call, of all systems. Raises OSError."""
        messages: list[Any] = []
        for data, sender in self._wire.receive():
            self.mav.buf, self.mav.buf_index = bytearray(), 0  # no message goes on in the next datagram
            for message in self.mav.parse_buffer(bytearray(data)) or ():
                if message.get_type() == "BAD_DATA":
                    self._count(bytes(message.data), str(message.reason))
                elif not message.get_type().startswith("UNKNOWN"):
                    self._wire.answer(sender)
                    messages.append(message)
        return messages

    def _count(self, data: bytes, reason: str) -> None:
        """Note a message that was not let in. One with a signature was noted when that was checked."""
        if "signature" not in reason:
            self.refused.add("damaged", None)
        elif not data[2] & SIGNED:
            self.refused.add("not signed", data[SYSTEM])

    def complaints(self, whose: str = "the vehicle") -> list[str]:
        """Why messages have been refused since the last call, in sentences. whose: who is at the other end."""
        return self.refused.take(whose)

    def close(self) -> None:
        self._wire.close()


def _codec(refused: Refusals, stamp: Callable[[], int], system: int, component: int) -> MAVLink:
    """pymavlink's, with the check of the module. stamp: the time of our clock, in steps."""
    try:
        from pymavlink.dialects.v20.common import MAVLink as Codec
    except ImportError:
        raise MisuseError(f"MAVLink needs pymavlink; to install it: {installing('mavlink')}") from None

    class CheckedCodec(Codec):  # type: ignore[misc]  # its library need not be there
        def check_signature(self, msgbuf: bytearray, srcSystem: int, srcComponent: int) -> bool:
            expected = hashlib.sha256(bytes(self.signing.secret_key) + bytes(msgbuf[:-6])).digest()[:6]
            if bytes(msgbuf[-6:]) != expected:
                refused.add("wrong key", srcSystem)
                return False
            ours, followed = stamp(), self.signing.timestamp
            self.signing.timestamp = ours
            fresh = bool(super().check_signature(msgbuf, srcSystem, srcComponent))
            # What we send must not look old to anybody, so it follows the clock that is furthest ahead.
            self.signing.timestamp = max(followed, self.signing.timestamp)
            if not fresh:
                refused.add("old", srcSystem)
                return False
            refused.compare(srcSystem, (int.from_bytes(msgbuf[-12:-6], "little") - ours) * STEP)
            return True

    codec = CheckedCodec(None, system, component)
    codec.robust_parsing = True
    return codec
