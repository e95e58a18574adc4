"""Sines and the like are right, and compiled to the same bits."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from sleepcast.simulator.simd.formulas import arc_tangent, either, exponential, sine_cosine, square_within, wrap

ANGLES = np.concatenate((np.linspace(-50.0, 50.0, 40_001), np.arange(-16, 17) * (pi / 4), [0.0, -0.0, 1e-300, 3000.0]))
WAYS = np.random.default_rng(4).normal(size=(2, 40_000)) * np.random.default_rng(5).choice(
    [1e-6, 1.0, 1e6], (2, 40_000)
)


def test_sines_and_cosines_are_right_to_a_last_place() -> None:
    sine, cosine = sine_cosine(ANGLES)
    assert np.abs(sine - np.sin(ANGLES)).max() < 3e-16
    assert np.abs(cosine - np.cos(ANGLES)).max() < 3e-16
    assert [float(value[0]) for value in sine_cosine(np.zeros(1))] == [0.0, 1.0]


def test_angles_of_ways_are_right_to_a_few_last_places() -> None:
    up, across = WAYS
    assert np.abs(arc_tangent(up, across) - np.arctan2(up, across)).max() < 2e-15
    corners = np.array([(b, a) for a in (-1.0, 0.0, 1.0) for b in (-1.0, 0.0, 1.0)]).T
    assert np.abs(arc_tangent(*corners) - np.arctan2(*corners)).max() < 1e-15


def test_exponentials_are_right_to_a_last_place() -> None:
    power = np.concatenate((np.linspace(-60.0, 60.0, 40_001), [-0.0, 1e-300, -699.0, 699.0]))
    assert np.abs(exponential(power) / np.exp(power) - 1.0).max() < 5e-16
    assert exponential(np.array([0.0, -1e9, -np.inf])).tolist() == [1.0, 0.0, 0.0]


def test_wrapped_angles_lie_within_half_a_turn_and_mean_the_same() -> None:
    wrapped = wrap(ANGLES)
    assert np.abs(wrapped).max() <= pi + 1e-12
    assert np.abs(np.sin(wrapped) - np.sin(ANGLES)).max() < 1e-12


def test_squares_are_within_a_radius_just_as_their_roots_are() -> None:
    for radius in [0.0, 0.1, 1.0, np.nextafter(2.0, 3.0), *np.random.default_rng(5).uniform(0.0, 100.0, 300).tolist()]:
        greatest = square_within(radius)
        assert np.sqrt(greatest) <= radius
        assert np.sqrt(np.nextafter(greatest, np.inf)) > radius
    assert square_within(np.inf) == np.inf
    assert np.isnan(square_within(np.nan))


def test_compiled_formulas_give_the_same_bits() -> None:
    numba = pytest.importorskip("numba")
    from sleepcast.simulator.simd import compiled

    assert compiled.FASTMATH

    @numba.njit
    def one_by_one(angles, up, across, out):  # type: ignore[no-untyped-def]
        for i in range(len(angles)):
            sine, cosine = sine_cosine(angles[i])
            out[0, i], out[1, i], out[2, i] = sine, cosine, wrap(angles[i])
        for i in range(len(up)):
            out[3, i] = arc_tangent(up[i], across[i])
            out[4, i] = either(up[i] < across[i], up[i], 7.0)

    out = np.zeros((5, len(ANGLES)))
    one_by_one(ANGLES, *WAYS, out)
    up, across = WAYS
    assert out[:3].tobytes() == np.stack((*sine_cosine(ANGLES), wrap(ANGLES))).tobytes()
    rest = np.stack((arc_tangent(up, across), np.where(up < across, up, 7.0)))
    assert out[3:, : len(up)].tobytes() == rest.tobytes()
