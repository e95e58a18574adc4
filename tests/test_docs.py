"""The documentation tells the truth: examples give what they say, links lead somewhere, commands are taken.

Fenced blocks are told apart by the word after the fence:

    sleep      expressions with their values, written as in tests/cases, on one fresh robot; `:ticks N` lets time pass
    finding    what the reader or the checker says of the expression in it
    explain    `:set` lines and an expression, a blank line, and the explanation of its evaluation
    bravo      commands of the tutorial, sent one after the other to that scenario's fleet: somebody obeys each, and
               nothing goes wrong (`bravo-fault`: it goes wrong afterwards, in a rule, which is deactivated)
    sentence   sentences for the fleet of bravo, each with its expression behind `=>`, which says the sentence again in
               the writer's words; or with the part that is not understood
    classic    the same as `sleep` for the classic dialect (also `faithful`, `appendix-a`); see `run_classic`
    python     a program that runs, and prints what its comments `# prints: ...` say
    sh         command lines of sleepcast that its parser takes
    console    command lines, each after `$ `, and what they print; `...` stands for anything
    terminal, air    a page that is followed as a whole: see tests/test_howto.py

A path behind that word makes the block a file, which the page's commands and programs find in their folder. Behind
`python`, `excerpt=station/station.py:Station._settle` makes it lines of that function, as they stand below
`src/sleepcast`; a line `...` leaves some out.
"""

from __future__ import annotations

import ast
import doctest
import importlib
import importlib.util
import os
import re
import shlex
import struct
import subprocess
import sys
import textwrap
import zlib
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import click
import go
import numpy as np
import pytest
import yaml

