"""How robots look in pictures: no two meanings look alike."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.api import looks
from sleepcast.api.looks import LOOKS, NONE, Appearance, looks_of, of_colour, of_group


def shape(look: Appearance) -> tuple[object, ...]:
    """What is left of a look without colour."""
    return tuple(look.corners), look.spot


def test_no_two_of_the_first_groups_and_colours_look_alike() -> None:
    found = [LOOKS[of_group(code)] for code in range(1, 50)] + [LOOKS[of_colour(number)] for number in range(1, 50)]
    assert all((shape(a), a.ink) != (shape(b), b.ink) for a, b in combinations(found, 2))
    assert LOOKS[of_group(50)] == LOOKS[of_group(1)]


def test_fourteen_groups_and_seven_of_each_kind_differ_without_colour() -> None:
    groups = [shape(LOOKS[of_group(code)]) for code in range(1, 15)]
    assert len(set(map(repr, groups))) == 14
    both = [*groups[:7], *(shape(LOOKS[of_colour(number)]) for number in range(1, 8))]
    assert len(set(map(repr, both))) == 14


def test_no_two_sorts_look_alike() -> None:
    sorts = LOOKS[: looks.TYPES]
    assert all((shape(a), a.ink) != (shape(b), b.ink) for a, b in combinations(sorts, 2))
    assert all(sort.points for sort in sorts)


def test_groups_come_before_colours_and_colours_before_sorts() -> None:
    with sc.open("shepherding", seed=1) as fleet:
        assert [name for _, name, _ in looks_of(fleet.swarm).entries] == ["sheep", "dog"]
        assert looks_of(fleet.swarm).bodies.tolist() == [0] * 20 + [1]
        fleet.send("(COLOUR caste)", everybody=True)
        found = looks_of(fleet.swarm)
        assert found.bodies.tolist() == [of_colour(1)] * 20 + [of_colour(2)]
        assert (found.rings == NONE).all()
        assert found.entries[2:] == [(of_colour(1), "colour 1", 20), (of_colour(2), "colour 2", 1)]
        fleet.send("(WHEN (= id 1) (JOIN a) (JOIN b))")
        fleet.send("(WHEN (= id 2) (JOIN a))")
        found = looks_of(fleet.swarm)
        assert found.bodies[:3].tolist() == [of_group(2), of_group(1), of_colour(1)]
        assert found.rings[:3].tolist() == [of_group(1), of_colour(1), NONE]
        assert ("a", 2) in [entry[1:] for entry in found.entries]
        html = fleet._repr_html_()
        assert "colour 2: 1" in html
        assert html.count('fill="none" stroke="#') == len(set(found.rings.tolist()) - {NONE})


@pytest.mark.parametrize(("value", "code"), [(1.0, 1), (254.0, 254), (0.0, 0), (2.5, 255), (-1.0, 255), (300.0, 255)])
def test_a_colour_without_a_byte_of_its_own_is_another_colour(value: float, code: int) -> None:
    with sc.open("best-of-n", seed=1, robots=3) as fleet:
        assert fleet.swarm.simulator.colours() == b""
        fleet.send(f"(COLOUR {value})", everybody=True)
        found = np.frombuffer(fleet.swarm.simulator.colours() or bytes(3), np.uint8)
        assert found.tolist() == [code] * 3


def test_more_colours_than_anybody_tells_apart_are_no_looks() -> None:
    with sc.open("best-of-n", seed=1, robots=20) as fleet:
        fleet.send("(COLOUR (MIN id 14))", everybody=True)
        assert set(looks_of(fleet.swarm).bodies.tolist()) == {of_colour(number) for number in range(1, 15)}
        fleet.send("(COLOUR id)", everybody=True)
        assert looks_of(fleet.swarm).bodies.tolist() == [0] * 20
        assert looks_of(fleet.swarm).entries == []
