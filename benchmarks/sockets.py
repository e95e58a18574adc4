"""One broadcast against many sockets: the same order to 2 to 1,000 robots.

    python -m benchmarks.sockets [--robots N ...] [--quick] [--json] [--out FILE.svg]

broadcast: the order as signed bytes in one multicast datagram, sent as often as the channel sends a command in its
first half second, whether or not it is still needed.
sockets, in turn: a TCP connection to each robot, open already; the order is written to one robot and its answer of one
byte awaited before the next one has its turn, as programs that use Nclient do.
sockets, at once: the same connections; the order is written to all of them, and then the answers are awaited.

Seconds are from the first sending until the last robot has the order. Bytes are those of IP, of UDP or TCP, and of the
content, both ways, retransmissions included, as nftables counts them at the sender. Two processes, one for the sender
and one for all robots, are in two networks of their own, made as for `benchmarks.channel`. With a loss of 10 % each of
the two networks drops a tenth of the TCP segments that reach it, from when all connections are open. Datagrams are lost
for each robot by itself: the robots share one network here, so each robot drops a tenth of what it hears by random
numbers of its own. Where no such networks can be made, everything is on the loopback, without loss, and bytes are not
counted.
"""

from __future__ import annotations

import argparse
import json
import selectors
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.channel.lab import PATIENCE, ROOT, Lab, LabError
from benchmarks.report import Json, described, machine, middle, number, table
from benchmarks.socket_ends import BROADCAST, WAYS
from sleepcast.channel.envelope import encode
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import Kind, Message, Role

FLEETS = (2, 10, 100, 1_000)
MOST = 5_000
"""Robots at most: each has a socket in one process."""
LOSSES = (0.0, 0.1)
DESK, ROBOTS = "desk", "robots"
LOOPBACK = "127.0.0.1"
LONGEST_TRIAL = 300.0
TEXT = "(WHEN (AND (< (DIST x y vessel_x vessel_y) 5mi) (> fuel 50%) (> ordnance 70%)) (JOIN bravo))"
COUNTER = """table inet bill {
 counter streams {}
 counter datagrams {}
 chain come { type filter hook input priority -10
  meta l4proto tcp counter name streams
  meta l4proto udp counter name datagrams
 }
 chain leave { type filter hook output priority -10
  meta l4proto tcp counter name streams
  meta l4proto udp counter name datagrams
 }
}"""
"""Before the chain that drops. Each by itself: connections of the trial before may still be closing."""


@dataclass(frozen=True)
class Row:
    """The medians of some trials. seconds: None if in most of them a robot never had the order; bytes: None if nobody
    counted; trials, complete: how many there were, and in how many of them all robots had it."""

    way: str
    robots: int
    loss: float
    seconds: float | None
    bytes: float | None
    trials: int
    complete: int


def orders(count: int) -> list[bytes]:
    """So many signed orders of the same length, with numbers of their own."""
    key = KeyPair.new("desk", Role.OPERATOR)
    now = time.time()
    messages = [Message("desk", 1, each + 1, Kind.COMMAND, now, now + 60.0, TEXT) for each in range(count)]
    return [encode(message, "fleet", key)[0] for message in messages]


def measured(lab: Lab | None, way: str, robots: int, loss: float, trials: int) -> Row:
    """One row. Raises LabError if the system refuses a rule."""
    desk, there = ("10.83.0.1", "10.83.0.2") if lab else (LOOPBACK, LOOPBACK)
    said = json.dumps([each.hex() for each in orders(trials)])
    ears = started(lab, ROBOTS, f"hear({way!r}, {robots}, {loss}, {there!r})", said)
    mouth = None
    try:
        answer(ears)
        mouth = started(lab, DESK, f"tell({way!r}, {robots}, {desk!r}, {there!r})", said)
        answer(mouth)
        lose(lab, 0.0 if way == BROADCAST else loss)
        began, sizes = [], []
        for _ in range(trials):
            carried(lab, way)
            say(mouth, "go")
            began.append(float(answer(mouth)))
            sizes.append(carried(lab, way))
        lose(lab, 0.0)
        assert ears.stdin is not None
        ears.stdin.close()
        heard: list[list[float]] = json.loads(answer(ears))
    finally:
        for process in (ears, mouth):
            if process is not None:
                process.kill()
                process.wait(PATIENCE)
    taken = [max(times) - start for times, start in zip(heard, began, strict=True) if len(times) == robots]
    bill = [each for each in sizes if each is not None]
    enough = 2 * len(taken) > trials
    return Row(way, robots, loss, middle(taken) if enough else None, middle(bill) if bill else None, trials, len(taken))


