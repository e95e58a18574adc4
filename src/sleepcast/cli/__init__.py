"""The roof: the command `sleepcast`, one subcommand for each job.

`main` owns how the program ends: every error that a user can cause becomes its sentence on standard error and its
exit status, Ctrl-C becomes 130, a reader that went away ends the program quietly. The subcommands live in modules of
their own, and those import the rooms below only when they run, so that a small job starts fast.
"""

from __future__ import annotations

import errno
import os
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module

import click

from sleepcast.cli.interrupts import INTERRUPTED
from sleepcast.cli.streams import ReaderGone, complain, open_streams
from sleepcast.core.errors import MisuseError, SleepcastError, did_you_mean
from sleepcast.core.extensions import COMMANDS as ADDED
from sleepcast.core.extensions import OWN, Extension, extensions, find_extension, load_extension
from sleepcast.core.version import VERSION

NO_ROOM = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})
"""What goes wrong with an output that a person sent to a file: a full disk, a quota, a broken device."""
READER_GONE = 141
"""The exit status of a program whose reader went away (128 + SIGPIPE)."""

COMMANDS = {
    "demo": ("sleepcast.cli.run", "demo", "Open a scenario in the browser."),
    "run": ("sleepcast.cli.run", "run", "Run a scenario's mission and print the outcome."),
    "replay": ("sleepcast.cli.replay", "replay", "Show a recording on the page, or check it."),
    "export": ("sleepcast.cli.export", "export", "Write a recording as a ROS 2 bag, tables, or for Rerun."),
    "sweep": ("sleepcast.cli.sweep", "sweep", "Run a scenario many times, with other settings and seeds."),
    "plot": ("sleepcast.cli.sweep", "plot", "Draw a figure of what a sweep has found."),
    "scenarios": ("sleepcast.cli.scenarios", "scenarios", "List the scenarios, or show the page of one."),
    "import": ("sleepcast.cli.import_", "import_", "Make a scenario of a file of another program."),
    "prepare": ("sleepcast.cli.prepare", "prepare", "Compile the simulator now, so that no later start waits."),
    "node": ("sleepcast.cli.node", "node", "Run one robot's mind with a real body."),
    "swarm": ("sleepcast.cli.swarm", "swarm", "Run many robots on the air in one process."),
    "eval": ("sleepcast.cli.eval", "evaluate", "Evaluate expressions in one memory."),
    "check": ("sleepcast.cli.check", "check", "Check expressions for errors."),
    "check-exercise": ("sleepcast.cli.exercise", "check_exercise", "Check an answer to an exercise."),
    "repl": ("sleepcast.cli.repl", "repl", "Evaluate expressions interactively."),
    "who": ("sleepcast.cli.who", "who", "Show which robots would obey an expression."),
    "send": ("sleepcast.cli.send", "send", "Send an expression to robots on the air."),
    "ask": ("sleepcast.cli.send", "ask", "Ask robots on the air for a value."),
    "stop": ("sleepcast.cli.stop", "stop", "Stop every robot on the air."),
    "release": ("sleepcast.cli.send", "release", "End a stop."),
    "lease": ("sleepcast.cli.lease", "lease", "Control a group of robots exclusively for a while."),
    "baseline": ("sleepcast.cli.baseline", "baseline", "Spare newcomers standing commands that were replaced."),
    "desk": ("sleepcast.cli.desk", "desk", "A full-screen desk in this terminal, for robots on the air."),
    "journal": ("sleepcast.cli.journal", "journal", "Read what was sent, received and decided."),
    "why": ("sleepcast.cli.who", "why", "Ask a robot why it obeyed a command, or did not."),
    "watch": ("sleepcast.cli.watch", "watch", "Watch robots on the air in a table."),
    "console": ("sleepcast.cli.console", "console", "Open the operator's page for robots on the air."),
    "bridge": ("sleepcast.cli.bridge", "bridge", "Connect other programs and fleets to the channel."),
    "roster": ("sleepcast.cli.roster", "roster", "List the robots that were heard on the air."),
    "keys": ("sleepcast.cli.keys", "keys", "Make keys, and choose which keys are trusted."),
}
"""Every subcommand with its module, its name there, and what the help page says of it, in the order of that page. Those
that packages add, plug-ins of sleepcast itself among them, stand behind these."""


TIMES = ("--seconds", "--time", "--timeout", "--wait", "--within", "--for", "--duration", "--deadline", "--period")
"""Options with which people say how long something is to take."""


