"""One robot's mind, driven without any socket, array or page."""

from __future__ import annotations

from math import inf, isnan, nan

import pytest

from sleepcast.channel.message import Kind, Message, outcome_of
from sleepcast.core.errors import SleepcastError
from sleepcast.core.model import Quantity
from sleepcast.language import HostFunction, Vocabulary, check
from sleepcast.language.explain import with_units
from sleepcast.language.learned_names import LearnedNames
from sleepcast.mind.limits import MAX_FAULTS_IN_ROW, MAX_QUEUE, REPORTS_A_SECOND, TICK_STEPS
from sleepcast.mind.telemetry import read_why, why_text
from sleepcast.node.linking import VariableTable, actuator, sensor
from sleepcast.node.node import MAX_RECOLLECTIONS, Node


class Body:
    """A body that notes what is asked of it."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, tuple[float, ...]]] = []

    def drive(self, *arguments: float) -> None:
        self.calls.append(("drive", arguments))


VOCABULARY = Vocabulary(
    "craft",
    sensors=(Quantity("x", "m"), Quantity("fuel", low=0, high=1, shown_as="%")),
    actuators=(Quantity("throttle", low=0, high=1),),
    functions=(
        HostFunction("DRIVE", Body.drive, dimensions=(None, None), arguments="speed turn"),
        HostFunction("BREAK", lambda body: 1 / 0, doc="always fails"),
    ),
)


def node(**options: object) -> Node:
    made = Node("r1", VOCABULARY, number=7, body=Body(), **options)  # type: ignore[arg-type]
    made.sense((100.0, 0.431), 0.0)
    return made


_numbers = iter(range(1, 100_000))


def message(text: str = "", kind: Kind = Kind.COMMAND, deadline: float = inf, number: int | None = None) -> Message:
    return Message("desk", 1, number or next(_numbers), kind, 0.0, deadline, text)


def outcomes(robot: Node) -> list[object]:
    found = [outcome_of(m.body) for m in robot.outbox if m.kind is Kind.ANSWER]
    robot.outbox.clear()
    return found


def obey(robot: Node, *texts: str, tick: int = 1) -> list[object]:
    for text in texts:
        robot.receive(message(text))
    robot.think(tick, tick * 0.1)
    return outcomes(robot)


@pytest.mark.parametrize(
    ("text", "outcome"),
    [
        ("(WHEN (> fuel 40%) (JOIN bravo))", "matched"),
        ("(WHEN (> fuel 50%) (JOIN bravo))", "not matched"),
        ("(WHEN (> ordnance 50%) (JOIN bravo))", "unknown"),
        ("(WHEN (AND (> fuel 50%) (> ordnance 50%)) (JOIN bravo))", "not matched"),
        ("(WHEN (OR (> fuel 50%) (> ordnance 50%)) (JOIN bravo))", "unknown"),
        ("(COND ((> ordnance 50%) 1) ((> fuel 40%) 0))", "matched"),
        ("(COND ((> ordnance 50%) 1) ((> fuel 50%) 0))", "unknown"),
        ("(IF (> ordnance 50%) (JOIN bravo) (JOIN alpha))", "unknown"),
        ("(> ordnance 50%)", "matched"),
        ("(AND (> ordnance 50%) (> fuel 40%))", "unknown"),
        ("(WHEN (> ordnance 50%) (/ 1 0))", "unknown"),
        ("(WHEN (> (/ fuel 0) 1) (JOIN bravo))", "fault"),
        ("(PROGN (RULE r (WHEN (> ordnance 1) 1)) (WHEN (> fuel 40%) r))", "matched"),
        ("(WHEN (> fuel 40%) (WHEN (> ordnance 1) 1))", "matched"),
        ("(COND ((> fuel 50%) 1) ((> fuel 40%) 0))", "matched"),
        ("(IF (> fuel 50%) 1 2)", "not matched"),
        ("(AND (> fuel 40%) (SETQ throttle 0))", "matched"),
        ("(AND (> fuel 50%) (SETQ throttle 0))", "not matched"),
        ("(LET ((f fuel)) (WHEN (> f 50%) (JOIN bravo)))", "not matched"),
        ("(PROGN (DEFVAR k 1) (WHEN (> fuel 40%) (SETQ k 2)))", "matched"),
        ("(JOIN bravo)", "matched"),
        ("0", "matched"),
        ("(WHEN (> fuel 40%) (/ 1 0))", "fault"),
        ("(BREAK)", "fault"),
        ("(nonsense 1)", "fault"),
        ("(SQRT)", "fault"),
        ("(((", "fault"),
    ],
)
def test_a_command_is_judged_by_its_top_level_test(text: str, outcome: str) -> None:
    assert obey(node(), text) == [outcome]


def test_whether_a_test_was_unknown_does_not_depend_on_how_often_it_was_asked() -> None:
    robot = node()
    for tick in range(1, 31):
        assert obey(robot, "(WHEN (> ordnance 50%) (JOIN bravo))", tick=tick) == ["unknown"]


def test_an_unknown_test_is_sent_as_one_that_did_not_match_and_a_field() -> None:
    robot = node()
    text = "(WHEN (> ordnance 50%) (JOIN bravo))"
    robot.receive(message(text))
    robot.receive(Message("desk", 1, next(_numbers), Kind.ASK, 0.0, text=text, body={"matched": True}))
    robot.think(1, 0.1)
    command, poll = (said.body for said in robot.outbox)
    assert (command["outcome"], command["unknown"]) == ("not matched", True)
    assert (poll["outcome"], poll["matched"], poll["unknown"]) == ("answer", False, True)


def test_a_message_is_evaluated_once_in_order_and_a_repeated_one_changes_nothing() -> None:
    robot = node()
    again = message("(SETQ k (+ k 1))", number=99_999)
    obey(robot, "(DEFVAR k 0)")
    for _ in range(3):
        robot.receive(again)
    robot.think(2, 0.2)
    robot.receive(again)
    robot.think(3, 0.3)
    assert robot.evaluate("k").value == 1.0
    assert outcomes(robot) == ["matched"]
    assert obey(robot, "(SETQ k 10)", "(SETQ k (* k 2))") == ["matched", "matched"]
    assert robot.evaluate("k").value == 20.0


def test_a_command_past_its_deadline_is_never_evaluated() -> None:
    robot = node()
    robot.receive(message("(JOIN bravo)", deadline=1.0))
    robot.think(50, 5.0)
    assert outcomes(robot) == ["late"]
    assert not robot.groups


def test_a_question_answers_and_changes_nothing() -> None:
    robot = node()
    robot.receive(message("(PROGN (SETQ throttle 1) (JOIN bravo) (* 2 fuel))", kind=Kind.ASK))
    robot.think(1, 0.1)
    assert robot.outbox[0].body["value"] == pytest.approx(0.862)
    assert not robot.groups
    assert isnan(dict(robot.variables())["throttle"])


def test_a_question_meets_the_same_refusals_as_a_command() -> None:
    robot = node()
    obey(robot, "(DEFVAR n)")
    for text in ("(SETQ absent 1)", "(SETQ throttle ordnance)"):
        robot.receive(message(text, kind=Kind.ASK))
    robot.receive(message("(PROGN (DEFVAR n 5) (KNOWN n))", kind=Kind.ASK))
    robot.think(1, 0.1)
    assert [bool(m.body["fault"]) for m in robot.outbox] == [True, True, False]
    assert robot.outbox[-1].body["value"] == 0.0


def test_a_quiet_robot_is_not_awake_and_a_rule_wakes_it() -> None:
    robot = node()
    awake = [robot.awake]
    robot.receive(message("(RULE look (SETQ throttle fuel))"))
    awake.append(robot.awake)
    robot.think(1, 0.1)
    awake.append(robot.awake)
    assert robot.actuators() == {"throttle": 0.431}
    assert robot.actuators() == {}
    obey(robot, "(DEACTIVATE look)", tick=2)
    assert [*awake, robot.awake] == [False, True, True, False]


def test_a_sleeping_or_frozen_robot_evaluates_messages_only() -> None:
    for stop, go in (("(SLEEP)", "(WAKE)"), ("(FREEZE)", "(THAW)")):
        robot = node()
        obey(robot, "(DEFVAR n 0)", "(RULE count (SETQ n (+ n 1)))")
        obey(robot, stop, tick=2)
        before = robot.evaluate("n").value
        robot.think(3, 0.3)
        assert robot.evaluate("n").value == before
        obey(robot, go, tick=4)
        assert robot.evaluate("n").value == before + 1


def test_while_a_robot_catches_up_its_rules_wait() -> None:
    robot = node()
    obey(robot, "(DEFVAR n 0)", "(DEFVAR own 0)")
    robot.install("mine", "(SETQ own (+ own 1))")
    robot.catch_up(True)
    assert obey(robot, "(RULE count (SETQ n (+ n 1)))", "(DRIVE 1 0)", tick=2) == ["matched"] * 2
    assert (robot.evaluate("n").value, robot.evaluate("own").value) == (0.0, 1.0)
    robot.catch_up(False)
    robot.think(3, 0.3)
    assert (robot.evaluate("n").value, robot.evaluate("own").value) == (1.0, 2.0)


def test_a_lease_deactivates_unless_it_is_renewed() -> None:
    robot = node()
    obey(robot, "(DEFVAR n 0)", "(RULE count (SETQ n (+ n 1)))", "(LEASE count 1s)", tick=0)
    robot.think(5, 0.5)
    obey(robot, "(LEASE count 1s)", tick=9)
    robot.think(15, 1.5)
    assert robot.rules()[0].active
    robot.think(20, 2.0)
    assert not robot.rules()[0].active
    assert [m.body["label"] for m in robot.outbox] == ["lease of count ended"]


def test_rules_run_in_the_order_of_buffers_then_arrival_and_a_priority_has_the_last_word() -> None:
    robot = node()
    robot.install("safe", "(SETQ throttle 0)", priority=1)
    obey(robot, "(RULE fast (SETQ throttle 1))", "(SETQQ E3 (SETQ throttle 0.5))", "(SETQ active3 TRUE)")
    assert robot.actuators() == {"throttle": 0.0}
    assert [rule.name for rule in robot.rules()] == ["E3", "safe", "fast"]


def test_built_in_rules_cannot_be_changed_over_the_air() -> None:
    robot = node()
    robot.install("safe", "(SETQ throttle 0)")
    for text in ("(FORGET safe)", "(DEACTIVATE safe)", "(RULE safe 1)", "(LEASE safe 1)"):
        assert obey(robot, text) == ["fault"]
    obey(robot, "(ROLLBACK)")
    assert robot.rules()[0].text == "(SETQ throttle 0)"
    assert robot.rules()[0].active


def test_what_the_budget_leaves_over_goes_first_in_the_next_tick() -> None:
    robot = node()
    heavy = 9_900
    rules = TICK_STEPS // heavy + 2
    for i in range(rules):
        body = "(DOTIMES (a 10) (DOTIMES (b 110) (SETQ n (+ n 0 0 0 0 0))))"
        assert robot.evaluate(f"(PROGN (DEFVAR n 0) (RULE r{i} {body}))").faults == ()
    robot.think(1, 0.1)
    ran = [rule.steps > 0 for rule in robot.rules()]
    assert set(ran) == {True, False}
    robot.think(2, 0.2)
    assert all(rule.steps > 0 for rule in robot.rules())


def test_a_rule_that_faults_again_and_again_is_deactivated_and_reported() -> None:
    robot = node()
    obey(robot, "(RULE bad (/ 1 0))", tick=0)
    for tick in range(1, MAX_FAULTS_IN_ROW):
        robot.think(tick, tick * 0.1)
    (rule,) = robot.rules()
    assert not rule.active
    assert rule.last_fault == "division by zero in (/ 1 0)"
    assert robot.outbox[-1].body["label"] == "rule bad deactivated"


def test_rollback_brings_back_the_rules_that_ran_without_a_fault() -> None:
    robot = node()
    obey(robot, "(RULE good (SETQ throttle 0.25))", tick=1)
    obey(robot, "(RULE good (SETQ throttle UNKNOWN))", "(RULE more (SETQ throttle 1))", tick=200)
    obey(robot, "(ROLLBACK)", tick=202)
    assert [(rule.name, rule.text, rule.active) for rule in robot.rules()] == [("good", "(SETQ throttle 0.25)", True)]
    assert robot.evaluate("more").value != 1.0


def test_rollback_still_works_long_after_a_bad_rule_was_deactivated() -> None:
    robot = node()
    obey(robot, "(RULE good (SETQ throttle 0.25))", tick=1)
    obey(robot, "(RULE good (SETQ throttle UNKNOWN))", tick=200)
    for tick in range(201, 500):
        robot.think(tick, tick * 0.1)
    assert not robot.rules()[0].active
    obey(robot, "(ROLLBACK)", tick=500)
    assert [(rule.text, rule.active) for rule in robot.rules()] == [("(SETQ throttle 0.25)", True)]


def test_stop_is_latched_until_release_and_needs_no_language() -> None:
    robot = node()
    robot.receive(message(kind=Kind.STOP))
    assert robot.stopped
    assert outcomes(robot) == ["stopped"]
    obey(robot, "(DRIVE 1 0)")
    assert robot.stopped
    robot.receive(message(kind=Kind.RELEASE))
    assert not robot.stopped


def test_a_stopped_robot_whose_body_has_no_latch_refuses_to_act() -> None:
    robot = node()
    robot.receive(message(kind=Kind.STOP))
    assert obey(robot, "(DRIVE 1 0)") == ["stopped", "fault"]
    assert robot.body.calls == []  # type: ignore[attr-defined]
    robot.receive(message(kind=Kind.RELEASE))
    assert obey(robot, "(DRIVE 1 0)") == ["released", "matched"]
    assert robot.body.calls == [("drive", (1.0, 0.0))]  # type: ignore[attr-defined]


class Rover:
    """A host whose own memory is linked."""

    def __init__(self) -> None:
        self.speed, self.broken = 0.0, False

    @property
    @actuator(unit="m/s", low=-1, high=1)
    def velocity(self) -> float:
        return self.speed

    @velocity.setter
    def velocity(self, value: float) -> None:
        self.speed = value

    @property
    @sensor(unit="m")
    def front_range(self) -> float:
        if self.broken:
            raise OSError("no echo")
        return 2.0


def test_stop_holds_linked_variables_and_a_failing_getter_is_a_fault() -> None:
    rover = Rover()
    table = VariableTable("rover").link(rover)
    robot = Node("r1", table.vocabulary, variables=table)
    assert robot.body is rover
    assert obey(robot, "(RULE go (SETQ velocity 1m/s))") == ["matched"]
    assert rover.speed == 1.0
    assert robot.actuators() == {}
    robot.receive(message(kind=Kind.STOP))
    robot.think(2, 0.2)
    assert rover.speed == 0.0
    rover.broken = True
    outcomes(robot)
    assert obey(robot, "(WHEN (< front_range 5m) (JOIN near))", tick=3) == ["fault"]
    robot.receive(message("(* 2 front_range)", kind=Kind.ASK))
    robot.think(4, 0.4)
    assert outcomes(robot) == ["answer"]
    assert isnan(dict(robot.variables())["front_range"])


def test_unknown_never_reaches_an_actuator_or_the_body() -> None:
    robot = node()
    assert obey(robot, "(SETQ throttle (* 2 ordnance))", "(DRIVE ordnance 1)") == ["fault", "fault"]
    assert robot.dropped == 2
    assert robot.actuators() == {}
    assert robot.body.calls == []  # type: ignore[attr-defined]


def test_a_failing_function_of_the_host_is_a_fault_and_not_the_end() -> None:
    result = node().evaluate("(+ 1 (BREAK))")
    assert isnan(result.value)
    assert [str(fault) for fault in result.faults] == ["BREAK failed: ZeroDivisionError: division by zero in (BREAK)"]


def test_why_explains_commands_and_rules_and_forgets_the_oldest() -> None:
    robot = node()
    obey(robot, "(RULE look (WHEN (> fuel 50%) (SETQ throttle 1)))")
    robot.receive(first := message("(WHEN (> fuel 50%) (JOIN bravo))"))
    robot.think(2, 0.2)
    assert robot.why(first.id).reason == "fuel = 43.1 %, needed > 50 %"
    assert robot.why().command == first.id
    assert robot.why("look").reason == "fuel = 43.1 %, needed > 50 %"
    robot.sense((nan, 0.9), 0.3)
    assert robot.why(first.id).reason == "fuel = 43.1 %, needed > 50 %"
    assert robot.why("look").matched
    for _ in range(MAX_RECOLLECTIONS):
        robot.evaluate("1")
    with pytest.raises(SleepcastError, match="remembers no command or rule"):
        robot.why(first.id)


def test_why_writes_values_as_people_read_them() -> None:
    robot = node()
    robot.evaluate("(WHEN (AND (> fuel 0.9) (< x 5km)) (JOIN bravo))")
    assert robot.why().render().splitlines() == [
        "     0  (WHEN (AND (> fuel 0.9) (< x 5km)) (JOIN bravo))",
        "     0    (AND (> fuel 0.9) (< x 5km))",
        "     0      (> fuel 0.9)   <- fuel = 43.1 %, needed > 90 %",
        "43.1 %        fuel",
        "  90 %        0.9",
        "     .      (< x 5km)",
        "     .        x",
        "     .    (JOIN bravo)",
        "not for this robot: fuel = 43.1 %, needed > 90 %",
    ]
    robot.evaluate("(- fuel 1%)")
    assert robot.why().render() == "42.1 %  (- fuel 1%)\n43.1 %    fuel"
    assert robot.why().to_dict()["value"] == pytest.approx(0.421)
    robot.evaluate("(WHEN (> fuel 50%) x)")
    assert robot.why().render().startswith("     0  (WHEN (> fuel 50%) x)"), "no distance, but nothing done"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("(< x 50%)", " 100 m    x"),
        ("(< x 30deg)", " 100 m    x"),
        ("(< 30deg fuel)", "43.1 %    fuel"),
        ("(> (* x x) 5km)", "10000    (* x x)"),
        ("(< (* x 5m) 3)", "  500    (* x 5m)"),
        ("(< x 3cm)", "10000 cm    x"),
        ("(< id 50%)", "700 %    id"),
    ],
)
def test_what_is_compared_with_something_else_keeps_its_unit(text: str, line: str) -> None:
    robot = node()
    robot.evaluate(text)
    found = robot.why()
    assert line.split() in [shown.split() for shown in found.render().splitlines()]
    heard = with_units(read_why(why_text(found)).root, lambda part: check(part, LearnedNames(VOCABULARY)).program)
    assert [each.unit for each in heard.children] == [each.unit for each in found.root.children]


def test_why_shows_that_two_values_differ_and_literals_as_they_were_written() -> None:
    robot = node()
    for fuel, text, needed in (
        (0.499999, "(WHEN (> fuel 50%) 1)", "fuel = 49.9999 %, needed > 50 %"),
        (0.5, "(WHEN (> fuel 50%) 1)", "fuel = 50 %, needed > 50 %"),
        (0.005, "(WHEN (> fuel 0.50001%) 1)", "fuel = 0.5 %, needed > 0.50001 %"),
        (0.005, "(WHEN (> 0deg 359.99deg) 1)", "0deg = 0 deg, needed > 359.99 deg"),
    ):
        robot.sense((100.0, fuel), 0.0)
        robot.evaluate(text)
        assert robot.why().reason == needed


def test_why_says_what_the_priority_of_a_rule_means() -> None:
    robot = node()
    obey(robot, "(RULE high (SETQ throttle 1) :priority 5)")
    obey(robot, "(RULE plain (SETQ throttle 1))")
    said = "priority 5: rules of a lower one run before it, and its assignments win over theirs"
    assert said in robot.why("high").render().splitlines()
    assert read_why(why_text(robot.why("high"))).precedence == said
    assert "priority" not in robot.why("plain").render()


def test_why_looks_into_operators() -> None:
    robot = node()
    obey(robot, "(DEFUN ready (limit) (AND (> fuel limit) (> x 5m)))")
    robot.evaluate("(WHEN (ready 50%) (JOIN bravo))")
    assert robot.why().reason == "(ready 50%): fuel = 43.1 %, needed > limit (50 %)"


def test_a_full_queue_drops_and_counts() -> None:
    robot = node()
    for _ in range(MAX_QUEUE + 5):
        robot.receive(message("1"))
    assert robot.lost == 5
    robot.think(1, 0.1)
    assert len(outcomes(robot)) == MAX_QUEUE


def test_reports_are_limited_by_the_second() -> None:
    robot = node()
    robot.evaluate("(DOTIMES (i 100) (REPORT i))")
    assert len(robot.outbox) == REPORTS_A_SECOND
    assert robot.lost == 100 - REPORTS_A_SECOND
    robot.think(20, 2.0)
    robot.evaluate("(REPORT 1)")
    assert len(robot.outbox) == REPORTS_A_SECOND + 1


def test_chance_is_a_function_of_seed_robot_tick_and_draw() -> None:
    def drawn(seed: int, number: int) -> list[float]:
        robot = Node("r", VOCABULARY, number=number, seed=seed)
        robot.think(5, 0.5)
        return [robot.evaluate("(RANDOM 0 1)").value for _ in range(3)]

    assert drawn(1, 1) == drawn(1, 1)
    assert len({*drawn(1, 1), *drawn(1, 2), *drawn(2, 1)}) == 9


def test_robots_of_one_vocabulary_may_learn_different_things() -> None:
    one, two = node(), node()
    obey(one, "(DEFVAR n 1)", "(RULE a (SETQ n 5))")
    obey(two, "(JOIN n)", "(DEFVAR a 3)")
    assert obey(one, "(WHEN (= n 5) (JOIN bravo))") == ["matched"]
    assert obey(two, "(WHEN (IN n) a)") == ["matched"]
    assert obey(two, "(SETQ n 1)") == ["fault"]
    assert two.evaluate("a").value == 3.0


def test_a_rule_follows_the_names_it_uses_as_they_come_and_go() -> None:
    robot = node()
    obey(robot, "(RULE a (SETQ throttle (OR b 0.1)))", tick=1)
    assert robot.actuators() == {"throttle": 0.1}
    obey(robot, "(DEFVAR b 0.7)", tick=2)
    assert robot.actuators() == {"throttle": 0.7}
    obey(robot, "(SETQ b 0.2)", tick=3)
    assert robot.actuators() == {"throttle": 0.2}


def test_a_rule_may_end_itself() -> None:
    robot = node()
    obey(robot, "(DEFVAR n 0)", "(RULE once (PROGN (SETQ n (+ n 1)) (DEACTIVATE once)))", tick=1)
    robot.think(2, 0.2)
    assert robot.evaluate("n").value == 1.0


def test_a_cycle_made_by_a_later_rule_is_refused() -> None:
    robot = node()
    assert obey(robot, "(RULE a (+ 1 b))", "(RULE b (+ 1 a))") == ["matched", "fault"]
    assert [rule.name for rule in robot.rules()] == ["a"]
