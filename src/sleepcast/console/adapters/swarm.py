"""A simulated swarm, as the operator's page shows it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from math import atan2, cos, hypot, inf, pi, sin, tan
from typing import cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.simulated_radio import RadioCounts
from sleepcast.console import MapLabel, NamedOutline, Outline, Scene
from sleepcast.console.adapters.fields import FieldPictures, shown_fields
from sleepcast.console.adapters.obstacles import editor_of
from sleepcast.console.adapters.relief import relief_of
from sleepcast.console.adapters.sight import senses_of, sight_now
from sleepcast.console.features.sight import SightView
from sleepcast.console.frames import packed_poses
from sleepcast.console.sensing import BodyKind, BodyView
from sleepcast.console.view import FieldPicture, Picture, PicturePlace, ShownSlider, Solids
from sleepcast.core.model import NamedArea
from sleepcast.fleet.failing import RECENT, FailingRule, failing_rules
from sleepcast.language import Vocabulary
from sleepcast.loop import Swarm
from sleepcast.loop.population import add_robot
from sleepcast.loop.swarm import Witness
from sleepcast.simulator import Area, Circle, MapPicture, Scenario, Shape, Simulator, Wall
from sleepcast.simulator.scenario.population import addable, comes_and_goes, with_room
from sleepcast.simulator.scenario.robot_settings import RobotSpec
from sleepcast.simulator.scenario.robot_types import slices
from sleepcast.simulator.scenario.sliders import Slider
from sleepcast.simulator.simd.formulas import wrap
from sleepcast.station import Station

ROUND = 32
"""Corners of a circle as it is drawn."""


class SwarmAdapter:
    """A simulated swarm as the console wants to see it (its `Swarm`)."""

    def __init__(self, swarm: Swarm, map_picture: MapPicture | None = None) -> None:
        """map_picture: that of the scenario, where this swarm came from a state, which has it no more."""
        self._swarm = swarm
        world = swarm.simulator.world
        self._world_version = world.version
        self._obstacles: Solids | None = None
        # Not the scenario's walls: the swarm may come from a snapshot.
        scenario = swarm.simulator.scenario
        self.map_picture = existing(map_picture or scenario.picture)
        now = replace(scenario, shapes=tuple(world.shapes.values()), picture=self.map_picture)
        self.editor = editor_of(swarm.simulator)
        self._names = swarm.simulator.names
        scene = scene_of(now, tuple(self._names))
        self._scene = msgspec.structs.replace(
            scene, version=self.editor.version if self.editor else None, addable=addable(scenario)
        )
        self.picture: Picture | None = None if self.map_picture is None else self.map_picture.png
        self._fields = FieldPictures(swarm.simulator)
        self.minds = swarm.fleet
        self.vocabulary: Vocabulary = swarm.vocabulary

    @property
    def scene(self) -> Scene:
        """What there is to see, with the robots that there are now."""
        if self._names is not self._swarm.simulator.names:
            self._names = self._swarm.simulator.names
            self._scene = msgspec.structs.replace(self._scene, names=tuple(self._names))
        return self._scene

    @property
    def desks(self) -> list[Station]:
        """The desks of the operators whom the run names, the first one's first."""
        return cast("list[Station]", self._swarm.desks) if self._swarm.operators else []

    @property
    def operators(self) -> list[tuple[str, str]]:
        """Those operators with their roles."""
        return [(name, role.value) for name, role in self._swarm.operators.items()]

    @property
    def tick(self) -> int:
        """Ticks since the start."""
        return self._swarm.simulator.tick

    def now(self) -> float:
        """Simulated seconds since the start."""
        return self._swarm.now()

    def send_initial_telemetry(self) -> None:
        """Let the station know how robots are at the start."""
        if self.tick == 0:
            self._swarm.send_initial_telemetry()

    def overhear(self, witness: Witness) -> RadioCounts:
        """Let it hear every message from now on; gives the counts of all copies, which grow."""
        self._swarm.witnesses.append(witness)
        return self._swarm.radio.counts

    def step(self) -> None:
        """One tick of everything."""
        self._swarm.step()

    def sensing(self, robot: int) -> BodyView:
        """What the body of this robot senses."""
        return sensing_of(self._swarm.simulator, robot)

    def sight(self, robot: int) -> SightView:
        """What this robot sees."""
        return sight_now(self._swarm.simulator, robot)

    def poses(self) -> bytes:
        """Where robots are, as of `packed_poses`."""
        simulator = self._swarm.simulator
        return packed_poses(*simulator.poses, simulator.heights)

    @property
    def add_robot(self) -> Callable[[str, float | None, float | None], str] | None:
        """Adds a robot of a type at x, y, m, and gives its name; None where none can be added."""
        return partial(add_robot, self._swarm) if self._scene.addable else None

    def obstacles(self) -> Solids | None:
        """What is solid now, once that has changed."""
        world = self._swarm.simulator.world
        if world.version != self._world_version:
            self._world_version = world.version
            self._obstacles = solids_of(world.shapes.values())
        return self._obstacles

    def field(self, name: str) -> FieldPicture:
        """A field of the scene as it is now."""
        return self._fields.of(name)

    def exhausted(self) -> NDArray[np.bool_] | None:
        """Which robots have used up one of the scene's supplies, so that they stand; None where no robot can."""
        return self._swarm.simulator.exhausted()

    def crashed(self) -> NDArray[np.bool_] | None:
        """Which robots have crashed, and lie where they fell; None where none can."""
        return self._swarm.simulator.crashed()

    @property
    def recent(self) -> float:
        """Simulated seconds after a fault for which its rule counts as failing."""
        return RECENT * self._swarm.simulator.scenario.speed_up

    def failing(self) -> list[FailingRule]:
        """The rules that fail on any robot now or have a short while ago."""
        return failing_rules(self._swarm.fleet.memory, self.now() - self.recent)

    def pings(self) -> bytes:
        """Who has pinged since this was last asked, a byte for each robot; see `Simulator.pinged`."""
        return self._swarm.simulator.pinged()

    def colours(self) -> bytes:
        """The colour that each robot shows, a byte for each; see `Simulator.colours`."""
        return self._swarm.simulator.colours()


