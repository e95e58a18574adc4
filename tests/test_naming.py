"""Names say what they stand for: no two classes share one, and no docstring names an exception that there is not."""

from __future__ import annotations

import ast
import builtins
import re
from collections import defaultdict
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "src" / "sleepcast"

SHARED = {
    "Clock": "of sleepcast, in every module that waits, and rosgraph_msgs/Clock, which is called so in ROS 2",
    "Fleet": "`sleepcast.Fleet`, which is public, and the minds that it is made of, the room of that name",
    "Pose": "for bodies and for programs of Nomads, both public, and geometry_msgs/Pose, which is called so in ROS 2",
}
"""Names that several classes may have, and why. A new one needs a reason as good as these: who searches for a name
should find one thing."""
MOST_SHARED = 20


@dataclass
class Written:
    """What the package says. classes: where those of each name are, nested ones included. named: names that it imports,
    or asks of something. docstrings: with their places, those of attributes too."""

    classes: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    named: set[str] = field(default_factory=set)
    docstrings: list[tuple[str, str]] = field(default_factory=list)

    def take(self, path: str, node: ast.AST) -> None:
        match node:
            case ast.ClassDef(name=name):
                self.classes[name].append(f"{path}:{node.lineno}")
            case ast.ImportFrom():
                self.named.update(alias.name for alias in node.names)
            case ast.Attribute(attr=name):
                self.named.add(name)
            case ast.Expr(value=ast.Constant(value=str(text))):
                self.docstrings.append((f"{path}:{node.lineno}", text))


@cache
def written() -> Written:
    found = Written()
    for path in sorted(SOURCE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            found.take(str(path.relative_to(ROOT)), node)
    return found


def test_no_two_classes_share_a_name() -> None:
    shared = {name: places for name, places in written().classes.items() if len(places) > 1}
    wrong = [f"{name}: {', '.join(places)}" for name, places in shared.items() if name not in SHARED]
    assert not wrong, "find another word, or make one of the two:\n" + "\n".join(wrong)
    assert not SHARED.keys() - shared, "these are names of one class by now; take them from the list"
    assert len(SHARED) <= MOST_SHARED


def test_docstrings_name_exceptions_that_there_are() -> None:
    known = vars(builtins).keys() | written().classes.keys() | written().named
    wrong = [
        f"{place}: there is no {name}"
        for place, text in written().docstrings
        for name in re.findall(r"\b\w+Error\b", text)
        if name not in known
    ]
    assert not wrong, "\n".join(wrong)
