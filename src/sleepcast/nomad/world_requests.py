"""What requests about the world do: polygons, drawing, what sensors would read elsewhere, whether a way is free."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from sleepcast.nomad import units
from sleepcast.nomad.requests import Kind
from sleepcast.nomad.session import Refusal
from sleepcast.nomad.state import BUMPER, ENTRIES, INFRARED, SONAR, ring
from sleepcast.nomad.windows import LAYERS, SENSORS, TRACES, Layer, Sketch
from sleepcast.robot import Contact, Pose, SimulatedWorld

Words = Sequence[int]
Corners = list[tuple[float, float]]

LEAST_CORNERS = 3
SEGMENT, ARC = 0, 1
"""The ways that motion_check knows."""

ERASED: dict[int, tuple[Layer, ...]] = {
    Kind.REFRESH_ALL: LAYERS,
    Kind.REFRESH_ALL_TRACES: TRACES,
    Kind.REFRESH_ACTUAL_TRACE: ("actual",),
    Kind.REFRESH_ENCODER_TRACE: ("encoder",),
    Kind.REFRESH_ALL_SENSORS: SENSORS,
    Kind.REFRESH_BUMPER_SENSOR: ("bumper",),
    Kind.REFRESH_INFRARED_SENSOR: ("infrared",),
    Kind.REFRESH_SONAR_SENSOR: ("sonar",),
    Kind.REFRESH_LASER_SENSOR: ("laser",),
    Kind.REFRESH_CLIENT_GRAPHICS: ("graphics",),
}
"""The layers of the windows that each request clears."""


def polygon(words: Words, more: int = 0) -> Corners:
    """n, x1, y1 ... xn, yn and so many more words as corners in m. Raises Refusal if that is not what they are."""
    corners = words[0]
    if corners < LEAST_CORNERS or len(words) != 1 + 2 * corners + more:
        raise Refusal(f"a polygon of {corners} corners in {len(words)} words")
    lengths = [units.metres(word) for word in words[1 : 1 + 2 * corners]]
    return list(zip(lengths[::2], lengths[1::2], strict=True))


def moved(words: Words) -> list[int]:
    """The polygon of move_obstacle, in words, after the move."""
    across, up = words[-2:]
    return [words[0], *(units.word(word + (up if place % 2 else across)) for place, word in enumerate(words[1:-2]))]


def sketch(kind: int, words: Words) -> Sketch:
    """What one of the drawing requests draws."""
    name: dict[int, Literal["robot", "line", "arc"]] = {Kind.DRAW_ROBOT: "robot", Kind.DRAW_LINE: "line"}
    lengths = {Kind.DRAW_ROBOT: 2}.get(Kind(kind), 4)
    *numbers, mode = words
    placed = [units.metres(number) for number in numbers[:lengths]]
    turned = [units.radians(number) for number in numbers[lengths:]]
    return Sketch(name.get(kind, "arc"), (*placed, *turned), mode)


def prediction(world: SimulatedWorld, robot: int, pose: Pose) -> list[int]:
    """The words of the reply to predict_sensors: an unused one, the sensors, unused ones, and an empty laser block."""
    sonars, infrared = world.predict(robot, pose)
    words = [0] * ENTRIES
    words[INFRARED:SONAR] = ring(infrared, units.infrared, units.NOTHING_NEAR)
    words[SONAR:BUMPER] = ring(sonars, units.inches, units.NOTHING_HEARD)
    return words


def checked(world: SimulatedWorld, robot: int, words: Words) -> list[int]:
    """The words of the reply to motion_check. Raises Refusal for a way of a kind that there is not."""
    start = (_hundredths(words[1]), _hundredths(words[2]))
    if words[0] == SEGMENT:
        met = world.along(robot, start, (_hundredths(words[3]), _hundredths(words[4])))
    elif words[0] == ARC:
        centre = (_hundredths(words[6]), _hundredths(words[7]))
        begin, end = words[3] / units.MILLIONTHS, words[4] / units.MILLIONTHS
        met = world.round(robot, centre, _hundredths(words[5]), begin, end)
    else:
        raise Refusal(f"motion_check knows ways of types {SEGMENT} and {ARC}, not {words[0]}")
    return [0, 0, 0, 0] if met is None else _contact(met)


def _contact(met: Contact) -> list[int]:
    x, y = (units.word(length / units.TENTH * units.HUNDREDTHS) for length in (met.x, met.y))
    return [1, x, y, units.word(met.normal * units.MILLIONTHS)]


def _hundredths(word: int) -> float:
    return units.metres(word / units.HUNDREDTHS)