class LazyGroup(click.Group):
    """Subcommands that are imported when they are asked for, and not to list them."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names, in the order in which a newcomer needs them."""
        added = sorted(extensions(ADDED).values(), key=lambda each: (each.package != OWN, each.name))
        return [*COMMANDS, *(each.name for each in added if each.name not in COMMANDS)]

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """The command of that name, or None. Raises MisuseError for one of a package that cannot be loaded."""
        if name in COMMANDS:
            module, attribute, _ = COMMANDS[name]
            command: click.Command = getattr(import_module(module), attribute)
            return command
        added = find_extension(ADDED, name)
        return None if added is None else _load(added)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands, of which none is imported for that."""
        added = extensions(ADDED)
        with formatter.section("Commands"):
            formatter.write_dl(
                [
                    (name, COMMANDS[name][2] if name in COMMANDS else added[name].about)
                    for name in self.list_commands(ctx)
                ]
            )

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does it, with our own words for a name that is no command."""
        name = args[0]
        if name not in COMMANDS and not name.startswith("-") and find_extension(ADDED, name) is None:
            names = self.list_commands(ctx)
            hint = _scenario_hint(name) or did_you_mean(name, names)
            raise click.UsageError(f"unknown command {name!r}{hint}: commands are {', '.join(names)}", ctx)
        return super().resolve_command(ctx, args)


def _load(added: Extension) -> click.Command:
    """The command that a package adds. Raises MisuseError."""
    command = load_extension(added, "command")
    if not isinstance(command, click.Command):
        raise MisuseError(
            f'command "{added.name}" of the package {added.package} is no click.Command but {command!r:.60}'
        )
    return command


def _scenario_hint(name: str) -> str:
    """The command that was probably meant, if this is the name of a scenario."""
    from sleepcast.simulator import scenario_names

    return f" (did you mean sleepcast demo {name}?)" if name in scenario_names() else ""


@click.group(
    cls=LazyGroup,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(VERSION, "--version", message="%(prog)s %(version)s")
@click.pass_context
def program(ctx: click.Context) -> int:
    """Broadcast one expression, and every robot decides for itself whether to obey.

    Without a command this is `sleepcast demo bravo`: 1,000 scouts in the browser.

    \b
    Examples:
      sleepcast
      sleepcast demo bravo --headless --seconds 60 --seed 7 --json
      sleepcast eval '(+ 1 2)'
    """
    if ctx.invoked_subcommand is None:
        from sleepcast.cli.run import demo

        status: int = ctx.invoke(demo, name="bravo")
        return status
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line (by default this process's own) and return the exit status."""
    try:
        status = _run(sys.argv[1:] if arguments is None else list(arguments))
        if sys.stdout is not None:
            sys.stdout.flush()
    except (ReaderGone, BrokenPipeError):
        _forget_output()
        return READER_GONE
    except Exception as error:
        if _lacks_files(error):
            _tell_few_files()
            return 1
        if not isinstance(error, OSError) or error.errno not in NO_ROOM:
            raise
        _forget_output()
        complain(f"cannot write the output: {error.strerror}")
        return 1
    return status


def _run(arguments: list[str]) -> int:
    open_streams()
    try:
        status = program.main(arguments, prog_name="sleepcast", standalone_mode=False)
    except click.NoSuchOption as error:
        if times := _other_times(error):
            sentence = f"there is no option {error.option_name} here: what takes a time is {', '.join(times)}"
            click.UsageError(sentence, error.ctx).show()
        else:
            error.show()
        return error.exit_code
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except SleepcastError as error:
        complain(str(error))
        if _lacks_files(error.__context__):
            _tell_few_files()
        return error.exit_status
    except (KeyboardInterrupt, click.Abort):
        return INTERRUPTED
    return status if isinstance(status, int) else 0


def _other_times(error: click.NoSuchOption) -> list[str]:
    """The options of a command that take a time from the person who calls it, for one that it has by another name."""
    if error.option_name not in TIMES or error.ctx is None:
        return []
    from sleepcast.cli.options import QuantityType

    named = [each.opts for each in error.ctx.command.params if isinstance(each.type, QuantityType)]
    return [opts[-1] for opts in named if opts[0] not in ("--skew", "--tick")]


def _lacks_files(error: BaseException | None) -> bool:
    """Whether something went wrong because this process may open no more files; a library may say it in its own way."""
    while error is not None:
        if isinstance(error, OSError | ImportError) and os.strerror(errno.EMFILE) in str(error):
            return True
        error = error.__cause__ or error.__context__
    return False


def _tell_few_files() -> None:
    """Say so, and nothing of what libraries could not finish."""
    complain(
        "this process may open too few files and sockets at once: allow more with `ulimit -n 1024`, and start again"
    )
    sys.unraisablehook = lambda _: None
    warnings.simplefilter("ignore")


def _forget_output() -> None:
    """Send what is still buffered nowhere, so that Python's own flush at the end has nothing to complain about."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            try:
                stream.flush()
            except OSError:
                os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
