"""`sleepcast console`: the operator's page for robots on the air."""

from __future__ import annotations

import click

from sleepcast.api.connection import AirOptions, observing_station
from sleepcast.cli.air import on_air
from sleepcast.cli.options import alert_option, allow_host_option, every_option
from sleepcast.cli.streams import announce, complain

TITLE = "Robots on the air"
STORY = (
    "Every robot heard on this channel is on the map, at its last reported position. What you type is broadcast "
    "to all of them, and each decides for itself whether to obey: (WHEN (> battery 50%) (JOIN bravo)). Those that "
    "would obey are highlighted while you type. Click a robot to see why it obeyed or did not. This page asks "
    "robots for telemetry; while it is paused, it does not."
)
"""What a stranger reads first."""


@click.command("console")
@click.option("--scenario", metavar="NAME|FILE", help="Draw the world of this scenario under the robots.")
@every_option("requests")
@click.option("--host", default="127.0.0.1", show_default=True, help="The address at which the page is served.")
@click.option("--port", type=click.IntRange(0, 65_535), help="Its port (default: 8317; 0 for any free one).")
@click.option("--insecure", is_flag=True, help="Allow a host that others can reach.")
@allow_host_option
@alert_option
@click.option("--no-browser", is_flag=True, help="Only print the address of the page.")
@on_air
def console(
    scenario: str | None,
    every: float,
    host: str,
    port: int | None,
    insecure: bool,
    allow: tuple[str, ...],
    alerts: tuple[str, ...],
    no_browser: bool,
    air: AirOptions,
) -> int:
    """Show the robots of a channel on a page in the browser: a map of where they say they are, a prompt that tells who
    would obey before you send, the account of every command, why a robot obeyed or did not, and STOP (F9).

    \b
    Examples:
      sleepcast console
      sleepcast console --scenario bravo --channel udp://192.168.1.255:47123
    """
    with observing_station(air, complain) as (station, telemetry):
        from sleepcast.console import DEFAULT_PORT, Address, Scene, serve_fleet
        from sleepcast.console.adapters.channel import EMPTY, FleetAdapter
        from sleepcast.core.clock import WallClock

        if scenario is None:
            noun = "robots" if station.fleet_size else "robots heard so far"
            picture = None
            ground = Scene(TITLE, STORY, noun, (), EMPTY, "m", ())
        else:
            from msgspec.structs import replace

            from sleepcast.console.adapters.swarm import scene_of
            from sleepcast.simulator import find_scenario

            world = find_scenario(scenario)
            drawn = scene_of(world, ("",))
            picture = None if world.picture is None else world.picture.png
            ground = replace(drawn, names=(), story=STORY)
        began = station.now
        fleet = FleetAdapter(station, telemetry, ground, every, began, picture)
        serve_fleet(
            fleet,
            station,
            WallClock(),
            began,
            address=Address(host, DEFAULT_PORT if port is None else port, insecure, not no_browser, allow),
            say=announce,
            alerts=alerts,
        )
    return 0
