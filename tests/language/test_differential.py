"""Every machine against the slow, obvious reference: random expressions in one memory after the other, bit for bit.

The values, the faults in their order, what is printed, told and asked of the body, whether the message matched, and
afterwards every variable, group, rule, buffer and operator must be the same. A text that the checker refuses is not
evaluated anywhere, and must have changed nothing.
"""

from __future__ import annotations

import math
import re
from random import Random

import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from language.authors import OPERATORS, Author
from language.cases import MACHINES, Machine, NodeMachine, Outcome, Setting, within
from language.reference_forms import cost
from sleepcast.language import check, read
from sleepcast.language.functions import BUILT_IN
from sleepcast.language.reader import QUASIQUOTE, UNQUOTE
from sleepcast.language.remembering import written_out
from sleepcast.mind.limits import MAX_FAULTS
from sleepcast.node.node import Node

pytestmark = pytest.mark.usefixtures("rules_elsewhere")

EXAMPLES = max(50, settings().max_examples)
"""Memories: so many, or as many as the chosen hypothesis profile says if that is more."""
EXPLAINED = max(40, settings().max_examples // 4)
"""The same for explanations, which take one machine instead of five."""
TEXTS = 6
"""Expressions evaluated in each of them."""
NUMBERS = st.sampled_from([math.nan, 0.0, 0.25, 0.5, 1.0, 3.0, -2.0, 1e300])
SHOWN = st.fixed_dictionaries(
    {"x": st.sampled_from([0.0, 1.0, -2.0, 2.5]), "y": st.sampled_from([0.0, 0.25, 2.0])},
    optional={"opinion": NUMBERS, "colour": st.sampled_from([0.0, 1.0]), "heading": NUMBERS},
)
SETTINGS = st.builds(
    Setting,
    values=st.fixed_dictionaries(dict.fromkeys(("fuel", "x", "speed", "sonar1", "throttle"), NUMBERS)),
    number=st.integers(0, 1_000),
    seed=st.integers(0, 2**32),
    around=st.dictionaries(st.sampled_from([1.0, 2.0, 3.0, 7.0, 30.0]), SHOWN),
)


def differences(wanted: Outcome, got: Outcome) -> list[str]:
    found = []
    if wanted.value.hex() != got.value.hex():
        found.append(f"value {got.value!r}, wanted {wanted.value!r}")
    faults = wanted.faults[:MAX_FAULTS]
    if len(faults) != len(got.faults) or not all(map(within, faults, got.faults)):
        found.append(f"faults {got.faults}, wanted {faults}")
    for name in ("prints", "tells", "pings", "does", "matched"):
        if getattr(wanted, name) != getattr(got, name):
            found.append(f"{name} {getattr(got, name)}, wanted {getattr(wanted, name)}")
    return found


def state_differences(wanted: Machine, got: Machine) -> list[str]:
    here, there = wanted.state(), got.state()
    return [f"{key} {there[key]}, wanted {here[key]}" for key in here if here[key] != there[key]]


@pytest.mark.slow
@settings(max_examples=EXAMPLES)
@given(setting=SETTINGS, chance=st.randoms(use_true_random=False))
def test_every_machine_agrees_with_the_reference(setting: Setting, chance: Random) -> None:
    reference, author = MACHINES["reference"](setting), Author(chance)
    # The node is there as the twin of the fleet's first robot, which differs from it in nothing.
    others = {name: make(setting) for name, make in MACHINES.items() if name not in ("reference", "node")}
    for _ in range(TEXTS):
        text = author.whole()
        note(text)
        outcomes = {name: machine.evaluate(text) for name, machine in others.items()}
        refused = {bool(outcome.refused) for outcome in outcomes.values()}
        assert len(refused) == 1, "some machines refuse this, others do not"
        wanted = None if True in refused else reference.evaluate(text)
        for name, machine in others.items():
            found = differences(wanted, outcomes[name]) if wanted else []
            found += state_differences(reference, machine)
            assert not found, f"{name}: " + "\n".join(found)


def written(texts: int) -> list[str]:
    author = Author(Random(1))
    return [author.whole() for _ in range(texts)]


def test_the_author_writes_every_form_there_is() -> None:
    used = {name.casefold() for text in written(5_000) for name in re.findall(r"\(([^\s()]+)", text)}
    # Quasi-quotes are written as marks; what ROLLBACK brings back is made by ticks, which the node's tests let pass.
    assert set(BUILT_IN) - used == {"rollback", QUASIQUOTE, UNQUOTE}


def test_few_of_its_texts_are_refused_and_many_have_a_known_value() -> None:
    robot = MACHINES["node"](Setting(values={"fuel": 0.5, "x": 3.0, "speed": 1.0, "throttle": 0.0}))
    outcomes = [robot.evaluate(text) for text in written(1_000)]
    assert sum(bool(outcome.refused) for outcome in outcomes) < 50
    assert sum(not math.isnan(outcome.value) for outcome in outcomes) > 400
    assert sum(bool(outcome.faults) for outcome in outcomes) > 100


def test_the_static_cost_is_one_step_for_each_part_and_for_each_that_is_stored() -> None:
    robot = Node("robot", Setting().vocabulary())
    for name, count in OPERATORS:
        robot.evaluate(f"(DEFUN {name} ({' '.join('pqs'[:count])}) 1)")
    texts = [text for text in written(1_000) if "warble" not in text and f"FORGET {OPERATORS[0][0][0]}" not in text]
    texts = [text for text in texts if check(text, robot).program is not None]
    assert len(texts) > 500
    for text in texts:
        assert check(text, robot).cost == cost(written_out(read(text), lambda key: False)), text


@pytest.mark.parametrize(
    "text",
    [
        "(PROGN (RULE E5 1) active5)",
        "(PROGN (FORGET E4) active4)",
        "(PROGN (DEACTIVATE E4) active4)",
        "(PROGN (ACTIVATE E9) (OR active9 active8))",
        "(PROGN (ROLLBACK) (+ active3 active4))",
        "(PROGN (JOIN bravo) (IN bravo))",
        "(PROGN (SLEEP) (SETQ marked sleeping) (+ marked sleeping frozen))",
    ],
)
def test_an_explanation_sees_what_acts_have_set(text: str) -> None:
    robot = NodeMachine(Setting())
    robot.evaluate("(RULE E4 (+ 1 1))")
    outcome = robot.evaluate(text)
    assert robot.result.explanation.value == outcome.value


@settings(max_examples=EXPLAINED)
@given(setting=SETTINGS, chance=st.randoms(use_true_random=False))
def test_an_explanation_tells_what_the_evaluation_gave(setting: Setting, chance: Random) -> None:
    robot, author = NodeMachine(setting), Author(chance)
    for _ in range(TEXTS):
        text = author.whole()
        note(text)
        if robot.evaluate(text).refused:
            continue
        result, explained = robot.result, robot.result.explanation
        assert explained.value.hex() == result.value.hex()
        assert explained.matched == result.matched
        assert explained.faults == tuple(map(str, result.faults))
