"""The way to a Crazyflie: Bitcraze's cflib, with its threads and callbacks turned into calls."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterable, Mapping
from math import degrees
from threading import Event, Lock
from time import monotonic
from typing import Any

from sleepcast.core.errors import MisuseError, printable
from sleepcast.core.extras import installing
from sleepcast.robot import OutOfReachError

SOON, AGAIN = 6.0, 0.2
"""Seconds for a quadcopter to answer at all, and after which it is asked again."""
PATIENCE = 10.0
"""Seconds for it to tell what it can log."""
PERIOD = 50
"""ms between two values of each variable: tens, for cflib rounds others down without a word."""
ROOM = 26
"""Bytes of one log message."""
SIZE = 4
"""Bytes of one variable at most."""


class CflibQuadcopter:
    """A `Quadcopter` at a URI of cflib. Raises OutOfReachError, MisuseError where cflib is not installed.

    logged: variables of the firmware that it is to send.
    """

    def __init__(self, uri: str, logged: Iterable[str]) -> None:
        try:
            import cflib.crtp
            from cflib.crazyflie import Crazyflie
        except ImportError:
            raise MisuseError(f"Crazyflies need cflib; to install it: {installing('crazyflie')}") from None
        logging.getLogger("cflib").setLevel(logging.CRITICAL)  # what matters is said by the node
        cflib.crtp.init_drivers()
        self._lock = Lock()
        self._values: dict[str, float] = {}
        self._why = ""
        self._copter: Any = _mended(Crazyflie)()
        answered, done = self._copter.answered, Event()

        def failed(uri: str, why: str) -> None:
            reason = printable(why.splitlines()[0]) if why else "the link is lost"
            self._why = f"{uri} does not answer: {reason}"
            answered.set()
            done.set()

        self._copter.connected.add_callback(lambda uri: done.set())
        self._copter.connection_failed.add_callback(failed)
        self._copter.connection_lost.add_callback(failed)
        try:
            self._copter.open_link(uri)
            end = monotonic() + SOON
            while not answered.wait(AGAIN) and monotonic() < end:
                self._copter.platform._request_protocol_version()
            if not (answered.is_set() and done.wait(PATIENCE)):
                self._why = f"{uri} does not answer"
            self._check()
            self._begin_log(list(logged))
        except BaseException:
            self.close()
            raise

    def _begin_log(self, names: list[str]) -> None:
        """Have these sent. Raises MisuseError for a firmware that does not know all of them."""
        from cflib.crazyflie.log import LogConfig

        at_once = ROOM // SIZE
        for first in range(0, len(names), at_once):
            block = LogConfig(f"sleepcast{first}", PERIOD)
            for name in names[first : first + at_once]:
                block.add_variable(name)
            try:
                self._copter.log.add_config(block)
            except KeyError as error:
                raise MisuseError(f"this Crazyflie's firmware is too old: {error.args[0]}") from None
            block.data_received_cb.add_callback(self._take)
            block.start()

    def _take(self, time: int, values: Mapping[str, float], block: object) -> None:
        with self._lock:
            self._values.update({name: float(value) for name, value in values.items()})

    def _check(self) -> None:
        if self._why:
            raise OutOfReachError(self._why)

    def hover(self, speed: float, side: float, turn_rate: float, height: float) -> None:
        self._check()
        self._copter.commander.send_hover_setpoint(speed, side, degrees(turn_rate), height)

    def arm(self, armed: bool) -> None:
        self._check()
        self._copter.supervisor.send_arming_request(armed)

    def stop_motors(self) -> None:
        self._check()
        self._copter.commander.send_stop_setpoint()

    def cut(self) -> None:
        self._check()
        self._copter.supervisor.send_emergency_stop()

    def land(self, seconds: float) -> None:
        self._check()
        self._copter.commander.send_notify_setpoint_stop()
        self._copter.high_level_commander.land(0.0, seconds, yaw=None)

    def logged(self) -> Mapping[str, float] | None:
        self._check()
        with self._lock:
            values, self._values = self._values, {}
        return values or None

    def close(self) -> None:
        """Close the connection."""
        link, self._copter.link = self._copter.link, None  # else cflib ends with a setpoint that ends a landing
        if link is not None:
            link.close()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self._copter.close_link()


def _mended(of_cflib: Any) -> Any:
    """A class as cflib's Crazyflie, without waits of cflib 0.1.34 that may never end: the node could then neither come
    back nor end.

    Whoever sends holds a lock. If sending fails, cflib ends its thread of pings, which may wait for that very lock. And
    if another thread lets go of the link in the middle of sending, or an answer comes then, the lock is never released.
    Over UDP, cflib asks everything once, as if no datagram were ever lost: here it asks again. What it asks first, it
    asks once over every link; `answered` says that the answers have come, and those that come again begin nothing anew.
    """

    class Crazyflie(of_cflib):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            self.answered = Event()
            self.link_statistics.latency = _NoPings()

        def _platform_info_fetched(self) -> None:
            if self.answered.is_set():
                return
            self.answered.set()
            if self.link_uri.startswith("udp:") and self.link is not None:
                self.link.needs_resending = True
            super()._platform_info_fetched()

        def send_packet(self, *packet: Any, **how: Any) -> None:
            try:
                super().send_packet(*packet, **how)
            except (AttributeError, KeyError):  # there is no link any more, or nothing to ask again for
                self._send_lock.release()

    return Crazyflie


class _NoPings:
    """In the place of cflib's measurement of a link's latency, which nobody here asks for."""

    def start(self) -> None:
        """Measure nothing."""

    def stop(self) -> None:
        """There is nothing to wait for."""
