"""The stage: a swarm of the loop as the console wants to see it, with the scene of its scenario."""

from __future__ import annotations

from collections.abc import Mapping

from sleepcast.console import Place, ReadyCommand, Scene
from sleepcast.language import Vocabulary
from sleepcast.loop import Swarm
from sleepcast.node.node import Node
from sleepcast.simulator import Scenario


class Stage:
    """`swarm` with its scene and its poses; everything else is the swarm's own."""

    def __init__(self, swarm: Swarm) -> None:
        self._swarm = swarm
        self.scene = scene_of(swarm.simulator.scenario, swarm.simulator.names)

    @property
    def minds(self) -> Mapping[str, Node]:
        return self._swarm.minds

    @property
    def vocabulary(self) -> Vocabulary:
        return self._swarm.vocabulary

    @property
    def tick(self) -> int:
        return self._swarm.simulator.tick

    def now(self) -> float:
        """Simulated seconds since the start."""
        return self._swarm.now()

    def step(self) -> None:
        """One tick."""
        self._swarm.step()

    def poses(self) -> bytes:
        """x, y (m) and heading (rad) of each robot in turn, float32, little endian."""
        bodies = self._swarm.simulator.bodies
        poses: bytes = bodies.sensed[:3].T.astype("<f4").tobytes()
        return poses


def scene_of(scenario: Scenario, names: tuple[str, ...]) -> Scene:
    """What the page shows of a scenario; names: of its robots, by their index."""
    return Scene(
        title=scenario.title,
        story=scenario.about.strip(),
        noun=f"{scenario.robots.type}s",
        names=names,
        area=(0.0, 0.0, scenario.width, scenario.height),
        unit=scenario.length_unit,
        radius=scenario.robots.geometry.radius,
        places=tuple(Place(place.title, place.x, place.y) for place in scenario.places),
        commands=tuple(ReadyCommand(c.title, c.text.strip(), c.about) for c in scenario.commands),
    )
