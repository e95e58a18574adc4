"""The words of sentences: those of the grammar, which are the same for all, and those of one fleet.

A fleet adds what its vocabulary has: variables, constants, functions of the body, and places. A place is a pair of
names `NAME_x` and `NAME_y`. It is called by its name, by its title, or by a word of its title that belongs to no other
place.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import field

from sleepcast.core.model import Constant, HostFunction
from sleepcast.core.records import dataclass
from sleepcast.core.units import UNITS
from sleepcast.language import Variable, Vocabulary

# ---- the grammar

ARTICLE = "the"
"""Has no meaning in any place."""
QUANTIFIERS = frozenset({"all", "every", "each"})
EVERYBODY = frozenset({"everybody", "everyone"})
ROBOTS = ("robots", "robot")
GROUP_WORDS = (("task", "element"), ("group",), ("team",))
"""May stand before the name of a group."""

COMPARATORS: dict[tuple[str, ...], str] = {
    ("more", "than"): ">",
    ("less", "than"): "<",
    ("at", "least"): ">=",
    ("at", "most"): "<=",
    ("exactly",): "=",
    ("greater", "than"): ">",
    ("over",): ">",
    ("above",): ">",
    ("fewer", "than"): "<",
    ("under",): "<",
    ("below",): "<",
}
"""Words for comparisons; the writer takes the first for each."""
FARTHER = (("farther", "than"), ("further", "than"))
STATES = {"frozen": "frozen", "marked": "marked", "sleeping": "sleeping"}
"""Words for flags of every robot, and the variables."""
STOPPED = "stopped"
SENDERS = ("sender", "me", "it", "them", "itself", "themselves")
"""In TELL, where the robot is that tells; the writer takes the first."""

VERBS = {
    "join": "joins",
    "leave": "leaves",
    "go": "goes",
    "stop": "stops",
    "drive": "drives",
    "freeze": "freezes",
    "thaw": "thaws",
    "sleep": "sleeps",
    "wake": "wakes",
    "mark": "marks",
    "unmark": "unmarks",
    "follow": "follows",
    "suspend": "suspends",
    "forget": "forgets",
    "set": "sets",
    "report": "reports",
    "ping": "pings",
    "say": "says",
    "tell": "tells",
}
"""What robots do: said of many, and of one."""
PLURAL = {singular: plural for plural, singular in VERBS.items()} | {plural: plural for plural in VERBS}
WITHOUT_OBJECT = {"freeze": "FREEZE", "thaw": "THAW", "sleep": "SLEEP", "wake": "WAKE", "ping": "PING"}
WITH_THEMSELVES = {"mark": "MARK", "unmark": "UNMARK"}
WITH_RULE = {"follow": "ACTIVATE", "suspend": "DEACTIVATE", "forget": "FORGET"}

OPENERS = frozenset(
    {"within", "farther", "further", "between", "with", "having", "whose", "that", "which", "who", "in", "inside"}
    | {"outside", "not", "frozen", "marked", "sleeping", "stopped", "more", "less", "at", "exactly", "greater"}
    | {"over", "above", "fewer", "under", "below"}
)
"""Words with which a condition begins."""
RESERVED = (
    OPENERS
    | QUANTIFIERS
    | EVERYBODY
    | frozenset(ROBOTS)
    | frozenset(PLURAL)
    | frozenset(SENDERS)
    | {"the", "members", "of", "and", "or", "but", "then", "than", "least", "most", "from", "to", "is", "are", "now"}
    | {"have", "has", "a", "chance", "rule", "turning", "straight", "ahead", "known", "unknown"}
)
"""Words that are no names."""

# ---- units

_TIMES = {"second": "s", "minute": "min", "hour": "h"}
_OTHERS = {
    "millisecond": "ms",
    "metre": "m",
    "meter": "m",
    "kilometre": "km",
    "kilometer": "km",
    "centimetre": "cm",
    "centimeter": "cm",
    "millimetre": "mm",
    "millimeter": "mm",
    "yard": "yd",
    "mile": "mi",
    "knot": "kn",
    "degree": "deg",
    "radian": "rad",
    "kilogram": "kg",
    "kilogramme": "kg",
}
UNIT_WORDS: dict[str, str] = {
    **{unit: unit for unit in UNITS if unit != "in"},
    **{word + ending: unit for word, unit in {**_TIMES, **_OTHERS}.items() for ending in ("", "s")},
    "inch": "in",
    "inches": "in",
    "foot": "ft",
    "feet": "ft",
    "percent": "%",
}
"""Words that stand after a number. `in` alone is none: it begins "in bravo"."""


def _nobody(name: str) -> int | None:
    return None


@dataclass(frozen=True)
class Lexicon:
    """The words of one fleet.

    noun: what its robots are called, in the plural.
    titles: of places, by their names.
    number_of: the number (the variable `id`) of the robot with a name, None if there is no such robot.
    groups: of which robots have heard.
    """

    vocabulary: Vocabulary
    noun: str = ROBOTS[0]
    titles: Mapping[str, str] = field(default_factory=dict)
    number_of: Callable[[str], int | None] = _nobody
    groups: Collection[str] = ()

    @property
    def nouns(self) -> tuple[str, str]:
        """What robots are called: many, and one."""
        return self.noun, self.noun[:-1] if self.noun.endswith("s") else self.noun

    def name(self, word: str) -> str | None:
        """The variable or constant that is called so, as it was declared; None if there is none."""
        key = word.casefold()
        if key in RESERVED:
            return None
        binding = self.vocabulary.bindings.get(key)
        if isinstance(binding, Variable | Constant):
            return binding.name
        return word if key in self.vocabulary.user_slots else None

    def names(self) -> list[str]:
        """All variables and constants, for suggestions."""
        bindings = self.vocabulary.bindings.values()
        return [*(each.name for each in bindings if not isinstance(each, HostFunction)), *self.vocabulary.user_slots]

    def function(self, name: str) -> HostFunction | None:
        """The function of the robots' bodies with this name."""
        binding = self.vocabulary.bindings.get(name.casefold())
        return binding if isinstance(binding, HostFunction) else None

    def action(self, word: str) -> HostFunction | None:
        """The function without arguments that a verb names: WANDER for "wander" and "wanders"."""
        for name in (word, word.removesuffix("s")):
            function = self.function(name)
            if function is not None and not function.dimensions and function.acts:
                return function
        return None

    def places(self) -> dict[tuple[str, ...], str]:
        """The names of places, by the words that they are called by."""
        names = {*self.vocabulary.bindings, *self.vocabulary.user_slots}
        places = [key[:-2] for key in names if key.endswith("_x") and f"{key[:-2]}_y" in names and len(key) > 2]
        titles = {key.casefold(): words_of(title) for key, title in self.titles.items()}
        called: dict[tuple[str, ...], set[str]] = {}
        for place in places:
            title = titles.get(place, ())
            for phrase in {title, *((word,) for word in title if word not in RESERVED)} - {()}:
                called.setdefault(phrase, set()).add(place)
        alone = {phrase: whose.pop() for phrase, whose in called.items() if len(whose) == 1}
        return alone | {(place,): place for place in places if place not in RESERVED}

    def place_titles(self) -> dict[str, str]:
        """How each place is called in writing: by its title, if it has one that no other place has."""
        titles = {key.casefold(): title for key, title in self.titles.items()}
        called = self.places()
        shown = {}
        for place in set(called.values()):
            title = titles.get(place, "")
            shown[place] = title if called.get(words_of(title)) == place else place
        return shown


def words_of(title: str) -> tuple[str, ...]:
    """The words of a title as they are compared."""
    return tuple(word for word in title.casefold().split() if word != ARTICLE)
