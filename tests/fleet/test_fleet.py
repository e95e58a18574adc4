"""A fleet, robot by robot against nodes: what random programs seldom come to."""

from __future__ import annotations

import gc
import tracemalloc
from math import inf, nan

import numpy as np
import pytest

from fleet.twins import Twins, vocabulary
from language.cases import ACTUATORS, SENSORS
from sleepcast.channel.message import Kind, Message, outcome_of
from sleepcast.columns import pure, values
from sleepcast.core.errors import SleepcastError
from sleepcast.core.model import Quantity
from sleepcast.fleet import Fleet, FleetError
from sleepcast.language import CheckError, ReadError, Vocabulary
from sleepcast.language.parts import Template
from sleepcast.mind import limits
from sleepcast.node import node
from sleepcast.station.validation import FleetNames

X = [sensor.name for sensor in SENSORS].index("x")


def twins(count: int = 5) -> Twins:
    """Robots whose x is their number, 1 upwards, and that have measured nothing else."""
    made = Twins(count, seed=3)
    made.sense([[i + 1.0 if place == X else nan for place in range(len(SENSORS))] for i in range(count)])
    return made


def test_a_rule_is_stored_by_those_only_for_whom_the_test_holds() -> None:
    both = twins()
    both.do("(WHEN (> x 2) (PROGN (DEFVAR n 0) (RULE count (SETQ n (+ n x)))))")
    both.do("(WHEN (< x 5) (RULE other (SETQ lamp (* 2 x))))")
    both.do("(WHEN (= x 4) (SETQQ E7 (SETQ throttle lamp)))")
    both.do("(ACTIVATE E7)")
    both.think()
    assert [len(view.rules()) for view in both.views] == [1, 1, 2, 3, 1]
    assert [view.values[both.fleet.vocabulary.first_actuator] for view in both.views][3] == 8.0
    both.compare()


def test_it_knows_when_all_have_learned_the_same() -> None:
    both = twins()
    state = both.fleet.state
    for text, same in (
        ("(RULE a (SETQ lamp x))", True),
        ("(WHEN (> x 2) (RULE b (SETQ lamp (* 2 x))))", False),
        ("(WHEN (<= x 2) (RULE b (SETQ lamp (* 2 x))))", True),
        ("(WHEN (= x 1) (RULE a (SETQ lamp 1)))", False),
        ("(RULE a (SETQ lamp 2))", True),
    ):
        both.do(text)
        both.think()
        assert (state.one_mind == state.mind[0]) == bool((state.mind == state.mind[0]).all()) == same
        both.compare()


def test_rules_that_arrived_in_another_order_run_in_that_order() -> None:
    both = twins()
    both.do("(WHEN (> x 2) (RULE a (SETQ lamp 1)))")
    both.do("(RULE b (SETQ lamp (+ 1 (IF (KNOWN lamp) (* 2 lamp) 0))))")
    both.do("(WHEN (<= x 2) (RULE a (SETQ lamp 1)))")
    both.do("(WHEN (= x 3) (RULE c (SETQ lamp 9)))")
    for _ in range(3):
        both.think()
    assert len({view.values[-1] for view in both.views}) > 1
    both.compare()


def test_a_rule_with_nothing_but_faults_is_deactivated_unless_it_is_built_in() -> None:
    both = twins()
    both.install(0, "bad", "(/ 1 0)", 0, protected=True)
    both.do("(WHEN (> x 1) (RULE bad (IF (< x 4) (/ 1 0) 1)))")
    for _ in range(limits.MAX_FAULTS_IN_ROW + 1):
        both.think()
        both.compare()
    assert [view.rules()[0].active for view in both.views] == [True, False, False, True, True]


def test_a_rule_that_forgets_itself_is_no_more_and_what_takes_its_place_stays() -> None:
    both = twins()
    both.do("(DEFVAR n 0)")
    both.do("(SETQQ E2 (PROGN (SETQ n (+ n 1)) (WHEN (= n 10) (FORGET E2) (RULE E2 (SETQ lamp 1))) (/ 1 0)))")
    both.do("(ACTIVATE E2)")
    for _ in range(limits.MAX_FAULTS_IN_ROW + 1):
        both.think()
        both.compare()
    for mind in both.nodes:
        assert [(rule.text, rule.active) for rule in mind.rules()] == [("(SETQ lamp 1)", True)]


