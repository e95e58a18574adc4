"""Conversion between the Nomad's units (1/10 in, 1/10 deg) and SI; no other module converts them.

On the wire lengths are tenths of inches, angles tenths of degrees, sonar readings whole inches, and every number is a
32-bit word. Everywhere else it is metres and radians. What is too far for a word becomes the farthest that fits.
"""

from __future__ import annotations

from math import isnan, pi

INCH = 0.0254
"""m, exactly."""
TENTH = 0.00254
"""m in the wire's unit of length, a tenth of an inch."""
TENTH_DEGREE = pi / 1800.0
"""rad in the wire's unit of angle."""
FULL_TURN = 3600
"""Tenths of degrees."""
HUNDREDTHS = 100.0
"""motion_check gives lengths as hundredths of the unit of length,"""
MILLIONTHS = 1_000_000.0
"""and angles as millionths of a radian."""

NEAREST_ECHO, NOTHING_HEARD = 6, 255
"""Inches: the least that a sonar reads, and what it reads where there is nothing."""
NOTHING_NEAR = 15
"""What an infrared sensor reads where there is nothing."""
INFRARED_STEP = 24 * INCH / NOTHING_NEAR
"""m of one step of an infrared reading: nothing is seen beyond 24 inches."""
CONFIGURED_PAUSE = 0.004
"""s in the unit of a sonar's firing rate."""
REAL_TIME = 10
"""How the wire writes a simulation as fast as real time."""
FULL_BATTERY = 255

LEAST_WORD, GREATEST_WORD = -(2**31), 2**31 - 1


def word(value: float) -> int:
    """The nearest whole number that a word can hold; 0 for NaN."""
    if isnan(value):
        return 0
    return round(max(LEAST_WORD, min(GREATEST_WORD, value)))


def metres(tenths: float) -> float:
    """A length, speed or acceleration of the wire in m."""
    return tenths * TENTH


def tenths(metres: float) -> int:
    """The other way."""
    return word(metres / TENTH)


def radians(tenth_degrees: float) -> float:
    """An angle, or rate of turn, of the wire in rad."""
    return tenth_degrees * TENTH_DEGREE


def tenth_degrees(radians: float) -> int:
    """The other way, with its sign and however many turns."""
    return word(radians / TENTH_DEGREE)


def direction(radians: float) -> int:
    """A direction as tenths of degrees, 0 to 3599."""
    return round(radians / TENTH_DEGREE) % FULL_TURN


def inches(metres: float) -> int:
    """What a sonar says that has measured this, in whole inches; NaN: it has measured nothing."""
    if isnan(metres):
        return NOTHING_HEARD
    return round(max(NEAREST_ECHO, min(NOTHING_HEARD, metres / INCH)))


def infrared(metres: float) -> int:
    """What an infrared sensor says that has measured this; NaN: it has measured nothing."""
    if isnan(metres):
        return NOTHING_NEAR
    return round(max(0, min(NOTHING_NEAR, metres / INFRARED_STEP)))


def milliseconds(seconds: float) -> int:
    """A time as the clock of the sensor board gives it, which begins anew after 2**31 ms."""
    return round(seconds * 1000.0) & GREATEST_WORD


def battery(charge: float) -> int:
    """A battery from 0, empty, to 1 as its voltmeter's raw reading."""
    return round(FULL_BATTERY * max(0.0, min(1.0, charge)))


def pace(speed: float) -> int:
    """Simulated seconds in a second as the wire writes them: 10 is real time."""
    return max(1, word(REAL_TIME * speed))
