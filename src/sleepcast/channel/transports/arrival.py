"""When datagrams have reached a socket, by the kernel's timestamps: a busy process reads them later.

The kernel stamps by the computer's clock, which may be set at any time; so a stamp counts only if nobody has set it
since the socket was read before. A process that is interrupted here takes arrivals for later ones, never for earlier.
"""

from __future__ import annotations

import socket
import struct
import sys
import time
from contextlib import suppress

from sleepcast.core.clock import seconds_passed

_STAMP = 35
"""`SO_TIMESTAMPNS` of Linux, which Python does not name: the option, and the type of what comes with a datagram."""
_TIME = struct.Struct("@ll")
"""What comes: s and ns."""
_ROOM = socket.CMSG_SPACE(_TIME.size) if sys.platform == "linux" else 0
_SET = 0.001
"""By how many s the computer's clock may differ from what has passed without having been set."""
_SLEWED = 0.001
"""The share by which it may be slowed down or hurried on, which is twice as much as systems do."""


class StampedSocket:
    """A datagram socket that does not wait, with the times of arrival. Without stamps there are none."""

    def __init__(self, receiving: socket.socket) -> None:
        self._socket, self._stamps = receiving, False
        self._read, self._ahead = seconds_passed(), 0.0
        if _ROOM:
            with suppress(OSError):
                receiving.setsockopt(socket.SOL_SOCKET, _STAMP, 1)
        self.compare()

    def fileno(self) -> int:
        return self._socket.fileno()

    def compare(self) -> None:
        """Before some datagrams are received: whether the computer's clock has gone on as it should."""
        stamped = time.time()
        now = seconds_passed()
        ahead = stamped - now
        self._stamps = abs(ahead - self._ahead) <= _SET + _SLEWED * (now - self._read)
        self._read, self._ahead = now, ahead

    def receive(self, size: int) -> tuple[bytes, tuple[str, int], float | None]:
        """A datagram of at most that many bytes, the address of its sender, and when it came, `seconds_passed` then;
        None where nobody knows. Raises what the socket raises."""
        datagram, extras, _, sender = self._socket.recvmsg(size, _ROOM)
        for _, kind, stamp in extras if self._stamps else ():
            if kind == _STAMP and len(stamp) == _TIME.size:
                seconds, nanoseconds = _TIME.unpack(stamp)
                return datagram, sender, seconds + 1e-9 * nanoseconds - self._ahead
        return datagram, sender, None
