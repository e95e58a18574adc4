"""Start sleepcast from a clone, or check it.

    python3 go.py [COMMAND ...]         the command `sleepcast ...`, from this folder
    python3 go.py with EXTRA,...        install what extras bring, such as experiments,gym (the README lists them)
    python3 go.py test quick            before each commit: all checks but the slow tests, in about a minute
    python3 go.py test [OPTION ...]     every check; the options go to pytest
    python3 go.py test network          the channel on a thousand robots in networks of their own: twenty minutes
    python3 go.py test counterparts [FAMILY ...] [--newest]
                                        other programs, in locked or in their newest versions (docs/counterparts.md)
    python3 go.py audit                 ask the package index what is known against the locked versions
    python3 go.py docs                  build the documentation as a site, in the folder site

The plan: fill a virtual environment in `.venv` beside this file from a lock with hashes (RUN to use it, DEV to test it:
RUN and more, of which an extra gets its part), keep a stamp of what was installed, so that a later start costs one
comparison, let the program compile what its simulations need, and hand over. Standard library only; what a warm start
can do without is imported late.
"""

import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import subprocess

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
PYTHON = VENV / "bin" / "python"
RUN, DEV, DOCS = "requirements/run.txt", "requirements/dev.txt", "requirements/docs.txt"
COUNTERPARTS, RCLPY = "requirements/counterparts.txt", "requirements/rclpy.txt"
FAST = ("llvmlite==", "numba==")
"""What not every computer that runs Python can have (Macs with Intel's processors, Linux with musl), nor needs."""
VERSION = "{}.{}".format(*sys.version_info)


def refusal(sentence: str, code: int = 2) -> SystemExit:
    print(sentence, file=sys.stderr)
    return SystemExit(code)


def run(*command: str, aside: bool = False) -> bool:
    """Run a module of the environment; true if it succeeded. aside: what it prints is no result."""
    return started(*command, stdout=sys.stderr if aside else None).wait() == 0


def started(*command: str, **streams: Any) -> "subprocess.Popen[bytes]":
    """Let a module of the environment run in a process beside this one, which it gives."""
    import subprocess

    return subprocess.Popen([PYTHON, "-m", *command], cwd=ROOT, **streams)


def make_environment(folder: Path) -> None:
    """Make a new virtual environment with pip, instead of whatever is there."""
    import importlib.util
    import subprocess
    import venv

    if importlib.util.find_spec("ensurepip") is None:
        raise refusal(
            f"This Python ({sys.executable}) cannot make virtual environments: its ensurepip is missing.\n"
            f"On Debian or Ubuntu, install it with: sudo apt install python{VERSION}-venv"
        )
    try:
        venv.create(folder, clear=True, symlinks=True, with_pip=True)
    except (OSError, subprocess.CalledProcessError) as error:
        raise refusal(f"Cannot make the virtual environment {folder}: {error}", 1) from None


def state(lock: str, extras: Sequence[str] = ()) -> str:
    """All that an environment made from this lock, with these extras, depends on."""
    files = ["pyproject.toml", lock, *([DEV] if extras else [])]
    return "\n".join([VERSION, str(ROOT), *extras, *((ROOT / file).read_text() for file in files)])


def extras_kept() -> list[str]:
    """The extras that `with` has installed, which stay."""
    file = VENV / "extras"
    return file.read_text().split() if file.exists() else []


def prepare(lock: str, more: Sequence[str] = ()) -> None:
    """Bring .venv to what the lock says, unless it is there already. more: extras that are wanted from now on."""
    stamp, extras = VENV / "installed", sorted({*extras_kept(), *more})
    there = stamp.read_text() if PYTHON.exists() and stamp.exists() else ""
    if there not in (state(lock, extras), state(DEV)):
        fill_environment(lock, extras, stamp)
        if lock == RUN and (there != state(RUN, extras_kept()) or "fast" in more):  # a check does so while mypy works
            run("sleepcast", "prepare", aside=True)  # it is ready without, but then the first scenario would compile
    if more:
        (VENV / "extras").write_text(" ".join(extras))


