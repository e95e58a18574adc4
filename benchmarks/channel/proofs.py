"""What the channel promises, tried on a fleet of processes in networks of their own: each proof gives rows and bars.

rewrite     a rule for everybody, at several losses: seconds until it runs on half of the robots, nearly all, all
catch_up    robots that were off, or out of reach, while rules changed
once        thousands of commands on the worst air: every one once, in time, on every robot, by its own journal
census      a question to everybody: every answer, and never too many at a time
stop        STOP: seconds until bodies are at rest, and who is told as silent
"""

from __future__ import annotations

import sqlite3
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from benchmarks.channel.experiment import Experiment
from benchmarks.channel.lab import Traffic
from benchmarks.report import Bar, number
from sleepcast.api.progress import steps

YARD = ("--scenario", str(Path(__file__).parent / "yard"))
QUIET_AFTER = 4.0
"""Seconds after which a new fleet has come to rest."""
ACCOUNT = frozenset({"ask", "answer"})
"""Kinds that tell the operator how it went; all others bring the rule to the robots."""
BLIND = 10
"""Repeats to every robot by itself, which is what one does who cannot know who has heard."""
LOSS, SOME_LOSS = 0.3, 0.1
TWICE, DELAY = 0.1, 0.05
LIFE = 5.0
"""Seconds for which a one-shot command is good."""
RATE = 20.0
"""Commands a second."""
BURST = 1_500.0
"""Answers a second, in any tenth of a second, that a radio must bear."""
ACCOUNTED = 10.0
"""Seconds in which everybody who can be heard has answered a STOP, however many answers are lost."""
REST = 3.0
"""Seconds after STOP within which a body must be at rest at all to be counted."""


@dataclass(frozen=True)
class Size:
    """How large a proof is: hosts, robots on each, and how many times it is tried."""

    hosts: int
    robots: int
    trials: int


@dataclass(frozen=True)
class Proof:
    """What came out. note: what a reader must know."""

    name: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    bars: Sequence[Bar]
    note: str = ""


@contextmanager
def fleet(size: Size, *options: str) -> Iterator[Experiment]:
    """A quiet fleet on a clear air, that the desk knows."""
    with Experiment(size.hosts, size.robots, *YARD, *options) as found:
        time.sleep(QUIET_AFTER)
        wanted = size.hosts * size.robots
        for _ in range(20):
            if found.order("ask", text="1", patience=3.0)["answers"] == wanted == found.order("who")["robots"]:
                return (yield found)
        raise RuntimeError("the fleet does not answer on a clear air")


