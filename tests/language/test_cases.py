"""Every case of the standard dialect on every machine there is, and the cases themselves are sound and many."""

from __future__ import annotations

import pytest

from language.cases import MACHINES, Block, blocks, mismatch, same

pytestmark = pytest.mark.usefixtures("rules_elsewhere")

BLOCKS = blocks()
FEWEST = 300
TOPICS = {
    "areas", "arithmetic", "assignment", "body", "boolean", "bounds", "buffers", "chance", "comparison", "control",
    "choosing", "doubts", "errors", "faults", "functions_with_numbers", "groups", "instants", "neighbours",
    "operators", "population", "remembering", "rules", "scanners", "space", "speaking", "support", "units",
}  # fmt: skip


@pytest.mark.parametrize("machine", sorted(MACHINES))
@pytest.mark.parametrize("block", [pytest.param(block, id=block.title) for block in BLOCKS])
def test_a_machine_does_what_the_cases_say(block: Block, machine: str) -> None:
    robot = MACHINES[machine](block.setting)
    wrong = []
    for case in block.cases:
        if case.refusal is not None and not robot.checks:
            continue
        difference = mismatch(case, robot.evaluate(case.text), robot.checks)
        if difference:
            wrong.append(f"{case.where}: {case.text}\n    wanted {case.expected}: {difference}")
    assert not wrong, "\n" + "\n".join(wrong)


def test_there_are_many_cases_of_every_topic() -> None:
    assert sum(len(block.cases) for block in BLOCKS) >= FEWEST
    assert {block.title.partition(":")[0] for block in BLOCKS} == TOPICS


def test_no_block_is_empty_and_no_title_is_used_twice() -> None:
    titles = [block.title for block in BLOCKS]
    assert len(set(titles)) == len(titles)
    assert all(block.cases for block in BLOCKS)


@pytest.mark.parametrize(
    ("value", "written", "equal"),
    [
        (0.0, "0", True),
        (-0.0, "0", False),
        (-0.0, "-0", True),
        (float("nan"), "UNKNOWN", True),
        (0.0, "UNKNOWN", False),
        (float("nan"), "0", False),
        (0.1 + 0.2, "0.3", False),
        (0.1 + 0.2, "~0.3", True),
        (0.301, "~0.3", False),
    ],
)
def test_values_are_compared_bit_for_bit(value: float, written: str, equal: bool) -> None:
    assert same(value, written) is equal
