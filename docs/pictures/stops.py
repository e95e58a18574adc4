"""Where the two robots of the scenario `stop` come to rest, as three histograms in one picture.

Twenty runs each of the ideal setup and of sonars that fire one after the other and hear each other, with a pause of 24
ms and of 4 ms. The runs and their ruler are those of the tests.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests"))

from scenarios.stopping import INCH, Trial, laboratory

SETUPS = (("ideal: no cross-talk", None), ("cross-talk, pause of 24 ms", 0.024), ("cross-talk, pause of 4 ms", 0.004))
SEEDS = range(20)
ASKED = (8, 10)
"""Inches from the nearest thing at which robots are to stop."""
MOST = 35
"""Inches that the picture shows."""
LEFT, RIGHT, TOP, ROW, HEIGHT = 40, 720, 64, 118, 84
"""Of the axis, and of each histogram, in the picture's units."""
WIDTH, TALL = 760, TOP + 3 * ROW + 44
INK, FAINT, BAR, MISLED, BAND, PAPER = "#1f2933", "#7b8794", "#2f6f9f", "#c2571a", "#d9ead3", "#fcfcfa"


def distances(pause: float | None) -> list[float]:
    """How far from the nearest thing each robot of each run stopped, inches."""
    return [stop.distance / INCH for seed in SEEDS for stop in Trial(laboratory(pause), seed).run().stops]


def across(inches: float) -> float:
    return LEFT + (RIGHT - LEFT) * inches / MOST


def text(x: float, y: float, said: str, *, colour: str = INK, size: int = 13, anchor: str = "start") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}" font-size="{size}" text-anchor="{anchor}">{said}</text>'


def histogram(title: str, found: list[float], foot: float, most: int) -> list[str]:
    """One row of the picture, standing on the line at `foot`; a bar of full height is `most` robots."""
    right = sum(ASKED[0] <= each <= ASKED[1] for each in found)
    early = sum(each > ASKED[1] + 0.5 for each in found)
    parts = [
        f'<rect x="{across(ASKED[0]):.1f}" y="{foot - HEIGHT}" width="{across(ASKED[1]) - across(ASKED[0]):.1f}" '
        f'height="{HEIGHT}" fill="{BAND}"/>',
        text(RIGHT, foot - HEIGHT + 12, title, size=14, anchor="end"),
        text(RIGHT, foot - HEIGHT + 30, f"{right} of {len(found)} within 8 to 10 in, {early} too early", anchor="end"),
    ]
    for inch, count in sorted(Counter(int(each) for each in found).items()):
        tall = HEIGHT * count / most
        colour = BAR if inch < ASKED[1] else MISLED
        parts.append(
            f'<rect x="{across(inch) + 0.5:.1f}" y="{foot - tall:.1f}" width="{across(1) - LEFT - 1:.1f}" '
            f'height="{tall:.1f}" fill="{colour}"/>'
        )
        parts.append(text(across(inch + 0.5), foot - tall - 3, str(count), colour=FAINT, size=10, anchor="middle"))
    parts.append(f'<path d="M{LEFT} {foot}H{RIGHT}" stroke="{INK}"/>')
    return parts


def picture(setups: dict[str, list[float]]) -> str:
    """The picture, an SVG on paper of its own, so that it reads on a dark page as well."""
    most = max(max(Counter(int(each) for each in found).values()) for found in setups.values())
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {TALL}" width="{WIDTH}" height="{TALL}" '
        f'font-family="Helvetica, Arial, sans-serif">',
        f'<rect width="{WIDTH}" height="{TALL}" rx="8" fill="{PAPER}"/>',
        text(
            LEFT, 26, "How far from the nearest thing two Scouts stop that were told to stop within ten inches", size=15
        ),
    ]
    for row, (title, found) in enumerate(setups.items(), 1):
        parts += histogram(title, found, TOP + row * ROW - 24, most)
    foot = TOP + 3 * ROW - 24
    parts += [text(across(inch), foot + 18, str(inch), anchor="middle") for inch in range(0, MOST + 1, 5)]
    below = f"inches from the robot to the nearest thing when it stopped; {len(SEEDS)} runs of each setup"
    return "\n".join((*parts, text((LEFT + RIGHT) / 2, foot + 40, below, anchor="middle"), "</svg>\n"))


def stop(path: Path) -> None:
    """Make the runs and write the picture to `path`."""
    setups = {title: distances(pause) for title, pause in SETUPS}
    path.write_text(picture(setups), encoding="utf-8")
    for title, found in setups.items():
        print(f"{title}: {min(found):.1f} to {max(found):.1f} in, {sum(each > 10.5 for each in found)} too early")