def fill_environment(lock: str, extras: Sequence[str], stamp: Path) -> None:
    """Install what the lock says and what the extras bring, then the project itself."""
    import subprocess

    what = " and what it needs for " + ", ".join(extras) if extras else ""
    print(f"sleepcast: installing {lock}{what} into {VENV} ...", file=sys.stderr)
    # pip writes its name with the version last: without it, .venv is half made or another Python's.
    if not (PYTHON.exists() and (VENV / "bin" / f"pip{VERSION}").exists()):
        make_environment(VENV)
    try:
        stamp.unlink(missing_ok=True)
    except OSError as error:
        raise refusal(f"Cannot change the virtual environment {VENV}: {error}", 1) from None

    def begin(file: str, packages: Sequence[str], *options: str) -> subprocess.Popen[bytes]:
        """Begin to install these packages, which the file is to list, and nothing else: a lock has all that they need
        (a test), of the versions that work."""
        (VENV / file).write_text("".join(packages))
        # Python compiles what is imported when it is; all of it would take longer than the download.
        how = ("install", "--quiet", "--disable-pip-version-check", "--no-compile", "--no-deps", "--require-hashes")
        return subprocess.Popen([PYTHON, "-m", "pip", *how, *options, "-r", VENV / file], cwd=ROOT)

    packages = packages_of(lock, extras)
    fast = [each for each in packages if each.startswith(FAST)]
    others = [each for each in packages if each not in fast]
    # One pip keeps one core busy. To build LLVM would take an hour.
    halves = [begin(f"lock-{part}.txt", others[part::2]) for part in range(min(2, len(others)))]
    is_fast = not fast or begin("lock-fast.txt", fast, "--only-binary=:all:").wait() == 0
    # The lock holds the build backend too, so the project itself is installed without the network.
    itself = ("--no-index", "--no-deps", "--no-build-isolation", "--editable", ".")
    failed = [half for half in halves if half.wait()]
    if failed or not run("pip", "install", "--quiet", "--disable-pip-version-check", *itself):
        raise refusal("Installing failed; pip says why above. Then run the same command again.", 1)
    if not is_fast:
        print("sleepcast: numba cannot be installed here, as pip says above: simulations are slower.", file=sys.stderr)
    stamp.write_text(state(lock, extras))


def packages_of(lock: str, extras: Sequence[str]) -> list[str]:
    """The packages of a lock, and those of DEV that extras bring: each with its versions and hashes."""
    found = read_lock(lock)
    if extras:
        found |= with_needs({name for extra in extras for name in libraries(extra)}, read_lock(DEV), found)
    return [found[name] for name in sorted(found)]


def read_lock(file: str) -> dict[str, str]:
    """The lines of each package in a lock."""
    import re

    packages: dict[str, str] = {}
    for entry, name in re.findall(r"(?m)^(([\w.-]+).*\n(?:[ #].*\n)*)", (ROOT / file).read_text()):
        packages[name] = packages.get(name, "") + entry  # other Pythons may need another version
    return packages


def with_needs(names: set[str], known: dict[str, str], there: Iterable[str] = ()) -> dict[str, str]:
    """These packages of a lock, and what they need besides what is there."""
    import re

    # The lock says behind "via" who needs a package.
    needed_by = {name: set(re.findall(r"(?m)^ *# +(?:via +)?([\w.-]+)", entry)) for name, entry in known.items()}
    found, new = dict[str, str](), names
    while new:
        found |= {name: known[name] for name in new}
        new = {name for name, by in needed_by.items() if by & new and name not in found and name not in there}
    return found


def libraries(extra: str) -> list[str]:
    """The names of the libraries that pyproject.toml lists for an extra."""
    return [package_name(line) for line in all_extras()[extra]]


def package_name(line: str) -> str:
    """As locks write it."""
    import re

    return re.sub("[-_.]+", "-", re.split(r"[^\w.-]", line)[0]).lower()


