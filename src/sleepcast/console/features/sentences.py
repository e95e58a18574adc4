"""Sentences beside the prompt: what an expression says in English, and the expression that a sentence means."""

from __future__ import annotations

from math import isnan
from typing import Protocol

from sleepcast.console.feature import answers
from sleepcast.console.incoming import PageMessage, Serial, Text
from sleepcast.console.outgoing import DeskMessage, ShownFinding
from sleepcast.console.view import SwarmView
from sleepcast.core.errors import with_caret
from sleepcast.language import ReadError, read
from sleepcast.language.vocabulary import ID
from sleepcast.sentences import Lexicon, ParsedSentence, from_sentence, to_sentence


class Phrase(PageMessage):
    """What an expression says, as a sentence."""

    serial: Serial
    text: Text


class Understand(PageMessage):
    """The expression that a sentence means."""

    serial: Serial
    text: Text


class Phrased(DeskMessage):
    """The sentence for an expression, "" if no sentence says it. parts: start and end in the sentence, start and end in
    the expression, of what stands for what."""

    serial: int
    sentence: str
    parts: list[tuple[int, int, int, int]]


class Understood(DeskMessage):
    """The expression that a sentence means, "" if it is not understood. unclear: which parts of it are not, or are
    probably a slip (warnings)."""

    serial: int
    text: str
    unclear: list[ShownFinding]


class SentenceSource(Protocol):
    """The swarm whose words are used."""

    @property
    def swarm(self) -> SwarmView: ...


@answers()
def phrase(source: SentenceSource, asked: Phrase) -> Phrased:
    """What an expression says."""
    try:
        sentence = to_sentence(read(asked.text), _lexicon(source.swarm))
    except ReadError:
        sentence = None
    if sentence is None:
        return Phrased(asked.serial, "", [])
    parts = [(part.start, part.end, part.shown_start, part.shown_end) for part in sentence.parts]
    return Phrased(asked.serial, sentence.text, parts)


@answers()
def understand(source: SentenceSource, asked: Understand) -> Understood:
    """What a sentence means. Raises SentenceError if it is too long."""
    heard = from_sentence(asked.text, _lexicon(source.swarm))
    return Understood(asked.serial, heard.text, _findings(heard, asked.text))


def _lexicon(swarm: SwarmView) -> Lexicon:
    """The words as they are now: user variables come with time, and the scene of robots on the air changes."""
    scene = swarm.scene
    titles = {place.key: place.name for place in scene.places if place.key}

    def number_of(name: str) -> int | None:
        if name not in scene.names:
            return None
        number = float(swarm.minds.column(ID)[scene.names.index(name)])
        return None if isnan(number) else int(number)

    return Lexicon(swarm.vocabulary, scene.noun, titles, number_of, tuple(swarm.minds.groups))


def _findings(heard: ParsedSentence, text: str) -> list[ShownFinding]:
    unclear = [("error", each) for each in heard.unclear] + [("warning", each) for each in heard.doubts]
    return [
        ShownFinding(severity, each.message, each.start, each.end, with_caret(each.message, text, each.start, each.end))
        for severity, each in unclear
    ]
