"""Robots far away: what the desk foresees from what they told is what it would foresee if it had their minds here."""

from __future__ import annotations

import json
import struct
from collections import Counter
from dataclasses import replace
from io import StringIO
from pathlib import Path
from random import Random

import pytest
from msgspec.json import encode
from rich.console import Console

from safety.scene import KEYS, START, Scene
from sleepcast.channel import Kind, Message
from sleepcast.channel.envelope import look
from sleepcast.channel.message import TELEMETRY, Inspection
from sleepcast.cli.watch import Window
from sleepcast.console import NamedOutline
from sleepcast.console import Scene as Ground
from sleepcast.console.adapters.channel import EMPTY, FleetAdapter, FleetMinds
from sleepcast.console.frames import places_of
from sleepcast.console.network import NetworkBackend
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import SleepcastError
from sleepcast.core.model import Constant, HostFunction, MapOutline, Quantity
from sleepcast.language import Vocabulary
from sleepcast.language.explain import Explanation, Step
from sleepcast.mind.telemetry import TelemetryError, digest, read_vocabulary, read_why, vocabulary_text, why_text
from sleepcast.node.node import Node
from sleepcast.station import Station
from sleepcast.station.cache import TelemetryCache
from sleepcast.station.network import NetworkStation
from sleepcast.station.remote import MAX_TYPES, RemoteMinds, TelemetryClient
from sleepcast.station.validation import NEVER_HEARD, TEST_UNKNOWN
from station.far import Far
from station.fleet import Fleet

LESSONS = (
    "(DEFUN low (limit) (< fuel limit))",
    "(DEFUN near (a b) (AND (low a) (< x b)))",
    "(RULE slow (WHEN (low 0.3) (SETQ speed 1)))",
    "(SETQQ E5 (IF (near 0.5 250) 1 0))",
    "(DEFVAR seen (* 2 id))",
    "(WHEN (> id 4) (JOIN bravo))",
    "(WHEN (= id 7) (DEFVAR special 1))",
    "(WHEN (= id 8) (RULE own (WHEN (> x 1) (SETQ speed 2))))",
)
QUESTIONS = (
    "(WHEN (> fuel 50%) (SETQ speed 1))",
    "(WHEN (IN bravo) (SETQ speed 1))",
    "(WHEN (near 0.8 450m) (SETQ speed 1))",
    "(WHEN (AND E5 (> seen 2)) (SETQ speed 1))",
    "(WHEN (OR (KNOWN special) (= seen 4)) (SETQ speed 1))",
    "(WHEN (> (SONAR 1) 1) (SETQ speed 1))",
    "(WHEN (AND (> fuel 50%) (PROB 0.5)) (SETQ speed 1))",
    "(WHEN (> no_such 1) (SETQ speed 1))",
    "(WHEN (KNOWN own) (SETQ speed 1))",
    "(WHEN (= active5 0) (SETQ speed 1))",
    "(WHEN (> speed 1) (SETQ speed 1))",
)


def taught() -> Fleet:
    fleet = Fleet()
    for node in fleet.minds.values():
        for lesson in LESSONS:
            assert not node.evaluate(lesson).faults
    return fleet


@pytest.mark.parametrize("text", QUESTIONS)
def test_what_was_told_foresees_what_the_minds_themselves_do(text: str) -> None:
    fleet = taught()
    fleet.report()
    near = fleet.station.preview(text)
    far = Far(fleet.minds)
    far.look()
    found = far.station().preview(text)
    assert (found.yes, found.no) == (near.yes, near.no)
    assert set(found.unknown) == set(near.unknown)


def test_names_and_minds_are_asked_for_once_for_all_that_have_them() -> None:
    far = Far(taught().minds)
    far.look()
    far.look()
    asked = [look for _, look in far.asked if look != Inspection.TELEMETRY]
    assert asked.count(Inspection.VOCABULARY) == 1
    assert asked.count(Inspection.MIND) == 3  # those in bravo and not, and the one with a rule of its own
    assert not far.minds.malformed


