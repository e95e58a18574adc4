"""What the channel promises, on real processes in networks of their own: one small proof in every run, all of them at
night, and as large as they are meant to be with `python3 go.py test network`.

How fast it goes is for `python -m benchmarks.channel` to say; here a bar in seconds only says that it came about, and a
share in time may miss its bar a little where other work takes the processor away.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import pytest
from benchmarks.channel.__main__ import FULL, IN_NETWORKS, QUICK, show
from benchmarks.channel.lab import why_not
from benchmarks.channel.proofs import Proof
from benchmarks.report import Bar

ALWAYS = "stop"
"""The proof of what nobody may be without for a day."""
NEARLY = 80.0
REASON = why_not()
pytestmark = pytest.mark.skipif(bool(REASON), reason=f"no networks of our own here: {REASON}")


def kept(bar: Bar) -> bool:
    """Whether what was promised holds, as far as a busy machine can tell."""
    assert bar.value is not None
    if bar.unit == "%":
        return bar.value > NEARLY
    return math.isfinite(bar.value) if bar.unit == "s" else bool(bar.met)


def broken(proof: Proof) -> list[str]:
    return [bar.text for bar in proof.bars if not kept(bar)]


@pytest.fixture(scope="module")
def small(request: pytest.FixtureRequest) -> Iterator[dict[str, Future[Proof]]]:
    """Those of this run at once, as each waits for its own fleet most of the time."""
    nightly = request.config.getoption("--hypothesis-profile") == "nightly"
    wanted = sorted(IN_NETWORKS) if nightly else [ALWAYS]
    with ThreadPoolExecutor(len(wanted)) as pool:
        yield {name: pool.submit(QUICK[name]) for name in wanted}


@pytest.mark.parametrize(
    "name",
    [ALWAYS, *(pytest.param(name, marks=pytest.mark.nightly) for name in sorted(IN_NETWORKS - {ALWAYS}))],
)
def test_a_small_fleet_keeps_what_was_promised(name: str, small: dict[str, Future[Proof]]) -> None:
    proof = small[name].result()
    print(show(proof))
    assert broken(proof) == []
    assert all(len(row) == len(proof.heads) for row in proof.rows)


@pytest.mark.nightly
@pytest.mark.parametrize("name", FULL)
def test_a_thousand_robots_keep_what_was_promised(name: str) -> None:
    proof = FULL[name]()
    print(show(proof))
    assert broken(proof) == []
