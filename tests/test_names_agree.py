"""One name, one meaning: robots of every sort that come with sleepcast take a function's arguments alike, and tell a
variable in the same unit, so that a text which is right for one is right for all that have its names."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from sleepcast.bridges.crazyflie.quadcopter import model_of as crazyflie
from sleepcast.bridges.mavlink.model import COPTER, PLANE, ROVER
from sleepcast.bridges.mavlink.model import model_of as mavlink
from sleepcast.bridges.mavlink.plane import MavlinkPlane
from sleepcast.bridges.mavlink.vehicle import MavlinkVehicle
from sleepcast.bridges.ros2.mapping import TURTLEBOT, read_mapping
from sleepcast.bridges.ros2.robot import model_of as ros2
from sleepcast.core.model import HostFunction, Quantity
from sleepcast.core.units import NONE, UNITS, Dimension
from sleepcast.nomad.bridge.model import BASES
from sleepcast.nomad.bridge.model import model_of as nomad
from sleepcast.robot import Limits, RobotModel
from sleepcast.simulator import Simulator, find_scenario
from sleepcast.simulator.scenario.scenario import scenario_names

TOP = Path(__file__).parents[1]
LIMITS = Limits(1.0, 1.0, 1.0)
OF_NOMADS = {"vm", "pr", "sp", "ac", "da", "place_robot", "conf_sn"}
"""Names of the Nomad's own wire: as many numbers as its base has axes, its simulated twin's in that wire's units."""
OF_TURTLEBOTS = {"nearest"}
"""A number of the mapping for TurtleBots, and a function where there are sonars: rules of users name both."""


@dataclass(frozen=True)
class Shape:
    """How a function is called. kinds: of its arguments, as far as they are said; acts: None where it is not known."""

    least: int
    most: int
    kinds: tuple[Dimension | None, ...]
    labelled: bool = False
    acts: bool | None = None

    @classmethod
    def of(cls, found: HostFunction) -> Shape:
        most = len(found.dimensions)
        least = most if found.least is None else found.least
        return cls(least, most, found.dimensions, found.labelled, found.acts)

    def agrees(self, other: Shape) -> bool:
        """Whether a call can be right for both, and means the same."""
        count = max(self.least, other.least) <= min(self.most, other.most)
        pairs = zip(self.kinds, other.kinds, strict=False)
        kinds = all(one is None or two is None or one == two for one, two in pairs)
        acts = self.acts is None or other.acts is None or self.acts is other.acts
        return count and kinds and acts and self.labelled is other.labelled


@dataclass(frozen=True)
class Names:
    """Of one sort of robots: its functions, and the dimensions of its variables, by key; its constants."""

    whose: str
    functions: dict[str, Shape]
    sensors: dict[str, Dimension]
    actuators: dict[str, Dimension]
    constants: frozenset[str] = frozenset()

    @classmethod
    def of(cls, whose: str, model: RobotModel) -> Names:
        functions = {each.name.casefold(): Shape.of(each) for each in model.functions}
        constants = frozenset(each.name.casefold() for each in model.constants)
        return cls(whose, functions, _dimensions(model.sensors), _dimensions(model.actuators), constants)


def _dimensions(quantities: tuple[Quantity, ...]) -> dict[str, Dimension]:
    return {each.name.casefold(): UNITS[each.unit].dimension if each.unit else NONE for each in quantities}


def board() -> Names:
    """What the sample of clients/micropython links, read from its text."""
    tree = ast.parse((TOP / "clients/micropython/main.py").read_text())
    found = Names("the board's sample", {}, {}, {})
    for call in ast.walk(tree):
        match call:
            case ast.Call(func=ast.Attribute(value=ast.Name(id="body"), attr=attr), args=[name, _, *rest]):
                key, more = ast.literal_eval(name).casefold(), list(map(ast.literal_eval, rest[:1]))
                words = {word.arg: ast.literal_eval(word.value) for word in call.keywords}
                if attr == "function":
                    count = more[0] if more else words.get("arguments", 0)
                    least, acts = words.get("least", count), words.get("acts", True)
                    found.functions[key] = Shape(least, count, (), words.get("labelled", False), acts)
                elif attr in ("sensor", "actuator"):
                    unit = more[0] if more else ""
                    kinds = found.sensors if attr == "sensor" else found.actuators
                    kinds[key] = UNITS[unit].dimension if unit else NONE
    return found


def example() -> Names:
    """The bridge of examples/line_rover, read from its text: it is a package of its own."""
    tree = ast.parse((TOP / "examples/line_rover/line_rover.py").read_text())
    found = Names("examples/line_rover", {}, {}, {})
    for word in (each for each in ast.walk(tree) if isinstance(each, ast.keyword)):
        kinds = {"sensors": found.sensors, "actuators": found.actuators}.get(word.arg or "")
        for call in word.value.elts if kinds is not None and isinstance(word.value, ast.Tuple) else ():
            assert isinstance(call, ast.Call)
            name, unit = map(ast.literal_eval, call.args[:2])
            assert kinds is not None
            kinds[name.casefold()] = UNITS[unit].dimension if unit else NONE
    return found


def bridges() -> Iterator[Names]:
    yield Names.of("crazyflie", crazyflie(LIMITS))
    for modes in (COPTER, ROVER):
        yield Names.of("mavlink", mavlink(modes, LIMITS, MavlinkVehicle))
    yield Names.of("mavlink plane", mavlink(PLANE, LIMITS, MavlinkPlane))
    for base in BASES.values():
        yield Names.of(f"nomad {base.name}", nomad(base))
    yield Names.of("ros2", ros2(read_mapping(TURTLEBOT, "/robot1")))


@pytest.fixture(scope="module")
def simulated() -> list[Names]:
    found = []
    for name in scenario_names():
        if name != "calibrate":  # of the same sort as crowd
            found.append(Names.of(f"scenario {name}", Simulator(find_scenario(name)).model))
    return found


def conflicts(one: Names, other: Names) -> Iterator[str]:
    """Each name that means something else to the two."""
    for key in (one.functions.keys() & other.functions.keys()) - OF_NOMADS:
        if not one.functions[key].agrees(other.functions[key]):
            yield f"{key} of {one.whose} and {other.whose}: {one.functions[key]} and {other.functions[key]}"
    for kind in ("sensors", "actuators"):
        mine, yours = getattr(one, kind), getattr(other, kind)
        apart = [key for key in mine.keys() & yours.keys() if mine[key] != yours[key]]
        yield from (f"{key} of {one.whose} and {other.whose} in other units" for key in apart)
    for mine, yours in ((one, other), (other, one)):
        both = mine.functions.keys() & (yours.sensors.keys() | yours.actuators.keys() | yours.constants)
        yield from (f"{key}: a function of {mine.whose}, a number of {yours.whose}" for key in both - OF_TURTLEBOTS)


def test_all_sorts_of_robots_mean_the_same_by_a_name(simulated: list[Names]) -> None:
    """The board's sample had a DRIVE of one argument, where all others have two."""
    everybody = [board(), example(), *bridges(), *simulated]
    found = {text for at, one in enumerate(everybody) for other in everybody[:at] for text in conflicts(one, other)}
    assert not found


def test_the_sample_of_the_board_has_names_to_compare() -> None:
    found = board()
    assert found.functions["drive"].most == 2
    assert {"x", "speed", "fuel"} <= found.sensors.keys()
    assert found.actuators.keys() == {"lamp"}
    assert {"x", "heading", "drive_speed"} <= example().sensors.keys() | example().actuators.keys()
