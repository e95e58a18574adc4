"""The vocabulary `nomad`: functions with Nclient's names take Nclient's units instead of SI.

`(VM 75 75)` turns the wheels at 7.5 inches a second then. Lengths, speeds, accelerations are tenths of inches, angles
tenths of degrees, the pause of `CONF_SN` is counted in steps of 4 ms. Everything else stays in SI: variables, and the
functions that Nclient does not have.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from sleepcast.nomad.units import CONFIGURED_PAUSE, TENTH, TENTH_DEGREE
from sleepcast.robot import BodyFunction, RobotModel
from sleepcast.units import NONE

NAME = "nomad"
FACTORS = {
    "VM": (TENTH, TENTH),
    "PR": (TENTH, TENTH),
    "SP": (TENTH, TENTH),
    "AC": (TENTH, TENTH),
    "DP": (TENTH, TENTH),
    "DA": (TENTH_DEGREE,),
    "PLACE_ROBOT": (TENTH, TENTH, TENTH_DEGREE),
    "CONF_SN": (CONFIGURED_PAUSE,),
}
"""What one of the wire's units is in SI, for the first arguments of a function; others are plain numbers."""


def nomad_vocabulary(model: RobotModel) -> RobotModel:
    """A robot's model with its functions in the wire's units, as far as it has them."""
    return replace(model, functions=tuple(map(_converted, model.functions)))


def _converted(function: BodyFunction) -> BodyFunction:
    factors = FACTORS.get(function.name)
    if factors is None:
        return function
    plain = (NONE,) * len(function.dimensions)
    doc = f"{function.doc} In tenths of inches, tenths of degrees, steps of 4 ms."
    return replace(function, call=_in_units(function.call, factors), dimensions=plain, doc=doc, many="")


def _in_units(call: Callable[..., float | None], factors: tuple[float, ...]) -> Callable[..., float | None]:
    def converted(body: object, *given: float) -> float | None:
        in_si = (number * factor for number, factor in zip(given, factors, strict=False))
        return call(body, *in_si, *given[len(factors) :])

    return converted
