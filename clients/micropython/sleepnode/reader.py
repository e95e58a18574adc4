"""The reader: text in, forms out, or a refusal.

A form is a list of forms, a name (a str, as written), a number (a tuple: its value in SI, its text as written, whether
it has no dimension), or a label in quotes (bytes). Texts come over the air, so their length,
their nesting and the length of names are bounded.
"""

import gc
import math
import sys

from micropython import const

_MAX_TEXT = const(16384)

# Refusals, by their places in `sentences.py`.
_UNIT_REFUSED = const(0)
_HUGE_REFUSED = const(1)
_NUMBER_REFUSED = const(2)
_NAME_ODD_REFUSED = const(3)
_BARS_REFUSED = const(4)
_NAME_LONG_REFUSED = const(5)
_LABEL_ODD_REFUSED = const(6)
_LABEL_LONG_REFUSED = const(7)
_PREFIX_REFUSED = const(8)
_CLOSED_REFUSED = const(9)
_QUOTE_REFUSED = const(10)
_OPEN_REFUSED = const(11)
_NESTED_REFUSED = const(12)
_LONG_REFUSED = const(13)
_MORE_REFUSED = const(14)
_NONE_REFUSED = const(15)

_MAX_NESTING = const(32)
_MAX_NAME = const(64)

_OPEN = const(40)
_CLOSE = const(41)
_QUOTE = const(34)
_SEMICOLON = const(59)
_DOT = const(46)
_SPACE = const(b" \t\n\r\f\v")
_DELIMITERS = const(b" \t\n\r\f\v()'`,;\"")
_FIRST = const(b"_+*/<>=^%!?$&.:-")
_REST = const(b"0123456789_+*/<>=^%!?$&.#:-")
_PREFIXES = {39: "quote", 96: "quasiquote", 44: "unquote"}
_MARKS = {"quote": "'", "quasiquote": "`", "unquote": ","}
_UNITS = const(
    " m 1 km 1000 in 0.0254 ft 0.3048 yd 0.9144 mi 1609.344 nmi 1852 s 1 min 60 h 3600 rad 1 m/s 1 in/s 0.0254 "
    "ft/s 0.3048 m/s2 1 rad/s 1 kg 1 km/h 1000/3600 kn 1852/3600 % /100 cm /100 mm /1000 ms /1000 "
)
"""Units and their factors; those that begin with a slash divide, which rounds once: 50% is 0.5."""
_PLAIN = const(("", "%", "deg", "rad"))
"""Units of plain numbers, which have no dimension."""


class Refused(Exception):
    """A text that no robot could run. reason: a place in `sentences.py`, or a text; values: what its sentence names."""

    def __init__(self, reason, *values):
        self.reason, self.values = reason, values

    def sentence(self):
        """What is wrong, for people."""
        if isinstance(self.reason, str):
            return self.reason
        try:
            from sleepnode.sentences import sentence

            said = sentence(self.reason) % self.values
        except MemoryError:
            said = "refused, and there is no memory to say why (%d)" % self.reason
        unload("sentences")
        return said


def unload(*names):
    """Let go of modules that were needed for a moment."""
    package, some = sys.modules["sleepnode"], False
    for name in names:
        if sys.modules.pop("sleepnode." + name, None) is not None and hasattr(package, name):
            delattr(package, name)
            some = True
    if some:
        gc.collect()


def read(text):
    """The one form in a text. Raises Refused."""
    if len(text) > _MAX_TEXT:
        raise Refused(_LONG_REFUSED, len(text), _MAX_TEXT)
    text = text.encode()
    items, around, at = [], [], 0
    while at < len(text):
        c = text[at]
        at += 1
        if c in _SPACE:
            continue
        if c == _SEMICOLON:
            end = text.find(b"\n", at)
            at = len(text) if end < 0 else end
            continue
        if c == _OPEN or c in _PREFIXES:
            if len(around) >= _MAX_NESTING:
                raise Refused(_NESTED_REFUSED, _MAX_NESTING)
            around.append((items, c))
            items = []
            continue
        if c == _CLOSE:
            if not around:
                raise Refused(_OPEN_REFUSED)
            outer, mark = around.pop()
            if mark != _OPEN:
                raise Refused(_PREFIX_REFUSED, _PREFIXES[mark])
            form, items = items, outer
        elif c == _QUOTE:
            end = text.find(b'"', at)
            if end < 0 or b"\n" in text[at:end]:
                raise Refused(_QUOTE_REFUSED)
            form, at = _label(text[at:end]), end + 1
        else:
            end = at
            while end < len(text) and text[end] not in _DELIMITERS:
                end += 1
            form, at = _word(text[at - 1 : end]), end
        while around and around[-1][1] != _OPEN:
            outer, mark = around.pop()
            form, items = [_PREFIXES[mark], form], outer
        items.append(form)
    if around:
        missing = sum([mark == _OPEN for _, mark in around])
        if around[-1][1] == _OPEN:
            raise Refused(_CLOSED_REFUSED, missing)
        raise Refused(_PREFIX_REFUSED, _PREFIXES[around[-1][1]])
    if len(items) != 1:
        raise Refused(_MORE_REFUSED if items else _NONE_REFUSED)
    return items[0]


