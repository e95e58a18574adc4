"""docs/counterparts.md: each row is held by tests that run its counterpart, in the version that the page names."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

import go
import pytest

import families

PAGE = go.ROOT / "docs" / "counterparts.md"
TESTS = Path(__file__).parent

PACKAGE = re.compile(r"([^,;:(]+?) (\d[\w.]*) \((?:PyPI|npm)(?: `([^`]+)`)?[^)]*\)")
"""`MAVSDK 4.1.0 (PyPI `mavsdk`)`: what people call it, its version, and its name on the index, if that is another."""


class Section(NamedTuple):
    title: str
    family: str
    """Empty where nothing of it is on a package index."""
    versions: dict[str, str]
    """Of packages."""
    called: dict[str, str]
    """Packages, by what the rows call them."""
    rows: list[list[str]]


@cache
def sections() -> list[Section]:
    found = []
    for part in PAGE.read_text(encoding="utf-8").split("\n## ")[1:]:
        command = re.search(r"`python3 go\.py test counterparts (\w+)`: (.*)\.\n", part)
        family, line = command.groups() if command else ("", "")
        packages = [
            (name.strip(), version, package or name.strip()) for name, version, package in PACKAGE.findall(line)
        ]
        rows = [re.split(r"(?<!\\) \| ", line[2:-2]) for line in part.splitlines() if line.startswith("| ")][1:]
        versions = {package: version for _, version, package in packages}
        called = {name: package for name, _, package in packages}
        found.append(Section(part.partition("\n")[0], family, versions, called, rows))
    return found


ROWS = [pytest.param(section, row, id=f"{row[0]}: {row[1]}"[:70]) for section in sections() for row in section.rows]


@cache
def marks(node: str) -> frozenset[str] | None:
    """The counterparts with which a test, its class or its whole file is marked; None if there is no such test."""
    path, *names = node.split("::")
    if not (file := TESTS / path).is_file():
        return None
    level: list[ast.stmt] = ast.parse(file.read_text(encoding="utf-8")).body
    lines = [each for each in level if isinstance(each, ast.Assign) and "pytestmark" in ast.unparse(each.targets[0])]
    marked = [each.value for each in lines]
    for name in names:
        found = [each for each in level if isinstance(each, ast.ClassDef | ast.FunctionDef) and each.name == name]
        if not found:
            return None
        marked += found[0].decorator_list
        level = found[0].body
    calls = [
        each for each in marked if isinstance(each, ast.Call) and ast.unparse(each.func) == "pytest.mark.counterpart"
    ]
    return frozenset(ast.literal_eval(word) for call in calls for word in call.args)


def test_each_family_has_a_section_with_its_command() -> None:
    assert sorted(section.family for section in sections() if section.rows and section.family) == sorted(
        {section.family for section in sections()} - {""}
    )
    assert {section.family for section in sections()} - {""} <= go.families().keys()


@pytest.mark.parametrize("section", sections(), ids=lambda section: section.title)
def test_the_versions_are_those_of_the_lock(section: Section) -> None:
    """After renewing the locks, write the new versions there, and run the command that stands before them."""
    for package, version in section.versions.items():
        assert families.belongs({package}, section.family), f"{package} is not in counterparts-{section.family}"
        assert version in families.locked_versions(package), (
            f"{package}: {families.locked_versions(package)} in the lock"
        )
    assert section.versions or not section.family


@pytest.mark.parametrize(("section", "row"), ROWS)
def test_a_row_has_tests_and_one_of_them_runs_each_counterpart(section: Section, row: list[str]) -> None:
    who, _, _, _, named = row
    nodes = re.findall(r"`([\w/]+\.py(?:::\w+)+)`", named)
    assert nodes, "name tests: `folder/test_file.py::test_what_we_do`"
    assert [node for node in nodes if marks(node) is None] == [], "there is no such test"
    scripts = [families.FINDINGS / name for name in re.findall(r"`findings/([\w-]+\.sh)`", " ".join(row))]
    run = {package for script in scripts for package in families.pinned_by(script)}
    run |= {package for node in nodes for package in marks(node) or ()}
    wanted = {
        package
        for name, package in section.called.items()
        if re.search(rf"(?<![\w/-]){re.escape(name)}(?![\w/-])", who)
    }
    wanted |= {
        command
        for command, family in families.COMMANDS.items()
        if family and re.search(rf"\b{command}\b", who, re.IGNORECASE)
    }
    assert wanted or not section.family, f"call it as the section does: {', '.join(section.called)}"
    if not section.family:
        known = [name for other in sections() for name in other.called if re.search(rf"\b{re.escape(name)}\b", who)]
        assert not known, f"its place is in the section that has {', '.join(known)}"
    assert wanted <= run, f"no test here is marked with {', '.join(sorted(wanted - run))}, and no finding installs it"


def test_a_row_names_no_version_that_the_section_names() -> None:
    for section in sections():
        for who, *_ in section.rows:
            for name in section.called:
                assert not re.search(rf"(?<![\w/-]){re.escape(name)} \d", who), (
                    f"{who}: the version stands above the table"
                )


@pytest.mark.parametrize("script", sorted(families.FINDINGS.glob("*.sh")), ids=lambda script: script.stem)
def test_a_finding_is_run_with_its_family(script: Path) -> None:
    about = families.pinned_by(script)[0]
    assert families.family_of({about}), f"no group counterparts-... of pyproject.toml has {about}"


def test_marks_name_what_a_family_has() -> None:
    for file in TESTS.rglob("test_*.py"):
        for names in families.named_in(file):
            assert families.family_of(names), f"{file.name}: {', '.join(sorted(names))} are in no family together"
