"""`sleepcast nserver`: simulated Nomads, for programs of their day and for those of today.

Here world, server and page are put together, or, headless, the first two.
"""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from sleepcast.cli.interrupts import Interrupts
from sleepcast.cli.options import SEED, NumberRange
from sleepcast.cli.progress import compiling
from sleepcast.cli.streams import ReaderGone, announce, complain
from sleepcast.core.errors import MisuseError

if TYPE_CHECKING:
    from sleepcast.bridges.ros2.scouts import Ros2Scouts
    from sleepcast.nomad.server.nserver import Nserver, ServerPace
    from sleepcast.nomad.server.relay import RealAddress
    from sleepcast.nomad.world.nomad_world import NomadWorld
    from sleepcast.nomad.world.setup_files import WorldSetup

PAGE_PORT = 8318
"""Where the page is, unless another port is wanted: beside the other page's, so that both can be open."""
PORT = 7019
"""Where programs look for a Nomads' server."""
REAL_TIME, SLOWEST = 1.0, 0.01
"""Simulated seconds in a second."""
SCOUTS = "scout"
"""What robots are called in ROS 2, before their number."""
QUICK = 3.0
"""Times real time beyond which ticks are worth compiling."""


@click.command("nserver")
@click.argument("world", required=False, metavar="[WORLD]", type=click.Path(path_type=Path))
@click.option(
    "--setup",
    metavar="ROBOT",
    default="ideal",
    show_default=True,
    help="ideal, noisy, nomad200, or a file.",
)
@click.option(
    "--robots", metavar="N", type=click.IntRange(min=1), help="Number of robots (default: the world's, or 1)."
)
@click.option("--seed", type=SEED, help="Random seed (default: the world's).")
@click.option(
    "--crosstalk/--no-crosstalk", default=None, help="Sonars hear each other's echoes (default: as in ROBOT)."
)
@click.option(
    "--port",
    type=click.IntRange(0, 65_535),
    help=f"Port for programs; 0: any free one (default: the world's, or {PORT}).",
)
@click.option(
    "--host", "hosts", metavar="ADDRESS", multiple=True, help="Also listen here (default: this machine only)."
)
@click.option(
    "--speed",
    metavar="X",
    type=NumberRange(SLOWEST, suffix="x"),
    default=REAL_TIME,
    help="Speed, as a multiple of real time; inf: unlimited.",
)
@click.option("--lockstep", is_flag=True, help="Advance when every program waits for a tick: runs repeat.")
@click.option(
    "--tk-order", type=click.Choice(["little", "big"]), default="little", help="Byte order of programs' texts."
)
@click.option("--real", metavar="N=URI", multiple=True, help="A real robot for real_robot(): 1=nomad://host:7019#1.")
@click.option("--ros2", is_flag=True, help="Each robot is a ROS 2 robot, too: /scout1, /scout2, with /clock.")
@click.option("--namespace", metavar="NAME", help="For ROS 2: /NAME1, /NAME2 ... (default: scout).")
@click.option("--domain", metavar="N", help="For ROS 2 (default: ROS_DOMAIN_ID, or 0).")
@click.option(
    "--discovery",
    metavar="WHERE",
    help="Where they are found: localhost, or subnet (default: ROS_AUTOMATIC_DISCOVERY_RANGE, or localhost).",
)
@click.option("--may-quit", is_flag=True, help="Let programs end the server with quit_server().")
@click.option("--headless", is_flag=True, help="Without a page: get_robot_conf() is answered at once.")
@click.option(
    "--page-port", type=click.IntRange(0, 65_535), default=PAGE_PORT, show_default=True, help="0: any free one."
)
@click.option("--no-browser", is_flag=True, help="Print the page's address, but open no browser.")
@click.option("--json", "as_json", is_flag=True, help="Print as JSON where the server listens.")
def nserver(
    world: Path | None,
    setup: str,
    robots: int | None,
    seed: int | None,
    crosstalk: bool | None,
    port: int | None,
    hosts: tuple[str, ...],
    speed: float,
    lockstep: bool,
    tk_order: Literal["little", "big"],
    real: tuple[str, ...],
    ros2: bool,
    namespace: str | None,
    domain: str | None,
    discovery: str | None,
    may_quit: bool,
    headless: bool,
    page_port: int,
    no_browser: bool,
    as_json: bool,
) -> int:
    """Simulate Nomads in WORLD (a TOML file, a world.setup, a list of polygons, or a ROS map; none is an empty room)
    and serve them to programs: C programs linked with Nclient, Python ones, SLEEP nodes. The programs of the thesis
    want port 7771.

    \b
    Examples:
      sleepcast nserver
      sleepcast nserver lab.toml --setup noisy --robots 2
      sleepcast nserver world.setup --setup robot.setup
      sleepcast nserver --port 7771
      sleepcast nserver --ros2 --robots 3
      sleepcast nserver --headless --lockstep --port 0 --json
    """
    if lockstep and speed not in (REAL_TIME, inf):
        raise MisuseError("in lockstep time goes as fast as the programs ask: leave out either --lockstep or --speed")
    if not ros2 and (namespace, domain, discovery) != (None, None, None):
        raise MisuseError("--namespace, --domain and --discovery are for ROS 2: add --ros2")
    with Interrupts() as interrupts:
        import asyncio

        from sleepcast.core.clock import WallClock
        from sleepcast.nomad.server.nserver import Nserver, ServerPace, listening_places
        from sleepcast.nomad.server.windows import Windows
        from sleepcast.nomad.world.building import nomad_world

        expedite = lockstep or speed > QUICK
        given = _given(world)
        with compiling():
            simulated = nomad_world(
                given.map, setup, robots or given.robots, seed, crosstalk=crosstalk, expedite=expedite
            )
        for line in (*given.ignored, *simulated.setup.ignored):
            _say(line)
        real_robots = _real_robots(real, simulated.count)
        server = Nserver(
            simulated,
            windows=Windows(simulated.count),
            tk_order=tk_order,
            may_quit=may_quit or bool(given.may_quit),
            lockstep=lockstep,
            headless=headless,
            real=real_robots,
            say=_say,
        )
        pace = ServerPace(WallClock(), speed)
        scouts = _scouts(server, namespace or SCOUTS, domain, discovery) if ros2 else None
        addresses = listening_places(hosts)
        interrupts.release()  # from here on Ctrl-C ends the loop in good order
        title = f"{world.stem if world is not None else 'An empty room'}, {Path(setup).stem}"
        page = None if headless else _page(simulated, pace, title, page_port, browser=not no_browser, as_json=as_json)
        port = (given.port or PORT) if port is None else port
        asyncio.run(_serve(server, pace, addresses, port, page, scouts, as_json=as_json))
    return 0