def project_file() -> dict[str, Any]:
    import tomllib

    return tomllib.loads((ROOT / "pyproject.toml").read_text())


def all_extras() -> dict[str, list[str]]:
    return dict(project_file()["project"]["optional-dependencies"])


def install_extras(*words: str) -> int:
    """Install what extras bring, and say how to use it."""
    wanted, known = [each for word in words for each in word.split(",") if each], all_extras()
    unknown = [each for each in wanted if each not in known]
    if unknown or not wanted:
        wrong = f"There is no extra {unknown[0]!r}" if unknown else "No extra is named"
        raise refusal(f"{wrong}: wanted some of {', '.join(known)}; for example: python3 go.py with experiments,gym")
    prepare(RUN, wanted)
    missing = [each for each in wanted if not all(map(is_installed, libraries(each)))]
    if missing:
        (VENV / "extras").write_text(" ".join(each for each in extras_kept() if each not in missing))
        raise refusal(f"Not to be had for this computer and Python {VERSION}: what {', '.join(missing)} needs.", 1)
    print(
        f"{', '.join(wanted)}: installed, for python3 go.py and {VENV / 'bin' / 'sleepcast'}\n"
        f"Your own programs and notebooks find it with this Python: {PYTHON}\n"
        f"To have both in this terminal by their names: source {VENV / 'bin' / 'activate'}"
    )
    return 0


def is_installed(library: str) -> bool:
    import subprocess

    look = f"import importlib.metadata as m; m.version({library!r})"
    return subprocess.run([PYTHON, "-c", look], stderr=subprocess.DEVNULL, check=False).returncode == 0


def test(*pytest_options: str) -> int:
    """Run every check, even after one has failed; pytest last, so that its closing line closes the output."""
    if pytest_options in (("--help",), ("-h",)):
        print(__doc__)
        return 0
    if pytest_options[:1] == ("network",):
        large = ("--hypothesis-profile", "nightly", "-rPs")  # and what was measured is told
        return 0 if run("pytest", "tests/network", *large, *pytest_options[1:]) else 1
    if pytest_options[:1] == ("quick",):
        pytest_options = ("--hypothesis-profile", "quick", "-m", "not browser", *pytest_options[1:])
    import subprocess
    import tempfile

    # Tests start the program a thousand times. Where nothing compiled may be kept, each start compiles all of it anew.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    # Whole files go to six processes more than there are cores, since many tests wait for real time, in the order of
    # tests/conftest.py: a file's tests share what is expensive to make.
    spread = (f"--numprocesses={(os.cpu_count() or 1) + 6}", "--dist=loadfile", "--no-loadscope-reorder")
    failed = []
    # mypy needs one core only, so it works beside the others, and is heard only if it finds something.
    with tempfile.TemporaryFile("w+") as found:
        print("== mypy, beside the others", flush=True)
        types = started("mypy", stdout=found, stderr=subprocess.STDOUT)
        compile_for_tests(types)
        for check in (("ruff", "format", "--check"), ("ruff", "check"), ("pytest", *spread, *pytest_options)):
            print("==", *check, flush=True)
            if not run(*check):
                failed.append(" ".join(check))
        if types.wait():
            found.seek(0)
            print(found.read(), file=sys.stderr)
            failed.append("mypy")
    if failed:
        print("failed:", *failed, sep="\n  ", file=sys.stderr)
    return 1 if failed else 0


def compile_for_tests(types: "subprocess.Popen[bytes]") -> None:
    """Let the program compile its kernels, and Python the tests as soon as that or mypy leaves it a core: else several
    processes of pytest would compile the same. types: mypy's process."""
    import subprocess
    import time

    preparing = started("sleepcast", "prepare", "--quiet", stdout=sys.stderr)
    while preparing.poll() is None and types.poll() is None:
        time.sleep(0.1)
    started("pytest", "--collect-only", "-qq", stdout=subprocess.DEVNULL).wait()
    preparing.wait()


