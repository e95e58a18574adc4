"""`sleepcast bridge`: connects other programs to the channel: maps that show robots, fleets that get minds, and what
several programs share."""

from __future__ import annotations

from collections.abc import Callable
from time import sleep

import click

from sleepcast.api.connection import AirOptions, observing_station
from sleepcast.bridges.crazyflie.radio import (
    MAX_COPTERS,
    PORT,
    RATES,
    RadioGoneError,
    SharedRadio,
    is_radio_address,
    radio_uri,
)
from sleepcast.cli.air import on_air
from sleepcast.cli.bridge_ros2 import ros2
from sleepcast.cli.interrupts import Interrupts
from sleepcast.cli.options import every_option
from sleepcast.cli.streams import announce, complain
from sleepcast.core.errors import MisuseError


@click.group("bridge")
def bridge() -> None:
    """Connect other programs to the channel: give minds to the robots of a ROS 2 fleet, show robots on maps, share a
    radio.

    \b
    Examples:
      sleepcast bridge ros2
      sleepcast bridge tak --server tcp://127.0.0.1:8087 --origin 36.6,-121.9
      sleepcast bridge crazyradio radio0:80 E7E7E7E701 E7E7E7E702
    """


bridge.add_command(ros2)


@bridge.command("tak", short_help="Show robots on the maps of a TAK server.")
@click.option(
    "--server", metavar="ADDRESS", required=True, help="tcp://HOST:PORT, tls://HOST:PORT?..., or udp://GROUP:PORT?..."
)
@click.option("--origin", metavar="LAT,LON", required=True, help="Where robots have x = 0, y = 0, in degrees.")
@every_option("pictures")
@click.option("--markers", is_flag=True, help="Let markers set by others become named places of robots.")
@click.option("--type", metavar="TYPE", help="Type of a robot's event (default: a-f-G-E-V-U, a ground robot).")
@on_air
def tak(server: str, origin: str, every: float, markers: bool, type: str | None, air: AirOptions) -> int:
    """Show every robot of a channel, its groups and its named places on the maps of TAK (ATAK, WinTAK, iTAK), as
    Cursor-on-Target events, until Ctrl-C.

    With --markers, a marker that somebody sets on such a map becomes a place that all robots know: a marker "Depot 1"
    gives them depot_1_x and depot_1_y. Whoever may set markers on that server then says where the place is.

    A tls:// address takes the files of your certificate, of its key and of the server's authority, all in PEM:
    tls://HOST:8089?cert=me.pem&key=me.key&ca=server.pem. With udp://239.2.3.1:6969?interface=NAME no server is needed.

    \b
    Examples:
      sleepcast bridge tak --server tcp://127.0.0.1:8087 --origin 36.6,-121.9
      sleepcast bridge tak --server 'udp://239.2.3.1:6969?interface=lo' --origin 36.6,-121.9 --markers
    """
    from sleepcast.core.geodesy import LocalMap, Origin
    from sleepcast.tak.bridge import TakBridge
    from sleepcast.tak.link import open_link
    from sleepcast.tak.picture import GROUND_ROBOT

    ground, link = LocalMap(Origin.read(origin)), open_link(server, announce)
    with observing_station(air, complain) as (station, telemetry):
        bridge = TakBridge(
            station,
            telemetry,
            link,
            ground,
            announce,
            fleet=air.fleet,
            every=every,
            markers=markers,
            type=GROUND_ROBOT if type is None else type,
        )
        import asyncio  # of no use to other commands

        asyncio.run(bridge.run())
    return 0


@bridge.command("crazyradio", short_help="Share a Crazyradio among the nodes of Crazyflies.")
@click.argument("radio", metavar="RADIO:CHANNEL")
@click.argument("addresses", metavar="ADDRESS...", nargs=-1, required=True)
@click.option("--rate", type=click.Choice(RATES), default="2M", show_default=True, help="Of the radio.")
@click.option(
    "--port", type=click.IntRange(1, 65_535 - MAX_COPTERS), default=PORT, show_default=True, help="The first UDP port."
)
def crazyradio(radio: str, addresses: tuple[str, ...], rate: str, port: int) -> int:
    """Let the nodes of several Crazyflies use one Crazyradio, which only one program can open, until Ctrl-C.

    The first port takes the emergency stop for all (ALL-MOTORS-OFF); the quadcopters, with these addresses of ten
    hexadecimal digits, have the next ports, in this order. The ports are for programs of this computer.

    \b
    Examples:
      sleepcast bridge crazyradio radio0:80 E7E7E7E701 E7E7E7E702
      sleepcast node --name cf1 --body 'crazyflie://127.0.0.1:19851?broadcast=19850'
      sleepcast node --name cf2 --body 'crazyflie://127.0.0.1:19852?broadcast=19850'
    """
    name, _, channel = radio.partition(":")
    base = radio_uri(name, int(channel) if channel.isascii() and channel.isdigit() and len(channel) < 4 else None, rate)
    if base is None:
        raise MisuseError(f"{radio!r:.40}: wanted a radio and its channel up to 125, as radio0:80")
    wrong = next((each for each in addresses if not is_radio_address(each)), None)
    if wrong is not None:
        raise MisuseError(f"{wrong!r:.40}: wanted the address of a Crazyflie, ten hexadecimal digits, as E7E7E7E701")
    if len(set(map(str.upper, addresses))) < len(addresses) or len(addresses) > MAX_COPTERS:
        raise MisuseError(f"{len(addresses)} addresses: wanted up to {MAX_COPTERS}, each once")
    with Interrupts() as interrupts:
        shared = SharedRadio(base, addresses, port, announce)
        interrupts.defer()
        for number, address in enumerate(addresses, 1):
            announce(f"{address} is at crazyflie://127.0.0.1:{port + number}?broadcast={port}")
        while True:
            try:
                with shared:
                    shared.run(interrupts.check)
            except RadioGoneError as error:
                complain(str(error))
            shared = _reopened(lambda: SharedRadio(base, addresses, port, announce), interrupts)
            announce("the Crazyradio is back")


def _reopened(open: Callable[[], SharedRadio], interrupts: Interrupts) -> SharedRadio:
    """The radio, as soon as it is plugged in."""
    while True:
        interrupts.check()
        try:
            return open()
        except RadioGoneError:
            sleep(1.0)
