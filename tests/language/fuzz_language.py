"""Fuzzing the language: whatever comes over the air, nothing crashes, hangs or grows.

Random bytes, well-formed expressions, and the same cut, doubled and mixed are given to the reader, the checker and a
robot's mind, both directly and as messages. Each text must be read or refused with a sentence, evaluated within a
second, explained, and printed so that it reads back; the rules it leaves behind must run; and when all is forgotten
the memory must be back where it was.

    python tests/language/fuzz_language.py [SECONDS [SEED]]
"""

from __future__ import annotations

import gc
import json
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from types import FrameType

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent.parent))

from language.authors import NUMBERS, Author
from language.cases import Body, NodeMachine, Setting
from sleepcast.channel.message import Kind, Message
from sleepcast.language import read, show
from sleepcast.language.functions import BUILT_IN
from sleepcast.language.reader import MAX_TEXT
from sleepcast.node.node import Node

SLOWEST = 1.0
"""Seconds of the processor that one text may take."""
HANGS = 20.0
"""Seconds after which a text counts as hanging: far more than `SLOWEST`, because a busy machine pauses at times."""
TEXTS = 60
"""Texts for one robot, before it is thrown away for a new one."""
BLOCKS = 1_000
"""Blocks of memory that may be held more at the end than after the first robots: forty are seen."""
MEGABYTES = 64
"""Growth of the process that is too much for caches and the allocator's own ways."""
WORDS: tuple[str, ...] = (
    *(function.name for function in BUILT_IN.values()),
    *NUMBERS,
    *"()'`,;\"",
    "E1",
    "e2",
    "E0",
    "fuel",
    "v1",
    "f1",
)


class Hang(BaseException):
    """A text took `HANGS` seconds; no robot's mind may catch it."""


@dataclass
class Report:
    """What came of a run. slowest: seconds of the processor for the slowest text. blocks, megabytes: the growth."""

    robots: int = 0
    texts: int = 0
    refused: int = 0
    faulted: int = 0
    slowest: float = 0.0
    blocks: int = 0
    megabytes: float = 0.0

    def __str__(self) -> str:
        return (
            f"{self.texts} texts for {self.robots} robots: {self.refused} refused, {self.faulted} with faults, "
            f"slowest {self.slowest:.3f} s, {self.blocks:+d} blocks, {self.megabytes:+.1f} MB"
        )


# ---- what is tried


def noise(chance: Random) -> str:
    """Bytes, as a radio delivers them."""
    received = chance.randbytes(chance.choice((1, 5, 30, 200, 2_000)))
    return str(received, chance.choice(("latin-1", "utf-8")), "replace")


def words(chance: Random) -> str:
    """Words of the language in no order."""
    return " ".join(chance.choices(WORDS, k=chance.choice((1, 3, 10, 40))))


def piles(chance: Random) -> str:
    """One piece, again and again."""
    piece = chance.choice(
        ("(", ")", "'", ",", "`", "1", "a", "-", ".", "(+ ", "1 ", "(COND (", '"', ";", "9e", "\n", "5m/")
    )
    return (piece * MAX_TEXT)[: chance.choice((10, 33, 100, 1_000, MAX_TEXT, MAX_TEXT + 1))]


def well_formed(chance: Random) -> str:
    return Author(chance, chance.choice((2, 4, 6))).text()


def broken(chance: Random) -> str:
    """A well-formed text after an accident or a few."""
    text = well_formed(chance)
    for _ in range(chance.choice((1, 1, 2, 5))):
        text = chance.choice(ACCIDENTS)(text, chance)
    return text


def span(text: str, chance: Random) -> tuple[int, int]:
    start = chance.randrange(len(text) + 1)
    return start, min(len(text), start + chance.choice((1, 2, 8, 40)))


def cut(text: str, chance: Random) -> str:
    start, end = span(text, chance)
    return text[:start] + text[end:]


def double(text: str, chance: Random) -> str:
    start, end = span(text, chance)
    return text[:end] + text[start:]


def swap_word(text: str, chance: Random) -> str:
    found = text.split(" ")
    found[chance.randrange(len(found))] = chance.choice(WORDS)
    return " ".join(found)


def insert(text: str, chance: Random) -> str:
    start, _ = span(text, chance)
    return text[:start] + chance.choice((*WORDS, *map(chr, range(32)), "\u00e9", "\u0663", "\ud800")) + text[start:]