def _label(data):
    length = len(str(data, "utf-8"))
    if length > _MAX_NAME:
        raise Refused(_LABEL_LONG_REFUSED, length, _MAX_NAME)
    if any([c < 32 or c == 127 for c in data]):
        raise Refused(_LABEL_ODD_REFUSED)
    return data


def _word(data):
    """A number or a name. (Bytes, because every character that is taken out of a text stays in memory for ever.)"""
    at = 1 if data[0] in b"+-" else 0
    dot = at < len(data) and data[at] == _DOT
    if _digits(data, at + dot) > at + dot:
        return _number(data)
    word = str(data, "utf-8")
    if len(word) > _MAX_NAME:
        raise Refused(_NAME_LONG_REFUSED, len(word), _MAX_NAME)
    if b"|" in data and not word.strip("|"):
        raise Refused(_BARS_REFUSED, word)
    if not (_is_letter(data[0]) or data[0] in _FIRST) or not all([_is_letter(c) or c in _REST for c in data]):
        raise Refused(_NAME_ODD_REFUSED, word)
    return word


def _is_letter(c):
    return 97 <= c | 32 <= 122 and c < 128


def _digits(data, at):
    while at < len(data) and 48 <= data[at] <= 57:
        at += 1
    return at


def _number(data):
    at = _digits(data, 1 if data[0] in b"+-" else 0)
    if data[at : at + 1] == b".":
        at = _digits(data, at + 1)
    if data[at : at + 1] in (b"e", b"E"):
        begin = at + 2 if data[at + 1 : at + 2] in (b"+", b"-") else at + 1
        end = _digits(data, begin)
        if end > begin:
            at = end
    word = str(data, "utf-8")
    unit = word[at:].lower()
    if unit and not _like_unit(data[at:]):
        raise Refused(_NUMBER_REFUSED, word)
    value = _nearest(word[:at])
    if unit:
        value = _to_si(value, unit)
    if value - value != 0:
        raise Refused(_HUGE_REFUSED, word)
    return value, word, unit in _PLAIN


def _nearest(word):
    """The number nearest to a text. Few digits are a whole number, multiplied or divided by a power of ten, both exact:
    so it is rounded once. The firmware's own `float` is now and then one unit of the last place off."""
    word, _, power = word.lower().partition("e")
    left, _, right = word.lstrip("+-").partition(".")
    power, digits = int(power or 0) - len(right), left + right
    if len(digits) <= 15 and -22 <= power <= 22:
        value = float(int(digits))
        value = value / float(10**-power) if power < 0 else value * float(10**power)
    else:
        from sleepnode.decimals import nearest

        value = nearest(digits, power)
        unload("decimals")
    return -value if word[:1] == "-" else value


def _to_si(value, unit):
    if unit in ("deg", "deg/s"):
        return value * (math.pi / 180.0)
    at = _UNITS.find(" %s " % unit)
    if at < 0 or unit[:1].isdigit():
        raise Refused(_UNIT_REFUSED, unit)
    at += len(unit) + 2
    factor, _, part = _UNITS[at : _UNITS.find(" ", at)].partition("/")
    if not factor:
        return value / float(part)
    return value * (float(factor) / float(part) if part else _nearest(factor))


def _like_unit(data):
    """Whether this is `%`, or letters, perhaps a slash and letters, perhaps one digit."""
    if data == b"%":
        return True
    if 48 <= data[-1] <= 57:
        data = data[:-1]
    parts = data.split(b"/")
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
    if isinstance(form, bytes):
        return '"' + str(form, "utf-8") + '"'
    return form if isinstance(form, str) else form[1]


def format_number(value):
    """The shortest text that reads back to this number, unknown as UNKNOWN."""
    if value is None:
        return "UNKNOWN"
    if -1e16 < value < 1e16 and value == int(value) and (value or math.copysign(1.0, value) > 0):
        return str(int(value))
    return _written("shortest", value)


def general(value):
    """The first digits of a number, as a fault tells them."""
    return _written("general", value)


def _written(how, value):
    from sleepnode import decimals

    text = getattr(decimals, how)(value)
    unload("decimals")
    return text
