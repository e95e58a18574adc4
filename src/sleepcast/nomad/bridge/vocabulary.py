"""The vocabulary `nomad`: functions with Nclient's names take Nclient's units instead of SI.

`(VM 75 75)` turns the wheels at 7.5 inches a second then. Lengths, speeds, accelerations are tenths of inches, angles
tenths of degrees, the pause of `CONF_SN` is counted in steps of 4 ms. Everything else stays in SI: variables, and the
functions that Nclient does not have.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from sleepcast.core.model import HostFunction
from sleepcast.core.units import ACCELERATION, LENGTH, NONE, RATE, SPEED, TIME
from sleepcast.nomad.wire.units import CONFIGURED_PAUSE, TENTH, TENTH_DEGREE
from sleepcast.robot import RobotModel

VOCABULARY = "nomad"
"""Its name for `--vocabulary`."""
TURNING = frozenset({"VM", "PR", "SP", "AC", "DP", "DA", "PLACE_ROBOT"})
"""Functions whose plain numbers are angles."""
NAMES = TURNING | {"CONF_SN"}
"""Those that take the wire's units."""
UNITS = {LENGTH: TENTH, SPEED: TENTH, ACCELERATION: TENTH, RATE: TENTH_DEGREE, TIME: CONFIGURED_PAUSE}
"""What one of the wire's units is in SI, by what it measures."""


def nomad_vocabulary(model: RobotModel) -> RobotModel:
    """A robot's model with its functions in the wire's units, as far as it has them."""
    return replace(model, functions=tuple(map(_converted, model.functions)))


def _converted(function: HostFunction) -> HostFunction:
    if function.name not in NAMES:
        return function
    angle = TENTH_DEGREE if function.name in TURNING else 1.0
    factors = tuple(angle if each is None else UNITS.get(each, angle) for each in function.dimensions)
    plain = (NONE,) * len(factors)
    doc = f"{function.doc} In tenths of inches, tenths of degrees, steps of 4 ms."
    return replace(function, call=_in_units(function.call, factors), dimensions=plain, doc=doc, many=None)


def _in_units(call: Callable[..., float | None], factors: tuple[float, ...]) -> Callable[..., float | None]:
    def converted(body: object, *given: float) -> float | None:
        return call(body, *(number * factor for number, factor in zip(given, factors, strict=False)))

    return converted