def placed(picture: MapPicture | None) -> PicturePlace | None:
    """Where the picture lies."""
    return None if picture is None else PicturePlace(picture.x, picture.y, picture.yaw, picture.resolution)


def existing(picture: MapPicture | None) -> MapPicture | None:
    """The picture if its file is there."""
    return picture if picture is not None and picture.file.is_file() else None


def _form(spec: RobotSpec) -> str:
    """See `Scene.forms`."""
    if spec.flight is None:
        return "rover"
    return "plane" if spec.flight.stall or spec.flight.particle else "copter"


def scene_of(scenario: Scenario, names: tuple[str, ...]) -> Scene:
    """What the page draws under the robots, which have these names."""
    solid = solids_of(scenario.shapes)
    sorts = (with_room(scenario) if comes_and_goes(scenario) else scenario).each_type
    return Scene(
        title=scenario.title,
        story=" ".join(scenario.about.split()),
        noun=f"{scenario.robots.type}s",
        names=names,
        area=(0.0, 0.0, scenario.width, scenario.height),
        unit=scenario.length_unit or "m",
        sizes=tuple(
            (part.stop - part.start, spec.geometry.radius)
            for spec, part in zip(sorts, slices(sorts, len(names)), strict=True)
        ),
        forms=tuple(map(_form, sorts)) if scenario.robots.flight else (),
        cameras=tuple(tan(spec.camera / 2.0) for spec in sorts) if scenario.robots.camera else (),
        kinds=tuple(spec.type for spec in scenario.each_type) if len(scenario.each_type) > 1 else (),
        places=tuple(MapLabel(each.title, each.x, each.y, each.name) for each in scenario.named_points),
        areas=tuple(NamedOutline(area.name, _outline(area)) for area in scenario.areas),
        obstacles=solid.obstacles,
        tall=solid.tall,
        lights=tuple(MapLabel(light.title, light.x, light.y) for light in scenario.lights),
        commands=tuple(replace(each, text=each.text.strip(), blank=each.blank.strip()) for each in scenario.commands),
        blanks=tuple(shown_slider(slider) for slider in scenario.sliders if slider.live),
        repeats=scenario.repeats,
        supplies=tuple(store.name for store in scenario.robots.stores if store.reach < inf),
        picture=placed(scenario.picture),
        fields=shown_fields(scenario),
        relief=relief_of(scenario),
        senses=senses_of(scenario),
    )