def test_the_desk_checks_in_the_names_of_the_robots() -> None:
    far = Far(taught().minds)
    far.look()
    station = far.station()
    assert station.check("(WHEN (near 1 2m) (SETQ speed (SONAR 3)))").findings == ()
    assert "SONAR" in station.check("(SONAR 1 2)").errors[0].message
    assert "did you mean fuel" in station.check("(WHEN (> fuell 1) (SETQ speed 1))").warnings[0].message


def test_a_mind_that_was_not_told_decides_nothing() -> None:
    far = Far(taught().minds)
    for robot in far.nodes:
        far.minds.take(far.answers(robot, Inspection.TELEMETRY), far.clock.now())
    far.minds.take(far.answers("s0", Inspection.VOCABULARY), far.clock.now())
    station = far.station()
    for text in ("(WHEN (low 1) (SETQ speed 1))", "(WHEN E5 (SETQ speed 1))", "(WHEN own (SETQ speed 1))"):
        found = station.preview(text)
        assert (found.yes, found.no, len(found.unknown)) == ((), (), 10)
    assert station.preview("(WHEN (> fuel 0.45) (SETQ speed 1))").yes == ("s5", "s6", "s7", "s8", "s9")


def test_news_has_its_age() -> None:
    far = Far(Fleet().minds)
    far.look(["s1", "s6"])
    far.clock.advance(4.0)
    far.look(["s7"])
    far.clock.advance(2.0)
    station = far.station()
    found = station.preview("(WHEN (> fuel 10%) (SETQ speed 1))")
    assert found.yes == ("s7",)
    assert found.oldest == 2.0
    assert set(found.unknown.values()) == {"its last news is too old"}


def test_news_of_before_the_last_command_is_too_old(tmp_path: Path) -> None:
    text = "(WHEN (> fuel 10%) (SETQ speed 1))"
    far, cache = Far(Fleet().minds), TelemetryCache(tmp_path / "seen")
    far.look()
    cache.save(far.minds, far.clock.now(), commanded=far.clock.now() + 1.0)
    far.clock.advance(2.0)
    later = Far(far.nodes, far.clock)
    commanded = cache.restore(later.minds, later.clock.now())
    station = later.station()
    assert len(station.preview(text).yes) == 8
    station.commanded.note(commanded)
    assert set(station.preview(text).unknown.values()) == {"it was commanded since its last news"}
    later.look(["s7"])
    station.observe(later.clock.now(), [later.minds["s7"]])
    assert station.preview(text).yes == ("s7",)


# ---- several types


def types() -> tuple[Vocabulary, Vocabulary]:
    scout = Vocabulary(
        "scout",
        sensors=(Quantity("x", "m", 0.0, 10.0), Quantity("fuel", low=0.0, high=1.0)),
        actuators=(Quantity("speed", "m/s", 0.0, 5.0),),
        constants=(Constant("FRONT", 0.0), Constant("SIDES", 16.0)),
        functions=(HostFunction("SONAR", lambda body, i: 1.0, (None,), acts=False, arguments="i"),),
    )
    boat = Vocabulary(
        "boat",
        sensors=(Quantity("depth", "m"), Quantity("x", "m", -5.0, 5.0)),
        actuators=(Quantity("rudder"), Quantity("speed", "m/s", 0.0, 20.0)),
        constants=(Constant("FRONT", 0.0), Constant("SIDES", 8.0)),
        functions=(HostFunction("SONAR", lambda body, i, j: 1.0, (None, None), acts=False, arguments="i j"),),
    )
    return scout, boat


def mixed() -> Far:
    scout, boat = types()
    nodes = {"s": Node("s", scout, number=1), "b": Node("b", boat, number=2)}
    nodes["s"].sense((3.0, 0.5), 0.0)
    nodes["b"].sense((7.0, -2.0), 0.0)
    nodes["b"].evaluate("(DEFVAR own 9)")
    return Far(nodes)


