"""One Crazyradio for many programs, and the emergency stop that its radio carries to all quadcopters at once.

Only one program can open a Crazyradio, and each node is one. So `SharedRadio` holds it, and gives every quadcopter on
its channel a UDP port of this computer, at which `crazyflie://127.0.0.1:PORT` finds it as it would find a simulated
one. Bitcraze's cflib shares the radio among the links.

All Crazyflies listen to one more address, `EVERYBODY`, and answer nothing to what comes there. Only the emergency stop
is sent there: the firmware prefers the setpoints that nodes send twenty times a second to its own take-offs and
landings, so a broadcast of those would do nothing to a quadcopter whose node is alive. What nobody confirms is sent
`REPEATS` times, and reaches quadcopters whose node has died, or is cut off.
"""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from threading import Event, Lock, Thread
from typing import Any, Self

from sleepcast.bridges.address import BodyError
from sleepcast.core.errors import MisuseError, printable
from sleepcast.core.extras import installing
from sleepcast.robot import OutOfReachError

EVERYBODY = (0xFF, 0xE7, 0xE7, 0xE7, 0xE7)
EMERGENCY_STOP = (bytes((0x9D, 3)), bytes((0x6D, 3)))
"""Packets that stop the motors for good: of the supervisor, and, for firmwares before 2025, of the localization."""
REPEATS, PAUSE = 10, 0.01
"""How often the emergency stop is sent, and seconds between two times. The radio itself sends what nobody confirms four
times."""
LARGEST = 31
"""Bytes of a packet: what the radio carries with its header."""
NOTHING, LINK_BITS = 0xFF, 0x0C
"""The header of a packet that says nothing, which the links themselves exchange, and its bits that are theirs."""
HERE, PORT = "127.0.0.1", 19_850
"""The ports are for programs of this computer: whoever reaches them commands quadcopters, and needs no key."""
RATES = ("250K", "1M", "2M")
LOOK = 0.1
"""Seconds after which a thread that waits for packets looks whether it is to end."""
AGAIN = 1.0
"""Seconds between two tries to reach a quadcopter, and between two looks at the radio."""
UNPLUGGED = 3.0
"""Seconds without an answer from the radio itself after which it counts as unplugged: its library may wait for ever."""
MAX_COPTERS = 20
"""Quadcopters of one radio: with more, each would hear less than ten setpoints a second."""


def radio_uri(radio: str, channel: int | None, rate: str) -> str | None:
    """A URI of cflib, without an address, of a radio such as radio0; None if there is none such."""
    if not (radio.startswith("radio") and radio[5:].isdigit() and channel is not None and 0 <= channel <= 125):
        return None
    return f"radio://{radio[5:]}/{channel}/{rate}"


def is_radio_address(text: str) -> bool:
    return len(text) == 10 and all(each in "0123456789ABCDEFabcdef" for each in text)


class RadioGoneError(OutOfReachError):
    """The Crazyradio does not answer: it is not plugged in, or another program has it."""


class RadioBroadcast:
    """Sends packets to all quadcopters on the channel of a link. uri: of cflib, as radio://0/80/2M. Raises
    RadioGoneError."""

    def __init__(self, uri: str) -> None:
        try:
            from cflib.crtp.radiodriver import RadioDriver, RadioManager
        except ImportError:
            raise MisuseError(f"Crazyflies need cflib; to install it: {installing('crazyflie')}") from None
        try:
            self.device, channel, rate, *_ = RadioDriver.parse_uri(uri)
            self._radio: Any = RadioManager.open(self.device)
        except Exception as error:  # cflib raises nothing more precise
            raise RadioGoneError(f"{printable(str(error))}: plug it in, or end the program that has it") from None
        self._radio.set_channel(channel)
        self._radio.set_data_rate(rate)
        self._radio.set_address(EVERYBODY)

    def send(self, packet: bytes) -> bool:
        """Whether the radio took it. Waits for the radio, for ever if that has been pulled out."""
        return self._radio.send_packet(packet) is not None

    def close(self) -> None:
        self._radio.close()


def stop_all_by_radio(uri: str) -> None:
    """The emergency stop to all quadcopters on the channel of this link. Raises RadioGoneError."""
    radio = RadioBroadcast(uri)
    taken = 0
    for _ in range(REPEATS):
        taken += sum(radio.send(packet) for packet in EMERGENCY_STOP)
        time.sleep(PAUSE)
    radio.close()
    if not taken:
        raise RadioGoneError("the Crazyradio does not answer")


def stop_all_by_port(host: str, port: int) -> None:
    """The same, through a `SharedRadio`, or a simulator, which takes it at this UDP port. Raises OSError."""
    family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    with socket.socket(family, kind, protocol) as line:
        for _ in range(REPEATS):
            for packet in EMERGENCY_STOP:
                line.sendto(packet, address)
            time.sleep(PAUSE)


