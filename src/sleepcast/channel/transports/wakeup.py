"""A bell: a file descriptor that is readable while there is news, for media that have no socket of their own."""

from __future__ import annotations

import socket
from contextlib import suppress


class WakeUp:
    """Rung from any thread; who waits does so on `fileno`."""

    def __init__(self) -> None:
        self._ear, self._hand = socket.socketpair()
        self._ear.setblocking(False)
        self._hand.setblocking(False)

    def fileno(self) -> int:
        """Readable from `ring` on until `quiet`; -1 once it is closed."""
        return self._ear.fileno()

    def ring(self) -> None:
        """There is news. A bell that rings already, or is closed, stays as it is."""
        with suppress(OSError):
            self._hand.send(b"!")

    def quiet(self) -> None:
        """The news have been taken; to be called before they are taken, so that none is overlooked."""
        with suppress(OSError):
            while len(self._ear.recv(4_096)) == 4_096:
                pass

    def close(self) -> None:
        """Ring no more."""
        self._ear.close()
        self._hand.close()