@pytest.mark.parametrize("first", ["s", "b"])
def test_robots_of_several_types_are_foreseen_each_in_its_own_names(first: str) -> None:
    far = mixed()
    for robot in (first, *({"s", "b"} - {first})):
        far.look([robot])
    station = far.station()
    wanted = {
        "(WHEN (> x 1m) (SETQ speed 1))": ("s",),
        "(WHEN (> depth 5m) (SETQ speed 1))": ("b",),
        "(WHEN (> fuel 0) (SETQ speed 1))": ("s",),
        "(WHEN (= SIDES 8) (SETQ speed 1))": ("b",),
        "(WHEN (= SIDES 16) (SETQ speed 1))": ("s",),
        "(WHEN (= own 9) (SETQ speed 1))": ("b",),
        "(WHEN (AND (= FRONT 0) (> id 0)) (SETQ speed 1))": ("s", "b") if first == "s" else ("b", "s"),
    }
    for text, yes in wanted.items():
        found = station.preview(text)
        assert (text, found.yes, set(found.unknown.values()) - {TEST_UNKNOWN}) == (text, yes, set())
    assert not station.check("(WHEN (> x -3m) (SETQ speed (+ (SONAR 1) (SONAR 1 2))))").errors
    assert not station.preview("(WHEN (> x -4.5m) (SETQ speed 1))").everybody, "the widest range counts"


def test_a_type_whose_names_cannot_be_united_is_left_out_with_a_reason() -> None:
    scout, _ = types()
    odd = Vocabulary("odd", sensors=(Quantity("sonar"), Quantity("x", "m")))
    far = Far({"s": Node("s", scout), "o": Node("o", odd)})
    far.look(["s"])
    far.look(["o"])
    assert list(far.minds) == ["s"]
    assert list(far.minds.refused.values()) == ["sonar is a number here and a function of scout"]


@pytest.mark.parametrize("order", ["fln", "nlf"])
def test_a_function_with_a_number_is_united_with_a_number_and_with_a_function(order: str) -> None:
    """LAND is a mode of a vehicle of 0.2.0, a function of others, and both of a vehicle of today."""
    land = HostFunction("LAND", lambda body: None)
    types = {
        "f": Vocabulary("flier", functions=(land,)),
        "l": Vocabulary("copter of 0.2.0", sensors=(Quantity("mode"),), constants=(Constant("LAND", 9.0),)),
        "n": Vocabulary("copter", sensors=(Quantity("mode"),), functions=(replace(land, value=9.0),)),
    }
    far = Far({name: Node(name, types[name]) for name in order})
    for name in order:
        far.look([name])
    assert (set(far.minds), far.minds.refused) == ({*order}, {})
    assert not far.station().check("(WHEN (= mode LAND) (LAND))").errors


class Clocked(Station):
    """A desk of robots that answer somebody else, which a `TelemetryClient` can be given."""

    @property
    def now(self) -> float:
        return self._clock.now()


def test_a_robot_that_comes_back_as_another_is_not_foreseen_by_what_it_told_before() -> None:
    """Its old numbers would even be read as those of other names, once a further type has moved all of them."""
    scout, boat = types()
    odd = Vocabulary("odd", sensors=(Quantity("sonar"), Quantity("x", "m")))
    far = Far({"s": Node("s", scout, number=1), "r": Node("r", scout, number=2)})
    for node in far.nodes.values():
        node.sense((3.0, 0.5), 0.0)
        node.evaluate("(SETQ speed 2)")
    station = Clocked(far.minds.vocabulary, far.minds, [].append, far.clock)
    client = TelemetryClient(station, far.minds)
    far.look()
    client.hear([])
    station.observe(far.clock.now(), far.minds.values())
    assert station.preview("(WHEN (> fuel 0) (MARK))").yes == ("s", "r")
    far.nodes = {"s": far.nodes["s"], "r": Node("r", odd, number=2), "b": Node("b", boat, number=3)}
    for robot in ("r", "b"):
        far.look([robot])
        station.observe(far.clock.now(), far.minds.values())
        client.hear([])
        foreseen = station.preview("(WHEN (> fuel 0) (MARK))")
        assert foreseen.yes == ("s",)
        assert foreseen.unknown["r"] == NEVER_HEARD
    assert station.preview("(WHEN (= depth 2) (MARK))").yes == ()
    far.nodes = {"r": Node("r", scout, number=2)}
    far.nodes["r"].sense((3.0, 0.5), 0.0)
    far.look()
    station.observe(far.clock.now(), [far.minds["r"]])
    client.hear([])
    assert station.preview("(WHEN (> fuel 0) (MARK))").yes == ("s", "r")