class UdpRelay:
    """A quadcopter at a UDP port.

    uri: of cflib.
    ending: when it is to end.
    say: gets a sentence when it is lost, and when it is back.
    """

    def __init__(self, name: str, uri: str, line: socket.socket, ending: Event, say: Callable[[str], None]) -> None:
        self._name, self._uri, self._line, self._ending, self._say = name, uri, line, ending, say
        self._driver: Any = None
        self._node: Any = None
        """The address of the program that has sent something last."""
        self.threads = [Thread(target=each, name=name, daemon=True) for each in (self._down, self._up)]

    def begin(self) -> None:
        for thread in self.threads:
            thread.start()

    def end(self) -> None:
        """Threads that wait for a radio that is gone wait on, and do nothing more."""
        for thread in self.threads:
            thread.join(2.0 * LOOK)

    def _up(self) -> None:
        """From the node to the quadcopter."""
        from cflib.crtp.crtpstack import CRTPPacket

        while not self._ending.is_set():
            try:
                data, sender = self._line.recvfrom(2 * LARGEST)
            except TimeoutError:
                continue
            except OSError:  # the node is gone, or this port is closed
                self._ending.wait(LOOK)
                continue
            if not 0 < len(data) <= LARGEST or data[0] == NOTHING:
                continue
            self._node, driver = sender, self._driver
            if driver is not None:
                driver.send_packet(CRTPPacket(data[0], list(data[1:])))

    def _down(self) -> None:
        """From the quadcopter to the node. A link that has died is made anew, again and again, and so is one that began
        while the quadcopter was away: it would stay without the numbers of cflib's "safelink", by which nothing is lost
        on the air, and a quadcopter that still goes by those of the link before takes what comes for repeats."""
        from cflib.crtp.radiodriver import RadioDriver

        was_lost = False
        while not self._ending.is_set():
            failed = Event()
            driver = RadioDriver()
            try:
                driver.connect(self._uri, None, lambda why, failed=failed: failed.set())
            except Exception:  # of cflib: the radio is gone, which is noticed elsewhere
                self._ending.wait(AGAIN)
                continue
            self._driver = driver
            while not failed.is_set() and not self._ending.is_set():
                packet = driver.receive_packet(LOOK)
                if packet is not None and driver.needs_resending:
                    break
                if packet is not None and was_lost:
                    was_lost = False
                    self._say(f"{self._name} is within reach again")
                if packet is not None and packet.header | LINK_BITS != NOTHING and self._node is not None:
                    with suppress(OSError):
                        self._line.sendto(bytes((packet.header, *packet.data)), self._node)
            self._driver = None
            driver.close()
            if failed.is_set():
                if not was_lost:
                    self._say(f"{self._name} is out of reach: the radio does not hear it")
                was_lost = True
                self._ending.wait(AGAIN)


class SharedRadio:
    """See the module. Raises RadioGoneError, and BodyError for a port that is in use.

    base: a URI of cflib without an address, as radio://0/80/2M.
    addresses: of quadcopters.
    port: to which the emergency stop for all comes; the quadcopters have the next ones.
    say: see `UdpRelay`.
    """

    def __init__(self, base: str, addresses: Sequence[str], port: int, say: Callable[[str], None]) -> None:
        self._lines: list[socket.socket] = []
        try:
            for each in range(len(addresses) + 1):
                self._lines.append(_listen(port + each))
            self._radio = RadioBroadcast(base)
        except BaseException:
            self._close_lines()
            raise
        self._lock, self._ending = Lock(), Event()
        self._usual = threading.excepthook
        self._died = ""
        """Of what one of its threads has died."""
        self._looks = 0
        """How often `run` has looked since the radio itself answered last; a process that stands still does not."""
        pairs = zip(addresses, self._lines[1:], strict=True)
        self._relays = [UdpRelay(each, f"{base}/{each}", line, self._ending, say) for each, line in pairs]
        self._threads = [Thread(target=each, daemon=True) for each in (self._take_stops, self._look_at_radio)]
        threading.excepthook = self._hear_of_end

    def run(self, check: Callable[[], None]) -> None:
        """Until `check`, called now and then, raises. Raises RadioGoneError; OutOfReachError when one of its threads
        has died: a radio that flies some and does not take the emergency stop is worse than none."""
        for relay in self._relays:
            relay.begin()
        for thread in self._threads:
            thread.start()
        while True:
            check()
            time.sleep(LOOK)
            self._looks += 1
            if self._died:
                raise OutOfReachError(f"what relays to Crazyflies has failed, please report it: {self._died}")
            if self._is_gone():
                raise RadioGoneError("the Crazyradio does not answer; is it unplugged?")

    def _is_gone(self) -> bool:
        return self._looks * LOOK > UNPLUGGED

    def _hear_of_end(self, args: threading.ExceptHookArgs) -> None:
        """The thread of cflib that talks to the radio ends when that is pulled out, which is noticed here anyway."""
        if args.thread in (*self._threads, *(each for relay in self._relays for each in relay.threads)):
            self._died = f"{args.exc_type.__name__}: {args.exc_value}"
        elif args.thread is None or args.thread.name != "Shared Radio":
            self._usual(args)

    def _send(self, packet: bytes) -> None:
        with self._lock:
            if self._radio.send(packet):
                self._looks = 0

    def _take_stops(self) -> None:
        """Whoever reaches the port may stop all, and nothing else."""
        while not self._ending.is_set():
            try:
                data = self._lines[0].recv(2 * LARGEST)
            except OSError:  # also when none has come for a while
                continue
            if data in EMERGENCY_STOP:
                self._send(data)

    def _look_at_radio(self) -> None:
        while not self._ending.wait(AGAIN):
            self._send(bytes((NOTHING,)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        from cflib.crtp.radiodriver import RadioManager

        self._ending.set()
        threading.excepthook = self._usual
        for relay in self._relays:
            relay.end()
        self._close_lines()
        if self._is_gone():
            RadioManager.remove(self._radio.device)  # else cflib would go on with the one that is gone
        else:
            self._radio.close()

    def _close_lines(self) -> None:
        for line in self._lines:
            line.close()


def _listen(port: int) -> socket.socket:
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    line.settimeout(LOOK)
    try:
        line.bind((HERE, port))
    except OSError as error:
        line.close()
        raise BodyError(f"port {port}: {error.strerror}; choose others with --port") from None
    return line
