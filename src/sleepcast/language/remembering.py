"""Forms that remember from tick to tick: ONCE, HELD, HYSTERESIS, EVERY, AFTER, WITHIN, AGE and SHARE.

A rule is evaluated in every tick, and these say when it shall do something. Each is written out in ordinary forms and
user variables when the rule is stored, so that robots know nothing else: what a rule remembers is seen among the
robot's variables, named after the rule, and kept in its snapshots like them.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from sleepcast.core.records import NamedTuple
from sleepcast.language.reader import QUASIQUOTE, QUOTE, Form, List, Number, Symbol, read, walk
from sleepcast.language.vocabulary import rule_key

NAME = 48
"""Characters of a rule's name that the names of what it remembers begin with."""


class Expansion(NamedTuple):
    """What a form is written out as: M and S stand for its variables, N and P for local names, A, B and C for its
    arguments, and REST for those after `arguments`. first: the value of a variable before the first evaluation."""

    text: str
    arguments: int
    first: str = "UNKNOWN"


FORMS = {
    "once": Expansion(
        "(LET ((N A) (P (DEFVAR M FALSE))) (SETQ M (IF (KNOWN N) N P)) (WHEN (AND N (NOT P)) REST))", 1, "FALSE"
    ),
    "held": Expansion(
        """(LET ((P (DEFVAR M)))
             (SETQ M (COND (A (IF (KNOWN P) P time)) (TRUE UNKNOWN)))
             (AND (KNOWN M) (>= (- time M) B)))""",
        2,
    ),
    "hysteresis": Expansion(
        "(LET ((N A) (P (DEFVAR M FALSE))) (SETQ M (COND ((>= N C) TRUE) ((<= N B) FALSE) (TRUE P))))", 3, "FALSE"
    ),
    "every": Expansion(
        """(LET ((P (DEFVAR M)))
             (WHEN (OR (NOT (KNOWN P)) (>= time P))
               (SETQ M (+ (COND ((<= (- time P) A) P) (TRUE time)) A))
               REST))""",
        1,
    ),
    "after": Expansion(
        """(LET ((P (DEFVAR M)))
             (IF (KNOWN P) P (SETQ M (+ time A)))
             (WHEN (AND (>= M 0) (>= time M)) (SETQ M -1) REST))""",
        1,
    ),
    "within": Expansion(
        """(LET ((P (DEFVAR M)))
             (LET ((N (- time (IF (KNOWN P) P (SETQ M time))))) (AND (>= N A) (< N B))))""",
        2,
    ),
    "age": Expansion(
        """(LET ((N A))
             (DEFVAR M)
             (DEFVAR S)
             (COND ((NOT (KNOWN N)) N) ((= N M) N) (TRUE (SETQ M N) (SETQ S time)))
             (- time S))""",
        1,
    ),
}
SHARE = "share"
"""The form for a value that robots share. What it tells is evaluated by robots that may not have it themselves.

A robot tells a new value in one tick of five, and any value in one of fifty: as often as TELL allows in the long run,
against losses and for robots that come later, and robots with different numbers in different ticks.
"""
_TURN = """(AND {known} (= (MOD (+ tick id) 5) 0)
                (OR (NOT (KNOWN P)) (/= {what} P) (= (MOD (+ tick id) 50) 0)))"""
_BEST = f"""
    (LET ((N (DEFVAR A)) (P (DEFVAR M)))
      (WHEN {_TURN.format(known="(KNOWN N)", what="N")}
        (SETQ M N)
        (TELL `(WHEN (OR (NOT (KNOWN (DEFVAR A))) (BETTER ,(WORSE N C) A)) (SETQ A ,(WORSE N C)))))
      N)"""
_NEWEST = f"""
    (LET ((N (DEFVAR A)) (P (DEFVAR M)))
      (DEFVAR MERGED)
      (DEFVAR VERSION 0)
      (WHEN (AND (KNOWN N) (OR (NOT (KNOWN MERGED)) (/= N MERGED)))
        (SETQ MERGED N)
        (SETQ VERSION (+ VERSION 1)))
      (WHEN {_TURN.format(known="(KNOWN MERGED)", what="VERSION")}
        (SETQ M VERSION)
        (TELL `(PROGN
          (DEFVAR A)
          (DEFVAR MERGED)
          (WHEN (OR (> ,VERSION (DEFVAR VERSION 0)) (AND (= ,VERSION VERSION) (> ,MERGED MERGED)))
            (SETQ VERSION ,VERSION)
            (SETQ MERGED ,MERGED)
            (SETQ A ,MERGED)))))
      N)"""
_MERGED = {"max": (read(_BEST), ">", "-"), "min": (read(_BEST), "<", "+"), "newest": (read(_NEWEST), ">", "-")}
"""How values are merged: what SHARE is written out as, the sign of a better value, and of one that is worse by C."""
REMEMBERS = re.compile(rf"\(\s*(?:{'|'.join((*FORMS, SHARE))})\b", re.IGNORECASE)
"""What a text that has one of these forms has in it; so may others."""
_TEMPLATES = {name: read(written.text) for name, written in FORMS.items()}


