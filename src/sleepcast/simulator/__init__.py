"""Many simulated bodies in one world, described by scenario files.

simd       vectors, formulas and compiled kernels for the heavy computations
world      solid things and where they come from: shapes, mazes, drawings, maps; the grid that finds neighbours
scenario   scenario files, robot types, missions
sonar      cones, noise, firing order and cross-talk, in NumPy and as kernels
motion     driving, steps and contact, in NumPy and as kernels
engine     array backends: NumPy always, or `fast` with the kernels
bodies     the robots' state as columns; their sonars, bumpers and sensors
simulation the simulator itself; `snapshot` saves and resumes it, `recording` writes runs to files and reads them

Each imports only what stands above it; tests/test_layout.py checks that.
"""

import numpy as np  # noqa: F401 - first: deep down in imports of imports, its own take Python twice as long

from sleepcast.core.settings import SettingsError
from sleepcast.simulator.bodies.bodies import Bodies, Saying
from sleepcast.simulator.bodies.body import Body, FlyingBody
from sleepcast.simulator.bodies.payload import Payload
from sleepcast.simulator.engine import Machine, choose
from sleepcast.simulator.kernel_warm_up import KERNELS, compile_kernels, keep_kernels, kernel_count, load_kernels
from sleepcast.simulator.scenario.mission import MissionError, Order, parse_mission, read_mission
from sleepcast.simulator.scenario.robot_settings import Supply
from sleepcast.simulator.scenario.robot_types import later_starts, named_by_starts
from sleepcast.simulator.scenario.scenario import (
    Place,
    Scenario,
    ScenarioOfSeeds,
    added_scenarios,
    find_scenario,
    load,
    read_scenario,
    scenario_names,
)
from sleepcast.simulator.scenario.world_settings import Changes
from sleepcast.simulator.simulation import Simulator
from sleepcast.simulator.single_robot import SafetyLimits, SingleRobot, limited, read_limits
from sleepcast.simulator.world.map_picture import MapPicture
from sleepcast.simulator.world.world import Area, Circle, Polygon, Shape, Wall, World

__all__ = [
    "KERNELS",
    "Area",
    "Bodies",
    "Body",
    "Changes",
    "Circle",
    "FlyingBody",
    "Machine",
    "MapPicture",
    "MissionError",
    "Order",
    "Payload",
    "Place",
    "Polygon",
    "SafetyLimits",
    "Saying",
    "Scenario",
    "ScenarioOfSeeds",
    "SettingsError",
    "Shape",
    "Simulator",
    "SingleRobot",
    "Supply",
    "Wall",
    "World",
    "added_scenarios",
    "choose",
    "compile_kernels",
    "find_scenario",
    "keep_kernels",
    "kernel_count",
    "later_starts",
    "limited",
    "load",
    "load_kernels",
    "named_by_starts",
    "parse_mission",
    "read_limits",
    "read_mission",
    "read_scenario",
    "scenario_names",
]
