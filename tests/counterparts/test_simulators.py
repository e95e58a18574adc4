"""What other simulators do, as docs/counterparts.md says."""

from __future__ import annotations

import warnings

import numpy as np
import pytest


@pytest.mark.counterpart("mesa")
def test_in_mesa_a_seed_and_a_number_for_rng_are_the_same() -> None:
    from mesa import Model

    def drawn(**given: object) -> list[float]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that one of them will go is a word of Mesa's
            return [float(each) for each in Model(**given).rng.random(3)]

    assert drawn(seed=7) == drawn(rng=7)
    assert drawn(rng=np.random.default_rng(7)) != drawn(rng=7)
