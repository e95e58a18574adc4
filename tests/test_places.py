"""The tables of CONTRIBUTING.md lead to the right files: every path in them exists, and rows are complete.

Whether a row is complete is found out with features that are there already. A `Feature` has a name that stands nowhere
by chance; the files that name it in their code are those that somebody had to touch to add it, and its row has to name
all of them, or a folder above. `besides` lists the few that name it and are not meant, with the reason: whoever adds a
feature of the same kind has nothing to do there.

Code is what is left without comments and docstrings. Files of scenarios and exercises use features, and are not looked
at. If a test fails after you have moved or added a file: say so in the row; only a file that a newcomer need not know
of when adding such a feature goes into `besides`.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCE, BOARD, TESTS = ROOT / "src" / "sleepcast", ROOT / "clients" / "micropython", ROOT / "tests"
BASES = (SOURCE, BOARD, ROOT)
"""Where the paths of a row's second column begin, as CONTRIBUTING.md says."""
TABLE = re.compile(
    r"^### ([^\n]+)\n(?:(?!###).)*?^\| to change or add \|[^\n]*\n\|[-|]+\n((?:^\|[^\n]*\n)+)", re.M | re.S
)
PATH = re.compile(r"`([\w./-]+)`")
INSIDE = re.compile(r"`([\w./-]+)` \(((?:`[\w.]+`(?:, )?)+)\)")
"""A file, and behind it in parentheses what to look for in it."""
SENTENCES = {"sentences/": "sentences have a row of their own"}
SUFFIXES = (".py", ".js", ".html", ".css", ".toml")


@dataclass(frozen=True)
class Row:
    """A row of a table: its subject, and the cells of its three columns."""

    subject: str
    change: str
    places: str
    tests: str

    def paths(self) -> list[Path]:
        """The files and folders of the second column, there or not."""
        return [_at(path, BASES) for path in paths_in(self.places)]


@dataclass(frozen=True)
class Feature:
    """A feature that is there. row: how the first column of its row begins. pattern: how code names it. besides: files
    or folders below `src/sleepcast` or the board that name it, and why they are not meant."""

    row: str
    pattern: str
    besides: Mapping[str, str] = field(default_factory=dict)