import forkserver
import sleepcast as sc
from language.cases import NodeMachine, Setting, apply_setting, mismatch, read_case
from sleepcast.cli import program
from sleepcast.cli.sentences import lexicon_of
from sleepcast.core.units import UNITS
from sleepcast.language import List, ReadError, check, read
from sleepcast.language.classic import MODES, ClassicError, ClassicMachine
from sleepcast.language.functions import BUILT_IN
from sleepcast.language.reader import walk
from sleepcast.loop import Swarm
from sleepcast.sentences import from_sentence, to_sentence
from sleepcast.simulator import Simulator, find_scenario
from sleepcast.station import Station
from test_layout import GROUND, HOUSE

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("src/**/*.md")])
REFERENCE = ROOT / "docs" / "language.md"
ARCHITECTURE = ROOT / "docs" / "architecture.md"
MAX_PICTURE = 2_000_000
"""Bytes of the README's picture: what a person on a slow line still waits for."""
PATIENCE = 15.0
"""Simulated seconds between two commands of the tutorial: enough for a rule to prove itself, or to fail."""
TICK = 0.1
"""Seconds of simulated time that one of `:ticks` lasts."""
EXCERPT = "excerpt="
FENCE = re.compile(r"^```([\w-]*)(?: (\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """One fenced block. sort: the word after the fence, or `excerpt`; file: the path behind it; source: what it is an
    excerpt of, as `path:function`. line: of its first line of text."""

    page: Path
    sort: str
    file: str
    text: str
    line: int
    source: str = ""

    @property
    def where(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def blocks_of(page: Path) -> list[Block]:
    """Every fenced block of a page."""
    text, found = page.read_text(encoding="utf-8"), []
    for match in FENCE.finditer(text):
        sort, behind, line = match[1], match[2] or "", text.count("\n", 0, match.start(3)) + 1
        source = behind.removeprefix(EXCERPT) if behind.startswith(EXCERPT) else ""
        found.append(Block(page, "excerpt" if source else sort, "" if source else behind, match[3], line, source))
    return found


def blocks(*sorts: str) -> list[Block]:
    """Every fenced block of these sorts in the documentation."""
    return [block for page in PAGES for block in blocks_of(page) if block.sort in sorts]


def each(*sorts: str) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("block", [pytest.param(block, id=block.where) for block in blocks(*sorts)])


def joined(block: Block) -> list[tuple[str, str]]:
    """The lines of a block with where they stand; a line that begins with a blank goes on with the one above."""
    lines: list[tuple[str, str]] = []
    for number, line in enumerate(block.text.splitlines(), block.line):
        if line.startswith(" ") and lines:
            where, above = lines.pop()
            lines.append((where, f"{above} {line.strip()}"))
        elif line:
            lines.append((f"{block.page.name}:{number}", line))
    return lines


# ---- examples of the language


@each("sleep")
def test_an_example_gives_what_it_says(block: Block) -> None:
    setting = Setting()
    lines = joined(block)
    while lines and lines[0][1].startswith(":") and not lines[0][1].startswith(":ticks"):
        apply_setting(setting, *lines.pop(0))
    robot, tick, wrong = NodeMachine(setting), 0, []
    for where, line in lines:
        if line.startswith(":ticks "):
            for _ in range(int(line.removeprefix(":ticks "))):
                tick += 1
                robot.mind.think(tick, tick * TICK)
            continue
        if line.startswith(":set "):
            apply_setting(setting, where, line)
            robot.sense(setting, tick * TICK)
            continue
        case = read_case(where, line)
        difference = mismatch(case, robot.evaluate(case.text), checks=True)
        if difference:
            wrong.append(f"{where}: {case.text}\n    wanted {case.expected}: {difference}")
    assert not wrong, "\n" + "\n".join(wrong)


@each("finding")
def test_a_finding_is_worded_as_it_is_shown(block: Block) -> None:
    shown = block.text.rstrip("\n")
    text = next(line for line in shown.splitlines() if line.startswith("  ")).strip()
    names = NodeMachine(Setting()).mind
    try:
        said = [finding.render(text) for finding in check(text, names).findings]
    except ReadError as error:
        said = [str(error)]
    assert shown in said


@each("explain")
def test_an_explanation_reads_as_it_is_shown(block: Block) -> None:
    asked, _, tree = block.text.partition("\n\n")
    setting, (*settings, text) = Setting(), asked.splitlines()
    for line in settings:
        apply_setting(setting, block.where, line)
    assert NodeMachine(setting).mind.evaluate(text).explanation.render() == tree.rstrip("\n")


@each("sentence")
def test_a_sentence_means_what_is_shown(block: Block) -> None:
    lexicon = lexicon_of("bravo")
    assert joined(block)
    for where, line in joined(block):
        sentence, _, meant = line.partition(" => ")
        heard = from_sentence(sentence, lexicon)
        if meant.startswith("not understood: "):
            parts = " | ".join(sentence[part.start : part.end] for part in heard.unclear)
            assert f"not understood: {parts}" == meant, where
            continue
        assert (heard.unclear, heard.form) == ((), read(meant)), where
        again = to_sentence(read(meant), lexicon)
        assert again is not None, where
        assert from_sentence(again.text, lexicon).form == heard.form, where


def test_the_commands_of_the_tutorial_are_obeyed() -> None:
    swarm = Swarm(Simulator(find_scenario("bravo"), 7))
    desk = swarm.desk = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm)
    swarm.run(PATIENCE)
    sent = [block for block in blocks("bravo", "bravo-fault") if block.page.name == "tutorial.md"]
    assert len(sent) > 5
    for block in sent:
        for text in block.text.strip().split("\n\n"):
            foretold = ("not told about", "divides by zero") if block.sort == "bravo-fault" else ("not told about",)
            findings = [
                finding.message
                for finding in desk.check(text).findings
                if not any(words in finding.message for words in foretold)
            ]
            command = desk.send(text)
            swarm.run(PATIENCE)
            account = desk.accounting(command.id)
            assert (findings, account.n_fault, account.n_silent) == ([], 0, 0), block.where
            assert account.n_matched > 0, block.where
            rules = [rule for node in swarm.minds.values() for rule in node.rules()]
            assert all(rule.active is (block.sort == "bravo") for rule in rules), block.where


def test_what_scouts_say_in_readme_and_tutorial_is_what_they_say() -> None:
    """Whoever sends the first command at the start, as both pages tell, can find these answers to Why on the page."""
    first = next(block.text.strip() for block in blocks("bravo"))
    fleet = sc.open("bravo")
    assert len(fleet.send(first).matched) == 26
    said = {fleet.why(robot).reason for robot in fleet.names}
    for name in ("README.md", "docs/tutorial.md"):
        prose = " ".join(FENCE.sub("", (ROOT / name).read_text(encoding="utf-8")).split())
        quoted = set(re.findall(r"`(\w+ = [^`]+, needed [^`]+)`", prose))
        assert quoted
        assert quoted <= said
        assert "26 of the 1,000" in prose or "26 of 1,000" in prose


def test_every_function_has_an_example_in_the_reference() -> None:
    shown: set[str] = set()
    for block in blocks("sleep"):
        if block.page == REFERENCE:
            for where, line in joined(block):
                if not line.startswith(":"):
                    form = read_case(where, line).text
                    shown.update(f.head for f in forms_in(form) if isinstance(f, List) and f.head)
    assert not sorted(set(BUILT_IN) - shown), "functions without an example in docs/language.md"


def forms_in(text: str) -> list[object]:
    """Every form in a text; none if it cannot be read."""
    try:
        return list(walk(read(text)))
    except ReadError:
        return []


def test_the_reference_lists_every_unit() -> None:
    section = REFERENCE.read_text(encoding="utf-8").partition("\n## Units\n")[2].partition("\n## ")[0]
    table = [line for line in section.splitlines() if line.startswith("| ")]
    assert set(re.findall(r"`([^`]+)`", "\n".join(table))) == set(UNITS)


BOUND = re.compile(r"^\| [^|]+ \| ([\d,.]+) \| `([\w.]+)\.([A-Z_]+)` \|", re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_bounds_in_tables_are_those_of_the_code(page: Path) -> None:
    for value, module, name in BOUND.findall(page.read_text(encoding="utf-8")):
        bound = getattr(importlib.import_module(f"sleepcast.{module}"), name)
        assert float(value.replace(",", "")) == bound, f"{module}.{name}"


def test_the_reference_shows_bounds() -> None:
    assert len(BOUND.findall(REFERENCE.read_text(encoding="utf-8"))) >= 15


# ---- the classic dialect


@each(*MODES)
def test_a_classic_example_gives_what_it_says(block: Block) -> None:
    machine = ClassicMachine(next(mode for mode in MODES if mode == block.sort))
    wrong = [fault for where, line in joined(block) if (fault := run_classic(machine, where, line))]
    assert not wrong, "\n".join(wrong)


def run_classic(machine: ClassicMachine, where: str, line: str) -> str:
    """How `EXPRESSION => VALUE ; says: LINE ; shown: TEXT` differs from what the machine does, "" if it does not."""
    text, _, rest = line.partition(" => ")
    expected, *notes = rest.split(" ; ")
    try:
        value = str(machine.evaluate(text))
    except ClassicError as error:
        value = str(error)
        if expected.startswith("error: ") and expected.removeprefix("error: ") in value:
            value = expected
    says = [note.removeprefix("says: ") for note in notes if note.startswith("says: ")]
    shown = [note.removeprefix("shown: ") for note in notes if note.startswith("shown: ")]
    if value != expected or machine.messages != says or (shown and machine.show(text).strip() != shown[0]):
        return f"{where}: {text} gave {value}, said {machine.messages}, shown {machine.show(text)}"
    return ""


# ---- the house


ROW = re.compile(r"^\| `(\w+)` \|[^|]+\|([^|]*)\|([^|]*)\|$", re.MULTILINE)


def test_the_table_of_rooms_is_the_one_that_the_layout_enforces() -> None:
    rows = {
        room: (set(re.findall(r"`(\w+)`", rooms)), set(re.findall(r"`(\w+)`", libraries)))
        for room, rooms, libraries in ROW.findall(ARCHITECTURE.read_text(encoding="utf-8"))
    }
    assert rows == {
        room: (set(entry.rooms), set(entry.libraries | entry.late_libraries)) for room, entry in HOUSE.items()
    }
    assert set(rows) > GROUND


# ---- scenario files


ANNOTATED = ROOT / "src" / "sleepcast" / "scenarios" / "README.md"
"""One whole scenario file with every key there is."""


def test_the_annotated_scenario_can_be_loaded_and_the_tables_name_its_keys(tmp_path: Path) -> None:
    text = next(block.text for block in blocks_of(ANNOTATED) if block.sort == "toml")
    (tmp_path / "scenario.toml").write_text(text, encoding="utf-8")
    find_scenario(str(tmp_path))
    named = set(re.findall(r"[a-z_]+", (ROOT / "docs" / "scenarios.md").read_text(encoding="utf-8")))
    keys = set(re.findall(r"^(?:# )?([a-z]\w*) =", text, re.MULTILINE))
    assert not keys - named, "keys that docs/scenarios.md does not name"


def test_decisions_have_the_numbers_that_a_reader_sees() -> None:
    """A list is shown with the numbers after its first, whatever is written."""
    text = (ROOT / "docs" / "decisions.md").read_text(encoding="utf-8")
    found = [int(number) for number in re.findall(r"^(\d+)\. ", text, re.MULTILINE)]
    assert found == list(range(1, len(found) + 1))


# ---- links


LINK = re.compile(r"(?<!`)\[[^\]]*\]\(([^)\s]+)\)")


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as they are made from the headings' words."""
    outside = FENCE.sub("", page.read_text(encoding="utf-8"))
    titles = re.findall(r"^#+ (.+)$", outside, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    wrong = []
    for link in LINK.findall(FENCE.sub("", page.read_text(encoding="utf-8"))):
        if link.startswith(("https://", "http://", "mailto:")):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists():
            wrong.append(f"{link}: there is no such file")
        elif anchor and anchor not in anchors(target):
            wrong.append(f"{link}: no heading makes this anchor")
    assert not wrong, "\n".join(wrong)


def test_every_page_can_be_reached_from_the_readme() -> None:
    seen, waiting = set(), [ROOT / "README.md"]
    while waiting:
        page = waiting.pop()
        if page in seen or page.suffix != ".md" or not page.exists():
            continue
        seen.add(page)
        links = LINK.findall(FENCE.sub("", page.read_text(encoding="utf-8")))
        waiting += [(page.parent / link.partition("#")[0]).resolve() for link in links if "://" not in link]
    assert not sorted(str(page.relative_to(ROOT)) for page in PAGES if page not in seen)


def test_the_sites_navigation_names_every_page_once() -> None:
    """`go.py docs` finds out the same, but takes too long for every check."""

    def named(entry: object) -> list[str]:
        if isinstance(entry, dict):
            (entry,) = entry.values()
        return [path for inside in entry for path in named(inside)] if isinstance(entry, list) else [str(entry)]

    paths = named(yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"])
    assert [path for path in paths if not (ROOT / path).is_file()] == []
    assert len(paths) == len(set(paths))
    assert {page.relative_to(ROOT).as_posix() for page in PAGES} - set(paths) == set()


# ---- pictures


def test_the_moving_picture_moves_and_is_small() -> None:
    picture = (ROOT / "docs" / "pictures" / "bravo.png").read_bytes()
    bodies = dict(pictures().chunks(picture))
    frames, repeats = struct.unpack(">II", bodies[b"acTL"])
    assert frames >= 20
    assert repeats == 0
    assert len(picture) < MAX_PICTURE


def test_a_moving_picture_keeps_its_frames(tmp_path: Path) -> None:
    apng = pictures()
    first = np.zeros((4, 6, 3), np.uint8)
    second = first.copy()
    second[1:3, 2:4] = (200, 40, 40)
    apng.write(tmp_path / "small.png", [first, second, second], [0.1, 0.2, 0.3])
    found = [(kind, body) for kind, body in apng.chunks((tmp_path / "small.png").read_bytes())]
    controls = [struct.unpack(">IIIIIHHBB", body) for kind, body in found if kind == b"fcTL"]
    assert [(x, y, width, height) for _, width, height, x, y, *_ in controls] == [
        (0, 0, 6, 4), (2, 1, 2, 2), (0, 0, 1, 1),
    ]  # fmt: skip
    assert [delay / 1000 for *_, delay, _, _, _ in controls] == [0.1, 0.2, 0.3]
    (changed,) = [body for kind, body in found if kind == b"fdAT"][:1]
    (palette,) = [body for kind, body in found if kind == b"PLTE"]
    places = zlib.decompress(changed[4:])[1:3]
    assert {palette[3 * place : 3 * place + 3] for place in places} == {bytes((200, 40, 40))}


def pictures() -> ModuleType:
    """The module that writes moving pictures."""
    spec = importlib.util.spec_from_file_location("apng", ROOT / "docs" / "pictures" / "apng.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# ---- commands and programs


SHELL = {
    "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    "COLUMNS": "100",
    "XDG_CACHE_HOME": os.environ["XDG_CACHE_HOME"],
    **forkserver.read_at_start(os.environ),
}
"""What the commands see: this environment's sleepcast and what is compiled already, no screen, no settings of whoever
runs the tests but those with which the program that is forked has begun."""


@each("sh")
def test_a_command_line_is_taken(block: Block) -> None:
    for line in block.text.splitlines():
        words = shlex.split(line, comments=True)
        if words[:2] == ["python3", "go.py"]:
            assert words[2:3] != ["with"] or set(words[3].split(",")) <= set(go.all_extras())
            words = ["sleepcast", *words[2:]] if words[2:3] not in (["test"], ["with"]) else []
        if words[:1] == ["sleepcast"] and len(words) > 1:
            parse(words[1:])


def parse(words: list[str]) -> None:
    """Let the command line's own parser take the words, without doing anything."""
    context = click.Context(program, info_name="sleepcast")
    name, command, rest = program.resolve_command(context, words)
    assert command is not None, f"there is no command {name}"
    command.make_context(name, rest, parent=context)


def write_files(page: Path, folder: Path) -> None:
    """Write the files that a page tells its reader to write: the blocks with a path behind their sort."""
    for block in blocks_of(page):
        if block.file:
            (folder / block.file).parent.mkdir(parents=True, exist_ok=True)
            (folder / block.file).write_text(block.text, encoding="utf-8")


@each("console")
def test_a_session_prints_what_is_shown(block: Block, tmp_path: Path) -> None:
    write_files(block.page, tmp_path)
    for session in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]:
        line, _, shown = session.partition("\n")
        command = forkserver.in_shell(line.replace("python3 go.py", "sleepcast"))
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        env = {**SHELL, "HOME": str(tmp_path), "PYTHONWARNINGS": "ignore"}
        done = forkserver.run(command, cwd=tmp_path, env=env, **streams)
        same = doctest.OutputChecker().check_output(shown, done.stdout, doctest.ELLIPSIS)
        assert same, f"{line}\nprinted\n{done.stdout}\nwanted\n{shown}"


@each("python")
def test_a_program_runs(
    block: Block, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    if "import supersuit" in block.text:
        pytest.importorskip("supersuit", reason="what it needs has no wheel for this Python")
    write_files(block.page, tmp_path)
    monkeypatch.chdir(tmp_path)
    exec(compile(block.text, block.where, "exec"), {"__name__": "example"})
    wanted = [line.partition("# prints: ")[2] for line in block.text.splitlines() if "# prints: " in line]
    assert capsys.readouterr().out.splitlines() == wanted


# ---- how it is built


def source_of(source: str) -> str:
    """The text of a function, given as `path:Class.method` below `src/sleepcast`, without the indent of its place."""
    path, _, name = source.partition(":")
    text = (ROOT / "src" / "sleepcast" / path).read_text(encoding="utf-8")
    node: ast.AST = ast.parse(text)
    for each in name.split("."):
        inside = [child for child in ast.iter_child_nodes(node) if getattr(child, "name", "") == each]
        assert inside, f"{path} has no {name} any more: say behind excerpt=, and in docs/architecture.md, where it went"
        (node,) = inside
    assert isinstance(node, ast.FunctionDef)
    return textwrap.dedent("\n".join(text.splitlines()[node.lineno - 1 : node.end_lineno]))


def excerpt_error(shown: str, source: str) -> str:
    """Why what is shown is not lines of the source in their order, "" if it is. Where lines stand apart, `...` stands
    between them; how far all of them are indented together does not matter."""
    lines = source.splitlines()
    begin = 0
    for piece in re.split(r"^ *\.\.\.\n", shown, flags=re.MULTILINE):
        wanted = textwrap.dedent(piece).splitlines()
        size = len(wanted)
        for place in range(begin, len(lines) - size + 1):
            if textwrap.dedent("\n".join(lines[place : place + size])).splitlines() == wanted:
                begin = place + size
                break
        else:
            there = {line.strip() for line in lines}
            gone = [line for line in wanted if line.strip() not in there] or [
                "(all are there, but not one after the other)"
            ]
            return "\n".join(["not in the function:", *gone, "", "the function as it is:", *lines])
    return ""


@each("excerpt")
def test_an_excerpt_is_what_the_function_says(block: Block) -> None:
    """If this fails, the function has changed: take its new lines over into the page, and look whether the words around
    them are still true. If it was moved, change the path after `excerpt=`, and the step in docs/architecture.md."""
    difference = excerpt_error(block.text, source_of(block.source))
    if difference:
        pytest.fail(f"{block.where} shows other lines than {block.source} has\n{difference}", pytrace=False)


def test_excerpts_are_compared_line_by_line() -> None:
    source = "def f(x):\n    if x:\n        y = 1\n    z = 2\n    return z\n"
    for shown in ("y = 1\n", "    if x:\n        y = 1\n", "if x:\n    y = 1\n...\nreturn z\n"):
        assert excerpt_error(shown, source) == ""
    for shown in ("y = 2\n", "if x:\ny = 1\n", "return z\n...\nz = 2\n", "y = 1\nreturn z\n"):
        assert excerpt_error(shown, source)


STEP = re.compile(r"`([a-z_/]+\.py): ([\w.]+)`")
DAY = ROOT / "docs" / "a-day-in-the-house.md"
"""One command down and one reading up, in excerpts."""


def test_a_day_in_the_house_goes_the_ways_that_the_architecture_lists() -> None:
    modules = {path for path, _ in STEP.findall(ARCHITECTURE.read_text(encoding="utf-8"))}
    sources = [block.source.partition(":")[0] for block in blocks_of(DAY) if block.sort == "excerpt"]
    assert len(sources) > 15
    assert [path for path in sources if path not in modules] == [], "docs/architecture.md names no step there"


def test_the_ways_down_and_up_exist() -> None:
    """Every step in docs/architecture.md that names a module and a function."""
    steps = STEP.findall(ARCHITECTURE.read_text(encoding="utf-8"))
    assert len(steps) > 25
    for path, name in steps:
        where = ".".join(["sleepcast", *path.removesuffix(".py").split("/")])
        found: object = importlib.import_module(where)
        for each in name.split("."):
            assert hasattr(found, each), f"docs/architecture.md: {path} has no {name}"
            found = getattr(found, each)
