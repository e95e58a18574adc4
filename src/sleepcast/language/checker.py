"""The checker: forms in, one tree of parts out, and everything that is wrong or doubtful, found in one pass.

A name is looked up as a local name first, then among buffers and the robot's vocabulary, then among what this robot
has learned. Errors are what no robot could run: unreadable text, a wrong number of arguments, assigning a sensor.
A name or function that nobody declared is a warning only, because robots differ: the name reads as unknown, the
function is a fault where it is reached.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import nan
from re import compile as pattern

from sleepcast.core.errors import MisuseError, and_more, did_you_mean, placed, slip_of, with_caret
from sleepcast.core.model import Constant, HostFunction
from sleepcast.core.records import dataclass
from sleepcast.core.units import UNITS
from sleepcast.language.functions import BODY_WORDS, FUNCTIONS, MANY, WORDS, Function
from sleepcast.language.parts import Defining, Label, Part, Storing
from sleepcast.language.parts import walk as walk_parts
from sleepcast.language.reader import ALIASES, Form, List, Number, Symbol, Text, rows, walk, written
from sleepcast.language.symbols import Group, Names, Operator, Stored, UserVariable, circle, known_groups, uses_in
from sleepcast.language.vocabulary import Binding, Variable, VocabularyError, buffer_number, describe, gives_way

MAX_COST = 10_000
"""Steps that one expression may cost by its own static bound; the same as an evaluation's budget."""
STORE_STEPS = 40
"""Steps that storing an expression costs besides those for its parts: it is checked and made into a program anew, which
takes a robot tens of microseconds."""

MAX_FINDINGS = 20
"""Errors of one text that are kept, warnings that are, and findings that are shown: who mends these sees the next."""

MAX_SUGGESTIONS = 20
"""Unknown names of one text for which a likely meant one is looked for: looking takes long beside all other checks."""

_NUMBER_BEFORE = pattern(r"(?:^|[\s(])([+-]?\d[\d.]*)[ \t]+\Z")
"""A number without a unit, and blanks, at the end of a text."""


@dataclass(frozen=True, slots=True)
class Finding:
    """Something wrong ("error") or doubtful ("warning") at the offsets start..end of the checked text.

    unknown: the name that nobody has declared, if it is about that. confirm: whether a desk asks once more before it
    sends such a text.
    """

    severity: str
    message: str
    start: int
    end: int
    unknown: str = ""
    confirm: bool = False

    @property
    def weight(self) -> int:
        return _weight(self.severity, self.unknown, confirm=self.confirm)

    def render(self, text: str) -> str:
        """The message, the line it is about, and carets under the spot."""
        return with_caret(self.message, text, self.start, self.end)


def _weight(severity: str, unknown: str, *, confirm: bool) -> int:
    """How much a finding matters to people: an error keeps a text from being sent, and so may the next two."""
    return 3 if severity == "error" else 2 if confirm else 1 if unknown else 0


