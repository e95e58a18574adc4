"""The repository as a newcomer meets it: locks that agree, a start that explains itself, a whole wheel."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Mapping
from email.parser import BytesParser
from pathlib import Path

import go
import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import sleepcast
from installing import borrowing
from slow import SLOW

ROOT = Path(__file__).resolve().parent.parent
SITE = "https://sleepcast.readthedocs.io/en/stable/"
SOURCE = ROOT / "src"


def run(
    *command: str | Path, cwd: Path = ROOT, env: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, check=False)


# --- locks ------------------------------------------------------------------------------------------------


def locked(lock: str) -> set[tuple[str, str]]:
    """Names and versions in a lock. A line that pins nothing (an address, an option) is an error."""
    pins: set[tuple[str, str]] = set()
    for line in (ROOT / "requirements" / lock).read_text(encoding="utf-8").splitlines():
        if line.startswith((" ", "#")):
            assert line.lstrip().startswith(("#", "--hash=sha256:")), f"{lock}: {line}"
            continue
        requirement = Requirement(line.removesuffix("\\"))
        (pin,) = requirement.specifier
        assert pin.operator == "==", f"{lock}: {line}"
        pins.add((canonicalize_name(requirement.name), pin.version))
    return pins


def test_the_development_lock_holds_all_of_the_users_lock() -> None:
    assert locked("run.txt") < locked("dev.txt")


def test_the_locks_satisfy_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    groups = project["dependency-groups"]
    fast = project["project"]["optional-dependencies"]["fast"]  # numba comes with a clone
    clone = fast + groups["backend"] + groups["gallery"]
    wanted = {"run.txt": project["project"]["dependencies"] + clone, "dev.txt": []}
    wanted["rivals.txt"] = groups.pop("rivals")  # what a single benchmark wants, and nobody else
    wanted["docs.txt"] = groups.pop("docs")  # in an environment of their own
    wanted["rclpy.txt"] = groups.pop("rclpy")  # likewise
    wanted["counterparts.txt"] = [line for lines in go.families().values() for line in lines]  # an environment a family
    for name, group in groups.items():
        if name.startswith("counterparts-"):
            continue
        wanted["dev.txt"] += [line for line in group if isinstance(line, str)]
    for lock, lines in wanted.items():
        pins = locked(lock)
        for requirement in map(Requirement, lines):
            versions = [version for name, version in pins if name == canonicalize_name(requirement.name)]
            assert versions, f"{lock} lacks {requirement}: renew it as CONTRIBUTING.md says"
            assert all(version in requirement.specifier for version in versions), f"{lock}: {requirement}"


def test_a_clone_can_sweep_the_whole_gallery() -> None:
    """Every experiment of the gallery is planned and measured with what a clone has after its first start."""
    program = """
import sys
from importlib.metadata import packages_distributions
from packaging.utils import canonicalize_name

there = {"sleepcast", *sys.argv[1:]}
for module, owners in packages_distributions().items():
    if there.isdisjoint(map(canonicalize_name, owners)):
        sys.modules[module] = None

import sleepcast as sc
from sleepcast.experiments.measures import if_known, read_measure
from sleepcast.experiments.plan import experiment_of_scenario
from sleepcast.simulator import scenario_names

for name in scenario_names():
    if experiment := experiment_of_scenario(name):
        next(experiment.runs())
        with sc.open(name) as fleet:
            print(name, *(f"{if_known(read_measure(text))(fleet):g}" for text in experiment.measures.values()))
"""
    packages = sorted(name for name, _ in locked("run.txt"))
    done = run(sys.executable, "-c", program, *packages)
    assert done.returncode == 0, done.stderr
    assert {"gauci", "condensation"} <= {line.split()[0] for line in done.stdout.splitlines()}


def test_the_readme_says_what_each_extra_brings() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    listed = re.findall(r"^\| `(\w+)` \|", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert listed == sorted(project["optional-dependencies"])


def installed_version(name: str) -> str:
    """The version of a package in this environment; "" if it is not there, as what is for other computers."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return ""


