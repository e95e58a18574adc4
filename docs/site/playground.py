"""The playground of the language's page: one robot on paper, to which a reader says expressions.

It runs in the reader's browser, where Pyodide is the Python: static/playground/worker.js calls it, so it imports the
standard library only. An expression is rehearsed, as a preview on a desk does it: nothing is kept, and what a robot
would do is only told.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import nan
from random import Random

from sleepcast.core.errors import MisuseError, and_more
from sleepcast.core.model import Constant, HostFunction, Quantity
from sleepcast.core.units import SPEED
from sleepcast.language import FreshNames, Number, ReadError, Rehearsal, Vocabulary, check, format_value, read
from sleepcast.language import rehearse as explained
from sleepcast.language.parts import Part, host_of
from sleepcast.language.reader import show
from sleepcast.language.vocabulary import MARKING

SENSORS = (
    Quantity("fuel", low=0, high=1, shown_as="%"),
    Quantity("ordnance", low=0, high=1, shown_as="%"),
    Quantity("x", "m"),
    Quantity("y", "m"),
    Quantity("speed", "m/s"),
    Quantity("sonar1", "m", low=0),
    Quantity("sonar2", "m", low=0),
    Quantity("sonar3", "m", low=0),
    Quantity("vessel_x", "m"),
    Quantity("vessel_y", "m"),
)
ROBOT = Vocabulary(
    "robot",
    SENSORS,
    (Quantity("throttle", low=0, high=1), Quantity("lamp")),
    constants=(Constant("FRONT", 1.0), Constant("REAR", 2.0)),
    functions=(
        HostFunction("VM", lambda robot, right, left: None, (SPEED, SPEED), arguments="right left"),
        HostFunction("ST", lambda robot: None),
        HostFunction("TK", lambda robot, text: None, labelled=True, arguments='"text"'),
        HostFunction("SONAR", lambda robot, i: robot.sonar(i), (None,), arguments="i", acts=False),
    ),
)
"""The robot of the page's examples, which also knows where the vessel is."""
SONAR1 = ROBOT.first_sensor + [sensor.name for sensor in SENSORS].index("sonar1")


class PaperRobot(Rehearsal):
    """A rehearsal that notes what a robot would have done."""

    def __init__(self, values: list[float]) -> None:
        super().__init__(values, draw=Random().random)
        self.deeds: list[str] = []

    def sonar(self, number: float) -> float:
        return self.values[SONAR1 + int(number) - 1] if number in (1, 2, 3) else nan

    def host(self, part: Part, *arguments: float) -> float:
        function = host_of(part)
        if not function.acts:
            value = function.call(self, *arguments)
            return nan if value is None else float(value)
        if any(argument != argument for argument in arguments):
            return self.fault(part, f"{function.name} is not asked: an argument is unknown")
        return self._noted(part, 1.0)

    def act(self, part: Part, *arguments: float) -> float:
        return self._noted(part, super().act(part, *arguments))

    def store(self, part: Part, value: float) -> float:
        return self._noted(part, super().store(part, value))

    def write(self, part: Part, value: float) -> float:
        return self._noted(part, super().write(part, value))

    def define(self, part: Part, value: float) -> float:
        return self._noted(part, super().define(part, value))

    def _noted(self, part: Part, value: float) -> float:
        """`value`, after the deed of `part`, unless it came to nothing."""
        if value == value:
            self.deeds.append(show(part.form))
        return value


def answer(text: str, readings: Mapping[str, str]) -> str:
    """What an expression gives on a robot with these readings, as JSON for the page."""
    try:
        values = measured(readings)
        checked = check(text, FreshNames(ROBOT))
    except MisuseError as error:
        return json.dumps({"error": str(error)})
    said = [f"{finding.severity}: {finding.render(text)}" for finding in checked.findings] + and_more(checked.more)
    if checked.program is None:
        return json.dumps({"error": "\n".join(said)})
    robot = PaperRobot(values)
    found = explained(checked.program, robot)
    return json.dumps(
        {
            "value": format_value(found.value),
            "said": [*said, *(f"fault: {fault}" for fault in found.faults)],
            "deeds": robot.deeds,
            "course": found.render(),
        }
    )


def measured(readings: Mapping[str, str]) -> list[float]:
    """The values of a robot's variables. Raises MisuseError."""
    values = [0.0] * ROBOT.first_sensor + [nan] * (ROBOT.size - ROBOT.first_sensor)
    values[MARKING] = 1.0
    for slot, sensor in enumerate(SENSORS, ROBOT.first_sensor):
        written = readings.get(sensor.name, "").strip()
        if not written:
            continue
        try:
            form = read(written)
        except ReadError as error:
            raise MisuseError(f"{sensor.name}: {error}") from error
        if not isinstance(form, Number):
            raise MisuseError(f'{sensor.name}: "{written}" is no number, perhaps with a unit, such as 80% or 5mi')
        if form.dimension not in (None, sensor.dimension):
            raise MisuseError(f"{sensor.name}: {form.unit} does not fit; wanted a number in {sensor.unit or '%'}")
        values[slot] = form.value
    return values