def seconds(times: Sequence[float], share: float) -> float:
    """The time within which this share of them lies; inf if some never came."""
    ordered = sorted(times)
    return ordered[max(0, -(-int(share * 1_000) * len(ordered) // 1_000) - 1)] if ordered else float("inf")


def middle(values: Sequence[float]) -> float:
    return sorted(values)[len(values) // 2]


# ---- 1


@dataclass
class Rewrite:
    """One rule at one loss. spent: bytes that brought it, without and with telling how it went."""

    loss: float
    id: str
    began: float
    spent: tuple[int, int]
    datagram: float


def rewrite(size: Size, losses: Sequence[float]) -> Proof:
    tried: list[Rewrite] = []
    with fleet(size) as found:
        for loss in losses:
            found.lab.lose(loss)
            for trial in steps(size.trials, "rewrite", quiet=False):
                tried.append(_rewritten(found, loss, f"(RULE go (SETQ drive_speed 0.{1 + trial % 9}))"))
        noted = found.noted()
    count = size.hosts * size.robots
    rows, bars = [], []
    for loss in losses:
        of_loss = [each for each in tried if each.loss == loss]
        times = [[time - each.began for time in noted.of(each.id).values()] for each in of_loss]
        times = [each + [float("inf")] * (count - len(each)) for each in times]
        shares = {share: [seconds(each, share) for each in times] for share in (0.5, 0.99, 1.0)}
        rule, all_in_all = (max(each.spent[i] for each in of_loss) for i in (0, 1))
        blind = BLIND * count * max(each.datagram for each in of_loss)
        cells = [f"{number(middle(times))} / {number(max(times))}" for times in shares.values()]
        rows.append(
            [f"{loss:.0%}", *cells, f"{rule / 1e3:,.1f}", f"{(all_in_all - rule) / 1e3:,.0f}", f"{blind / 1e3:,.0f}"]
        )
        if loss == LOSS:
            bars += [
                Bar(f"new rule on 99 % of {count:,} robots at 30 % loss, worst", max(shares[0.99]), 1.0, "s", False),
                Bar(f"new rule on all of {count:,} robots at 30 % loss, worst", max(shares[1.0]), 5.0, "s", False),
                Bar("its bytes, of ten blind repeats to everybody", rule / blind, 1.0, "x", False),
            ]
    heads = ["loss", "50 %, s", "99 %, s", "100 %, s", "kB", "kB of answers", "kB of 10 blind repeats"]
    return Proof("rewrite", heads, rows, bars, f"median / worst of {size.trials}; kB: worst")


def _rewritten(found: Experiment, loss: float, text: str) -> Rewrite:
    before = found.lab.traffic()
    told = found.order("send", text=text, standing=True, patience=LIFE)
    time.sleep(2.0)
    spent = {kind: traffic.since(before.get(kind, Traffic())) for kind, traffic in found.lab.traffic().items()}
    total = sum(traffic.bytes for traffic in spent.values())
    account = sum(spent[kind].bytes for kind in spent.keys() & ACCOUNT)
    return Rewrite(
        loss,
        str(told["id"]),
        float(told["began"]),
        (total - account, total),
        spent["standing"].bytes / spent["standing"].datagrams,
    )


# ---- 2


CHANGES = 50
NAMES = 10


def catch_up(size: Size) -> Proof:
    rows, bars = [], []
    with fleet(size, "--store", "{folder}/{host}.db") as found:
        found.lab.lose(SOME_LOSS)
        ways = {"killed, and started again": _killed, "out of reach, and back": _away}
        back = {}
        for name, way in ways.items():
            for trial in steps(size.trials, "catch_up", quiet=False):
                host = found.hosts[trial % len(found.hosts)]
                back[name, trial] = (host, *way(found, host))
        noted = found.noted()
    for name in ways:
        took, wrong = [], 0
        for (which, _), (host, since, changes) in back.items():
            if which != name:
                continue
            robots = [f"r{number + 1 + found.hosts.index(host) * size.robots}" for number in range(size.robots)]
            for robot in robots:
                heard = noted.order(robot, changes)
                wrong += [command for command, _ in heard] != changes
                took.append(max((when for _, when in heard), default=float("inf")) - since)
        rows.append([name, number(middle(took)), number(max(took)), str(wrong)])
        bars += [
            Bar(f"{name}: seconds until all {CHANGES} changes are there, worst", max(took), 5.0, "s", False),
            Bar(f"{name}: robots whose changes are not the same in the same order", wrong, 0, "", False),
        ]
    heads = ["a host's robots", "median, s", "worst, s", "not alike"]
    return Proof("catch_up", heads, rows, bars, f"{CHANGES} changes of rules; {SOME_LOSS:.0%} loss")


def _changes(found: Experiment) -> list[str]:
    told = found.order(
        "flood",
        texts=[f"(RULE r{i} (SETQ drive_speed 0.{i % 9 + 1}))" for i in range(NAMES)],
        count=CHANGES,
        rate=20.0,
        standing=True,
    )
    return [command for command, *_ in told["sent"]]


def _killed(found: Experiment, host: str) -> tuple[float, list[str]]:
    """When the robots of this host were up again, and what had changed while they were dead."""
    found.kill(host)
    changes = _changes(found)
    found.begin(host)
    since = time.time()
    time.sleep(8.0)
    return since, changes


def _away(found: Experiment, host: str) -> tuple[float, list[str]]:
    """When this host could be heard again, and what had changed while it could not."""
    found.lab.cut(host)
    changes = _changes(found)
    found.lab.heal()
    since = time.time()
    time.sleep(8.0)
    return since, changes


# ---- 3


TEXTS = (
    "(SETQ drive_speed 0.1)",
    "(WHEN (< id 100000) (SETQ drive_speed 0.2))",
    "(WHEN (> id 100000) (SETQ drive_speed 9))",
)
"""For everybody, for all by their numbers, and for none: a robot decides, and answers, each time."""


def once(size: Size, count: int) -> Proof:
    with fleet(size, "--store", "{folder}/{host}.db", "--lease", "off") as found:
        found.lab.lose(LOSS)
        relay = found.lab.disturb(DELAY, TWICE, seed=1)
        sent = found.order("flood", texts=list(TEXTS), count=count, rate=RATE, life=LIFE)["sent"]
        found.lab.end(relay)
        found.noted()
        kept = [row for host in found.hosts for row in _journal(found.folder / f"{host}.db")]
    deadlines = {command: deadline for command, _, deadline in sent}
    done = Counter((robot, command) for robot, command, outcome, _ in kept if outcome in EVALUATED)
    late = sum(
        time > deadlines[command] for _, command, outcome, time in kept if outcome in EVALUATED and command in deadlines
    )
    wrong = sum(command in deadlines and outcome not in EVALUATED for _, command, outcome, _ in kept)
    ours = {pair: times for pair, times in done.items() if pair[1] in deadlines}
    twice = sum(times > 1 for times in ours.values())
    pairs = count * size.hosts * size.robots
    rows = [
        [
            f"{count:,}",
            f"{size.hosts * size.robots}",
            f"{len(ours):,}",
            f"{pairs - len(ours):,}",
            str(twice),
            str(late),
            str(wrong),
        ]
    ]
    bars = [
        Bar("pairs of command and robot evaluated in time", 100.0 * len(ours) / pairs, 99.9, "%"),
        Bar("commands evaluated twice on a robot", twice, 0, "", False),
        Bar("commands evaluated after their deadline", late, 0, "", False),
    ]
    heads = ["commands", "robots", "evaluated", "not", "twice", "late", "refused"]
    air = f"{LOSS:.0%} loss, {TWICE:.0%} twice, up to {1e3 * DELAY:.0f} ms late and out of order"
    return Proof("once", heads, rows, bars, f"{air}; {RATE:.0f} commands a second")


EVALUATED = frozenset({"matched", "not matched"})


def _journal(file: Path) -> list[tuple[str, str, str, float]]:
    """Robot, command, outcome and time (s of Unix time) of all that a host's robots have evaluated, as they kept it."""
    with closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as store:
        return store.execute("SELECT robot, command, outcome, time FROM journal WHERE kind = 'command'").fetchall()


# ---- 4


def census(size: Size) -> Proof:
    took, answers, rates = [], [], []
    wanted = size.hosts * size.robots
    with fleet(size) as found:
        found.lab.lose(SOME_LOSS)
        for _ in steps(size.trials, "census", quiet=False):
            with _rate(found) as seen:
                told = found.order("ask", text="id", patience=5.0)
            took.append(float(told["took"]))
            answers.append(int(told["answers"]))
            rates.append(max(seen, default=0.0))
            time.sleep(0.5)
    missed = wanted * size.trials - sum(answers)
    rows = [[f"{SOME_LOSS:.0%}", number(middle(took)), number(max(took)), str(missed), number(max(rates))]]
    bars = [
        Bar(f"complete census of {wanted:,} robots at 10 % loss, worst", max(took), 2.0, "s", False),
        Bar("answers missing", missed, 0, "", False),
        Bar("answers a second in the worst tenth of a second", max(rates), BURST, "", False),
    ]
    heads = ["loss", "median, s", "worst, s", "answers missing", "answers a second, most"]
    return Proof("census", heads, rows, bars, f"{size.trials} questions")


@contextmanager
def _rate(found: Experiment) -> Iterator[list[float]]:
    """Answers a second on the air, over each tenth of a second or a little more."""
    seen: list[float] = []
    going = True

    def look() -> None:
        before, since = found.lab.traffic().get("answer", Traffic()), time.monotonic()
        while going:
            time.sleep(0.1)
            now, when = found.lab.traffic().get("answer", Traffic()), time.monotonic()
            seen.append((now.datagrams - before.datagrams) / (when - since))
            before, since = now, when

    thread = threading.Thread(target=look)
    thread.start()
    try:
        yield seen
    finally:
        going = False
        thread.join()


# ---- 5


def stop(size: Size) -> Proof:
    count = size.hosts * size.robots
    keys: list[tuple[float, str]] = []
    with fleet(size) as found:
        found.order("send", text="(RULE go (SETQ drive_speed 0.2))", standing=True, patience=LIFE)
        found.lab.lose(LOSS)
        for _ in steps(size.trials, "stop", quiet=False):
            told = found.order("stop", patience=REST)
            keys.append((float(told["began"]), str(told["id"])))
            time.sleep(max(0.0, keys[-1][0] + REST - time.time()))
            found.order("release", patience=REST)
            time.sleep(0.5)
        cut_off = found.hosts[-1]
        found.lab.cut(cut_off)
        silent = found.order("stop", patience=ACCOUNTED)["silent"]
        noted = found.noted()
    wanted = sorted(f"r{number}" for number in range(count - size.robots + 1, count + 1))
    times = [each for began, _ in keys for each in noted.stopped(began, REST)]
    shares = [seconds(times, share) for share in (0.5, 0.99, 1.0)]
    never = sum(each == float("inf") for each in times)
    wrong = len(set(wanted) ^ set(silent))
    rows = [[f"{LOSS:.0%}", f"{len(times):,}", *map(number, shares), str(never), f"{len(silent)}"]]
    bars = [
        Bar(f"STOP of {count:,} moving robots at 30 % loss, 99 %", shares[1], 0.5, "s", False),
        Bar("of all robots, share that was moving when STOP came", 100.0 * len(times) / count / len(keys), 90.0, "%"),
        Bar("names wrong among those told as silent while a host is cut off", wrong, 0, "", False),
    ]
    heads = [
        "loss",
        "moving",
        "50 %, s",
        "99 %, s",
        "100 %, s",
        f"not at rest in {REST:g} s",
        "silent, of a host cut off",
    ]
    return Proof("stop", heads, rows, bars, f"{size.trials} times; from the key until the body is at rest")