def needs_of(name: str) -> list[Requirement]:
    """What a package says that it needs here."""
    needs = map(Requirement, importlib.metadata.requires(name) or [])
    return [each for each in needs if each.marker is None or each.marker.evaluate({"extra": ""})]


@pytest.mark.parametrize("extra", go.all_extras())
def test_the_lock_gives_an_extra_all_that_it_needs(extra: str) -> None:
    """And nothing twice: what go.py takes for it is closed, as the packages themselves say."""
    lock = "\n" + "".join(go.packages_of(go.RUN, [extra]))
    taken = set(re.findall(r"(?m)^[\w.-]+", lock))
    for name in taken:
        assert lock.count(f"\n{name}==") == f"\n{(ROOT / 'requirements' / 'dev.txt').read_text()}".count(f"\n{name}==")
    assert {canonicalize_name(name) for name in go.libraries(extra)} <= taken
    for name in filter(installed_version, taken):
        for each in needs_of(name):
            assert canonicalize_name(each.name) in taken, f"{name} needs {each}"


@pytest.mark.parametrize("lock", [go.RUN, go.DEV])
def test_a_lock_holds_all_that_its_packages_need(lock: str) -> None:
    """go.py installs what a lock lists and nothing else, so pip does not look for what is missing."""
    override = (ROOT / "requirements" / "override.txt").read_text()
    overridden = {Requirement(line).name for line in override.splitlines() if not line.startswith("#")}
    pins = locked(Path(lock).name)
    there = {name for name, _ in pins if installed_version(name)}
    assert len(there) > 20
    for name in there:
        for each in needs_of(name):
            pinned = [version for other, version in pins if other == canonicalize_name(each.name)]
            assert each.name in overridden or any(map(each.specifier.contains, pinned)), f"{name} needs {each}"


def test_the_citation_and_the_changelog_are_of_this_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["title"] == "sleepcast"
    assert citation["version"] == sleepcast.__version__
    assert f"\n## {sleepcast.__version__} ({citation['date-released']})\n" in (ROOT / "CHANGELOG.md").read_text()


def test_every_slow_file_is_there() -> None:
    assert [name for name in SLOW if not (ROOT / "tests" / name).is_file()] == []


