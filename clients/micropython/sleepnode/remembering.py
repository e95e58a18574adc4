"""Forms that remember from tick to tick, written out in ordinary ones when a rule is stored; SHARE in `sharing.py`.

Loaded when the first text with such a form comes. In the templates M and S stand for the variables of a form, N and P
for local names, A, B and C for its arguments, and REST for those behind them.
"""

from micropython import const

from sleepnode.checker import buffer_number
from sleepnode.reader import head_of, read

_MAX_PREFIX = const(48)

_FORMS = {
    "once": ("(LET ((N A) (P (DEFVAR M FALSE))) (SETQ M (IF (KNOWN N) N P)) (WHEN (AND N (NOT P)) REST))", 1, "FALSE"),
    "held": (
        "(LET ((P (DEFVAR M))) (SETQ M (COND (A (IF (KNOWN P) P time)) (TRUE UNKNOWN)))"
        " (AND (KNOWN M) (>= (- time M) B)))",
        2,
        "UNKNOWN",
    ),
    "hysteresis": (
        "(LET ((N A) (P (DEFVAR M FALSE))) (SETQ M (COND ((>= N C) TRUE) ((<= N B) FALSE) (TRUE P))))",
        3,
        "FALSE",
    ),
    "every": (
        "(LET ((P (DEFVAR M))) (WHEN (OR (NOT (KNOWN P)) (>= time P))"
        " (SETQ M (+ (COND ((<= (- time P) A) P) (TRUE time)) A)) REST))",
        1,
        "UNKNOWN",
    ),
    "after": (
        "(LET ((P (DEFVAR M))) (IF (KNOWN P) P (SETQ M (+ time A)))"
        " (WHEN (AND (>= M 0) (>= time M)) (SETQ M -1) REST))",
        1,
        "UNKNOWN",
    ),
    "within": (
        "(LET ((P (DEFVAR M))) (LET ((N (- time (IF (KNOWN P) P (SETQ M time))))) (AND (>= N A) (< N B))))",
        2,
        "UNKNOWN",
    ),
    "age": (
        "(LET ((N A)) (DEFVAR M) (DEFVAR S)"
        " (COND ((NOT (KNOWN N)) N) ((= N M) N) (TRUE (SETQ M N) (SETQ S time))) (- time S))",
        1,
        "UNKNOWN",
    ),
}
_KEPT = ("quote", "quasiquote", "tell")


def written_out(form, checker):
    """A message with the rules that it stores written out. What they remember is set back when they are stored."""
    head = head_of(form)
    if not isinstance(form, list) or head in _KEPT:
        return form
    if len(form) == 3 and isinstance(form[1], str):
        quoted = head == "setq" and head_of(form[2]) == "quote" and len(form[2]) == 2
        if quoted or head in ("rule", "setqq"):
            key = form[1].lower()
            number = buffer_number(key)
            rule = _Rule(key if number is None else "e%d" % number, checker)
            body = rule.body(form[2][1] if quoted else form[2])
            stored = ["SETQQ" if quoted else form[0], form[1], body]
            return ["PROGN"] + rule.resets + [stored] if rule.resets else stored
    return [written_out(item, checker) for item in form]


class _Rule:
    """A rule that is written out. resets: what sets its memory back."""

    def __init__(self, key, checker):
        self.key, self.checker, self.resets = key, checker, []

    def body(self, form):
        head = head_of(form)
        if not isinstance(form, list) or head in _KEPT or head == "defun":
            return form
        if head in ("rule", "setqq"):
            return written_out(form, self.checker)
        if head == "share" and not self.checker.meaning(head):
            from sleepnode.sharing import shared

            return shared(form, self)
        inside = [self.body(item) for item in form]
        if head not in _FORMS or self.checker.meaning(head):
            return inside
        text, count, first = _FORMS[head]
        if len(form) <= count:
            return inside
        name = "%s_%s%d" % (self.key[:_MAX_PREFIX], head, len(self.resets) + 1)
        values = {"n": [name + "_now"], "p": [name + "_before"], "m": [name], "s": [name + "_since"]}
        for at, form in enumerate(inside[1:4]):
            values["abc"[at]] = [form]
        values["rest"] = inside[1 + count :]
        for variable in "ms" if head == "age" else "m":
            reset = "(PROGN (DEFVAR %s) (SETQ %s %s))" % (values[variable][0], values[variable][0], first)
            self.resets.append(read(reset))
        return filled(read(text), values)[0]


def filled(template, values):
    """A template with forms in the place of its names."""
    if isinstance(template, list):
        items = []
        for item in template:
            items += filled(item, values)
        return [items]
    if isinstance(template, str):
        return values.get(template.lower(), [template])
    return [template]
