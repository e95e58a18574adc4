"""Which counterparts (docs/counterparts.md) a test needs, whether they are installed here, and in which versions.

A test that runs one names it: `@pytest.mark.counterpart("mavsdk", "pymavlink")`, by its name on the package index, on
npm, or as a command. An ordinary run skips what is not installed. `go.py test counterparts` gives each family an
environment of its own and runs `pytest --counterparts FAMILY` there, in which nothing may be missing that can be had
for this computer.
"""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import go
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

FAMILIES = go.families()
NODE_MODULES = Path(sys.prefix) / "node_modules"
ROS = os.environ.get("SLEEPCAST_RCLPY")
COMMANDS = {"inkscape": "plans", "libreoffice": "plans", "node": "", "pdftocairo": "plans"}
"""What no package index has, with its family: skipped where there is no such command. Any family may need node."""

FINDINGS = go.ROOT / "findings"
FINDING_TESTS = "test_finding_scripts.py"
MARK = re.compile(r"mark\.counterpart\(([^)]*)\)")


@cache
def members(family: str) -> dict[str, bool]:
    """The counterparts of a family, and whether each can be had for this computer and Python."""
    lines = map(Requirement, FAMILIES[family])
    found = {canonicalize_name(line.name): line.marker is None or line.marker.evaluate() for line in lines}
    found |= dict.fromkeys(go.npm_families().get(family, ()), True)
    if family == "ros2":
        ours = (sys.platform, platform.machine()) == ("linux", "x86_64")
        found |= {name: ours for name in go.read_lock(go.RCLPY) if name.startswith("ros-")}
    return found | {name: False for name, of in COMMANDS.items() if of in ("", family)}


def belongs(names: set[str], family: str) -> bool:
    """Whether a test with these counterparts is one of the family."""
    return bool(names - {"node"}) and names <= members(family).keys()


def family_of(names: set[str]) -> str:
    """Where all of them are; empty if nowhere."""
    return next((family for family in FAMILIES if belongs(names, family)), "")


@cache
def is_installed(name: str) -> bool:
    if name in COMMANDS:
        return shutil.which(name) is not None
    return bool(installed_version(name))


def installed_version(name: str) -> str:
    """Empty if it is not there."""
    if name.startswith("ros-"):
        return "there" if ROS else ""
    try:
        return version(name)
    except PackageNotFoundError:
        about = NODE_MODULES / name / "package.json"
        return str(json.loads(about.read_text(encoding="utf-8"))["version"]) if about.is_file() else ""


@cache
def locked_versions(name: str) -> set[str]:
    """The versions in the lock: other Pythons may need another one. Empty where it is in none."""
    for lock in (go.COUNTERPARTS, go.RCLPY):
        if entry := go.read_lock(lock).get(name):
            return set(re.findall(rf"(?m)^{re.escape(name)}==([^ ;]+)", entry))
    npm = json.loads((go.ROOT / "requirements/counterparts/package-lock.json").read_text(encoding="utf-8"))
    entry = npm["packages"].get(f"node_modules/{name}")
    return {entry["version"]} if entry else set()


def pinned_by(script: Path) -> list[str]:
    """The packages that a finding installs, the one that it is about first."""
    program = script.read_text(encoding="utf-8").partition("\nset -eu")[2]
    found = re.findall(r"(?<![\w.@-])(@?[A-Za-z][\w./-]*)(?:==|@)\$?\w", program)
    return [name if "/" in name else canonicalize_name(name) for name in found]


@cache
def named_in(file: Path) -> list[set[str]]:
    """The counterparts of each test of a file, as its marks name them."""
    if file.name == FINDING_TESTS:
        return [set(pinned_by(script)[:1]) for script in FINDINGS.glob("*.sh")]
    found = MARK.findall(file.read_text(encoding="utf-8"))
    return [set(re.findall(r'"([^"]+)"', names)) for names in found]


def versions(family: str) -> str:
    """What is here of a family, and where that is not what the lock says."""
    told = []
    for name in members(family):
        if name not in COMMANDS and not name.startswith("ros-") and (here := installed_version(name)):
            locked = locked_versions(name)
            told.append(name + f" {here}" + ("" if here in locked else f" ({', '.join(sorted(locked))} in the lock)"))
    return ", ".join(told)