# ---- robots that lie


def told(sender: str, what: object) -> Message:
    return Message(sender, 1, 1, Kind.ANSWER, 0.0, body={TELEMETRY: what})


def telemetry_of(far: Far, robot: str, **changes: object) -> dict[str, object]:
    found = far.answers(robot, Inspection.TELEMETRY).body[TELEMETRY]
    assert isinstance(found, dict)
    return found | changes


def test_who_lies_about_a_digest_lies_about_himself() -> None:
    far = Far(taught().minds)
    far.look()
    before = far.station().preview("(WHEN (near 0.8 450m) (SETQ speed 1))")
    lie = json.dumps({"groups": [], "operators": [["near", ["a", "b"], "1"]], "rules": []})
    assert far.minds.take(told("liar", lie), 1.0) == [], "nobody has this mind"
    assert far.minds.take(told("liar", telemetry_of(far, "s1", mind=digest(lie))), 1_000.0)
    assert not far.minds.take(told("liar", lie), 1_000.0)
    after = far.station().preview("(WHEN (near 0.8 450m) (SETQ speed 1))")
    assert (set(after.yes) - {"liar"}, after.no) == (set(before.yes), before.no)
    assert far.minds.take(told("s1", telemetry_of(far, "s1", values=b"\0" * 16)), 1_000.0) == []
    assert far.minds["s1"].values[far.minds.vocabulary.first_sensor] == 100.0, "what it told before stands"
    assert far.minds.malformed == 1


def test_a_page_forgets_groups_that_nobody_is_in() -> None:
    """Robots may name a new group with every report, for as long as one looks on."""
    far = Far(taught().minds)
    far.look()
    station = far.station()
    seen, names = FleetMinds(station, far.minds), tuple(far.minds)
    first, *_ = names
    for number in range(50):
        news = far.minds.take(told(first, telemetry_of(far, first, groups=["crew", f"g{number}"])), 2.0 + number)
        station.observe(2.0 + number, news)
        seen.look(names)
    assert [key for key in seen.groups if key.startswith("g")] == ["g49"]
    assert seen.groups["crew"].tolist() == [True] + [False] * (len(names) - 1)


def test_a_flood_of_types_names_and_robots_has_an_end() -> None:
    minds = RemoteMinds()
    for number in range(3 * MAX_TYPES):
        text = json.dumps(
            {"name": "t", "sensors": [[f"v{number}", "", None, None, None, "", ""]], "actuators": []}
            | {"constants": [], "functions": []}
        )
        body = {"type": digest(text), "mind": bytes(8), "values": bytes(8 * 8), "active": 0, "running": b""}
        user = {f"u{number}_{i}": 1.0 for i in range(200)}
        minds.take(told(f"r{number}", body | {"user": user, "groups": [], "stopped": False}), 1.0)
        minds.take(told(f"r{number}", text), 1.0)
    assert len(minds.types) == MAX_TYPES
    assert len(minds.vocabulary.user_slots) <= 256
    assert sum(len(found.robots) for found in minds.wanted(1.0)) <= 64
    assert not minds.wanted(1.5), "who does not tell is not asked again at once"


def test_a_long_chain_of_rules_is_no_way_to_break_the_desk() -> None:
    fleet = Fleet(1)
    far = Far(fleet.minds)
    rules = [[f"r{i}", f"r{i + 1}", False] for i in range(60)]
    mind = json.dumps({"groups": [], "operators": [["op", ["a"], "(op a)"]], "rules": rules})
    far.look()
    far.minds.take(told("s0", telemetry_of(far, "s0", mind=digest(mind))), 1_000.0)
    far.minds.take(told("s0", mind), 1_000.0)
    for text in ("(WHEN r0 (SETQ speed 1))", "(WHEN (op 1) (SETQ speed 1))"):
        assert far.station().preview(text).unknown == {"s0": TEST_UNKNOWN}, "too deep to come to anything"


JUNK: tuple[object, ...] = (
    None,
    True,
    -1,
    2**70,
    1e308,
    float("nan"),
    "",
    "x" * 70_000,
    "\ud7ff",
    b"\xff" * 9,
    [],
    [[]],
    {"": []},
)


