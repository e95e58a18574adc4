"""How much of an AND only looks. Loaded for one text and let go again: few messages begin with an AND."""

from micropython import const

from sleepnode.checker import Function
from sleepnode.functions import arguments_of, pure_number
from sleepnode.reader import head_of

_LOOKING = const(("in", "inside", "to-edge", "prob", "random", "gauss"))
_PLAIN = const(("eq", "and", "or", "known", "cond", "if", "when", "progn", "let", "dotimes", "dice"))


def leading(c, form):
    """How many operands of an AND only look and do nothing, from the first on."""
    count = 0
    for part in form[1:]:
        if _acts(c, part, ()):
            break
        count += 1
    return count


def _acts(c, form, local):
    """Whether a form changes the robot or speaks."""
    head = head_of(form)
    if not head:
        return False
    binding = c.mind.binding(head)
    rest = form[1:]
    if isinstance(binding, Function):
        if binding.acts:
            return True
    elif c.kind_of(head) == "operator":
        pass
    elif arguments_of(head) is None:
        return False  # a function that the robot does not have does nothing, nor do its arguments
    elif head == "setq":
        if not (rest and isinstance(rest[0], str) and rest[0].lower() in local):
            return True
        rest = form[2:]
    elif head in _LOOKING:
        return any([_acts(c, part, local) for part in rest if isinstance(part, list)])
    elif head not in _PLAIN and pure_number(head) is None:
        return True
    if head in ("cond", "dice"):
        rest = [part for clause in rest if isinstance(clause, list) for part in clause]
    elif head in ("let", "dotimes") and rest and isinstance(rest[0], list):
        pairs = rest[0] if head == "let" else [rest[0]]
        names = tuple(
            [pair[0].lower() for pair in pairs if isinstance(pair, list) and pair and isinstance(pair[0], str)]
        )
        values = [pair[1] for pair in pairs if isinstance(pair, list) and len(pair) > 1]
        return any([_acts(c, part, local) for part in values]) or any(
            [_acts(c, part, local + names) for part in rest[1:]]
        )
    return any([_acts(c, part, local) for part in rest])
