"""The reader: text in, forms out, or a refusal.

A form is a list of forms, a name (a str, as written), a number (a tuple: its value in SI, its text as written, whether
it has no dimension), or a Label. Texts come over the air, so their length,
their nesting and the length of names are bounded.
"""

import gc
import math
import sys

MAX_TEXT = 16384
MAX_NESTING = 32
MAX_NAME = 64

_SPACE = " \t\n\r\f\v"
_DELIMITERS = _SPACE + "()'`,;\""
_FIRST = "_+*/<>=^%!?$&.:-"
_REST = "_+*/<>=^%!?$&.#:-"
_PREFIXES = {"'": "QUOTE", "`": "QUASIQUOTE", ",": "UNQUOTE"}
_MARKS = {"quote": "'", "quasiquote": "`", "unquote": ","}
_UNITS = (
    " m 1 km 1000 in 0.0254 ft 0.3048 yd 0.9144 mi 1609.344 nmi 1852 s 1 min 60 h 3600 rad 1 m/s 1 in/s 0.0254 "
    "ft/s 0.3048 m/s2 1 rad/s 1 kg 1 km/h 1000/3600 kn 1852/3600 % /100 cm /100 mm /1000 ms /1000 "
)
"""Units and their factors; those that begin with a slash divide, which rounds once: 50% is 0.5."""
_PLAIN = ("", "%", "deg", "rad")
"""Units of plain numbers, which have no dimension."""


class Refused(Exception):
    """A text that no robot could run. reason: a key of `sentences.SENTENCES`; values: what its sentence names."""

    def __init__(self, reason, *values):
        self.reason, self.values = reason, values

    def sentence(self):
        """What is wrong, for people."""
        try:
            from sleepnode.sentences import SENTENCES

            said = SENTENCES[self.reason] % self.values
        except (KeyError, MemoryError):
            said = self.reason
        unload("sentences")
        return said


def unload(name):
    """Let go of a module that was needed for a moment."""
    gc.collect()
    package = sys.modules["sleepnode"]
    if sys.modules.pop("sleepnode." + name, None) is not None and hasattr(package, name):
        delattr(package, name)
        gc.collect()


class Label:
    """A text in double quotes."""

    def __init__(self, text):
        self.text = text


def read(text):
    """The one form in a text. Raises Refused."""
    forms = read_all(text)
    if not forms:
        raise Refused("none")
    if len(forms) > 1:
        raise Refused("more")
    return forms[0]


def read_all(text):
    """Every form in a text. Raises Refused."""
    if len(text) > MAX_TEXT:
        raise Refused("long", len(text), MAX_TEXT)
    items, around, at = [], [], 0
    while at < len(text):
        c = text[at]
        at += 1
        if c in _SPACE:
            continue
        if c == ";":
            end = text.find("\n", at)
            at = len(text) if end < 0 else end
            continue
        if c == "(" or c in _PREFIXES:
            if len(around) >= MAX_NESTING:
                raise Refused("nested", MAX_NESTING)
            around.append((items, c))
            items = []
            continue
        if c == ")":
            if not around:
                raise Refused("open")
            outer, mark = around.pop()
            if mark != "(":
                raise Refused("prefix", mark)
            form, items = items, outer
        elif c == '"':
            end = text.find('"', at)
            if end < 0 or "\n" in text[at:end]:
                raise Refused("quote")
            form, at = _label(text[at:end]), end + 1
        else:
            end = at
            while end < len(text) and text[end] not in _DELIMITERS:
                end += 1
            form, at = _word(text[at - 1 : end]), end
        while around and around[-1][1] != "(":
            outer, mark = around.pop()
            form, items = [_PREFIXES[mark], form], outer
        items.append(form)
    if around:
        missing = sum([mark == "(" for _, mark in around])
        if around[-1][1] == "(":
            raise Refused("closed", missing)
        raise Refused("prefix", around[-1][1])
    return items


def _label(text):
    if len(text) > MAX_NAME:
        raise Refused("label-long", len(text), MAX_NAME)
    if any([ord(c) < 32 or 127 <= ord(c) < 160 for c in text]):
        raise Refused("label-odd")
    return Label(text)


def _word(word):
    """A number or a name."""
    body = word[1:] if word[0] in "+-" else word
    if body[:1].isdigit() or (body[:1] == "." and body[1:2].isdigit()):
        return _number(word)
    if len(word) > MAX_NAME:
        raise Refused("name-long", len(word), MAX_NAME)
    if "|" in word and not word.strip("|"):
        raise Refused("bars", word)
    if not (_is_letter(word[0]) or word[0] in _FIRST) or not all(
        [_is_letter(c) or c.isdigit() or c in _REST for c in word]
    ):
        raise Refused("name-odd", word)
    return word


def _is_letter(c):
    return "a" <= c <= "z" or "A" <= c <= "Z"


def _digits(word, at):
    while at < len(word) and "0" <= word[at] <= "9":
        at += 1
    return at


def _number(word):
    at = _digits(word, 1 if word[0] in "+-" else 0)
    if word[at : at + 1] == ".":
        at = _digits(word, at + 1)
    if word[at : at + 1] in ("e", "E"):
        begin = at + 2 if word[at + 1 : at + 2] in ("+", "-") else at + 1
        end = _digits(word, begin)
        if end > begin:
            at = end
    unit = word[at:].lower()
    if unit and not _like_unit(unit):
        raise Refused("number", word)
    value = float(word[:at])
    if unit:
        value = _to_si(value, unit)
    if value - value != 0:
        raise Refused("huge", word)
    return value, word, unit in _PLAIN


def _to_si(value, unit):
    if unit in ("deg", "deg/s"):
        return value * (math.pi / 180.0)
    at = _UNITS.find(" %s " % unit)
    if at < 0 or "0" <= unit[0] <= "9":
        raise Refused("unit", unit)
    at += len(unit) + 2
    factor, _, part = _UNITS[at : _UNITS.find(" ", at)].partition("/")
    if not factor:
        return value / float(part)
    return value * (float(factor) / float(part) if part else float(factor))


def _like_unit(unit):
    """Whether this is `%`, or letters, perhaps a slash and letters, perhaps one digit."""
    if unit == "%":
        return True
    if unit[-1].isdigit():
        unit = unit[:-1]
    parts = unit.split("/")
    return len(parts) <= 2 and all([part and all([_is_letter(c) for c in part]) for part in parts])


def head_of(form):
    """The key of the function that a list calls, "" for anything else."""
    return form[0].lower() if isinstance(form, list) and form and isinstance(form[0], str) else ""


def height(form):
    """Lists inside one another."""
    return 1 + max([height(item) for item in form] or [0]) if isinstance(form, list) else 0


def show(form, hole=None):
    """The text of a form on one line. hole: written for each part after a comma, if that is wanted."""
    if isinstance(form, list):
        head = head_of(form)
        if head in _MARKS and len(form) == 2:
            if hole is not None and head == "unquote":
                return hole
            return _MARKS[head] + show(form[1], hole)
        return "(" + " ".join([show(item, hole) for item in form]) + ")"
    if isinstance(form, Label):
        return '"' + form.text + '"'
    return form if isinstance(form, str) else form[1]


def format_number(value):
    """The shortest text that reads back to this number, unknown as UNKNOWN."""
    if value is None:
        return "UNKNOWN"
    if -1e16 < value < 1e16 and value == int(value):
        return str(int(value))
    return repr(value)