def test_priorities_and_protection() -> None:
    both = twins()
    for robot in range(3):
        both.install(robot, "guard", "(SETQ lamp 7)", 5, protected=True)
    both.install(3, "E2", "(SETQ lamp 8)", -1, protected=True)
    for text in (
        "(RULE late (SETQ lamp 1))", "(RULE guard 0)", "(FORGET guard)", "(DEACTIVATE E2)", "(SETQ active2 0)",
        "(LEASE guard 1)",
    ):  # fmt: skip
        both.do(text)
        both.compare()
    assert [view.variables()[-1][1] for view in both.views][:3] == [7.0, 7.0, 7.0]


def test_what_the_budget_leaves_over_goes_first_in_the_next_tick() -> None:
    both = twins()
    loop = "(DOTIMES (i 1000) (+ i 1 1 1 1 x))"
    both.do("(PROGN (DEFVAR n 0) (DEFVAR m 0))")
    for i in range(9):
        test = "(> x 1)" if i < 7 else "(> x 2)"
        both.do(f"(WHEN {test} (RULE k{i} (PROGN (SETQ n (+ n 1)) {loop} (SETQ m {i}))))")
        both.compare()
    both.install(4, "urgent", f"(PROGN (SETQ m 50) {loop})", 3, protected=False)
    for _ in range(6):
        both.think()
        both.compare()
    assert both.fleet.scheduler.left_over


def test_rules_that_enter_costly_buffers_are_expected_to_cost_as_much_again() -> None:
    both = twins()
    both.do("(SETQQ E9 (DOTIMES (i 900) (+ i 1 1 1 1 1 1 1)))")
    for i in range(8):
        both.do(f"(WHEN (> x {i // 2}) (RULE k{i} (IF (> x {i // 3}) E9 0)))")
        both.compare()
    for _ in range(5):
        both.think()
        both.compare()
    assert both.fleet.scheduler.left_over


def test_robots_that_run_out_of_steps_stop_there_and_the_others_go_on() -> None:
    both = twins()
    both.do("(SETQQ E1 (DOTIMES (i 900) (+ i 1 1 1 1)))")
    both.do("(DEFVAR n 0)")
    both.do(
        '(WHEN 1 (SETQ n 1) (IF (> x 2) E1 0) (SETQ n 2) (IF (> x 4) E1 0) (REPORT "here" n) (SETQ lamp (/ 1 0))'
        " (RANDOM 0 1) (DEFVAR late 1) (JOIN bravo) (RULE r 1) (MARK) (PING) (TELL 1) (ST) E1 (PRINT n) (SETQ n 3))"
    )
    both.compare()
    both.compare_reasons()
    both.do("(RULE r (PROGN E1 (SETQ n (+ n 1)) E1 (SETQ n (+ n 1)) (RANDOM 0 1)))")
    both.think()
    both.compare()


def test_leases_end_and_are_reported() -> None:
    both = twins()
    both.do("(RULE a (SETQ lamp 1))")
    both.do("(SETQQ E3 (SETQ lamp 2))")
    both.do("(ACTIVATE E3)")
    both.do("(LEASE a (* 0.3 x))")
    both.do("(WHEN (> x 3) (LEASE E3 0.5))")
    both.do("(LEASE a (/ 1 (- x 2)))")
    for _ in range(12):
        both.think()
        both.compare()
    assert [[rule.active for rule in view.rules()] for view in both.views] == [[True, False]] * 3 + [[False, False]] * 2


def test_rollback_brings_back_what_has_proved_itself() -> None:
    both = twins()
    both.do("(RULE good (SETQ lamp 1))")
    both.do("(SETQQ E4 (SETQ lamp 2))")
    both.do("(WHEN (> x 3) (LEASE good 1000))")
    both.think(120)
    both.do("(WHEN (> x 1) (RULE bad (/ 1 0)))")
    both.do("(WHEN (> x 2) (FORGET good))")
    both.do("(WHEN (> x 3) (SETQQ E4 (SETQ lamp 3)))")
    both.compare()
    both.do("(ROLLBACK)")
    both.compare()
    both.think(30)
    both.do("(WHEN (< x 3) (ROLLBACK))")
    both.compare()
    both.compare_reasons()
    assert {tuple(rule.name for rule in view.rules()) for view in both.views} == {("E4", "good")}


def test_asleep_and_frozen_robots_evaluate_messages_only() -> None:
    both = twins()
    both.do("(RULE r (SETQ lamp (+ 1 (IF (KNOWN lamp) lamp 0))))")
    both.do("(COND ((= x 1) (SLEEP)) ((= x 2) (FREEZE)))")
    both.do("(WHEN (> x 4) (SLEEP))")
    both.compare()
    both.do("(WAKE)", [0, 2])
    both.think()
    both.compare()