Own = Callable[[str], bool]
"""Whether a key has another meaning, to which the form of this name gives way."""


def written_out(form: Form, own: Own) -> Form:
    """A message with these forms, in the rules that it stores, written out; `form` itself if there are none.

    What a rule remembers is set back when the rule is stored.
    """
    if not any(isinstance(inside, List) and (inside.head in FORMS or inside.head == SHARE) for inside in walk(form)):
        return form
    return _message(form, own)


def _message(form: Form, own: Own) -> Form:
    if not isinstance(form, List) or form.head in (QUOTE, QUASIQUOTE, "tell"):
        return form
    target, body = form.items[1:3] if len(form.items) >= 3 else (form, form)
    quoted = form.head == "setq" and isinstance(body, List) and body.head == QUOTE and len(body.items) == 2
    if isinstance(target, Symbol) and (quoted or form.head in ("rule", "setqq")):
        rule = _Rule(rule_key(target.key), form, own)
        body = rule.body(body.items[1] if quoted and isinstance(body, List) else body)
        head = Symbol("SETQQ", form.start, form.end) if quoted else form.items[0]
        stored = List((head, target, body, *form.items[3:]), form.start, form.end)
        return List((Symbol("PROGN"), *rule.resets, stored), form.start, form.end) if rule.resets else stored
    return List(tuple(_message(item, own) for item in form.items), form.start, form.end)


class _Rule:
    """A rule that is written out. resets: what sets its memory back."""

    def __init__(self, key: str, where: Form, own: Own) -> None:
        self.key, self.where, self.own = key, where, own
        self.resets: list[Form] = []

    def body(self, form: Form) -> Form:
        """What the rule's expression, or a part of it, means."""
        if not isinstance(form, List) or form.head in (QUOTE, QUASIQUOTE, "tell", "defun"):
            return form
        if form.head in ("rule", "setqq"):
            return _message(form, self.own)
        if form.head == SHARE and not self.own(SHARE):
            return self._share(form)
        inside = List(tuple(map(self.body, form.items)), form.start, form.end)
        written = FORMS.get(form.head or "")
        if written is None or len(form.items) <= written.arguments or self.own(form.head or ""):
            return inside
        name = f"{self.key[:NAME]}_{form.head}{len(self.resets) + 1}"
        names = {"n": f"{name}_now", "p": f"{name}_before", "m": name, "s": f"{name}_since"}
        values: dict[str, tuple[Form, ...]] = {short: (Symbol(long),) for short, long in names.items()}
        values |= zip("abc", ((each,) for each in inside.items[1:]), strict=False)
        values["rest"] = inside.items[1 + written.arguments :]
        for variable in "ms" if form.head == "age" else "m":
            reset = read(f"(PROGN (DEFVAR {names[variable]}) (SETQ {names[variable]} {written.first}))")
            self.resets.extend(_filled(reset, {}, self.where))
        return _filled(_TEMPLATES[form.head or ""], values, form)[0]

    def _share(self, form: List) -> Form:
        """A value that is shared; `form` itself if it is not written as it should be."""
        match form.items[1:]:
            case (Symbol() as name, Symbol(key=key), *rest) if key in _MERGED:
                template, better, worse = _MERGED[key]
            case _:
                return form
        match rest:
            case []:
                step = Number(0.0)
            case [Number(value=value) as step] if value >= 0 and key != "newest":
                pass
            case _:
                return form
        prefix = f"{self.key[:NAME]}_{SHARE}{len(self.resets) + 1}"
        names = {"n": f"{prefix}_now", "p": f"{prefix}_before", "m": prefix, "better": better, "worse": worse}
        names |= {"merged": f"{name.key[:NAME]}_merged", "version": f"{name.key[:NAME]}_version"}
        values: dict[str, tuple[Form, ...]] = {short: (Symbol(long),) for short, long in names.items()}
        values |= {"a": (name,), "c": (step,)}
        self.resets.extend(_filled(read("(PROGN (DEFVAR A) (DEFVAR M) (SETQ M UNKNOWN))"), values, self.where))
        return _filled(template, values, form)[0]


def _filled(template: Form, values: dict[str, tuple[Form, ...]], where: Form) -> tuple[Form, ...]:
    """A template with forms in place of its names, all of it standing where `where` stands."""
    if isinstance(template, List):
        items = tuple(each for item in template.items for each in _filled(item, values, where))
        return (List(items, where.start, where.end),)
    if isinstance(template, Number):
        return (Number(template.value, template.unit, template.text, where.start, where.end),)
    if isinstance(template, Symbol):
        return values.get(template.key, (Symbol(template.text, where.start, where.end),))
    return (template,)
