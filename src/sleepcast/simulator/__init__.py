"""Many simulated bodies in one world, described by scenario files.

`settings`, `scenario`, `robot_settings` and `world_settings` read the files, `groups`, `signals` and `measures`
parts of them, `mission` the scripts, `gallery` finds them. `maze` draws walls; `ros_map` reads maps, in which
`outlines` finds walls; `drawing` reads SVG by `svg_paths` and `svg_values`. `world` has what is solid, `areas` tells
what lies inside, `bodies` have the robots' state.
`motion` moves them by `wheels` or without, until `bumpers` touch; `echoes` are their sonars, `senses` see lights and
hear pings. The heavy work is done by a machine of `engine`: `cones`, `contact` and `grid` in NumPy, or `fast` with its
compiled `kernels`. `simulation` puts everything together. `rehearsal` compiles before anybody waits for a tick.

`nomads` drives such bodies axis by axis, as a server of robots does: with `motors`, in worlds of `sites`, built as
`setups` say.
"""

from sleepcast.simulator.bodies.bodies import Saying
from sleepcast.simulator.bodies.body import Body
from sleepcast.simulator.bodies.safety_limits import Guard, limited, read_limits
from sleepcast.simulator.bodies.single_robot import LoneBody
from sleepcast.simulator.engine import Machine, choose
from sleepcast.simulator.rehearsal import rehearse
from sleepcast.simulator.scenario.mission import MissionError, Order, parse_mission, read_mission
from sleepcast.simulator.scenario.robot_settings import Store
from sleepcast.simulator.scenario.scenario import (
    Place,
    ReadyCommand,
    Scenario,
    find_scenario,
    load,
    read_scenario,
    scenario_names,
)
from sleepcast.simulator.scenario.settings import SettingsError
from sleepcast.simulator.scenario.world_settings import Changes
from sleepcast.simulator.simulation import Simulator
from sleepcast.simulator.world.world import Area, Circle, Polygon, Shape, Wall, World

__all__ = [
    "Area",
    "Body",
    "Changes",
    "Circle",
    "Guard",
    "LoneBody",
    "Machine",
    "MissionError",
    "Order",
    "Place",
    "Polygon",
    "ReadyCommand",
    "Saying",
    "Scenario",
    "SettingsError",
    "Shape",
    "Simulator",
    "Store",
    "Wall",
    "World",
    "choose",
    "find_scenario",
    "limited",
    "load",
    "parse_mission",
    "read_limits",
    "read_mission",
    "read_scenario",
    "rehearse",
    "scenario_names",
]
