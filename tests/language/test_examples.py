"""Every built-in has an example that a person may type, and it gives what is said."""

from __future__ import annotations

import pytest

from sleepcast.cli.standard_memory import StandardMemory
from sleepcast.language import check
from sleepcast.language.functions import BUILT_IN, EXAMPLES

SENT = {"AFTER-ISSUE"}
"""What counts from the issue of a message, so that it is a fault by itself."""


def test_every_function_has_an_example() -> None:
    assert {name.casefold() for name in EXAMPLES} == set(BUILT_IN)


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_gives_what_is_said(name: str) -> None:
    text, value = EXAMPLES[name]
    memory = StandardMemory()
    assert [finding.message for finding in check(text, memory.node).findings] == []
    outcome = memory.evaluate(text)
    assert (outcome.value, outcome.status) == (value, int(name in SENT)), outcome
    assert name in text or name in ("UNQUOTE",)
