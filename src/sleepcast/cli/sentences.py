"""`sleepcast check --sentence`: the expression of a sentence, and the sentence of an expression."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from sleepcast.cli.streams import put
from sleepcast.core.errors import MisuseError, with_caret
from sleepcast.core.records import dataclass

if TYPE_CHECKING:
    from sleepcast.sentences import Lexicon, Unclear


@dataclass(frozen=True, slots=True)
class Translation:
    """A text and what it is in the other language, "" if there is nothing; unclear: why."""

    text: str
    other: str
    unclear: tuple[Unclear, ...] = ()


def translate(sources: tuple[str, ...], scenario: str | None, as_json: bool) -> int:
    """Print each source in the other language; gives how many have nothing there."""
    if scenario is None:
        raise MisuseError(
            "--sentence needs --scenario NAME: its robots, places and variables are the words of sentences"
        )
    lexicon = lexicon_of(scenario)
    translations = [_translation(source.strip(), lexicon) for source in sources]
    if as_json:
        put(json.dumps({"sentences": list(map(_as_dict, translations))}))
    else:
        for each in translations:
            _print(each)
    return sum(not each.other for each in translations)


def lexicon_of(scenario: str) -> Lexicon:
    """The words of the robots of a scenario, by its name or file."""
    from sleepcast.loop import vocabulary_of
    from sleepcast.sentences import Lexicon
    from sleepcast.simulator import Simulator, find_scenario

    world = find_scenario(scenario)
    simulator = Simulator(world)
    numbers = {name: number for number, name in enumerate(simulator.names, 1)}
    titles = {place.name: place.title for place in world.named_points}
    return Lexicon(vocabulary_of(simulator.model), f"{world.robots.type}s", titles, numbers.get)


def _translation(text: str, lexicon: Lexicon) -> Translation:
    from sleepcast.language import ReadError, read
    from sleepcast.sentences import Unclear, from_sentence, to_sentence

    if not text.startswith("("):
        heard = from_sentence(text, lexicon)
        return Translation(text, heard.text, heard.unclear)
    try:
        sentence = to_sentence(read(text), lexicon)
    except ReadError as error:
        return Translation(text, "", (Unclear(error.start, error.end, error.reason),))
    if sentence is None:
        return Translation(text, "", (Unclear(0, len(text), "no sentence says this"),))
    return Translation(text, sentence.text)


def _print(translation: Translation) -> None:
    if translation.other:
        put(translation.other)
    for each in translation.unclear:
        put(f"not understood: {with_caret(each.message, translation.text, each.start, each.end)}")


def _as_dict(translation: Translation) -> dict[str, object]:
    unclear = [{"start": each.start, "end": each.end, "message": each.message} for each in translation.unclear]
    return {"text": translation.text, "translation": translation.other, "unclear": unclear}