def tool_environment(name: str, *what: str) -> Path:
    """A new environment of this name, beside .venv, with what pip is told to install."""
    import subprocess

    tools = ROOT / name
    make_environment(tools)
    install = ("-m", "pip", "install", "--quiet", "--disable-pip-version-check", *what)
    if subprocess.run([tools / "bin" / "python", *install], cwd=ROOT, check=False).returncode:
        raise refusal(f"Filling {name} failed; pip says why above. Then run the same command again.", 1)
    return tools


def families() -> dict[str, list[str]]:
    """The families of docs/counterparts.md, with what each needs from the package index."""
    groups = {name.removeprefix("counterparts-"): lines for name, lines in project_file()["dependency-groups"].items()}
    return {
        name: [line for line in lines if isinstance(line, str)]
        for name, lines in groups.items()
        if {"include-group": "counterparts-tests"} in lines
    }


def npm_families() -> dict[str, list[str]]:
    """What families need from npm."""
    import json

    return dict(json.loads((ROOT / "requirements/counterparts/package.json").read_text())["families"])


def counterparts(*words: str) -> int:
    """Test how counterparts behave, one family after the other, and say where docs/counterparts.md is wrong now."""
    newest, known = "--newest" in words, families()
    wanted = [word for word in words if word != "--newest"]
    if unknown := [word for word in wanted if word not in known]:
        raise refusal(
            f"There is no family {unknown[0]!r} of counterparts: wanted some of {', '.join(known)}, or --newest"
        )
    ends = {family: try_family(family, newest) for family in wanted or known}
    for family, end in ends.items():
        print(f"{end:15} {family}")
    return 0 if set(ends.values()) == {"as it was"} else 1


def try_family(family: str, newest: bool) -> str:
    """Run the tests of a family in an environment of its own."""
    import subprocess
    import tempfile

    print(f"== {family}, {'newest versions' if newest else 'from the lock'}", flush=True)
    try:
        python, surroundings = family_environment(family, newest), dict(os.environ)
        if family == "ros2" and (sys.platform, os.uname().machine) == ("linux", "x86_64"):
            surroundings["SLEEPCAST_RCLPY"] = str(rclpy_environment(newest))
    except SystemExit:  # it has said why
        return "not tried"
    # Else pytest would clear away what other runs of it on this computer have left, and fail where they still write.
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        tests = (python, "-m", "pytest", "--counterparts", family, f"--basetemp={folder}/tests")
        end = subprocess.run(tests, cwd=ROOT, env=surroundings, check=False).returncode
    return {0: "as it was", 1: "otherwise now"}.get(end, "not tried")


def family_environment(family: str, newest: bool) -> Path:
    """The Python of an environment with this family, what its tests need, and sleepcast."""
    groups, lines = project_file(), families()[family]
    lines = [*lines, *groups["dependency-groups"]["counterparts-tests"], *groups["project"]["dependencies"]]
    if newest:
        what = ["--upgrade", *lines]
    else:
        locked = ROOT / ".venv-counterparts" / f"{family}.txt"
        locked.parent.mkdir(exist_ok=True)
        locked.write_text("".join(with_needs({package_name(line) for line in lines}, read_lock(COUNTERPARTS)).values()))
        what = ["--require-hashes", "--no-deps", "--requirement", str(locked)]
    tools = tool_environment(f".venv-counterparts/{family}", "--no-compile", *what)
    for site in tools.glob("lib/python*/site-packages"):
        (site / "sleepcast.pth").write_text(str(ROOT / "src"))  # to install it, its family may forbid what builds it
    if packages := npm_families().get(family):
        add_from_npm(tools, packages, newest)
    return tools / "bin" / "python"