FEATURES = {
    "the function CLAMP": Feature(
        "a pure function",
        r"(?i)\bclamp\b",
        {"console/static/style.css": "CSS has a function of this name", "console/static/mission.css": "the same"},
    ),
    "the form HYSTERESIS": Feature("a form that others can say", r"(?i)\bhysteresis\b"),
    "the form WHEN": Feature(
        "a special form",
        r"""(?i)["']when["']""",
        SENTENCES
        | {
            "cli/journal.py": "what an option is called in its help",
            "cli/run.py": "the same",
            "cli/tui/screen.py": "a style of the screen",
            "console/static/alerts.js": "takes the test out of a command",
            "console/static/robot.js": "the head of a column",
            "experiments/goals.py": "a key of goals",
            "language/reader.py": "a word of other languages, for which WHEN is suggested",
        },
    ),
    "the form DOTIMES": Feature("a special form", r"""(?i)["']dotimes["']"""),
    "the form COND": Feature(
        "a special form",
        r"""["']cond["']""",
        {"gym/together.py": "one of the parts that read sensors alone, for speed"},
    ),
    "the act JOIN": Feature(
        "an act on rules, groups or functions",
        r"""(?i)["']join["']""",
        SENTENCES | {"api/events.py": "a kind of event", "console/marks.py": "a kind of mark"},
    ),
    "the act FORGET": Feature(
        "an act on rules, groups or functions",
        r"""(?i)["']forget["']""",
        SENTENCES | {"sleepnode/latch.py": "which messages the latch has room for"},
    ),
    "the chance of GAUSS": Feature("chance", r"""(?i)["' /]gauss["' /]|import gauss|sleepnode\.gauss"""),
    "the mark of a quasi-quote": Feature("what the reader takes", r"(?i)quasiquote", SENTENCES),
    "the unit km": Feature("a unit", r"""["' ]km["' ]"""),
    "the dialect appendix-a": Feature("the dialects of 1998", r"appendix.a\b"),
    "how many rules a robot may have": Feature(
        "a bound of a robot's mind",
        r"\b_?MAX_RULES\b",
        {"station/failures.py": "how many rules that fail a desk remembers"},
    ),
    "the role of an observer": Feature("keys and roles", r"""\bOBSERVER\b|["']observer["']"""),
    "ids of messages that were heard": Feature(
        "which messages count as heard before",
        r"\bMAX_SEEN\b",
        {"station/cache.py": "how much a desk keeps of what it has heard of robots"},
    ),
    "what STOP holds": Feature(
        "an outcome that robots answer",
        r"""(?<!['"(])\bHELD(?:_BY_STOP)?\b|\b(?:account|row)\.held\b|\bn_held\b"""
        r"""|["']held["'], ["']not|["']held["']: (?:True|["'])""",
        {
            "cli/tui/session.py": "how long a key is held",
            "console/static/timeline.js": "how long a hand holds the timeline",
            "console/static/why.js": "explanations have a row of their own",
            "nomad/panes/backend.py": "what the page of Nomads says of STOP",
            "simulator/simd/": "where the value lies that an object holds",
        },
    ),
    ":priority": Feature("which rule has the last word", r"PRIORITY|:priority"),
    "the dead man's switch": Feature(
        "what a driven robot does",
        r"\bDriving\b",
        {"nomad/panes/static/": "driving a robot by hand", "fleet/schema.py": "how a snapshot keeps it"},
    ),
    "coming to rest": Feature(
        "when a stopped robot is at rest",
        r"\bat_rest\b",
        {
            "simulator/simulation.py": "robots that do not move",
            "testing/": "the contract that tests it",
        },
    ),
    "taking a lease": Feature("leases", r"LeaseAction"),
    "taking a lease on the page": Feature("leases", r"""ChangeLease|LeaseAction|ask\(.lease"""),
    "the kind HEARTBEAT": Feature(
        "a kind of message",
        r"\b_?HEARTBEAT\b",
        {
            "bridges/mavlink/opening.py": "MAVLink has messages of this name",
            "bridges/mavlink/vehicle.py": "MAVLink has messages of this name",
            "api/session_test.py": "sees by them when an operator went away",
        },
    ),
    "duplicates on the radio": Feature("the radio of a simulated swarm", r"\bduplication\b"),
    "telling that a robot catches up": Feature(
        "what robots report of themselves",
        r"""["']catching_up["']|telemetry\.catching_up|\bBodyState\b""",
        {"cli/baseline_check.py": "waits with a comparison until robots have caught up"},
    ),
    "the transport zenoh": Feature("a transport", r"""["']zenoh["']|^zenoh\b"""),
    "the journal's entry of an account": Feature("an entry of the journal", r"""\bACCOUNTED\b"""),
    "the subcommand watch": Feature(
        "a subcommand",
        r"""["']watch["']""",
        {
            "console/static/main.js": "a message of the page",
            "console/static/robot.js": "the same",
            "language/parts.py": "a slot of a part",
        },
    ),
    "the request for a spread": Feature(
        "a request of the page",
        r"""\b(?:Get)?Spread\b|def spread\(source|ask\(.spread""",
    ),
    "the key F8": Feature(
        "a keyboard shortcut",
        r"\bF8\b",
        {"console/feature.py": "a sentence that names the key"},
    ),
    "dark pages": Feature(
        "light and dark",
        r"color-scheme|data-theme=",
        {"simulator/world/svg_styles.py": "styles of drawings"},
    ),
    "the layer of density": Feature(
        "a layer of the map", r"\b[Dd]ensity\b", {"cli/run.py": "how many robots there are for an area"}
    ),
    "worlds without edges": Feature(
        "the table [world]",
        r"""["']torus["']|(?:scenario|world)\.(?:torus|around)\b""",
    ),
    "hills of fields": Feature("what a field of a scenario consists of", r"\bhills?\b"),
    "the sensor front_range": Feature(
        "a sensor",
        r"\bfront_range\b",
        {"nomad/bridge/model.py": "a Nomad behind a server, which has a row of its own"},
    ),
    "noise of a sensor": Feature(
        "noise of a sensor",
        r"""(?<!sonar)\.noise\b|["']noise["']""",
    ),
    "beams that return nothing": Feature(
        "noise of a sensor", r"\bdropout\b", {"nomad/world/robots/": "a setup whose sonars lose some"}
    ),
    "the neighbours' MEAN_X": Feature("a function of a robot's neighbours", r"\bMEAN_X\b"),
    "the slip of wheels": Feature("how robots drive", r"\bslip_noise\b", {"nomad/world/robots/": "a setup that slips"}),
    "sliding along what is touched": Feature("how robots drive", r"\bslides\b"),
    "counting encoders": Feature("what encoders count", r"""wheels\.counts|\b_counts\(table|import encoders"""),
    "the topic of failing rules": Feature("what recordings hold", r"""\bFAILING\b|["']/failing["']"""),
    "what a test says was never sent": Feature("what a saved test holds", r"\bnever_sent\b"),
    "the largest cluster": Feature("a measure of an experiment", r"\blargest_cluster\b"),
    "maps of heat": Feature("a figure of results", r"""["']heat["']"""),
    "what is said where a goal was missed": Feature(
        "an exercise",
        r"""["']otherwise["']|\.otherwise\b""",
        {"language/reader.py": "a word of other languages, for which TRUE is suggested"},
    ),
    "batteries in ROS 2": Feature(
        "ROS 2 robots",
        r"\bBatteryState\b",
        {"bridges/ros2/sensors.py": "simulated robots in ROS 2, which have a row of their own"},
    ),
    "motors off": Feature("Crazyflies", r"\bMOTORS.OFF\b"),
    "robots at ground stations": Feature("MAVLink", r"\bGroundStation\b"),
    "markers of TAK": Feature("robots on TAK maps", r"\bmarkers\b"),
    "erasing what a bumper felt": Feature("a request of the Nomad's wire", r"(?i)\brefresh_bumper_sensor\b"),
}