def test_stop_is_obeyed_at_once_and_refuses_what_acts() -> None:
    both = twins()
    both.hear(Message("desk", 9, 1, Kind.STOP, 0.0), [0, 2])
    both.compare()
    both.do("(VM x 1)")
    both.compare()
    both.hear(Message("desk", 9, 2, Kind.RELEASE, 0.0))
    both.do("(VM x 1)")
    both.compare()
    assert not any(view.stopped for view in both.views)


def said(both: Twins) -> list[object]:
    return [outcome_of(message.body) for view in both.views for message in view.outbox]


@pytest.mark.parametrize(
    "text",
    [
        "(WHEN (> nothing 1) (MARK))",
        "(WHEN (AND (> x 1) (> nothing 1)) (MARK))",
        "(IF (> nothing 1) (MARK) (UNMARK))",
        "(COND ((> x 3) 1) ((> nothing 1) (MARK)))",
        "(AND (> x 1) (> nothing 1))",
        "(AND (> nothing 1) (MARK))",
        "(LET ((n nothing)) (WHEN n (MARK)))",
        "(PROGN (DEFVAR k 1) (WHEN (OR (> x 3) (> nothing k)) (MARK)))",
    ],
)
def test_where_a_test_was_unknown_is_told(text: str) -> None:
    both = twins()
    for _ in range(9):  # also once the text would be native code
        both.send(text)
        both.think()
        assert "unknown" in said(both)
        both.compare()


def test_who_was_to_move_under_stop_is_told() -> None:
    both = twins()
    both.hear(Message("desk", 9, 1, Kind.STOP, 0.0), [0, 1])
    both.compare()
    both.send(f"(WHEN (< x 3) (SETQ {ACTUATORS[0].name} 1))")
    both.think()
    assert said(both).count("held") == 2
    both.compare_reasons()
    both.compare()
    assert [view.why().verdict for view in both.views][:2] == ["held by STOP, so it did not move"] * 2
    both.send("(MARK)")
    both.think()
    assert "held" not in said(both)
    both.compare_reasons()
    both.compare()
    assert not any(view.why().held for view in both.views), "what moves nothing is done"


def test_what_a_stopped_robot_enters_is_held_too() -> None:
    both = twins()
    both.hear(Message("desk", 9, 1, Kind.STOP, 0.0), [0, 1])
    for text in (
        f"(DEFUN go (v) (SETQ {ACTUATORS[0].name} v))",
        "(go 1)",
        "(go nothing)",
        "(WHEN (> nothing 1) (go 1))",
    ):
        both.do(text)
        both.compare_reasons()
        assert [view.why().held for view in both.views][:3] == [text == "(go 1)", text == "(go 1)", False], text
    both.do("(RULE keep (go 1))")
    assert [mind.why("keep").held for mind in (both.views[0], both.nodes[0], both.views[2])] == [True, True, False]


def test_why_a_stopped_robot_did_nothing_can_be_asked() -> None:
    both = twins()
    both.hear(Message("desk", 9, 1, Kind.STOP, 0.0), [0, 2])
    both.do("(WHEN (> x 1) (VM x 1))")
    both.hear(Message("desk", 9, 2, Kind.RELEASE, 0.1))
    both.compare_reasons()
    assert both.views[2].why().faults == ("the robot is stopped: VM waits for RELEASE in (VM x 1)",)


def test_the_order_of_stop_and_release_is_that_of_their_numbers() -> None:
    both = twins()
    both.think(100)

    def hear(kind: Kind, number: int, robots: list[int], **body: object) -> None:
        both.hear(Message("desk", 9, number, kind, 9.0 - number, body=body), robots)  # their times say the opposite

    hear(Kind.STOP, 1, [0, 1])
    hear(Kind.RELEASE, 2, [0, 2])
    hear(Kind.STOP, 1, [2])
    hear(Kind.RELEASE, 4, [3, 4])
    hear(Kind.STOP, 3, [3], **{"for": ["r0"]})
    hear(Kind.STOP, 5, [3, 4], **{"not": ["r4"]})
    hear(Kind.RELEASE, 6, [4])
    assert [view.stopped for view in both.views] == [False, True, False, True, False]
    both.compare()
    hear(Kind.RELEASE, 7, [0, 1, 2, 3], **{"for": ["r0", "r1", "r2"]})
    assert [view.stopped for view in both.views] == [False, False, False, True, False]
    both.compare()