def rclpy_environment(newest: bool) -> Path:
    """The Python of an environment with real ROS 2, whose packages are pre-releases."""
    lines = project_file()["dependency-groups"]["rclpy"]
    what = ("--pre", "--upgrade", *lines) if newest else ("--require-hashes", "--requirement", RCLPY)
    return tool_environment(".venv-counterparts/rclpy", "--no-compile", *what) / "bin" / "python"


def add_from_npm(tools: Path, packages: Sequence[str], newest: bool) -> None:
    """Install some of the packages of requirements/counterparts/, and no others."""
    import json
    import shutil

    source = ROOT / "requirements/counterparts"
    wanted = json.loads((source / "package.json").read_text())["dependencies"]
    dependencies = {name: "latest" if newest else wanted[name] for name in packages}
    (tools / "package.json").write_text(json.dumps({"private": True, "dependencies": dependencies}))
    if not newest:
        shutil.copy(source / "package-lock.json", tools)
    npm(tools, "install")


def npm(tools: Path, command: str) -> None:
    """Run npm on the package.json of an environment."""
    import shutil
    import subprocess

    if shutil.which("npm") is None:
        raise refusal(f"{tools.name} needs npm. On Debian or Ubuntu, install it with: sudo apt install npm", 1)
    quietly = ("--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error")
    if subprocess.run(["npm", command, *quietly], cwd=tools, stdout=sys.stderr, check=False).returncode:
        raise refusal(f"Filling {tools.name} failed; npm says why above. Then run the same command again.", 1)


def docs() -> int:
    """Build the documentation as a site, with MkDocs in an environment of its own and with what comes from npm."""
    import shutil
    import subprocess

    if shutil.which("npm") is None:
        raise refusal("The site needs npm. On Debian or Ubuntu, install it with: sudo apt install npm", 1)
    tools = tool_environment(".venv-docs", "--require-hashes", "--requirement", DOCS)
    for name in ("package.json", "package-lock.json"):
        shutil.copy(ROOT / "requirements" / "npm" / name, tools / name)
    npm(tools, "ci")
    return subprocess.run([tools / "bin" / "python", "-m", "mkdocs", "build"], cwd=ROOT, check=False).returncode


def audit() -> int:
    """Ask the package index what is known against the locked versions, with a tool in an environment of its own."""
    import subprocess

    python = tool_environment(".venv-audit", "pip-audit>=2.7") / "bin" / "python"
    # The development lock holds all of the users'. Without --strict, what cannot be looked up would pass as harmless.
    options = ("--strict", "--require-hashes", "--disable-pip", "--requirement", DEV)
    return subprocess.run([python, "-m", "pip_audit", *options], cwd=ROOT, check=False).returncode


def main(*arguments: str) -> None:
    if sys.version_info < (3, 11):  # noqa: UP036 - an older Python is the one that must say this sentence
        raise refusal(
            f"sleepcast needs Python 3.11 or newer; this is Python {VERSION} ({sys.executable}).\n"
            "Start it with a newer one, for example: python3.11 go.py"
        )
    if os.name != "posix":
        raise refusal("go.py knows Linux and macOS; on Windows, start it inside WSL.")
    if arguments[:2] == ("test", "counterparts"):
        sys.exit(counterparts(*arguments[2:]))
    if arguments[:1] == ("test",):
        prepare(DEV)
        sys.exit(test(*arguments[1:]))  # the options go to pytest
    if arguments[:1] in (("audit",), ("docs",), ("with",)):
        if arguments[1:] in (("--help",), ("-h",)):
            print(__doc__)
            return
        if arguments[0] == "with":
            sys.exit(install_extras(*arguments[1:]))
        if arguments[1:]:
            raise refusal(f"go.py {arguments[0]} takes no arguments, but got: {' '.join(arguments[1:])}")
        sys.exit(audit() if arguments[0] == "audit" else docs())
    prepare(RUN)
    # Named with its Python: in a deep folder a script's first line may be too long for the system.
    os.execv(PYTHON, [str(PYTHON), str(VENV / "bin" / "sleepcast"), *arguments])


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except KeyboardInterrupt:
        sys.exit(130)
