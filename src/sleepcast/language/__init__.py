"""The SLEEP language: text to form, form to checked parts, parts to a program that one robot's machine evaluates.

Standard library only; it knows nothing of robots, channels or pages.
"""

from sleepcast.core.model import Constant, HostFunction
from sleepcast.language.checker import CheckError, Finding
from sleepcast.language.evaluate import Memory
from sleepcast.language.explain import Explanation, Recollection, Step, explain, rehearse
from sleepcast.language.lint import Checked, check
from sleepcast.language.program import MAX_STEPS, Library, Program, evaluate
from sleepcast.language.reader import Form, List, Number, ReadError, Symbol, Text, format_value, read, read_all, show
from sleepcast.language.rehearsal import Rehearsal
from sleepcast.language.symbols import FreshNames, Names
from sleepcast.language.vocabulary import Variable, VariableKind, Vocabulary

__all__ = [
    "MAX_STEPS",
    "CheckError",
    "Checked",
    "Constant",
    "Explanation",
    "Finding",
    "Form",
    "FreshNames",
    "HostFunction",
    "Library",
    "List",
    "Memory",
    "Names",
    "Number",
    "Program",
    "ReadError",
    "Recollection",
    "Rehearsal",
    "Step",
    "Symbol",
    "Text",
    "Variable",
    "VariableKind",
    "Vocabulary",
    "check",
    "evaluate",
    "explain",
    "format_value",
    "read",
    "read_all",
    "rehearse",
    "show",
]