def paths_in(cell: str) -> list[str]:
    """What in a cell is the path of a file or a folder."""
    return [path for path in PATH.findall(cell) if "/" in path or path.endswith((*SUFFIXES, ".md", ".yml"))]


def _at(path: str, bases: tuple[Path, ...]) -> Path:
    return next((base / path for base in bases if (base / path).exists()), bases[0] / path)


@cache
def rows() -> list[Row]:
    """The rows of all tables."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    return [
        Row(subject, *(cell.strip() for cell in line.strip("|").split("|")))
        for subject, lines in TABLE.findall(text)
        for line in lines.splitlines()
    ]


@cache
def sources() -> list[tuple[Path, str]]:
    """Each file that may name a feature, with its text."""
    found = [
        path for base in (SOURCE, BOARD / "sleepnode") for path in sorted(base.rglob("*")) if path.suffix in SUFFIXES
    ]
    apart = [SOURCE / "scenarios", SOURCE / "exercises", SOURCE / "console" / "static" / "vendor"]
    return [
        (path, path.read_text(encoding="utf-8"))
        for path in found
        if not any(path.is_relative_to(folder) for folder in apart)
    ]


@cache
def code(path: Path) -> str:
    """The text without what only people read."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        tree = ast.parse(text)
        for node in ast.walk(tree):
            inside = getattr(node, "body", None)
            if isinstance(inside, list):
                node.body = [each for each in inside if not _is_docstring(each)] or [ast.Pass()]  # type: ignore[attr-defined]
        return ast.unparse(tree)
    return re.sub(r"(?:^|\s)//.*", "", text, flags=re.MULTILINE) if path.suffix == ".js" else text


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def naming(pattern: str) -> Iterator[Path]:
    """The files whose code names something."""
    named = re.compile(pattern, re.MULTILINE)
    return (path for path, text in sources() if named.search(text) and named.search(code(path)))


def row_of(feature: Feature) -> Row:
    (found,) = [row for row in rows() if row.change.startswith(feature.row)]
    return found


def below(path: Path, places: list[Path]) -> bool:
    return any(path.is_relative_to(place) for place in places)


def test_there_is_a_row_for_every_subject() -> None:
    assert len(rows()) >= 100
    assert len({row.subject for row in rows()}) >= 15


def test_the_paths_of_all_rows_exist() -> None:
    """A file or folder that was moved must be moved in CONTRIBUTING.md as well."""
    assert [(row.change, path) for row in rows() for path in row.paths() if not path.exists()] == []
    named = [(row.change, path) for row in rows() for path in paths_in(row.tests)]
    assert {row.change for row in rows()} - {change for change, _ in named} == set(), "no test"
    assert [(change, path) for change, path in named if not (TESTS / path).exists()] == [], "not below tests/"


@pytest.mark.parametrize("row", [pytest.param(row, id=row.change) for row in rows() if INSIDE.search(row.places)])
def test_what_a_row_says_is_in_a_file_is_there(row: Row) -> None:
    for path, names in INSIDE.findall(row.places):
        if not path.endswith((".py", ".js")):
            continue
        text = _at(path, BASES).read_text(encoding="utf-8")
        gone = [name for name in re.findall(r"`(?:\w+\.)*(\w+)`", names) if not re.search(rf"\b{name}\b", text)]
        assert not gone, f"{path} does not name it any more"


@pytest.mark.parametrize("name", FEATURES)
def test_a_row_names_every_file_that_knows_of_a_feature(name: str) -> None:
    feature = FEATURES[name]
    places = row_of(feature).paths()
    besides = [_at(path, BASES) for path in feature.besides]
    found = list(naming(feature.pattern))
    assert found, f"{feature.pattern} names nothing: the feature was renamed"
    lacking = [path.relative_to(ROOT).as_posix() for path in found if not below(path, places + besides)]
    assert not lacking, f"the row {feature.row!r} of CONTRIBUTING.md says nothing of files that name {name}"
    needless = [path for path in besides if not any(below(each, [path]) for each in found)]
    assert not needless, "files that do not name the feature any more need no reason"