def shown_slider(slider: Slider) -> ShownSlider:
    """A slider as the page shows it."""
    return ShownSlider(slider.name, slider.title, slider.unit, slider.value, slider.low, slider.high, slider.step)


def _outline(area: NamedArea) -> Outline:
    """The corners of an area; a disc has many."""
    if area.is_disc:
        x, y, radius = area.sizes
        return outlines(Circle(x, y, radius))[0]
    return tuple(zip(area.sizes[::2], area.sizes[1::2], strict=True))


def solids_of(shapes: Iterable[Shape]) -> Solids:
    """These shapes as the page draws them."""
    all_ = list(shapes)
    tall = tuple(shape.tall for shape in all_)
    return Solids(tuple(map(outlines, all_)), tall if any(each is not None for each in tall) else ())


def outlines(shape: Shape) -> tuple[Outline, ...]:
    """A shape as the page draws it. A wall goes there and back; a circle has many corners."""
    if isinstance(shape, Circle):
        angles = (2.0 * pi * corner / ROUND for corner in range(ROUND))
        return (tuple((shape.x + shape.radius * cos(angle), shape.y + shape.radius * sin(angle)) for angle in angles),)
    if isinstance(shape, Wall):
        return ((*shape.points, *shape.points[-2:0:-1]),)
    return shape.outlines if isinstance(shape, Area) else (shape.corners,)


# ---- what bodies sense


def kind_of(scenario: Scenario, spec: RobotSpec) -> BodyKind:
    """What bodies of this kind have in this scenario."""
    senses = (("neighbours", scenario.neighbours), ("pings", scenario.pings))
    most = hypot(scenario.width, scenario.height)  # a circle that lies around everything tells nothing
    reaches = tuple((name, sense.reach) for name, sense in senses if sense is not None and sense.reach < most)
    ring = spec.ring
    if ring is None:
        return BodyKind(spec.geometry.radius, spec.wheels is not None, reaches=reaches)
    return BodyKind(spec.geometry.radius, spec.wheels is not None, ring.count, ring.beam, ring.most, reaches)


def sensing_of(simulator: Simulator, robot: int) -> BodyView:
    """What the body of this robot senses now. Changes nothing that a run depends on."""
    bodies = simulator.bodies
    kind = kind_of(simulator.scenario, bodies.part_of(robot).scenario.robots)
    ranges = bodies.sonar_ranges([robot])[0, : kind.sonars].tolist() if kind.sonars else []
    x, y, heading = (float(column[robot]) for column in (bodies.x, bodies.y, bodies.heading))
    columns = (bodies.encoder_x, bodies.encoder_y, bodies.encoder_heading)
    believed_x, believed_y, believed_heading = (float(column[robot]) for column in columns)
    touched: tuple[float, ...] = ()
    if bodies.contact is not None and bodies.bumper[robot] > 0.0:
        away = atan2(float(bodies.hit_y[robot]), float(bodies.hit_x[robot])) - heading
        touched = (float(wrap(np.array([away]))[0]),)
    return kind.sensing((x, y, heading), (believed_x, believed_y, believed_heading), ranges, touched)
