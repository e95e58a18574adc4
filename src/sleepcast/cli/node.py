"""`sleepcast node`: one robot's mind as a process, with a real body or one in the simulator."""

from __future__ import annotations

from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path

import click

from sleepcast.api.connection import AirOptions, open_store, session_for
from sleepcast.cli.air import chosen_store, no_store_option, store_option, with_keys
from sleepcast.cli.interrupts import Interrupts
from sleepcast.cli.options import SEED, QuantityType, locked_option, restraints, tick_option
from sleepcast.cli.streams import complain
from sleepcast.core.errors import MisuseError

STANDARD, NOMAD = "standard", "nomad"
SIMULATED = "sim"
"""The scheme of a body in the simulator."""


@click.command("node")
@click.option("--name", default="r1", show_default=True, help="The robot's name.")
@click.option("--body", "uri", metavar="URI", required=True, help="The body, as nomad://HOST:PORT#1 or sim.")
@click.option(
    "--rules", metavar="FILE", type=click.Path(path_type=Path), help="Expressions to start with, or a mission script."
)
@locked_option
@click.option(
    "--datagrams", metavar="PORT", type=click.IntRange(0, 65_535), help="Receive plain datagrams of 3 numbers."
)
@click.option(
    "--ground-station", "ground", metavar="URI", help="Be a MAVLink vehicle there, as mavlink://HOST:PORT?key=FILE."
)
@click.option("--host", default="127.0.0.1", show_default=True, help="The address on which datagrams are received.")
@click.option(
    "--vocabulary",
    type=click.Choice([STANDARD, NOMAD]),
    default=STANDARD,
    show_default=True,
    help="nomad: VM, PR and the like in tenths of inches.",
)
@tick_option
@click.option("--lockstep", is_flag=True, help="For a server in lockstep: follow the server's ticks.")
@click.option("--seconds", metavar="TIME", type=QuantityType(), help="End after this time (default: at Ctrl-C).")
@click.option(
    "--id", "number", type=click.IntRange(0, 1_000_000), help="Its id in expressions (default: the number in its name)."
)
@click.option(
    "--channel", metavar="URI", help="The channel on which commands arrive, for example udp://239.255.83.76:47123."
)
@store_option
@no_store_option
@restraints
@with_keys
@click.option("--seed", type=SEED, default=0, show_default=True, help="Random seed.")
def node(
    name: str,
    uri: str,
    rules: Path | None,
    golden: Path | None,
    datagrams: int | None,
    ground: str | None,
    host: str,
    vocabulary: str,
    tick: float,
    lockstep: bool,
    seconds: float | None,
    number: int | None,
    seed: int,
    channel: str | None,
    file: Path | None,
    forgetful: bool,
    lease: str,
    limits: Path | None,
    tells: str,
    air: AirOptions,
) -> int:
    """Run one robot's mind with the body at URI until Ctrl-C, which stops the body first.

    `sim` is a body in the simulator, alone in the world of the scenario bravo; `sim:maze`, or the path of a scenario,
    is one in another world. Installed packages may add others.

    With --channel it obeys commands from the air, signed with keys that it trusts (`sleepcast send`, `sleepcast keys`).
    Lines on standard input are commands, STOP and RELEASE included. A FILE has expressions, evaluated at the start, or
    commands with their times (@10s ...). With --datagrams a datagram of three numbers as text sets `message` to TRUE
    and `m0`, `m1` and `m2` to the numbers. A body moved by a command from the air stops when no operator was heard for
    the time of --lease. With --ground-station the robot is a vehicle of a ground station such as QGroundControl or
    MAVProxy, which sees it, stops it (HOLD), releases it (GUIDED) and drives it. If this process dies, the server stops
    the robot; if the server dies, this continues without a body, and reconnects when the server is back.

    A robot on a channel resumes its state when it is restarted: its rules, groups and variables, a STOP, and the
    commands it has received are in its store, and survive a kill at any moment. --rules is for the first start only.

    \b
    Examples:
      sleepcast node --name r1 --body nomad://127.0.0.1:7019#1 --rules stop.sleep --datagrams 5001
      sleepcast node --name r2 --body nomad://127.0.0.1#2 --channel 'udp://239.255.83.76:47123?interface=lo'
      sleepcast node --name r3 --body sim --channel udp://127.255.255.255:47123 --golden keep.sleep --store r3.store
      sleepcast node --name r7 --body sim --channel 'udp://239.255.83.76:47123?interface=lo'
      sleepcast node --body nomad://127.0.0.1#2 --vocabulary nomad
      sleepcast node --body 'nomad://127.0.0.1:7019?speed=0.3#1'
      sleepcast node --body sim --ground-station 'mavlink://127.0.0.1:14550?key=vehicle.key&origin=36.6,-121.9'
    """
    _check_name(name)
    with Interrupts() as interrupts, ExitStack() as stack:
        from sleepcast.bridges import UNLIMITED, Opening, open_robot
        from sleepcast.channel.plain_datagrams import Datagrams
        from sleepcast.cli.node_life import NodeProcess, StartScript, number_in, read_start_script
        from sleepcast.mind.authority import Tells, read_lease
        from sleepcast.simulator import read_limits

        beginning, locked = (StartScript() if each is None else read_start_script(each) for each in (rules, golden))
        if locked.orders:
            raise MisuseError(f"{golden} is a mission script: locked rules have no times")
        seconds_unattended = read_lease(lease)
        listener = None if datagrams is None else stack.enter_context(Datagrams(host, datagrams))
        store_file = chosen_store(file, forgetful, air.fleet, name, channel is not None)
        store = None if store_file is None else stack.enter_context(closing(open_store(store_file, complain)))
        session = None
        if channel is not None:
            if lockstep:
                raise MisuseError("--lockstep and --channel do not go together: deadlines on the air are of real time")
            air = replace(air, channel=channel)
            session = stack.enter_context(closing(session_for(air, name, robot=True, say=complain, store=store)))
        if vocabulary == NOMAD and uri.partition(":")[0] == SIMULATED:
            raise MisuseError("a body in the simulator has the vocabulary that its scenario says: no --vocabulary")
        number = number_in(name) if number is None else number
        of_body = UNLIMITED if limits is None else read_limits(limits)
        robot = stack.enter_context(open_robot(uri, Opening(lockstep, of_body, number, seed, vocabulary)))
        station = None
        if ground is not None:
            from sleepcast.bridges.mavlink.ground_station import open_ground_station

            fastest = robot.model.limits.speed, robot.model.limits.turn_rate
            station = stack.enter_context(closing(open_ground_station(ground, number, fastest)))
        interrupts.defer()
        life = NodeProcess(
            name,
            robot,
            listener,
            session,
            store,
            number=number,
            seed=seed,
            lease=seconds_unattended,
            tells=Tells(tells),
            ground=station,
        )
        life.begin(locked, beginning)
        life.go_on(interrupts.check, 0.0 if lockstep else tick, seconds)
    return 0


def _check_name(name: str) -> None:
    from sleepcast.channel.message import MAX_NAME, is_robot_name

    if not is_robot_name(name):
        raise MisuseError(f"--name {name!r:.80}: wanted 1 to {MAX_NAME} characters without blanks, for example r1")
