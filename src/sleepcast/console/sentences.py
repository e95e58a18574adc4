"""Sentences beside the prompt: what an expression says in English, and the expression that a sentence means."""

from __future__ import annotations

from math import isnan

from sleepcast.console.outgoing import Said, ShownFinding
from sleepcast.console.view import SwarmView
from sleepcast.core.errors import with_caret
from sleepcast.language import ReadError, read
from sleepcast.language.vocabulary import ID
from sleepcast.sentences import Lexicon, ParsedSentence, from_sentence, to_sentence


class Phrased(Said):
    """The sentence for an expression, "" if no sentence says it. parts: start and end in the sentence, start and end in
    the expression, of what stands for what."""

    serial: int
    sentence: str
    parts: list[tuple[int, int, int, int]]


class Understood(Said):
    """The expression that a sentence means, "" if it is not understood. unclear: which parts of it are not, or are
    probably a slip (warnings)."""

    serial: int
    text: str
    unclear: list[ShownFinding]


class Interpreter:
    """Translates with the words of one swarm."""

    def __init__(self, swarm: SwarmView) -> None:
        self._swarm = swarm

    def phrase(self, serial: int, text: str) -> Phrased:
        """What an expression says."""
        try:
            sentence = to_sentence(read(text), self._lexicon())
        except ReadError:
            sentence = None
        if sentence is None:
            return Phrased(serial, "", [])
        parts = [(part.start, part.end, part.shown_start, part.shown_end) for part in sentence.parts]
        return Phrased(serial, sentence.text, parts)

    def understand(self, serial: int, text: str) -> Understood:
        """What a sentence means. Raises SentenceError if it is too long."""
        heard = from_sentence(text, self._lexicon())
        return Understood(serial, heard.text, _findings(heard, text))

    def _lexicon(self) -> Lexicon:
        """The words as they are now: user variables come with time, and the scene of robots on the air changes."""
        scene = self._swarm.scene
        titles = {place.key: place.name for place in scene.places if place.key}
        groups = tuple(self._swarm.minds.groups)
        return Lexicon(self._swarm.vocabulary, scene.noun, titles, self._number_of, groups)

    def _number_of(self, name: str) -> int | None:
        names = self._swarm.scene.names
        if name not in names:
            return None
        number = float(self._swarm.minds.column(ID)[names.index(name)])
        return None if isnan(number) else int(number)


def _findings(heard: ParsedSentence, text: str) -> list[ShownFinding]:
    found = [("error", each) for each in heard.unclear] + [("warning", each) for each in heard.doubts]
    return [
        ShownFinding(sort, each.message, each.start, each.end, with_caret(each.message, text, each.start, each.end))
        for sort, each in found
    ]
