"""`sleepcast bridge`: what robots on the air look like to other programs, and what those say to robots."""

from __future__ import annotations

import click

from sleepcast.api.connection import AirOptions, observing_station
from sleepcast.cli.air import on_air
from sleepcast.cli.options import every_option
from sleepcast.cli.streams import announce, complain


@click.group("bridge", short_help="Let other programs see robots on the air.")
def bridge() -> None:
    """Let other programs see robots on the air, and speak to them.

    \b
    Examples:
      sleepcast bridge tak --server tcp://127.0.0.1:8087 --origin 36.6,-121.9
    """


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
            type=type or GROUND_ROBOT,
        )
        import asyncio  # of no use to other commands

        asyncio.run(bridge.run())
    return 0