def test_messages_wait_are_heard_once_and_come_too_late() -> None:
    both = twins()
    again = Message("desk", 7, 1, Kind.COMMAND, 0.0, text="(SETQ lamp (+ 1 (IF (KNOWN lamp) lamp 0)))")
    for robots in ([1], None, [1, 2], None):
        both.hear(again, robots)
    both.think(robots=[0, 1])
    both.think()
    both.send("(JOIN bravo)", deadline=0.05)
    both.send("(JOIN")
    both.send("(SETQ x 1)")
    both.send("(+ x RANDOM)", kind=Kind.ASK)
    both.send("(RANDOM 0 x)", kind=Kind.ASK)
    both.think()
    both.compare()
    for i in range(limits.MAX_QUEUE + 3):
        both.send(f"(SETQ lamp {i})", [0, 3] if i % 2 else None)
    both.think()
    both.compare()
    assert any(view.lost for view in both.views)


def test_too_much_is_not_said() -> None:
    both = twins(3)
    both.do(f'(WHEN (> x 1) (DOTIMES (i {limits.MAX_OUTBOX + 9}) (TELL 1)) (DOTIMES (i 40) (REPORT "a" i)))')
    both.do("(DOTIMES (i 300) (PING x))")
    both.compare()
    for _ in range(15):
        both.do('(REPORT "b" x)')
    both.compare()


def test_what_is_told_is_told_at_a_bounded_rate() -> None:
    both = twins(3)
    both.do("(RULE chatter (WHEN (> x 1) (TELL `(SETQ lamp ,(+ x tick)))))")
    told: list[int] = []
    for _ in range(60):
        both.think()
        told.append(sum(message.kind is Kind.COMMAND for message in both.views[1].outbox))
        assert [m.text for m in both.views[0].outbox if m.kind is Kind.COMMAND] == []
        both.compare()
    assert sum(told[:20]) == limits.TELL_BURST + 2 * limits.TELLS_A_SECOND
    assert sum(told[40:]) == 2 * limits.TELLS_A_SECOND
    both.do("(DEACTIVATE chatter)", ticks=100)
    both.compare()
    both.do("(DOTIMES (i 9) (TELL i))")
    assert [message.body["label"] for message in both.views[0].outbox if message.kind is Kind.REPORT] == [
        limits.TELLS_TOO_OFTEN
    ]
    both.compare()


def test_what_was_told_is_told_on_as_far_as_its_hops_reach() -> None:
    def told(hops: object, text: str, role: str = "") -> list[object]:
        both = twins(1)
        body = {} if hops is None else {"hops": hops}
        both.hear(Message("r9", 1, 1, Kind.COMMAND, 0.0, text=text, body=body, role=role))
        both.think()
        found = [message.body["hops"] for message in both.views[0].outbox if message.kind is Kind.COMMAND]
        both.compare()
        return found

    assert told(None, "(TELL 1)") == [1]
    assert told(None, "(TELL 1 :hops 8)") == [8]
    assert told(1, "(TELL 1 :hops 8)") == []
    assert told(2, "(TELL 1 :hops 8)") == [1]
    assert told(99, "(TELL 1 :hops 8)") == [7]
    for odd in (0, -5, True, 1.5, "many", None):
        assert told(odd, "(TELL 1)", "robot") == []
    assert told(None, "(TELL 1)", "commander") == [1]


def test_texts_are_made_for_what_is_told_and_for_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[tuple[float, ...]] = []
    text = Template.text
    monkeypatch.setattr(Template, "text", lambda self, values: made.append(tuple(values)) or text(self, values))
    both = twins(2)
    both.do("(DOTIMES (i 999) (TELL `(+ ,i ,id)))")
    both.compare()
    assert len(made) == 2 * 2 * limits.TELL_BURST


def test_a_reason_is_looked_for_once_where_all_are_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    settled: list[object] = []
    found = pure._settled
    monkeypatch.setattr(pure, "_settled", lambda *given: settled.append(given) or found(*given))
    both = twins(50)
    both.do("(DOTIMES (i 200) (/ 1 0))")
    both.compare()
    assert len(settled) == 200
    both.do("(DOTIMES (i 150) (SQRT (- id)))")
    both.compare()


