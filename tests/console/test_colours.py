"""The colours of robots on the map: seen against it, and told apart by people who see colours otherwise."""

from __future__ import annotations

import re
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import sleepcast.console
from sleepcast.api.looks import INKS

STATIC = Path(sleepcast.console.__file__).parent / "static"
CSS = (STATIC / "style.css").read_text(encoding="utf-8")
LIGHT, DARK = CSS.split('data-theme="dark"')[:2]
GROUPS = range(1, 8)

# Machado, Oliveira and Fernandes (2009), at full severity, for linear RGB.
SIGHT = {
    "normal": np.eye(3),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
}
LEAST = {"normal": 16.0, "deuteranopia": 12.0, "protanopia": 12.0}
"""Distances of CIEDE2000 that any two colours have at least; a change of 2 is seen side by side."""


def linear(colour: str) -> NDArray[np.float64]:
    values = np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)]) / 255.0
    found: NDArray[np.float64] = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    return found


def luminance(colour: str) -> float:
    return float(linear(colour) @ (0.2126, 0.7152, 0.0722))


def contrast(one: str, other: str) -> float:
    """As WCAG 2 has it."""
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def lab(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    to_xyz = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.119192, 0.9503041]]
    )
    part = np.clip(rgb, 0.0, 1.0) @ to_xyz.T / to_xyz.sum(axis=1)
    f = np.where(part > (6 / 29) ** 3, np.cbrt(part), part / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def distance(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """CIEDE2000."""
    (l1, a1, b1), (l2, a2, b2) = one, other
    mean = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2
    more = 1 + 0.5 * (1 - np.sqrt(mean**7 / (mean**7 + 25**7)))
    c1, c2 = np.hypot(a1 * more, b1), np.hypot(a2 * more, b2)
    h1, h2 = (np.degrees(np.arctan2(b, a * more)) % 360 for a, b in ((a1, b1), (a2, b2)))
    turn = (h2 - h1 + 180) % 360 - 180
    hue = ((h1 + h2) / 2 + (180 if abs(h1 - h2) > 180 else 0)) % 360
    light, chroma = (l1 + l2) / 2, (c1 + c2) / 2
    angles = ((1, -30, -0.17), (2, 0, 0.24), (3, 6, 0.32), (4, -63, -0.2))
    t = 1 + sum(weight * np.cos(np.radians(times * hue + add)) for times, add, weight in angles)
    d_l = (l2 - l1) / (1 + 0.015 * (light - 50) ** 2 / np.sqrt(20 + (light - 50) ** 2))
    d_c = (c2 - c1) / (1 + 0.045 * chroma)
    d_h = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2)) / (1 + 0.015 * chroma * t)
    twist = np.sin(np.radians(60 * np.exp(-(((hue - 275) / 25) ** 2))))
    both = -2 * np.sqrt(chroma**7 / (chroma**7 + 25**7)) * twist
    return float(np.sqrt(d_l**2 + d_c**2 + d_h**2 + both * d_c * d_h))


def theme(css: str) -> dict[str, str]:
    return dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", css))


THEMES = {"light": theme(LIGHT), "dark": theme(DARK)}
ROBOTS = {name: [found[f"robot-{ink}"] for ink in range(9)] for name, found in THEMES.items()}
GROUNDS = {name: [found["map"], found["map-area"]] for name, found in THEMES.items()}
ROBOTS["pictures"], GROUNDS["pictures"] = list(INKS), ["#ffffff", "#111111"]


def test_the_distance_is_that_of_the_published_examples() -> None:
    """Two pairs of Sharma, Wu and Dalal (2005)."""
    for one, other, wanted in (
        ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
        ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
    ):
        assert distance(np.array(one), np.array(other)) == pytest.approx(wanted, abs=1e-4)


@pytest.mark.parametrize("where", ROBOTS)
def test_robots_are_seen_against_the_map(where: str) -> None:
    for colour in ROBOTS[where]:
        for ground in GROUNDS[where]:
            assert contrast(colour, ground) >= 3.0, f"{colour} on {ground}"


@pytest.mark.parametrize("sight", SIGHT)
@pytest.mark.parametrize("where", THEMES)
def test_a_field_is_read_by_its_brightness_and_hides_no_robot(where: str, sight: str) -> None:
    scale = [THEMES[where][f"field-{step}"] for step in range(5)]
    seen = [lab(np.clip(SIGHT[sight] @ linear(colour), 0.0, 1.0)) for colour in scale]
    bright = [float(each[0]) for each in seen]
    assert bright == sorted(bright, reverse=where == "light")
    assert all(distance(one, other) > 4.0 for one, other in pairwise(seen))
    for robot in ROBOTS[where]:
        assert contrast(robot, scale[-1]) >= 1.5, robot


@pytest.mark.parametrize("sight", SIGHT)
@pytest.mark.parametrize("where", ROBOTS)
def test_seven_groups_are_told_apart_by_colour(where: str, sight: str) -> None:
    for one, other in combinations([ROBOTS[where][ink] for ink in GROUPS], 2):
        seen = [lab(np.clip(SIGHT[sight] @ linear(colour), 0.0, 1.0)) for colour in (one, other)]
        assert distance(*seen) >= LEAST[sight], f"{one} and {other}"