def mutated(value: object, chance: Random) -> object:
    """The same with something in it changed for something else."""
    if isinstance(value, dict) and value and chance.random() < 0.9:
        key = chance.choice(list(value))
        if chance.random() < 0.1:
            return {name: inside for name, inside in value.items() if name != key}
        return value | {key: mutated(value[key], chance)}
    if isinstance(value, list) and value and chance.random() < 0.9:
        at = chance.randrange(len(value))
        return [*value[:at], mutated(value[at], chance), *value[at + 1 :]] if chance.random() < 0.9 else value * 3
    if isinstance(value, str | bytes) and value and chance.random() < 0.5:
        at = chance.randrange(len(value))
        return value[:at] + value[at + 1 :]
    return chance.choice(JUNK)


def test_whatever_is_told_the_desk_goes_on() -> None:
    chance = Random(5)
    far = mixed()
    far.nodes["s"].evaluate("(RULE slow (WHEN (> x 1) (SETQ speed 1)))")
    far.look()
    station = Station(far.minds.vocabulary, far.minds, [].append, far.clock)
    texts = [far.answers("s", look).body[TELEMETRY] for look in (Inspection.VOCABULARY, Inspection.MIND)]
    plain = far.answers("s", Inspection.TELEMETRY).body[TELEMETRY]
    accepted = 0
    for turn in range(3_000):
        who = f"f{turn % 50}"
        if turn % 2:
            what = mutated(plain, chance)
        else:
            text = chance.choice(texts)
            assert isinstance(text, str)
            what = json.dumps(mutated(json.loads(text), chance), default=str)
            about = {"type": digest(what)} if text is texts[0] else {"mind": digest(what)}
            assert isinstance(plain, dict)
            far.minds.take(told(who, plain | about), 1_000.0)
        for mind in far.minds.take(told(who, what), 1_000.0):
            accepted += 1
            station.observe(mind.reported_at, [mind])
            mind.variables(), mind.rules(), mind.heard()
        if turn % 100 == 0:
            Station(far.minds.vocabulary, far.minds, [].append, far.clock).preview("(WHEN (> x 1) (SETQ speed 1))")
            far.minds.wanted(1_000.0 + turn)
    assert accepted > 100
    assert far.minds.malformed > 500
    assert {"s", "b"} <= set(far.minds)


# ---- why


def test_why_comes_back_as_it_was() -> None:
    far = Far(taught().minds)
    found = read_why(str(far.answers("s1", Inspection.WHY, "slow").body[TELEMETRY]))
    here = far.nodes["s1"].why("slow")
    assert found.to_dict() == here.to_dict()
    refused = far.answers("s1", Inspection.WHY, "desk-1.99").body
    assert TELEMETRY not in refused
    assert "remembers no command or rule desk-1.99" in str(refused["fault"])


def test_a_long_why_is_told_in_its_upper_parts() -> None:
    node = Node("s", Fleet(1).minds["s0"].vocabulary)
    node.evaluate(
        "(RULE big (WHEN (OR " + " ".join(f"(= x {i} {'1' * 50}{i})" for i in range(99)) + ") (SETQ speed 1)))"
    )
    far = Far({"s": node})
    text = str(far.answers("s", Inspection.WHY, "big").body[TELEMETRY])
    assert len(text.encode()) < 49_152
    assert len(read_why(text).root.children[0].children) == 99


def test_an_explanation_is_checked_like_everything_else() -> None:
    chance = Random(6)
    far = Far(taught().minds)
    good = json.loads(str(far.answers("s1", Inspection.WHY, "slow").body[TELEMETRY]))
    refused = 0
    for _ in range(1_000):
        try:
            read_why(json.dumps(mutated(good, chance), default=str)).render()
        except TelemetryError:
            refused += 1
    assert refused > 300
    deep = '["x",1,0,1,"",[' * 5_000 + "]]" * 5_000
    with pytest.raises(TelemetryError):
        read_why(json.dumps(good | {"root": 0}).replace('"root": 0', f'"root": {deep}'))


# A desk that asks robots of themselves, over a radio that loses, and what it puts on a page.


