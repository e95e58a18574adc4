"""The radio and the clock of a small computer: UDP to a multicast group or a broadcast address, and Unix time."""

import gc
import select
import time

from micropython import const

from sleepnode.reader import unload

_MOST = const(1201)
"""Bytes read of a datagram: one more than are allowed."""
_SHORT = const(500)
_RESERVE = const(1500)
_MADE = const(1767225600000)
"""2026-01-01: a clock that shows an earlier time was never set."""


class Radio:
    """A socket that receives from `address` and sends to it. interface: the address of the network card to use, "" for
    the system's choice."""

    def __init__(self, address, port, interface=""):
        from sleepnode.opening import opened

        self.socket, self._to = opened(address, port, interface)
        unload("opening")
        self._poll = select.poll()
        self._poll.register(self.socket, select.POLLIN)
        self._reserve = None
        self._keep_reserve()

    def receive(self):
        """A datagram that has come, None for none. Raises MemoryError if what came does not fit into the memory."""
        for _ in self._poll.ipoll(0):
            datagram = None
            for size in (_MOST, _MOST, _SHORT):
                try:
                    datagram = self.socket.recvfrom(size)[0]
                    break
                except OSError:
                    return None
                except MemoryError:  # reading takes one large piece: that of the reserve; a STOP fits into less
                    self._reserve = None
                    gc.collect()
            self._keep_reserve()
            if datagram is None:
                raise MemoryError
            return datagram
        return None

    def _keep_reserve(self):
        if self._reserve is None:
            try:
                self._reserve = bytearray(_RESERVE)
            except MemoryError:
                pass

    def wait(self, most):
        """Sleep until a datagram has come, for `most` ms at most."""
        for _ in self._poll.ipoll(most):
            pass

    def send(self, data):
        """Broadcast; a full queue of the system counts as a loss on the air."""
        try:
            self.socket.sendto(data, self._to)
        except OSError:
            pass


class Clock:
    """Milliseconds of Unix time. is_set: whether somebody has set this computer's clock."""

    def __init__(self):
        epoch = 946684800 if time.gmtime(0)[0] == 2000 else 0
        self._now = int((time.time() + epoch) * 1000)
        self._ticks = time.ticks_ms()
        self.is_set = self._now >= _MADE

    def now(self):
        ticks = time.ticks_ms()
        self._now += time.ticks_diff(ticks, self._ticks)
        self._ticks = ticks
        return self._now

    def set(self, now):
        self._now, self._ticks, self.is_set = now, time.ticks_ms(), True