def mix(text: str, chance: Random) -> str:
    other = well_formed(chance)
    return text[: span(text, chance)[0]] + other[span(other, chance)[0] :]


ACCIDENTS: tuple[Callable[[str, Random], str], ...] = (cut, double, swap_word, insert, mix)
SOURCES: tuple[Callable[[Random], str], ...] = (
    noise,
    words,
    piles,
    well_formed,
    well_formed,
    well_formed,
    broken,
    broken,
)


# ---- trying it


@contextmanager
def no_hang() -> Iterator[None]:
    def ring(number: int, frame: FrameType | None) -> None:
        raise Hang(f"a text took more than {HANGS:g} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, HANGS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def try_one(text: str, direct: NodeMachine, radio: Node, tick: int, report: Report) -> None:
    """Give one text to both robots. Raises whatever should never come out of the language."""
    outcome = direct.evaluate(text)
    report.refused += bool(outcome.refused)
    report.faulted += bool(outcome.faults)
    if outcome.refused:
        if " at " not in outcome.refused:
            raise AssertionError(f"the refusal names no place: {outcome.refused}")
    else:
        form = read(text)
        if read(show(form)) != form:
            raise AssertionError(f"shown, it reads back as something else: {show(form)}")
        json.dumps(direct.result.explanation.to_dict(), allow_nan=False)
        if not direct.result.explanation.render():
            raise AssertionError("the explanation is empty")
    for told in outcome.tells:
        read(told)
    direct.mind.think(tick, float(tick))
    if len(text) <= MAX_TEXT:
        radio.receive(Message("operator", 0, tick, Kind.COMMAND, float(tick), float(tick + 1), text))
    radio.think(tick, float(tick))
    for said in (*direct.mind.outbox, *radio.outbox):
        json.dumps(said.body, allow_nan=False)
    radio.outbox.clear()


def one_robot(seed: int, report: Report) -> None:
    """A robot's life of `TEXTS` texts; what goes wrong is raised anew with what it takes to see it again."""
    chance = Random(f"{seed} {report.robots}")
    setting = Setting(
        values={"fuel": 0.5, "x": 3.0, "throttle": 0.0}, number=chance.randrange(9), seed=chance.getrandbits(64)
    )
    direct = NodeMachine(setting, compiled=chance.random() < 0.5)
    radio = Node("robot", setting.vocabulary(), body=Body(setting.around))
    for tick in range(TEXTS):
        text = chance.choice(SOURCES)(chance)
        begun = time.process_time()
        try:
            with no_hang():
                try_one(text, direct, radio, tick, report)
            taken = time.process_time() - begun
            if taken > SLOWEST:
                raise AssertionError(f"it took {taken:.2f} s")
        except (Exception, Hang) as error:
            where = f"seed {seed}, robot {report.robots}, text {tick} of {len(text)} characters: {text[:2_000]!r}"
            raise AssertionError(f"{where}\n{type(error).__name__}: {error!s:.1000}") from error
        report.texts += 1
        report.slowest = max(report.slowest, taken)
    report.robots += 1


def resident() -> float:
    """Megabytes of the process's memory, 0 where the system does not say."""
    statm = Path("/proc/self/statm")
    return int(statm.read_text().split()[1]) * 4096 / 1e6 if statm.exists() else 0.0


def held() -> tuple[int, float]:
    """Blocks and megabytes in use. Collecting a vocabulary lets go of its programs; the next round collects those."""
    while gc.collect():
        pass
    return sys.getallocatedblocks(), resident()


def fuzz(seconds: float, seed: int = 0) -> Report:
    """Fuzz for so long. Raises AssertionError with the texts that led to a crash, a hang or growth."""
    report = Report()
    ends = time.monotonic() + seconds
    warm = time.monotonic() + seconds / 4
    while time.monotonic() < warm or report.robots < 3:
        one_robot(seed, report)
    blocks, megabytes = held()
    while time.monotonic() < ends:
        one_robot(seed, report)
    blocks_now, megabytes_now = held()
    report.blocks, report.megabytes = blocks_now - blocks, megabytes_now - megabytes
    if report.blocks > BLOCKS or report.megabytes > MEGABYTES:
        raise AssertionError(f"memory grew: {report}")
    return report


if __name__ == "__main__":
    given = sys.argv[1:]
    print(fuzz(float(given[0]) if given else 60.0, int(given[1]) if given[1:] else 0))