def looking(scene: Scene) -> tuple[NetworkStation, TelemetryClient]:
    minds = RemoteMinds()
    desk = scene.desk(minds=minds)
    telemetry = TelemetryClient(desk, minds)
    desk.listeners.append(telemetry.hear)
    return desk, telemetry


def kinds(scene: Scene) -> Counter[Kind]:
    return Counter(look(datagram).kind for datagram in scene.sent)


def teach(scene: Scene, text: str) -> None:
    for robot in scene.fleet.values():
        assert not robot.node.evaluate(text).faults


@pytest.mark.parametrize("seed", range(3))
def test_everybody_is_known_over_a_bad_radio(seed: int) -> None:
    scene = Scene(robots=20, loss=0.3, delay=0.02, seed=seed)
    teach(scene, "(DEFUN late (n) (> id n))")
    desk, telemetry = looking(scene)
    telemetry.look()
    scene.run(4.0)
    found = desk.preview("(WHEN (late 14.5) (DRIVE 1))")
    assert (found.count(1), found.count(0), found.count(2)) == (5, 15, 0)
    assert not telemetry.learning(START)


def test_nobody_speaks_unasked() -> None:
    scene = Scene(robots=5)
    _, telemetry = looking(scene)
    telemetry.look()
    scene.run(2.0)
    scene.sent.clear()
    scene.run(20.0)
    assert not kinds(scene)[Kind.ASK]
    assert not kinds(scene)[Kind.ANSWER]


def test_what_was_learned_since_is_asked_for_again() -> None:
    scene = Scene(robots=4)
    teach(scene, "(DEFUN late (n) (> id n))")
    desk, telemetry = looking(scene)
    telemetry.look()
    scene.run(1.0)
    assert desk.preview("(WHEN (late 1) (DRIVE 1))").yes == ("r2", "r3")
    scene.fleet["r0"].node.evaluate("(DEFUN late (n) TRUE)")
    telemetry.look()
    scene.run(1.0)
    assert desk.preview("(WHEN (late 1) (DRIVE 1))").yes == ("r0", "r2", "r3")
    scene.fleet["r3"].on = False
    scene.run(6.0)
    telemetry.look()
    scene.run(2.0)
    found = desk.preview("(WHEN (late 1) (DRIVE 1))")
    assert (found.yes, dict(found.unknown)) == (("r0", "r2"), {"r3": "its last news is too old"})


def test_why_over_a_bad_radio() -> None:
    scene = Scene(robots=3, loss=0.3, delay=0.02, seed=4)
    desk, telemetry = looking(scene)
    sent = desk.send("(WHEN (> fuel 80%) (DRIVE 1))", count=3)  # the desk knows no DRIVE
    scene.run(2.0)
    asked = telemetry.ask_why("r1", sent.id)
    lost = telemetry.ask_why("r1", "nobody-1.1")
    assert telemetry.explanation(asked, "r1") is None
    scene.run(3.0)
    found = telemetry.explanation(asked, "r1")
    assert found is not None
    assert (found.matched, found.reason) == (False, "fuel = 50 %, needed > 80 %")
    assert "50 %      fuel" in found.render().splitlines()
    with pytest.raises(SleepcastError, match="remembers no command"):
        telemetry.explanation(lost, "r1")


def test_why_says_that_stop_held_it() -> None:
    scene = Scene(robots=2)
    desk, telemetry = looking(scene)
    desk.stop()
    scene.run(1.0)
    sent = desk.send("(SETQ throttle 1)", count=2, everybody=True)
    scene.run(1.0)
    assert desk.accounting(sent.id).n_held == 2
    asked = telemetry.ask_why("r1", sent.id)
    scene.run(1.0)
    found = telemetry.explanation(asked, "r1")
    assert found is not None
    assert (found.matched, found.held, found.verdict) == (True, True, "held by STOP, so it did not move")
    assert found.render().endswith("held by STOP, so it did not move")
    assert found.to_dict()["held"] is True