def started(lab: Lab | None, host: str, call: str, first: str) -> subprocess.Popen[str]:
    """A process that calls a function of `socket_ends`, with a first line of input."""
    command = (sys.executable, "-c", f"from benchmarks.socket_ends import hear, tell; {call}")
    if lab is None:
        process = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    else:
        process = lab.start(host, *command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    say(process, first)
    return process


def say(process: subprocess.Popen[str], line: str) -> None:
    assert process.stdin is not None
    process.stdin.write(f"{line}\n")
    process.stdin.flush()


def answer(process: subprocess.Popen[str]) -> str:
    """The next line that a process says, within the longest trial."""
    assert process.stdout is not None
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        line = process.stdout.readline() if selector.select(LONGEST_TRIAL) else ""
    if not line:
        raise SystemExit(f"a process has said nothing within {LONGEST_TRIAL:g} s")
    return line


def nft(lab: Lab, host: str, *words: str) -> str:
    """What nftables says on a host."""
    process = lab.start(host, "nft", *words, stdout=subprocess.PIPE)
    said, _ = process.communicate(timeout=PATIENCE)
    if process.returncode:
        raise LabError(f"nft {' '.join(words)}: {process.returncode}")
    return said


def lose(lab: Lab | None, share: float) -> None:
    """From now on both ends lose this share of the TCP segments that reach them."""
    for host in (DESK, ROBOTS) if lab else ():
        assert lab is not None
        nft(lab, host, "flush chain inet radio ears")
        if share > 0.0:
            drop = f"numgen random mod 1000 < {round(1_000 * share)} drop"
            nft(lab, host, f"add rule inet radio ears meta l4proto tcp {drop}")


def carried(lab: Lab | None, way: str) -> int | None:
    """Bytes of this way that the sender has sent and received since the last call."""
    if lab is None:
        return None
    told = json.loads(nft(lab, DESK, "-j", "reset", "counters", "table", "inet", "bill"))["nftables"]
    counted = {each["counter"]["name"]: int(each["counter"]["bytes"]) for each in told if "counter" in each}
    return counted["datagrams" if way == BROADCAST else "streams"]


def draw(rows: Sequence[Row], path: Path) -> None:
    """Seconds and bytes against the number of robots."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    mpl.rcParams["svg.hashsalt"] = "sockets"
    mpl.rcParams["svg.fonttype"] = "none"
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    for axes, field, label in zip(
        figure.subplots(1, 2), ("seconds", "bytes"), ("seconds until all have it", "bytes"), strict=True
    ):
        for way, colour in zip(WAYS, ("tab:blue", "tab:red", "tab:orange"), strict=True):
            for loss in LOSSES:
                line = [(row.robots, getattr(row, field)) for row in rows if (row.way, row.loss) == (way, loss)]
                found = [(robots, value) for robots, value in line if value is not None]
                style = {"color": colour, "linestyle": "--" if loss else "-", "marker": "o", "markersize": 4}
                if found:
                    axes.plot(*zip(*found, strict=True), label=f"{way}, {100 * loss:g} % loss", **style)
        axes.set(xscale="log", yscale="log", xlabel="robots", ylabel=label)
        axes.grid(alpha=0.3)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    figure.savefig(path, format="svg", metadata={"Date": None})


def shown(rows: Sequence[Row]) -> str:
    """The table, with ratios to the broadcast to as many robots with the same loss."""
    lines = []
    for row in rows:
        base = next(each for each in rows if (each.way, each.robots, each.loss) == (BROADCAST, row.robots, row.loss))
        name = f"{row.way}, {100 * row.loss:g} % loss"
        cells = [f"{row.robots:,}", "not all" if row.seconds is None else number(row.seconds)]
        cells.append(number(row.seconds / base.seconds) if row.seconds and base.seconds else "")
        cells.append("not counted" if row.bytes is None else f"{row.bytes:,.0f}")
        cells.append(number(row.bytes / base.bytes) if row.bytes and base.bytes else "")
        lines.append((name, *cells, f"{row.complete} of {row.trials}"))
    return table(("", "robots", "seconds", "x broadcast", "bytes", "x broadcast", "all had it"), lines)


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.sockets", description=(__doc__ or "").partition("\n\n")[0]
    )
    parser.add_argument("--robots", type=int, nargs="+", metavar="N", help="sizes of the fleet")
    parser.add_argument("--quick", action="store_true", help="small fleets, one trial each; rough numbers")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--out", metavar="FILE", type=Path, help="draw an SVG too; takes matplotlib")
    options = parser.parse_args()
    fleets = options.robots or (FLEETS[:2] if options.quick else FLEETS)
    if not all(1 <= robots <= MOST for robots in fleets):
        parser.error(f"--robots takes 1 to {MOST:,}")
    rows, why = [], ""
    with ExitStack() as stack:
        lab = None
        try:
            lab = stack.enter_context(Lab([DESK, ROBOTS]))
            nft(lab, DESK, COUNTER)
        except LabError as error:
            lab, why = None, f"{error}: only rows without loss, on the loopback"
        for robots in fleets:
            trials = 1 if options.quick else max(1, min(9, 300 // robots))
            for loss in LOSSES if lab else LOSSES[:1]:
                rows += [measured(lab, way, robots, loss, trials) for way in WAYS]
    found = machine()
    if options.out:
        draw(rows, options.out)
    if options.json:
        print(json.dumps(Json(machine=found, note=why, order=len(orders(1)[0]), rows=[asdict(row) for row in rows])))
        return 0
    print(f"{described(found)}; an order of {len(orders(1)[0])} bytes\n\n{shown(rows)}")
    if why:
        print(f"\n{why}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