class Findings:
    """Everything wrong or doubtful in `text`: the first `MAX_FINDINGS` of each weight, and how many there are (counts,
    by severity)."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.kept: list[Finding] = []
        self.counts: Counter[str] = Counter()
        self._kept: Counter[int] = Counter()

    def note(
        self, severity: str, message: str, start: int, end: int, *, unknown: str = "", confirm: bool = False
    ) -> None:
        """Note one more, `@@` in whose message becomes its line and column."""
        self.counts[severity] += 1
        weight = _weight(severity, unknown, confirm=confirm)
        if self._kept[weight] < MAX_FINDINGS:
            self._kept[weight] += 1
            self.kept.append(Finding(severity, placed(message, self.text, start), start, end, unknown, confirm))

    def shown(self) -> tuple[Finding, ...]:
        """Those that a person is shown, in the order of the text; of too many, those of the most weight."""
        first = sorted(self.kept, key=lambda finding: -finding.weight)[:MAX_FINDINGS]
        return tuple(sorted(first, key=lambda finding: finding.start))


class CheckError(MisuseError):
    """An expression that no robot could run; its text lists the errors with carets. more: errors besides these. by:
    see `Checked`."""

    def __init__(self, findings: Sequence[Finding], text: str, more: int = 0, by: str = "") -> None:
        shown = (finding.render(text) for finding in findings)
        super().__init__("\n".join([*shown, *and_more(more), *filter(None, [by])]))
        self.findings, self.text = findings, text


class Checker:
    """One pass over one text. After `part`, see findings, uses (keys fetched or called) and free (learned names).

    warns: whether warnings are wanted; a robot, which shows nobody any, looks for errors alone.
    """

    def __init__(self, names: Names, text: str, special: Mapping[str, Special], *, warns: bool = True) -> None:
        self.names, self.text, self.special, self.warns = names, text, special, warns
        self.findings = Findings(text)
        self.uses: set[str] = set()
        self.free: set[str] = set()
        self.scopes: list[dict[str, int]] = []
        self.fixed_locals: dict[int, str] = {}
        """Local names that cannot be assigned, by their numbers, and what they are."""
        self.locals = 0
        self.loops = self.around = 0
        """DOTIMES, and forms that go through neighbours, that are open where the checker is."""
        self.suggestions = 0
        self.joining: set[int] = set()
        """Where the operators stand that a finding about a whole row of them is about."""
        self.pending: dict[str, str] = {}
        """Names that this very text declares: key to "variable", "rule", "group" or "operator"."""
        self.pending_parameters: dict[str, int] = {}
        self.pending_uses: dict[str, frozenset[str]] = {}
        self.stored_parts: list[Part] = []
        """Expressions that this text stores for later, as parts."""
        self.checked = 0
        """Forms turned into parts so far."""

    # ---- findings

    def error(self, message: str, form: Form) -> Part:
        """Note an error at `form` (`@@` becomes its line and column) and go on with a part that is unknown."""
        self.findings.note("error", message, form.start, form.end)
        return Part("const", form, number=nan)

    def warn(self, message: str, form: Form, unknown: str = "") -> None:
        """Note a warning at `form`, if warnings are wanted. unknown: see `Finding`."""
        if self.warns:
            self.findings.note("warning", message, form.start, form.end, unknown=unknown)

    def unknown(self, what: str, symbol: Symbol) -> None:
        """Note that nobody has declared a name, if warnings are wanted. what: its kind."""
        if not self.warns:
            return
        before = _NUMBER_BEFORE.search(self.text[max(0, symbol.start - 32) : symbol.start])
        if before and symbol.key in UNITS:  # it stands apart from its number
            hint = f" (did you mean {before[1]}{symbol.text}?)"
        else:
            hint = self.suggestion(symbol.text)
        self.warn(f'unknown {what} "{symbol.text}" @@{hint}', symbol, symbol.text)

    def suggestion(self, name: str) -> str:
        """` (did you mean X?)` out of every name that this robot knows, for the first unknown names of a text and a
        warning that is wanted."""
        self.suggestions += 1
        if self.suggestions > MAX_SUGGESTIONS or not self.warns:
            return ""
        if name.casefold() in ALIASES:
            return f" (did you mean {ALIASES[name.casefold()]}?)"
        return did_you_mean(name, (*self.names.vocabulary.names(), *self.names.heard(), *self.pending))

    def doubt_group(self, symbol: Symbol) -> None:
        """Note a doubt about a group of which nobody has heard, if it is like one that is known: whoever asks for it
        hardly means a new one."""
        if not self.warns or self.suggestions >= MAX_SUGGESTIONS:
            return
        self.suggestions += 1
        pending = (key for key, kind in self.pending.items() if kind == "group")
        meant = slip_of(symbol.text, [*known_groups(self.names), *pending])
        if meant is not None:
            message, at = f'unknown group "{symbol.text}" @@ (did you mean {meant}?)', (symbol.start, symbol.end)
            self.findings.note("warning", message, *at, unknown=symbol.text, confirm=True)

    # ---- names

    def declare_all(self, form: Form) -> None:
        """Note the names that `form` itself declares, so that the rest of it may use them."""
        kinds = {"defvar": "variable", "rule": "rule", "defun": "operator", "area": "operator", "join": "group"}
        for inside in walk(form):
            if isinstance(inside, List) and inside.head in kinds and len(inside.items) >= 2:
                name = inside.items[1]
                if isinstance(name, Symbol) and not (inside.head in WORDS and self.meaning(inside.head)):
                    self.pending.setdefault(name.key, kinds[inside.head])
                    if inside.head == "defun" and len(inside.items) > 2 and isinstance(inside.items[2], List):
                        self.pending_parameters[name.key] = len(inside.items[2].items)

    def local(self, key: str) -> int | None:
        """The number of the local name `key`, innermost first."""
        for scope in reversed(self.scopes):
            if key in scope:
                return scope[key]
        return None

    @contextmanager
    def scope(self, keys: list[str], fixed: str = "") -> Iterator[tuple[int, ...]]:
        """Local names while the block lasts; gives their numbers. fixed: what they are, if they cannot be assigned."""
        numbers = tuple(range(self.locals, self.locals + len(keys)))
        self.locals += len(keys)
        self.scopes.append(dict(zip(keys, numbers, strict=True)))
        if fixed:
            self.fixed_locals.update(dict.fromkeys(numbers, fixed))
        yield numbers
        self.scopes.pop()

    def kind_of(self, key: str) -> str | None:
        """What the learned name `key` is or will be: "variable", "rule", "group", "operator", or None."""
        self.free.add(key)
        known = self.names.declared(key)
        if known is None:
            return self.pending.get(key)
        return {UserVariable: "variable", Stored: "rule", Operator: "operator", Group: "group"}[type(known)]

    def meaning(self, key: str) -> str | None:
        """What a name is already, for a person: `sensor variable`, `buffer`, `rule`, ...; None if it is free."""
        if buffer_number(key) is not None:
            return "buffer"
        if key in FUNCTIONS:
            return "function"
        binding = self.binding(key)
        return self.kind_of(key) if binding is None or gives_way(binding) else describe(binding)

    def binding(self, key: str) -> Binding | None:
        """What the robot's vocabulary has under a name, unless that gives way to what the name has been given to."""
        binding = self.names.vocabulary.bindings.get(key)
        return None if gives_way(binding) and self.kind_of(key) is not None else binding

    def may_be_local(self, symbol: Symbol) -> None:
        """Note an error for a local name that would hide a constant: TRUE is TRUE everywhere."""
        if isinstance(self.names.vocabulary.bindings.get(symbol.key), Constant):
            self.error(f"{symbol.text} @@ is a constant: choose another name", symbol)

    def user_slot(self, symbol: Symbol) -> int:
        """The slot of a user variable; an error and slot 0 if the vocabulary is full."""
        try:
            return self.names.vocabulary.user_slot(symbol.key)
        except VocabularyError as error:
            self.error(f"{error} @@", symbol)
            return 0

    # ---- parts

    def part(self, form: Form) -> Part:
        """The part that evaluates `form`."""
        self.checked += 1
        if isinstance(form, Number):
            return Part("const", form, number=form.value)
        if isinstance(form, Symbol):
            return self._symbol(form)
        if isinstance(form, List):
            return self._call(form)
        return self.error("a text in quotes @@ stands only as the label of REPORT, PRINT or TK", form)

    def parts(self, forms: tuple[Form, ...]) -> tuple[Part, ...]:
        return tuple(map(self.part, forms))

    def _symbol(self, symbol: Symbol) -> Part:
        key = symbol.key
        number = self.local(key)
        if number is not None:
            return Part("local", symbol, slot=number, name=key)
        binding = self.binding(key)
        if isinstance(binding, Variable):
            op = "linked" if binding.linked else "var"
            return Part(op, symbol, slot=binding.slot, name=key, data=binding)
        if isinstance(binding, Constant):
            return Part("const", symbol, number=binding.value, name=key)
        if isinstance(binding, HostFunction) and binding.value is not None:
            return Part("const", symbol, number=float(binding.value), name=key)
        if binding is not None or key in FUNCTIONS:
            return self.error(f"{symbol.text} @@ is a function: write ({symbol.text} ...)", symbol)
        number = buffer_number(key)
        if number == 0:
            return self.error("E0 @@ is the message itself: it cannot be named in an expression", symbol)
        if number is not None:
            self.uses.add(f"e{number}")
            return Part("fetch", symbol, name=f"e{number}")
        return self._learned(symbol)

    def _learned(self, symbol: Symbol) -> Part:
        kind = self.kind_of(symbol.key)
        self.uses.add(symbol.key)  # even if it is nothing yet: it may become a rule
        if kind == "variable":
            return Part("var", symbol, slot=self.user_slot(symbol), name=symbol.key)
        if kind == "rule":
            return Part("fetch", symbol, name=symbol.key)
        if kind == "group":
            return self.error(f"{symbol.text} @@ is a group: write (IN {symbol.text})", symbol)
        if kind == "operator":
            return self.error(f"{symbol.text} @@ is an operator: write ({symbol.text} ...)", symbol)
        if symbol.start not in self.joining:
            self.unknown("name", symbol)
        return Part("absent", symbol, name=symbol.key)

    def _call(self, form: List) -> Part:
        if not form.items:
            return self.error("nothing in the parentheses @@: wanted (function argument ...)", form)
        head = form.items[0]
        if not self.prefixed(form, 1 if isinstance(head, Symbol) and self._is_callable(head.key) else 0):
            return Part("const", form, number=nan)
        if not isinstance(head, Symbol):
            self.parts(form.items[1:])
            return self.error("a list @@ begins with a function's name: wanted (function argument ...)", head)
        function = FUNCTIONS.get(head.key)
        if function is not None:
            return self._builtin(form, function)
        binding = self.binding(head.key)
        if isinstance(binding, HostFunction):
            return self._host(form, binding)
        is_buffer = buffer_number(head.key) is not None
        if binding is not None or is_buffer or self.kind_of(head.key) not in (None, "operator"):
            self.parts(form.items[1:])
            what = self.meaning(head.key)
            return self.error(f"{head.text} @@ is a {what}, not a function: its name alone gives its value", head)
        if self.kind_of(head.key) == "operator":
            return self._operator(form, head)
        if head.key in WORDS:
            return self._builtin(form, WORDS[head.key])
        self.uses.add(head.key)
        if head.key in BODY_WORDS:
            lacking = f"{head.text} @@ is a fault on these robots, which {BODY_WORDS[head.key]}"
            self.warn(lacking, head, head.text)
        else:
            self.unknown("function", head)
        self.parts(form.items[1:])
        return Part("missing", form, name=head.text)

    def _is_callable(self, key: str) -> bool:
        return (
            key in FUNCTIONS
            or isinstance(self.binding(key), HostFunction)
            or self.kind_of(key) == "operator"
            or (key in WORDS and self.meaning(key) is None)
        )

    def prefixed(self, form: List, begin: int, *, is_call: bool = True) -> bool:
        """Whether no operator among the items of `form` from `begin` on stands between its arguments, having noted an
        error if one does, and a warning if it is one that could be a name."""
        fine = True
        for first, last in rows(form, begin):
            row = form.items[first : last + 1]
            operators = [item for item in row[1::2] if isinstance(item, Symbol)]
            wrong = (first == 0 and is_call) or any(operator.key in FUNCTIONS for operator in operators)
            if not wrong and not all(map(self._is_unknown, operators)):
                continue
            fine = fine and not wrong
            self.joining.update(operator.start for operator in operators)
            here = written(row, self.text)
            message = f"an operator comes before what it joins @@{here and f': write {here}'}"
            self.findings.note("error" if wrong else "warning", message, row[0].start, row[-1].end, confirm=not wrong)
        return fine

    def _is_unknown(self, symbol: Symbol) -> bool:
        key = symbol.key
        return self.local(key) is None and key not in self.names.vocabulary.bindings and self.kind_of(key) is None

    def _builtin(self, form: List, function: Function) -> Part:
        if not self.counts(form, function.least, function.most, function):
            return Part("const", form, number=nan)
        if function.name.casefold() in self.special:
            return self.special[function.name.casefold()](self, form)
        if function.kind == "act":
            return Part("act", form, self.parts(form.items[1:]), name=function.name.casefold())
        return Part("pure", form, self.parts(form.items[1:]), name=function.name, data=function)

    def counts(self, form: List, least: int, most: int, used: Function | HostFunction | str) -> bool:
        """Whether `form` has from `least` to `most` arguments; an error if it has not. used: the usage, or whose it
        is."""
        given = len(form.items) - 1
        if least <= given <= most:
            return True
        wanted = f"{least}" if least == most else f"at least {least}" if most >= MANY else f"{least} to {most}"
        if given > MANY:
            wanted = f"at most {most}"
        plural = "" if wanted.endswith(" 1") or wanted == "1" else "s"
        usage = used if isinstance(used, str) else used.usage
        self.error(f"{usage} takes {wanted} argument{plural}, got {given} @@", form)
        return False

    def _host(self, form: List, function: HostFunction) -> Part:
        most = len(function.dimensions)
        least = most if function.least is None else function.least
        if function.labelled:
            least, most = least + 1, most + 1
        if not self.counts(form, least, most, function):
            return Part("const", form, number=nan)
        if not function.labelled:
            parts = self.parts(form.items[1:])
            slot = self._slot_read(function, parts)
            return Part("host", form, parts, slot=slot, name=function.name.casefold(), data=function)
        label = form.items[1]
        if not isinstance(label, Text):
            return self.error(f'{function.usage} @@ wants a text in quotes, such as "here"', label)
        rest = self.parts(form.items[2:])
        return Part("host", form, rest, slot=-1, name=function.name.casefold(), data=Label(label.value, function))

    def _slot_read(self, function: HostFunction, parts: Sequence[Part]) -> int:
        """The slot of the sensor whose value a function gives, -1 if it does not say so."""
        if function.reads is None:
            return -1
        name = function.reads([each.number if each.op == "const" else None for each in parts])
        sensor = self.names.vocabulary.bindings.get(name.casefold())
        return sensor.slot if isinstance(sensor, Variable) else -1

    def parameters(self, key: str) -> int:
        """How many parameters an operator has or will have."""
        known = self.names.declared(key)
        return len(known.parameters) if isinstance(known, Operator) else self.pending_parameters.get(key, 0)

    def _operator(self, form: List, head: Symbol) -> Part:
        known, count = self.names.declared(head.key), self.parameters(head.key)
        parameters = (known.name, *known.parameters) if isinstance(known, Operator) else (head.text, "...")
        usage = f"({' '.join(parameters)})"
        self.uses.add(head.key)
        if not self.counts(form, count, count, usage):
            return Part("const", form, number=nan)
        return Part("call", form, self.parts(form.items[1:]), name=head.key)

    # ---- stored expressions

    def stored(self, key: str, body: tuple[Form, ...], parameters: list[str], where: Form) -> int:
        """Check forms that are kept for later under `key`, by themselves: none of the local names here hold there.

        Gives the steps that storing them costs, having noted an error if `key` would come to use itself.
        """
        before = self.checked
        outside = self.scopes, self.uses, self.free, self.loops, self.around
        self.scopes, self.uses, self.free, self.loops, self.around = [], set(), set(), 0, 0
        with self.scope(parameters):
            tree = Part("progn", where, self.parts(body))
        self.stored_parts.append(tree)
        if (
            cancel := next((part for part in walk_parts(tree) if part.op == "act" and part.name == "cancel"), None)
        ) is not None:
            self.error("CANCEL @@ stands in what is sent once: nobody has sent what is stored", cancel.form)
        uses = frozenset(self.uses)
        self.scopes, self.uses, self.free, self.loops, self.around = outside
        self.bounded(tree, where)
        through = circle(
            key, uses, lambda k: self.pending_uses[k] if k in self.pending_uses else uses_in(self.names, k)
        )
        if through is not None:
            self.error(f"{key.upper()} @@ would name itself{through}: an evaluation must end", where)
        else:
            self.pending_uses[key] = uses
        return STORE_STEPS + self.checked - before

    def bounded(self, tree: Part, where: Form) -> int:
        """The static cost of `tree`, having noted an error if it is over `MAX_COST`."""
        steps = cost(tree)
        if steps > MAX_COST:
            self.error(f"this @@ may cost {steps} steps, at most {MAX_COST} are allowed", where)
        return steps


def cost(part: Part) -> int:
    """Steps that `part` is charged: one for each part inside it, those in a DOTIMES as often as it repeats, those for a
    neighbour as often as there may be neighbours, and for a stored expression `STORE_STEPS` and one for each of its
    parts.

    What a buffer or an operator costs is charged where it is entered.
    """
    inside = sum(map(cost, part.parts))
    if part.op == "dotimes":
        return 1 + int(part.number) * inside
    if part.op in ("over", "each"):
        return 1 + sum(map(cost, part.parts[:-1])) + int(part.number) * cost(part.parts[-1])
    if isinstance(part.data, Storing | Defining):
        return 1 + inside + int(part.number)
    return inside if part.op == "clause" else 1 + inside


Special = Callable[[Checker, List], Part]
"""How a special form is taken apart."""