def test_one_of_an_older_version_has_said_so_in_its_answer() -> None:
    scene = Scene(robots=2)
    desk, telemetry = looking(scene)
    sent = desk.send("(SETQ throttle 1)", count=2, everybody=True)
    old = Explanation("(DRIVE 1)", 1.0, True, "", Step("(DRIVE 1)", 1.0, 0, 9), command=sent.id)
    desk.hear(Message("r1", 0, 1, Kind.ANSWER, 0.0, body={"command": sent.id, "outcome": "matched", "held": True}))
    for robot in ("r0", "r1"):
        asked = telemetry.ask_why(robot, sent.id)
        body = {"command": asked.id, "outcome": "answer", TELEMETRY: why_text(old)}
        assert '"held"' not in body[TELEMETRY], "older desks read what they always did"
        telemetry.hear([Message(robot, 0, 2, Kind.ANSWER, 0.0, body=body)])
        found = telemetry.explanation(asked, robot)
        assert found is not None
        assert found.held is (robot == "r1")


def poses(fleet: FleetAdapter) -> dict[str, tuple[float, float, float]]:
    found = struct.unpack(f"<{3 * len(fleet.scene.names)}f", fleet.poses())
    return dict(zip(fleet.scene.names, zip(found[::3], found[1::3], found[2::3], strict=True), strict=True))


def test_the_page_shows_how_high_robots_say_they_are() -> None:
    axes = tuple(Quantity(axis, "m") for axis in "xyz")
    scene = Scene(robots=2, vocabulary=Vocabulary("copter", sensors=axes))
    desk, telemetry = looking(scene)
    fleet = FleetAdapter(desk, telemetry, Ground("air", "", "robots", (), EMPTY, "m", ()), 1.0, START)
    fleet.hear()
    scene.run(1.0)
    fleet.hear()
    assert sorted(places_of(fleet.poses(), 2).T.tolist()) == [[0.0, 0.5, 0.5], [1.0, 0.5, 0.5]]


WAY, FENCE = (
    MapOutline("survey", ((1.0, 2.0), (30.0, 4.0)), False),
    MapOutline("fence1", ((0.0, 0.0), (9.0, 0.0), (9.0, 9.0)), True),
)


def test_the_page_draws_what_robots_tell_of_their_fences_and_plans() -> None:
    axes = tuple(Quantity(axis, "m") for axis in "xy")
    scene = Scene(robots=2, vocabulary=Vocabulary("copter", sensors=axes, outlines=(WAY, FENCE)))
    desk, telemetry = looking(scene)
    yard = NamedOutline("yard", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))
    ground = Ground("air", "", "robots", (), EMPTY, "m", (), areas=(yard,))
    fleet = FleetAdapter(desk, telemetry, ground, 1.0, START)
    for _ in range(3):  # they are asked, and answer
        scene.run(1.0)
        fleet.hear()
    assert fleet.scene.areas == (yard, NamedOutline("survey", WAY.points, False), NamedOutline("fence1", FENCE.points))
    assert fleet.scene.area[2] > 30.0, "the way lies on the map"
    sent = json.loads(encode(fleet.scene.areas))
    assert [area.get("closed", True) for area in sent] == [True, False, True]
    assert "closed" not in sent[0], "what pages of areas alone are sent is as it was"


@pytest.mark.parametrize(
    "sent", [["a b", [0.0, 0.0], False], ["a", [0.0], False], ["a", [1e9, 0.0], True], ["a", [0.0] * 402, True]]
)
def test_an_outline_that_is_none_is_refused(sent: list[object]) -> None:
    text = vocabulary_text(Vocabulary("copter", outlines=(WAY,)))
    assert read_vocabulary(text).outlines == (WAY,)
    with pytest.raises(TelemetryError):
        read_vocabulary(text.replace('["survey",[1.0,2.0,30.0,4.0],false]', json.dumps(sent)))


def test_robots_without_outlines_say_what_they_always_said() -> None:
    assert "outlines" not in vocabulary_text(Vocabulary("copter"))


