"""`sleepcast bridge ros2`: a mind for every robot of a ROS 2 fleet, in one process; or a list of the robots."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from sleepcast.api.connection import CHANNEL, AirOptions
from sleepcast.cli.air import no_store_option, with_keys
from sleepcast.cli.interrupts import Interrupts
from sleepcast.cli.options import SEED, QuantityType, each_rules_option, locked_option, restraints, tick_option
from sleepcast.cli.streams import announce, complain, put
from sleepcast.core.errors import MisuseError, counted

if TYPE_CHECKING:
    from sleepcast.bridges.ros2.fleet import DiscoveredRobot, Ros2Fleet

LOOKS = 5.0
"""Seconds for which `--dry-run` looks, unless it is said: robots are found one by one, with loss more slowly."""


@click.command("ros2", short_help="Give a mind to every robot of a ROS 2 fleet.")
@click.option("--robot", "robots", metavar="NAMESPACE", multiple=True, help="Only this robot; may be repeated.")
@click.option(
    "--robots", "file", metavar="FILE", type=click.Path(path_type=Path), help="Only the robots with names in FILE."
)
@click.option(
    "--mapping", metavar="FILE", type=click.Path(path_type=Path), help="Names of topics (default: a TurtleBot's)."
)
@click.option("--domain", metavar="N", help="ROS domain (default: ROS_DOMAIN_ID, or 0).")
@click.option(
    "--discovery",
    metavar="WHERE",
    help="Where robots are: localhost, or subnet (default: ROS_AUTOMATIC_DISCOVERY_RANGE, or subnet).",
)
@click.option("--sim-time", "sim_time", is_flag=True, help="Time is what /clock says.")
@click.option("--dry-run", "dry", is_flag=True, help="List the robots and what they lack; give none a mind.")
@click.option("--json", "as_json", is_flag=True, help="With --dry-run: print the list as one JSON object.")
@click.option(
    "--channel", metavar="URI", default=CHANNEL, show_default=True, help="The channel on which commands arrive."
)
@each_rules_option
@locked_option
@tick_option
@click.option("--seconds", metavar="TIME", type=QuantityType(), help="End after this time (default: at Ctrl-C).")
@click.option(
    "--store",
    metavar="FOLDER",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for state that survives a restart (default: in your data).",
)
@no_store_option
@restraints
@with_keys
@click.option("--seed", type=SEED, default=0, show_default=True, help="Random seed.")
def ros2(
    robots: tuple[str, ...],
    file: Path | None,
    mapping: Path | None,
    domain: str | None,
    discovery: str | None,
    sim_time: bool,
    dry: bool,
    as_json: bool,
    channel: str,
    rules: Path | None,
    golden: Path | None,
    tick: float,
    seconds: float | None,
    store: Path | None,
    forgetful: bool,
    lease: str,
    limits: Path | None,
    tells: str,
    air: AirOptions,
    seed: int,
) -> int:
    """Give a mind to every robot of a ROS 2 fleet, in one process and with one participant in its domain, until Ctrl-C,
    which stops all bodies first.

    Robots are found by their topics: a namespace with the topics of the mapping is a robot, named after its namespace.
    Later ones join; a robot that goes keeps its mind, and is out of reach until it is back. With --robot or --robots
    only these get minds, at once. Each is a robot as `sleepcast node` runs it, with a store, a lease and a STOP of its
    own, and obeys commands from the air (`sleepcast send`).

    \b
    Examples:
      sleepcast bridge ros2 --dry-run
      sleepcast bridge ros2
      sleepcast bridge ros2 --robot scout1 --robot scout2 --mapping rover.toml --domain 7
      sleepcast bridge ros2 --robots fleet.txt --limits field.toml
    """
    named = _namespaces(robots, file)
    if as_json and not dry:
        raise MisuseError("--json is for the list of --dry-run")
    if forgetful and store is not None:
        raise MisuseError("--store and --no-store do not go together: leave one of them out")
    with Interrupts() as interrupts:
        from sleepcast.bridges import UNLIMITED
        from sleepcast.bridges.ros2.fleet import Ros2Fleet
        from sleepcast.bridges.ros2.mapping import TURTLEBOT
        from sleepcast.bridges.ros2.robot import LOCALHOST, join_network, ros_place
        from sleepcast.cli.fleet_life import FleetProcess, MindOptions
        from sleepcast.cli.node_life import StartScript, read_start_script
        from sleepcast.mind.authority import Tells, read_lease
        from sleepcast.simulator import read_limits

        beginning, locked = (StartScript() if each is None else read_start_script(each) for each in (rules, golden))
        if beginning.orders or locked.orders:
            raise MisuseError(f"{rules or golden} is a mission script: a fleet begins with expressions, without times")
        minds = MindOptions(
            locked,
            beginning,
            store,
            forgetful,
            UNLIMITED if limits is None else read_limits(limits),
            read_lease(lease),
            Tells(tells),
            tick,
            seed,
        )
        number, where = ros_place(domain, discovery)
        with closing(join_network(number, local=where == LOCALHOST)) as network:
            fleet = Ros2Fleet(network, mapping or TURTLEBOT, sim_time=sim_time)
            if dry:
                return _list(fleet, named, LOOKS if seconds is None else seconds, as_json)
            process = FleetProcess(fleet, replace(air, channel=channel), minds, named)
            interrupts.defer()
            how = "waits for" if named else "looks for"
            announce(f"{how} robots in ROS domain {number} ({where}); Ctrl-C stops their bodies and ends their minds")
            process.run(interrupts.check, seconds)
    return 0


def _namespaces(robots: tuple[str, ...], file: Path | None) -> list[str]:
    """The namespaces of the robots that are named, each once. Raises MisuseError for one that is none."""
    from sleepcast.bridges.ros2.mapping import is_namespace
    from sleepcast.station.roster import read_expectation

    names = [*robots, *(read_expectation(os.fspath(file)).names if file is not None else ())]
    if file is not None and len(names) == len(robots):
        raise MisuseError(f"--robots {file}: wanted a file of their names")
    namespaces = dict.fromkeys("/" + name.strip("/") if name.strip("/") else "" for name in names)
    for namespace in namespaces:
        if not is_namespace(namespace):
            raise MisuseError(f"{namespace[1:61]!r} is no namespace of ROS 2: wanted letters, digits and _, as scout3")
    return list(namespaces)


def _list(fleet: Ros2Fleet, named: list[str], seconds: float, as_json: bool) -> int:
    """Print which robots there are, and what they lack; 0 if each that is wanted is there, and one at least."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        fleet.look()
        time.sleep(min(0.1, max(0.0, end - time.monotonic())))
    seen = fleet.look()
    robots = {namespace: each for namespace, each in seen.items() if each.is_robot and namespace in (named or seen)}
    lost = [namespace for namespace in named if namespace not in robots]
    if as_json:
        put(json.dumps(_as_dict(seen, robots, lost)))
        return 1 if lost or not robots else 0
    if not seen:
        complain(fleet.nobody())
    put(f"{counted(len(robots), 'robot')} in {seconds:g} s")
    for namespace, robot in robots.items():
        wrong = [each.wrong or each.doubt for each in robot.topics if each.wrong or each.doubt]
        put(f"{namespace or '/'}: {'; '.join(wrong) if wrong else 'all topics are there'}")
    for namespace in lost if named else [each for each in seen if each not in robots]:
        lacks = seen[namespace].lacks() if namespace in seen else ["none of its topics is there"]
        put(f"{namespace or '/'} is no robot of this mapping: {'; '.join(lacks)}")
    return 1 if lost or not robots else 0


def _as_dict(
    seen: Mapping[str, DiscoveredRobot], robots: Mapping[str, DiscoveredRobot], lost: list[str]
) -> dict[str, object]:
    return {
        "robots": [_robot_dict(robot) for robot in robots.values()],
        "others": [_robot_dict(robot) for namespace, robot in seen.items() if namespace not in robots],
        "lost": lost,
    }


def _robot_dict(robot: DiscoveredRobot) -> dict[str, object]:
    topics = [
        {
            "topic": each.topic,
            "type": each.type,
            "direction": "in" if each.comes else "out",
            "wrong": each.wrong,
            "doubt": each.doubt,
        }
        for each in robot.topics
    ]
    return {"namespace": robot.namespace, "topics": topics}