# --- go.py ------------------------------------------------------------------------------------------------


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """What go.py needs, in a folder without .venv, so that it starts as on a fresh machine."""
    for name in ("go.py", "pyproject.toml", "requirements/run.txt", "requirements/dev.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


def test_go_refuses_an_old_python(clone: Path) -> None:
    done = start_changed(clone, "sys.version_info = (3, 9, 2)")
    assert "sleepcast needs Python 3.11 or newer; this is Python 3.9 (" in done.stderr
    assert "python3.11 go.py" in done.stderr
    assert (done.returncode, done.stdout) == (2, "")


@pytest.mark.parametrize("words", [[], ["audit"]], ids=["install", "a tool's environment"])
def test_go_names_the_package_that_is_missing(clone: Path, words: list[str]) -> None:
    done = start_changed(clone, "sys.modules['ensurepip'] = None", *words)
    version = "{}.{}".format(*sys.version_info)
    assert "cannot make virtual environments: its ensurepip is missing" in done.stderr
    assert f"sudo apt install python{version}-venv" in done.stderr
    assert (done.returncode, done.stdout) == (2, "")


def start_changed(
    clone: Path, change: str, *words: str, env: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run the clone's go.py in a Python that differs by this change."""
    start = f"import runpy, sys; {change}; sys.argv = ['go.py', *{words}]; runpy.run_path('go.py', run_name='__main__')"
    return run(sys.executable, "-c", start, cwd=clone, env=env)


def test_go_tells_what_it_builds_and_takes_no_more_words(clone: Path) -> None:
    taken = run(sys.executable, "go.py", "docs", "--help", cwd=clone)
    assert (taken.returncode, "go.py docs" in taken.stdout) == (0, True)
    wrong = run(sys.executable, "go.py", "docs", "here", cwd=clone)
    assert (wrong.returncode, "takes no arguments" in wrong.stderr) == (2, True)


def test_go_builds_no_site_without_npm(clone: Path) -> None:
    done = run(sys.executable, "go.py", "docs", cwd=clone, env={**os.environ, "PATH": str(clone)})
    assert done.stderr.startswith("The site needs npm.")
    assert (done.returncode, done.stdout) == (1, "")
    assert not (clone / ".venv-docs").exists()


def test_go_says_why_it_cannot_make_its_environment(clone: Path) -> None:
    (clone / ".venv").write_text("a file where the folder should be")
    done = run(sys.executable, "go.py", cwd=clone)
    assert f"Cannot make the virtual environment {clone / '.venv'}: " in done.stderr
    assert "Traceback" not in done.stderr
    assert (done.returncode, done.stdout) == (1, "")


def test_go_stops_cleanly_at_an_interrupt(clone: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "go.py"], cwd=clone, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stderr is not None
        first = process.stderr.readline()
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to everything that runs in it
        rest = process.stderr.read()
    assert first.startswith("sleepcast: installing")
    assert "Traceback" not in rest
    assert process.returncode == 130


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with sleepcast in which go.py finds our libraries installed, so that its locks may name none."""
    clone = tmp_path_factory.mktemp("ours")
    for name in ("go.py", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, clone / name)
    shutil.copytree(SOURCE, clone / "src")  # with what Python has compiled, else each clone would compile it anew
    (clone / "requirements").mkdir()
    (clone / "requirements" / "run.txt").write_text("")
    (clone / "requirements" / "dev.txt").write_text("")
    borrowing(clone / ".venv")
    (clone / ".venv" / "bin" / f"pip{go.VERSION}").touch()  # pip is one of our libraries, too
    return clone


NOWHERE = f"--hash=sha256:{'0' * 64}"
"""The hash of what no index has."""


def offline(clone: Path) -> dict[str, str]:
    """Surroundings in which pip finds no package."""
    return {**os.environ, "PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(clone / "nothing")}


def test_go_takes_a_failed_installation_for_no_installation(ours: Path, tmp_path: Path) -> None:
    clone = shutil.copytree(ours, tmp_path / "clone", symlinks=True)
    (clone / "requirements" / "run.txt").write_text(f"nothing==1.0 \\\n    {NOWHERE}\n")
    for _ in range(2):
        done = run(sys.executable, "go.py", cwd=clone, env=offline(clone))
        assert "sleepcast: installing requirements/run.txt" in done.stderr
        assert "Installing failed; pip says why above." in done.stderr
        assert "Traceback" not in done.stderr
        assert (done.returncode, done.stdout) == (1, "")


@pytest.fixture(scope="module")
def started(ours: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """A clone after its first start, on a computer that can have no numba; and what that said."""
    clone = shutil.copytree(ours, tmp_path_factory.mktemp("first") / "clone", symlinks=True)
    lock = f"llvmlite==99.0 \\\n    {NOWHERE}\n    # via numba\nnumba==99.0 \\\n    {NOWHERE}\n"
    (clone / "requirements" / "run.txt").write_text(lock)
    return clone, run(sys.executable, "go.py", "eval", "(+ 1 2)", cwd=clone, env=offline(clone))


def test_go_does_without_numba_where_there_is_none_for_this_computer(
    started: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    _, done = started
    assert (done.returncode, done.stdout) == (0, "3\n"), done.stderr
    assert "numba cannot be installed here" in done.stderr


def test_go_compiles_the_simulator_as_the_last_step_of_its_set_up(
    started: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    """And what that tells is no result."""
    clone, done = started
    assert done.stdout == "3\n"
    assert "scenarios are ready to start" in done.stderr
    again = run(sys.executable, "go.py", "eval", "(+ 1 2)", cwd=clone)
    assert (again.stdout, again.stderr) == ("3\n", "")


@pytest.fixture
def toy(ours: Path, tmp_path: Path) -> tuple[Path, dict[str, str]]:
    """A clone, set up already, with an extra whose library needs another one; and where pip finds both."""
    clone, index = shutil.copytree(ours, tmp_path / "clone", symlinks=True), tmp_path / "index"
    index.mkdir()
    lock = ""
    for name, needs, by in (
        ("toy-library", "toy-helper", "sleepcast (pyproject.toml:dev)"),
        ("toy-helper", "", "toy-library"),
    ):
        lock += f"{name}==1.0 \\\n    --hash=sha256:{small_wheel(index, name, needs)}\n    # via {by}\n"
    (clone / "requirements" / "dev.txt").write_text(lock)
    project = clone / "pyproject.toml"
    project.write_text(project.read_text().replace("\nzenoh = [", '\ntoy = ["Toy-Library>=1"]\nzenoh = ['))
    (clone / ".venv" / "installed").write_text(stamp_of(clone))
    return clone, {**os.environ, "PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(index)}


def small_wheel(folder: Path, name: str, needs: str) -> str:
    """Write a wheel without modules; gives its hash. needs: the name of another package, or nothing."""
    about, file = f"{name.replace('-', '_')}-1.0", folder / f"{name.replace('-', '_')}-1.0-py3-none-any.whl"
    with zipfile.ZipFile(file, "w") as archive:
        requires = f"Requires-Dist: {needs}\n" if needs else ""
        archive.writestr(
            f"{about}.dist-info/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n{requires}"
        )
        archive.writestr(f"{about}.dist-info/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{about}.dist-info/RECORD", "")
    return hashlib.sha256(file.read_bytes()).hexdigest()


def stamp_of(clone: Path, *extras: str) -> str:
    """What go.py keeps of a finished set-up, as it says itself."""
    return run(sys.executable, "-c", f"import go; print(go.state(go.RUN, {extras}), end='')", cwd=clone).stdout


def test_go_installs_an_extra_with_all_that_it_needs_and_keeps_it(toy: tuple[Path, dict[str, str]]) -> None:
    clone, env = toy
    done = run(sys.executable, "go.py", "with", "toy", cwd=clone, env=env)
    assert done.returncode == 0, done.stderr
    assert f"find it with this Python: {clone}/.venv/bin/python\n" in done.stdout
    names = "from importlib.metadata import version as v; print(v('toy-library'), v('toy-helper'))"
    assert run(clone / ".venv" / "bin" / "python", "-c", names).stdout == "1.0 1.0\n"
    assert "scenarios are ready" not in done.stderr, "nothing to compile has changed"
    again = run(sys.executable, "go.py", "eval", "(+ 1 2)", cwd=clone, env=env)
    assert (again.stdout, again.stderr) == ("3\n", "")
    assert (clone / ".venv" / "installed").read_text() == stamp_of(clone, "toy"), "with a newer lock it is renewed, too"


def test_go_names_the_extras_that_there_are(clone: Path) -> None:
    for words, said in (((), "No extra is named"), (("maps,gim",), "There is no extra 'gim'")):
        done = run(sys.executable, "go.py", "with", *words, cwd=clone)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith(f"{said}: wanted some of bags, cluster, crazyflie, ")


def test_go_names_the_families_of_counterparts(clone: Path) -> None:
    done = run(sys.executable, "go.py", "test", "counterparts", "tak", "tok", cwd=clone)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(
        "There is no family 'tok' of counterparts: wanted some of crazyflie, learning, mavlink, "
    )


def test_go_says_which_family_does_otherwise_and_goes_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ends = {"tak": "otherwise now", "zenoh": "as it was"}
    tried = list[tuple[str, bool]]()
    monkeypatch.setattr(go, "try_family", lambda family, newest: tried.append((family, newest)) or ends[family])
    assert go.counterparts("tak", "--newest", "zenoh") == 1
    assert capsys.readouterr().out == "otherwise now   tak\nas it was       zenoh\n"
    assert go.counterparts("zenoh") == 0
    assert tried == [("tak", True), ("zenoh", True), ("zenoh", False)]


def test_go_tries_no_family_that_it_cannot_install(clone: Path) -> None:
    for name in ("counterparts.txt", "counterparts/package.json"):
        (clone / "requirements" / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / "requirements" / name, clone / "requirements" / name)
    borrow = f"sys.path.insert(0, {str(ROOT / 'tests')!r}); import installing, venv; venv.create = installing.with_pip"
    done = start_changed(clone, borrow, "test", "counterparts", "zenoh", env=offline(clone))
    assert (done.returncode, done.stdout) == (1, "== zenoh, from the lock\nnot tried       zenoh\n")
    assert "pip says why above" in done.stderr


@pytest.mark.parametrize("family", go.families())
def test_the_lock_gives_a_family_all_that_it_needs(family: str) -> None:
    lines = [*go.families()[family], *go.project_file()["project"]["dependencies"]]
    names = {go.package_name(line) for line in lines}
    taken = go.with_needs(names, go.read_lock(go.COUNTERPARTS))
    assert names < taken.keys()
    known = set(json.loads((ROOT / "requirements/counterparts/package.json").read_text())["dependencies"])
    assert set(go.npm_families().get(family, ())) <= known


# --- the wheel --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    done = run(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder)
    assert done.returncode == 0, done.stdout + done.stderr
    (built,) = folder.glob("*.whl")
    return built


def test_the_wheel_holds_the_whole_package(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
    files = {path.relative_to(SOURCE) for path in (SOURCE / "sleepcast").rglob("*") if path.is_file()}
    made_by_tools = {path for path in files if any(part.startswith((".", "__pycache__")) for part in path.parts)}
    assert packed == {path.as_posix() for path in files - made_by_tools}
    assert "sleepcast/console/static/index.html" in packed
    assert "sleepcast/py.typed" in packed
    assert any(name.startswith("sleepcast/scenarios/") for name in packed)


def test_what_the_package_index_shows_leads_to_the_documentation(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        (metadata,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        about = BytesParser().parsebytes(archive.read(metadata))
    text = about.get_payload()
    assert isinstance(text, str)
    links = re.findall(r"\]\(([^)\s]+)", text)
    assert not [link for link in links if not link.startswith(("https://", "#"))]
    urls = [url.partition(", ")[2] for url in about.get_all("Project-URL", [])]
    ours = [link.removeprefix(SITE).partition("#")[0] for link in (*links, *urls) if link.startswith(SITE)]
    assert len(ours) > 30
    assert [path for path in ours if not (source := page_source(path)).is_file() or source.suffix == ".html"] == []


def page_source(path: str) -> Path:
    """The file from which the documentation's site makes what it has at this path."""
    folder, _, name = path.rpartition("/")
    name = "README.md" if name in ("", "index.html") else name
    return ROOT / folder / (name.removesuffix(".html") + ".md" if name.endswith(".html") else name)


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scripts of an environment that holds the wheel, and borrows our libraries but not our sleepcast."""
    home = tmp_path_factory.mktemp("empty")
    borrowing(home)
    python = home / "bin" / "python"
    install = ("install", "--quiet", "--no-compile", "--ignore-installed", "--no-index", "--no-deps", wheel)
    done = run(sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", python, *install)
    assert done.returncode == 0, done.stderr
    return home / "bin"


def test_the_wheel_works_on_its_own(installed: Path, tmp_path: Path) -> None:
    where = run(installed / "python", "-c", "import sleepcast; print(sleepcast.__file__)", cwd=tmp_path)
    assert Path(where.stdout.strip()).is_relative_to(installed.parent)
    version = run(installed / "sleepcast", "--version", cwd=tmp_path)
    assert sleepcast.__version__ in version.stdout
    value = run(installed / "sleepcast", "eval", "(+ 1 2)", cwd=tmp_path)
    assert (value.stdout, value.stderr, value.returncode) == ("3\n", "", 0)


def test_the_wheel_says_what_pip_is_to_install(installed: Path, tmp_path: Path) -> None:
    program = "from sleepcast.core.extras import installing; print(installing('tak'))"
    said = run(installed / "python", "-c", program, cwd=tmp_path).stdout
    assert said == f"{installed / 'python'} -m pip install 'pyproj>=3.6' 'takproto>=2.1'\n"


def test_the_wheels_scenario_runs(installed: Path, tmp_path: Path) -> None:
    options = ("--headless", "--seconds", "1", "--seed", "7", "--json")
    done = run(installed / "sleepcast", "demo", "bravo", *options, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["scenario"] == "bravo"