def test_a_rule_that_robots_have_deactivated_is_known_until_their_telemetry_says_otherwise() -> None:
    scene = Scene(robots=3)
    desk, telemetry = looking(scene)
    fleet = FleetAdapter(desk, telemetry, Ground("air", "", "robots", (), EMPTY, "m", ()), 1.0, START)
    scene.run(1.0)
    fleet.hear()
    assert fleet.failing() == []
    desk.send("(WHEN (> id 0) (RULE Guard (/ 1 0)))", standing=True)
    scene.run(2.0)
    fleet.hear()
    (found,) = fleet.failing()
    names = [fleet.scene.names[place] for place in found.robots.tolist()]
    assert (found.name, len(names), found.inactive) == ("Guard", 2, 2)
    assert set(names) == {robot.node.name for robot in scene.fleet.values() if robot.node.number > 0}
    scene.run(2.0)
    fleet.hear()
    assert len(fleet.failing()[0].robots) == 2, "their telemetry says the same"
    desk.send("(RULE Guard (MARK))", standing=True, everybody=True)
    for _ in range(3):  # they are asked, and answer
        scene.run(1.0)
        fleet.hear()
    assert fleet.failing() == []


def test_a_liar_neither_moves_the_map_nor_breaks_the_page() -> None:
    scene = Scene(robots=3)
    desk, telemetry = looking(scene)
    ground = Ground("air", "", "robots", (), EMPTY, "m", ())
    fleet = FleetAdapter(desk, telemetry, ground, 1.0, START)
    fleet.hear()
    scene.run(1.0)
    fleet.hear()
    assert telemetry.minds["r1"].values[telemetry.minds.vocabulary.first_sensor] == 1.0
    told = telemetry.minds["r1"].telemetry
    numbers = list(struct.unpack(f"<{len(told.values) // 8}d", told.values))
    asked = telemetry.look()
    lies = {
        "values": struct.pack(f"<{len(numbers)}d", *numbers[:7], 1e300, *numbers[8:]),
        "type": told.type,
        "mind": b"12345678",
        "active": 2**63 - 1,
        "running": b"\xff" * 8,
        "user": {"x": 1.0, "(": 2.0, "own": float("inf")},
        "groups": ["\x1b[2J", "[/red]", "bravo"],
        "stopped": True,
    }
    for number, lie in enumerate((lies, lies | {"values": b"123"}, lies | {"groups": [1]}, "junk", 5, None)):
        body = {"command": asked.id, "outcome": "answer", "value": None, "fault": None, TELEMETRY: lie}
        scene.say(
            Message("r[/9]", 1, number, Kind.ANSWER, scene.clock.now(), scene.clock.now() + 5.0, body=body), KEYS["r*"]
        )
    scene.run(1.0)
    fleet.hear()
    assert telemetry.minds["r[/9]"].stopped
    assert telemetry.minds["r[/9]"].groups == {"bravo"}
    window = Window(desk, telemetry, None, ["x", "own"])
    with StringIO() as shown:
        Console(file=shown, width=100).print(window.table(10))
        assert "r[/9]" in shown.getvalue()
    json.dumps(window.as_dict(), allow_nan=False)
    assert fleet.scene.names == ("r0", "r1", "r2", "r[/9]")
    found = poses(fleet)
    left, low, right, high = fleet.scene.area
    assert max(abs(left), abs(low), abs(right), abs(high)) < 100.0
    assert all(position[2] != position[2] for position in found.values()), "nobody here has told a y"
    assert dict(fleet.minds["r[/9]"].variables())["own"] != dict(fleet.minds["r[/9]"].variables())["own"]
    desk.preview("(WHEN (> x 1) (DRIVE 1))")
    assert fleet.silent().tolist() == [False] * 4
    scene.run(6.0)
    assert fleet.silent().tolist() == [True] * 4
    assert fleet.age("r1") is not None
    assert fleet.age("nobody") is None


def test_the_page_says_that_colours_are_not_reported_where_robots_have_any(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene(robots=3)
    desk, telemetry = looking(scene)
    fleet = FleetAdapter(desk, telemetry, Ground("air", "", "robots", (), EMPTY, "m", ()), 1.0, START)
    page = NetworkBackend(fleet, desk, ManualClock(), START)
    assert page.hello().note == ""
    colour = HostFunction("COLOUR", lambda *given: 0.0)
    monkeypatch.setattr(FleetAdapter, "vocabulary", Vocabulary(functions=(colour,)))
    assert page.hello().note == "On the air, robots do not report what they show with COLOUR."
