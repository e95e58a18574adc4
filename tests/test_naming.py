"""Names say what they stand for: no two classes share one, and no docstring names an exception that there is not."""

from __future__ import annotations

import ast
import builtins
import re
from collections import defaultdict
from collections.abc import Iterator
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


@cache
def syntax() -> dict[str, ast.Module]:
    """Every module of the package, by its path."""
    paths = sorted(SOURCE.rglob("*.py"))
    return {str(path.relative_to(ROOT)): ast.parse(path.read_text(encoding="utf-8")) for path in paths}


def nodes() -> Iterator[tuple[str, ast.AST]]:
    for path, tree in syntax().items():
        yield from ((path, node) for node in ast.walk(tree))


def classes() -> dict[str, list[str]]:
    """Where classes of each name are, nested ones included."""
    places = defaultdict(list)
    for path, node in nodes():
        if isinstance(node, ast.ClassDef):
            places[node.name].append(f"{path}:{node.lineno}")
    return places


def test_no_two_classes_share_a_name() -> None:
    shared = {name: places for name, places in classes().items() if len(places) > 1}
    wrong = [f"{name}: {', '.join(places)}" for name, places in shared.items() if name not in SHARED]
    assert not wrong, "find another word, or make one of the two:\n" + "\n".join(wrong)
    assert not SHARED.keys() - shared, "these are names of one class by now; take them from the list"
    assert len(SHARED) <= MOST_SHARED


def known_exceptions() -> set[str]:
    """Exceptions of Python, of sleepcast, and those of libraries that it names in its code."""
    known = set(vars(builtins)) | classes().keys()
    for _, node in nodes():
        match node:
            case ast.ImportFrom():
                known.update(alias.name for alias in node.names)
            case ast.Attribute():
                known.add(node.attr)
    return known


def docstrings() -> Iterator[tuple[str, str]]:
    """Every docstring, those of attributes too, and its place."""
    for path, node in nodes():
        match node:
            case ast.Expr(value=ast.Constant(value=str(text))):
                yield f"{path}:{node.lineno}", text


def test_docstrings_name_exceptions_that_there_are() -> None:
    known = known_exceptions()
    wrong = [
        f"{place}: there is no {name}"
        for place, text in docstrings()
        for name in re.findall(r"\b\w+Error\b", text)
        if name not in known
    ]
    assert not wrong, "\n".join(wrong)
