"""Texts of strangers that would fill the memory are refused before they are read."""

from __future__ import annotations

import time
import tracemalloc
from contextlib import suppress
from pathlib import Path

import pytest

from sleepcast.core.settings import MAX_BYTES, MAX_DEPTH, SettingsError, toml_document

MANY = 200_000


@pytest.mark.parametrize(
    "text",
    [
        "a = 1\n[" + "a." * MANY + "a]\n",
        "a = 1\n[[" + "a." * MANY + "a]]\n",
        "a = 1\n" + "b." * MANY + "a = 1\n",
        "a = 1\n" + "'b' . " * MANY + "a = 1\n",
        'a = 1\nx = { "b"' + '."b"' * MANY + " = 1 }\n",
        "a = 1\n[" + "a." * MAX_DEPTH + "a]\n" + "".join(f"k{number}=1\n" for number in range(MANY // 2)),
        "a = 1\n" + r'"\"".' * MANY + "a = 1\n",
    ],
    ids=["table", "array of tables", "key", "quoted", "inline", "many in one", "escaped"],
)
def test_tables_in_tables_without_end_are_refused(text: str) -> None:
    assert len(text) < MAX_BYTES * 1.5
    text = text[:MAX_BYTES]
    began = time.process_time()
    tracemalloc.start()
    try:
        with pytest.raises(SettingsError, match=rf"^x\.toml:2: more than {MAX_DEPTH} tables in tables"):
            toml_document(Path("x.toml"), text)
        assert tracemalloc.get_traced_memory()[1] < 16 * 1024**2
    finally:
        tracemalloc.stop()
    assert time.process_time() - began < 4.0


@pytest.mark.parametrize("mark", ["a", ".", " ", '"', "a ", "'", "a" * 70 + " ", r"\"", '"\\\\'])
def test_whatever_is_repeated_takes_as_long_as_it_is_long(mark: str) -> None:
    began = time.process_time()
    with suppress(SettingsError):
        toml_document(Path("x.toml"), (mark * MAX_BYTES)[:MAX_BYTES])
    assert time.process_time() - began < 4.0


def test_real_depths_and_sentences_are_read() -> None:
    deep = ".".join("abcdefghij")
    said = "Go. Wait. Turn. " * 10
    root = toml_document(Path("x.toml"), f'story = "{said}"\n[{deep}]\nx = 1.5\n').root()
    assert root.text("story") == said
    for name in deep.split("."):
        root = root.table(name)
    assert root.number("x") == 1.5


def test_a_key_is_shown_as_far_as_people_read() -> None:
    with pytest.raises(SettingsError) as caught, toml_document(Path("x.toml"), "a" * 500_000 + " = 1\n").root() as root:
        root.has("b")
    assert len(str(caught.value)) < 1_000
