"""The colours and the scene of a recording, for other viewers: who belongs together is seen as on the page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sleepcast.api.looks import INKS, LOOKS, TYPES, bodies_of, named, of_colour, of_group
from sleepcast.loop import Swarm
from sleepcast.simulator.recording.protobuf import NANO
from sleepcast.simulator.recording.recorder import GROUPS, SCENE, Recorder
from sleepcast.simulator.recording.scene import MAX_MEMBERS, Colour, deletion, ground, half_length, members, walls

_COLOURS = tuple(map(Colour.of, INKS))
_BYTES = np.array([[round(255 * part) for part in colour] for colour in _COLOURS], np.uint8)
_INKS = np.array([look.ink for look in LOOKS])


class Painter:
    """Records colours of points, and the entities of the scene: the world whenever its walls have changed, and with
    each picture the robots of each group, and those that show a colour."""

    def __init__(self, recorder: Recorder, swarm: Swarm) -> None:
        self._recorder, self._simulator = recorder, swarm.simulator
        count = len(swarm.simulator.names)
        self._types = np.zeros(count, np.intp)
        for number, part in enumerate(swarm.simulator.bodies.of_each_type):
            self._types[part] = number % TYPES
        self._size = half_length(swarm.simulator.scenario)
        self._parts: list[tuple[str, Colour, NDArray[np.intp]]] = []
        """What is drawn of robots: the name of the entity, its colour, and who belongs to it."""
        self._drawn: set[str] = set()
        self._walls = -1
        """Which version of the walls was recorded."""
        self.paint([], bytes(count), b"")

    def begin(self) -> None:
        """Another part of the recording begins, which has none of the scene yet."""
        self._walls, self._drawn = -1, set()

    def paint(self, names: Sequence[str], groups: bytes, shown: bytes) -> None:
        """Robots look otherwise from now on.

        names: of the groups.
        groups: the number of each robot's newest one.
        shown: the colour of each; empty if there is none.
        """
        codes = np.frombuffer(groups, np.uint8)
        colours = np.frombuffer(shown or bytes(len(groups)), np.uint8)
        self._recorder.paint(_BYTES[_INKS[bodies_of(self._types, codes, colours)]])
        alone = np.where(codes, np.uint8(0), colours)
        entities = [(f"group {name}", of_group(code), codes == code) for code, name in enumerate(names, 1)]
        entities += [(named(n), of_colour(n), alone == n) for n in np.unique(alone).tolist() if n]
        parts = ((name, _COLOURS[_INKS[look]], np.flatnonzero(who)) for name, look, who in entities)
        self._parts = [part for part in parts if 0 < part[2].size <= MAX_MEMBERS]

    def picture(self, time: float) -> None:
        """Record the scene at this time (s)."""
        simulator, stamp = self._simulator, round(time * NANO)
        if self._walls != simulator.world.version:
            self._walls = simulator.world.version
            solid = walls(stamp, simulator.world.shapes.values())
            self._recorder.scene(SCENE, time, [*ground(stamp, simulator.scenario), solid])
        entities = []
        places, z = simulator.poses, simulator.heights
        for name, colour, who in self._parts:
            x, y, heading = (values[who] for values in places)
            entities.append(members(stamp, name, colour, self._size, (x, y, heading), None if z is None else z[who]))
        now = {name for name, *_ in self._parts}
        gone = [deletion(stamp, name) for name in sorted(self._drawn - now)]
        self._drawn = now
        if entities or gone:
            self._recorder.scene(GROUPS, time, entities, gone)
