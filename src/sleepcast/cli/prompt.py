"""The editor of the repl: history, completion from the live names, several lines, matching parentheses."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from prompt_toolkit import PromptSession
from prompt_toolkit.application import get_app
from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document
from prompt_toolkit.filters import Condition
from prompt_toolkit.history import FileHistory, History, InMemoryHistory
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.layout.processors import HighlightMatchingBracketProcessor

from sleepcast.cli.streams import complain, still_open
from sleepcast.core.files import data_folder
from sleepcast.core.units import value_in_words
from sleepcast.language import Variable
from sleepcast.language.functions import BUILT_IN
from sleepcast.language.vocabulary import unit_of

if TYPE_CHECKING:
    from sleepcast.node.node import Node

PROMPT, MORE = "sleep> ", "  ...> "
MAX_HISTORY = 1_048_576
"""Bytes of history kept from one conversation to the next: years of typing; the older half goes when it is full."""

WORD = re.compile(r"[^\s()'`,;\"]+\Z")
"""The word that ends a text."""
_ENTRY = b"\n# "


def typed_texts(node: Node, questions: Sequence[str]) -> Iterator[str]:
    """What a person types, text by text, until Ctrl-D; Ctrl-C drops the text that is being typed."""
    session: PromptSession[str] = PromptSession(
        PROMPT,
        history=history(),
        completer=NameCompleter(node, questions),
        multiline=Condition(lambda: still_open(get_app().current_buffer.text) > 0),
        prompt_continuation=MORE,
        input_processors=[HighlightMatchingBracketProcessor(chars="()")],
        key_bindings=_keys(),
    )
    while True:
        try:
            yield session.prompt()
        except KeyboardInterrupt:
            continue
        except EOFError:
            return


def _keys() -> KeyBindings:
    """Tab puts in the only name that fits, however its letters are written; else it goes through those that do."""
    keys = KeyBindings()

    @keys.add("tab")
    def complete(event: KeyPressEvent) -> None:
        buffer = event.current_buffer
        fitting = list(buffer.completer.get_completions(buffer.document, CompleteEvent(completion_requested=True)))
        if len(fitting) == 1:
            buffer.cancel_completion()
            buffer.apply_completion(fitting[0])
        elif buffer.complete_state is not None:
            buffer.complete_next()
        else:
            buffer.start_completion(insert_common_part=True)

    return keys


class WordCompleter(Completer):
    """Completes the word before the cursor."""

    def get_completions(self, document: Document, complete_event: CompleteEvent) -> Iterable[Completion]:
        """The names that begin with the word before the cursor."""
        before = document.text_before_cursor
        match = WORD.search(before)
        word = match.group() if match else ""
        if not word and not complete_event.completion_requested:
            return
        for name in self.names(before, word):
            if name.casefold().startswith(word.casefold()):
                yield Completion(name, start_position=-len(word), display_meta=self.about(name))

    @abstractmethod
    def names(self, before: str, word: str) -> Iterable[str]:
        """What may stand there.

        before: all that was typed up to the cursor.
        word: what it ends with.
        """

    @abstractmethod
    def about(self, name: str) -> str:
        """What a name is, in a few words."""


class NameCompleter(WordCompleter):
    """Completes names that the mind knows at this moment, each with what it is, and the questions of the repl."""

    def __init__(self, node: Node, questions: Sequence[str]) -> None:
        self._node, self._questions = node, questions

    def names(self, before: str, word: str) -> Iterable[str]:
        if before.startswith(":") and before == word:
            return self._questions
        return sorted({*self._node.vocabulary.names(), *self._node.heard()}, key=str.casefold)

    def about(self, name: str) -> str:
        usage = usage_of(name)
        if usage:
            return usage
        binding = self._node.vocabulary.bindings.get(name.casefold())
        if isinstance(binding, Variable):
            return value_in_words(self._node.values[binding.slot], unit_of(name, self._node.vocabulary))
        return ""


def usage_of(name: str) -> str:
    """How a function of the language is called, "" for any other name."""
    function = BUILT_IN.get(name.casefold())
    return function.usage if function is not None else ""


def history() -> History:
    """The history of earlier conversations; only of this one, with a sentence, if there is nowhere to keep it."""
    try:
        folder = data_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        file = folder / "history"
        with file.open("ab"):
            pass
        shorten(file)
        return FileHistory(str(file))
    except (OSError, RuntimeError) as error:
        complain(f"the history of this conversation will not be kept: {error}")
        return InMemoryHistory()


def shorten(file: Path, most: int = MAX_HISTORY) -> None:
    """Drop the older half of a history of more than `most` bytes, whole entries at a time."""
    data = file.read_bytes() if file.stat().st_size > most else b""
    if data:
        start = data.find(_ENTRY, len(data) - most // 2)
        shorter = file.with_suffix(".new")
        shorter.write_bytes(data[start:] if start >= 0 else b"")
        shorter.replace(file)