def _given(world: Path | None) -> WorldSetup:
    """What a world.setup says, or that this is the world. Raises SettingsError."""
    from sleepcast.nomad.world.setup_files import SUFFIX, WorldSetup, read_world_setup

    return read_world_setup(world) if world is not None and world.suffix.casefold() == SUFFIX else WorldSetup(map=world)


def _page(
    world: NomadWorld, pace: ServerPace, title: str, port: int, *, browser: bool, as_json: bool
) -> Callable[[Nserver], Awaitable[None]]:
    """What serves the page of a server until it ends."""
    from sleepcast.console import Address
    from sleepcast.core.clock import WallClock
    from sleepcast.nomad.panes.adapter import NomadsAdapter
    from sleepcast.nomad.panes.serving import serve_nomads

    address, say = Address("127.0.0.1", port, insecure=False, browser=browser), _say if as_json else announce

    def page(server: Nserver) -> Awaitable[None]:
        shown = NomadsAdapter(server, pace, title, world.area)
        return serve_nomads(shown, WallClock(), address=address, port_option="--page-port", say=say)

    return page


async def _serve(
    server: Nserver,
    pace: ServerPace,
    hosts: Sequence[str],
    port: int,
    page: Callable[[Nserver], Awaitable[None]] | None,
    scouts: Ros2Scouts | None,
    *,
    as_json: bool,
) -> None:
    """Serve programs, ROS 2 and the page where there are any, until a program that may ends the server, or Ctrl-C."""
    from sleepcast.nomad.server.nserver import unheard

    await server.listen(hosts, port)
    if sentence := unheard(hosts):
        _say(sentence)
    robots = server.world.count
    if as_json:
        names = {"ros2": [*scouts.names]} if scouts else {}
        announce(json.dumps({"hosts": list(hosts), "port": server.port, "robots": robots, **names}))
    else:
        where = ", ".join(f"{host} port {server.port}" for host in hosts)
        if scouts:
            first, *others = (name or "one robot" for name in scouts.names)
            announce(f"ROS 2, domain {scouts.domain}: {' to '.join([first, *others[-1:]])}.")
        announce(f"{robots} robot{'s' if robots > 1 else ''} at {where}.{'' if page else ' Ctrl-C ends it.'}")
    served = server.run(pace) if page is None else page(server)
    await (served if scouts is None else scouts.beside(served))


def _scouts(server: Nserver, name: str, domain: str | None, discovery: str | None) -> Ros2Scouts:
    """The server's robots in ROS 2 from now on. Raises MisuseError, OutOfReachError."""
    from sleepcast.bridges.ros2.robot import LOCALHOST, join_network, ros_place

    number, where = ros_place(domain, discovery, LOCALHOST)
    network = join_network(number, local=where == LOCALHOST)
    if where != LOCALHOST:
        _say(f"whoever is in ROS domain {number} of this network can drive these robots: ROS 2 asks for no password")
    if server.service.lockstep:
        _say("in lockstep time goes as programs of the Nomads' wire ask: those of ROS 2 follow /clock")
    from sleepcast.bridges.ros2.scouts import Ros2Scouts, namespaces  # which is there only where the network is

    scouts = Ros2Scouts(server, network, namespaces(name, server.world.count))
    server.companions.append(scouts)
    return scouts


def _real_robots(given: Sequence[str], count: int) -> dict[int, RealAddress]:
    """The real robots of --real by the index of the simulated one. Raises MisuseError."""
    from sleepcast.nomad.server.relay import real_robot

    places = {}
    for text in given:
        number, _, uri = text.partition("=")
        if not (number.isdecimal() and 1 <= int(number) <= count):
            raise MisuseError(
                f"--real wants the number of a robot, 1 to {count}, and where it is: 1=nomad://host:7019#1"
            )
        places[int(number) - 1] = real_robot(uri)
    return places


def _say(line: str) -> None:
    """Tell the person at the terminal; the server goes on if there is none."""
    with suppress(ReaderGone):
        complain(line)