def test_measurements_grow_old() -> None:
    aging = Vocabulary("aging", (Quantity("near", "m", freshness=0.5), Quantity("far", "m")))
    fleet = Fleet(["a", "b"], aging)
    alone = [node.Node(name, aging) for name in ("a", "b")]
    first, second, third = [[1.0, 2.0], [3.0, nan]], [[nan, inf], [5.0, 6.0]], [[nan, 1.0], [nan, nan]]
    for now, readings in ((0.0, first), (0.4, second), (0.8, third)):
        fleet.sense(np.array(readings), now)
        fleet.think(int(now * 10), now)
        for each, row in zip(alone, readings, strict=True):
            each.sense(row, now)
            each.think(int(now * 10), now)
        seen = [[value.hex() for _, value in each.variables()[-2:]] for each in alone]
        assert [[value.hex() for _, value in view.variables()[-2:]] for view in fleet.values()] == seen


def test_a_fault_of_some_robots_is_no_fault_of_others() -> None:
    fleet = Fleet([f"r{i}" for i in range(values.CHUNK + 5)], vocabulary())
    readings = np.full((len(fleet), len(SENSORS)), nan)
    readings[:, X] = np.arange(len(fleet)) - 3.0
    fleet.sense(readings, 0.0)
    (outcome,) = fleet.evaluate("(SQRT x)")
    assert {int(robot) for noted in outcome.faults for robot in noted.robots} == {0, 1, 2}
    assert outcome.values[3:].tolist() == np.sqrt(readings[3:, X]).tolist()
    assert fleet["r0"].why().faults == ("square root of -3 in (SQRT x)",)


def test_what_it_cannot_do_is_said_before_anything_is_done() -> None:
    with pytest.raises(FleetError, match="links y"):
        Fleet(["a"], Vocabulary("linked", (Quantity("y"),), linked=frozenset({"y"})))
    with pytest.raises(FleetError, match="names that differ"):
        Fleet(["a", "a"], vocabulary())
    fleet = Fleet(["a", "b"], vocabulary())
    with pytest.raises(FleetError, match="0 to 1"):
        fleet.think(1, 0.1, [2])
    with pytest.raises(FleetError, match="shape"):
        fleet.sense(np.zeros((2, 3)), 0.0)
    with pytest.raises(ReadError):
        fleet.evaluate("(+ 1")
    with pytest.raises(CheckError):
        fleet.evaluate("(SETQ x 1)")
    with pytest.raises(SleepcastError, match="remembers no command"):
        fleet["a"].why()


def test_the_desk_knows_what_any_robot_has_learned() -> None:
    both = twins()
    both.do("(WHEN (> x 3) (PROGN (DEFUN twice (a) (* 2 a)) (RULE run (SETQ lamp (twice x))) (JOIN Bravo)))")
    names = FleetNames(both.fleet.vocabulary, both.fleet)
    assert set(names.heard()) == {"twice", "run", "Bravo"}
    assert names.declared("twice") is not None
    assert both.fleet.members() == {"bravo": 2}
    robots, values = both.fleet.actuators("lamp")
    assert robots.tolist() == [3, 4]
    assert values.tolist() == [8.0, 10.0]
    both.think()
    both.nodes[3].actuators()
    both.nodes[4].actuators()
    both.fleet.actuators("lamp")
    both.compare()


def _ten_ticks_of_learning(robots: int) -> tuple[Fleet, int]:
    """A fleet whose robots each took ten rules and ten definitions, and the bytes traced before they took any."""
    fleet = Fleet([f"r{i}" for i in range(robots)], vocabulary(), seed=1)
    names = tracemalloc.get_traced_memory()[0]
    fleet.sense(np.random.default_rng(1).random((robots, len(SENSORS))), 0.0)
    for tick in range(10):
        rule = f"(RULE k{tick} (WHEN (> x 0.{tick}) (SETQ lamp {tick})))"
        command = f"(WHEN (> fuel 0.{tick}) (DEFVAR u{tick} x))"
        fleet.receive(Message("desk", 1, 2 * tick, Kind.COMMAND, 0.0, text=rule))
        fleet.receive(Message("desk", 1, 2 * tick + 1, Kind.COMMAND, 0.0, text=command))
        fleet.think(tick, tick / 10)
        assert sum(len(saying.robots) for saying in fleet.take_messages()) == 2 * robots
    return fleet, names


def test_a_robot_takes_less_than_a_kilobyte() -> None:
    robots = 20_000
    _ten_ticks_of_learning(robots)  # what is compiled or loaded once belongs to the process, not to a robot
    tracemalloc.start()
    fleet, names = _ten_ticks_of_learning(robots)
    gc.collect()
    taken = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert len(fleet.names) == robots
    assert taken < 1_000 * robots, f"{taken / robots:.0f} bytes a robot, {names / robots:.0f} of them at the start"
