"""The desk behind the page: previews, accounts, names, explanations and the watched robot, in words for people."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from console.asking import put
from counting import ONCE, counted
from sleepcast.channel.message import Kind, Message
from sleepcast.console.account_table import MAX_ROWS, AccountTable
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.backend import Backend
from sleepcast.console.driver import Driver
from sleepcast.console.features.accounts import Outcomes, Replies
from sleepcast.console.features.failing import Failed
from sleepcast.console.features.names import GetNames
from sleepcast.console.features.preview import GetPreview
from sleepcast.console.features.send import Send
from sleepcast.console.features.why import Explained, ShownStep, Why
from sleepcast.console.features.wink import Wink
from sleepcast.console.outgoing import Failing, Obstacles, Roll, WatchedRobot
from sleepcast.console.values import places_of
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.units import value_in_words
from sleepcast.language.vocabulary import MARKED
from sleepcast.loop import Pace, Swarm
from sleepcast.simulator import Simulator, Wall, read_scenario
from sleepcast.station import FAULT, MATCHED, NO, NOT_MATCHED, SILENT, UNKNOWN, YES, DoubtError, SendPolicy, Station
from sleepcast.station.sent import HELD_BY_STOP
from sleepcast.station.validation import TEST_UNKNOWN
from small_worlds import simulator

FULL = "(WHEN (> battery 60%) (JOIN crew))"


@dataclass
class Stand:
    """Twenty rovers, their desk, and a clock that the test moves."""

    swarm: Swarm
    station: Station
    clock: ManualClock
    desk: Backend

    def run(self, seconds: float = 2.0) -> None:
        self.swarm.run(seconds)
        self.desk.driver.draw()

    def level(self, name: str) -> float:
        return dict(self.swarm.minds[name].variables())["battery"]


@pytest.fixture
def stand(tmp_path: Path) -> Stand:
    swarm = Swarm(simulator(tmp_path))
    swarm.desk = station = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm, policy=SendPolicy(doubts=True))
    clock = ManualClock()
    on_page = SwarmAdapter(swarm)
    found = Stand(
        swarm, station, clock, Backend(on_page, station, Driver(on_page, Pace(clock, swarm, 1.0), clock), clock)
    )
    found.run()
    return found


def steps(step: ShownStep) -> list[ShownStep]:
    return [step, *(inside for part in step.parts for inside in steps(part))]


class TestPreview:
    def test_counts_and_marks_who_would_obey(self, stand: Stand) -> None:
        found = put(stand.desk, GetPreview, 3, FULL)
        expected = [YES if stand.level(name) > 0.6 else NO for name in stand.swarm.minds]
        assert list(found.lit) == expected
        assert (found.serial, found.counted, found.findings, found.everybody) == (3, True, [], False)
        assert (found.yes, found.no, found.unknown) == (expected.count(YES), expected.count(NO), 0)
        assert 0 < found.yes < 20
        assert found.cost > 0

    def test_says_why_nothing_can_be_said(self, stand: Stand) -> None:
        found = put(stand.desk, GetPreview, 1, "(WHEN (PROB 0.5) (MARK))")
        assert (found.unknown, set(found.lit)) == (20, {UNKNOWN})
        assert found.reasons == [("its test depends on chance", 20)]

    def test_shows_what_cannot_be_read_with_a_caret(self, stand: Stand) -> None:
        (finding,) = put(stand.desk, GetPreview, 1, "(MARK))").findings
        assert (finding.severity, finding.start, finding.end) == ("error", 6, 7)
        assert finding.shown == f"{finding.message}\n  (MARK))\n        ^"
        assert not put(stand.desk, GetPreview, 1, "(MARK))").counted

    def test_shows_every_error_and_warning(self, stand: Stand) -> None:
        found = put(stand.desk, GetPreview, 1, "(WHEN (> batery 60) (SETQ x 5))")
        assert [each.severity for each in found.findings] == ["warning", "error"]
        assert "did you mean battery?" in found.findings[0].message
        assert not found.counted

    def test_marks_what_is_for_everybody(self, stand: Stand) -> None:
        found = put(stand.desk, GetPreview, 1, "(MARK)")
        assert (found.everybody, found.yes) == (True, 20)


class TestWink:
    def test_the_robot_blinks_by_its_mark_which_is_then_as_it_was(self, stand: Stand) -> None:
        put(stand.desk, Send, 1, "(WHEN (< id 3) (MARK))", False)
        stand.run()
        robots = [stand.swarm.minds[name] for name in list(stand.swarm.minds)[:4]]
        put(stand.desk, Wink, 1, 0)
        put(stand.desk, Wink, 2, 3)
        seen = []
        for _ in range(70):
            stand.run(0.1)
            seen.append([robot.values[MARKED] for robot in robots])
        first, second, third, fourth = zip(*seen, strict=True)
        assert first.count(0.0) > 10
        assert first[-5:] == (1.0,) * 5
        assert fourth.count(1.0) > 10
        assert fourth[-5:] == (0.0,) * 5
        assert set(second) == {1.0}
        assert set(third) == {0.0}
        assert not any(rule.active for robot in robots for rule in robot.rules())
        row = stand.desk.commands().rows[-1]
        assert (row.matched, row.silent) == (1, 0)

    def test_one_that_blinks_already_is_left_alone(self, stand: Stand) -> None:
        put(stand.desk, Wink, 1, 0)
        with pytest.raises(MisuseError, match="blinks already"):
            put(stand.desk, Wink, 2, 0)
        stand.run(7.0)
        put(stand.desk, Wink, 3, 0)

    def test_a_robot_that_is_not_there_is_refused(self, stand: Stand) -> None:
        with pytest.raises(MisuseError, match="there is no robot number 20"):
            put(stand.desk, Wink, 1, 20)


class TestSending:
    def test_a_command_is_checked_foreseen_and_validated_once_however_often_its_sender_is_asked(
        self, stand: Stand
    ) -> None:
        with counted() as found:
            put(stand.desk, Send, 1, FULL, False)
        assert found == ONCE
        doubted = "(WHEN (> battery 60%) (> battery 20%) (MARK))"
        with counted() as found:
            with pytest.raises(DoubtError):
                put(stand.desk, Send, 1, doubted, False)
            put(stand.desk, Send, 1, doubted, False, confirmed=True)
        assert found == ONCE | {"validated": 2}

    def test_an_account_grows_with_the_answers(self, stand: Stand) -> None:
        sent = put(stand.desk, Send, 1, FULL, False).command
        (row,) = stand.desk.commands().rows
        assert (row.id, row.kind, row.text) == (sent, "command", FULL)
        assert (row.matched, row.not_matched, row.fault, row.silent) == (0, 0, 0, 20)
        assert set(put(stand.desk, Outcomes, 1, sent).outcomes) == {SILENT}
        stand.run()
        (row,) = stand.desk.commands().rows
        assert row.matched + row.not_matched == 20
        assert row.matched == row.predicted > 0
        codes = [MATCHED if stand.level(name) > 0.6 else NOT_MATCHED for name in stand.swarm.minds]
        assert list(put(stand.desk, Outcomes, 1, sent).outcomes) == codes

    def test_a_fault_is_counted_as_one(self, stand: Stand) -> None:
        sent = put(stand.desk, Send, 1, "(WHEN (> (/ 1 0) 2) (MARK))", False, confirmed=True).command
        stand.run()
        assert stand.desk.commands().rows[-1].fault == 20
        assert set(put(stand.desk, Outcomes, 1, sent).outcomes) == {FAULT}

    def test_a_misspelt_name_is_counted_as_unknown_and_sent_when_it_is_confirmed(self, stand: Stand) -> None:
        misspelt = "(WHEN (> batery 60%) (MARK))"
        found = put(stand.desk, GetPreview, 1, misspelt)
        assert (found.yes, found.no, found.unknown) == (0, 0, 20)
        assert found.reasons == [(TEST_UNKNOWN, 20)]
        with pytest.raises(DoubtError, match="no robot has batery"):
            put(stand.desk, Send, 1, misspelt, False)
        sent = put(stand.desk, Send, 1, misspelt, False, confirmed=True).command
        stand.run()
        row = stand.desk.commands().rows[-1]
        assert (row.matched, row.not_matched, row.unknown, row.fault, row.silent) == (0, 0, 20, 0, 0)
        why = put(stand.desk, Why, 2, 0, sent)
        assert isinstance(why, Explained)
        assert (why.why.matched, why.why.held, why.why.reason) == (False, False, "batery is unknown, needed > 60 %")

    def test_what_is_sent_under_stop_is_held(self, stand: Stand) -> None:
        stand.desk.stop()
        stand.run()
        sent = put(stand.desk, Send, 1, "(WHEN (> battery 60%) (SETQ drive_speed 1))", False).command
        stand.run()
        row = stand.desk.commands().rows[-1]
        assert row.held == row.matched > 0
        codes = put(stand.desk, Outcomes, 1, sent).outcomes
        held = codes.index(HELD_BY_STOP)
        why = put(stand.desk, Why, 2, held, sent)
        assert isinstance(why, Explained)
        assert (why.why.matched, why.why.held) == (True, True)

    def test_a_rule_that_fails_is_counted_with_the_command_that_brought_it(self, stand: Stand) -> None:
        text = "(WHEN (> battery 60%) (RULE guard (SETQ drive_speed (/ 1 0))))"
        first = put(stand.desk, Send, 1, text, False).command
        stand.run(0.3)
        (row,) = stand.desk.commands().rows
        full = [name for name in stand.swarm.minds if stand.level(name) > 0.6]
        assert row.matched == len(full)
        (found,) = row.failing
        assert (found.rule, found.robots) == ("guard", len(full))
        assert found.reason == "division by zero in (/ 1 0)"
        stand.run()  # long enough to deactivate it
        (whole,) = next(each for each in stand.desk.news(-1) if isinstance(each, Failing)).rules
        assert (whole.rule, whole.robots, whole.inactive) == ("guard", len(full), len(full))
        marks = put(stand.desk, Failed, 2, "guard").outcomes
        assert [name for name, mark in zip(stand.swarm.minds, marks, strict=True) if mark] == full
        assert put(stand.desk, Failed, 2, "").outcomes == marks

        second = put(stand.desk, Send, 1, "(WHEN (> battery 80%) (RULE guard (MOD 1 0)))", False).command
        stand.run()
        fuller = sum(stand.level(name) > 0.8 for name in full)
        rows = {row.id: row for row in stand.desk.commands().rows}
        assert [each.robots for each in rows[first].failing] == [len(full) - fuller]
        assert [each.robots for each in rows[second].failing] == [fuller]

        put(stand.desk, Send, 1, "(FORGET guard)", True)
        stand.run()
        assert all(row.failing == () for row in stand.desk.commands().rows)
        with pytest.raises(MisuseError, match="The rule guard does not fail on any robot at this time"):
            put(stand.desk, Failed, 2, "guard")

    def test_what_commands_store_is_known_of_those_only_that_are_shown(
        self, stand: Stand, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("sleepcast.console.account_table.MAX_ROWS", 3)
        table = AccountTable(stand.station, SwarmAdapter(stand.swarm))
        put(stand.desk, Send, 1, "(RULE guard (SETQ drive_speed (/ 1 0)))", True)
        for number in range(8):
            put(stand.desk, Send, 1, f"(SETQ seen {number})", True)
            stand.run(0.3)
            rows = table.rows()
            assert table.failing.now.rules
            assert set(table.failing._stored) <= {row.id for row in rows}
        assert len(table.failing._stored) == 3

    def test_who_cannot_have_heard_yet_is_waiting_not_silent(self, stand: Stand) -> None:
        stand.desk.driver.pace.paused = False
        put(stand.desk, Send, 1, FULL, False)
        assert [row.waiting for row in stand.desk.commands().rows] == [""]
        stand.desk.driver.pace.paused = True
        assert [(row.waiting, row.silent) for row in stand.desk.commands().rows] == [("paused", 20)]
        stand.run()
        assert [(row.waiting, row.silent) for row in stand.desk.commands().rows] == [("", 0)]

    def test_who_was_silent_before_the_pause_is_silent_in_it(self, stand: Stand) -> None:
        stand.desk.driver.pace.paused = False
        stand.station.send(FULL, only=["rover1"])
        stand.run()
        stand.station.hear(Message("elsewhere", 0, 1, Kind.HEARTBEAT, 0.0))
        stand.desk.stop()
        stand.run()
        stand.desk.driver.pace.paused = True
        assert [(row.waiting, row.silent) for row in stand.desk.commands().rows] == [("", 0), ("", 1)]

    def test_everybody_must_be_meant(self, stand: Stand) -> None:
        with pytest.raises(MisuseError, match="every robot that hears it would obey"):
            put(stand.desk, Send, 1, "(MARK)", False)
        assert stand.desk.commands().rows == []
        put(stand.desk, Send, 1, "(MARK)", True)
        stand.run()
        assert stand.desk.commands().rows[-1].matched == 20

    def test_what_is_hardly_meant_is_sent_when_it_is_confirmed(self, stand: Stand) -> None:
        doubted = "(WHEN (> battery 1%) (> battery 200%) (MARK))"
        with pytest.raises(DoubtError):
            put(stand.desk, Send, 1, doubted, False)
        assert stand.desk.commands().rows == []
        put(stand.desk, Send, 1, doubted, False, confirmed=True)
        stand.run()
        assert stand.desk.commands().rows[-1].matched == 20

    def test_only_the_latest_commands_are_shown(self, stand: Stand) -> None:
        for _ in range(MAX_ROWS + 3):
            put(stand.desk, Send, 1, FULL, False)
        rows = stand.desk.commands().rows
        assert len(rows) == MAX_ROWS
        assert rows[-1].id == stand.station.commands()[-1].id

    def test_an_unknown_command_has_no_outcomes(self, stand: Stand) -> None:
        with pytest.raises(SleepcastError, match="was sent from this desk"):
            put(stand.desk, Outcomes, 1, "desk-9.9")


class TestStop:
    def test_says_no_more_than_the_robots_have_said(self, stand: Stand) -> None:
        assert safety(stand) == (False, "")
        stand.desk.stop()
        latched, sentence = safety(stand)
        assert latched
        assert sentence.startswith("STOP: 0 of 20 robots report stopped; silent: rover1 (last heard 0 s ago)")
        assert sentence.endswith("and 17 more.")
        stand.run()
        assert safety(stand) == (True, "STOP: all 20 robots are at rest.")
        assert all(node.stopped for node in stand.swarm.minds.values())
        assert stand.desk.driver.frame[1] & 2
        stand.desk.release()
        assert safety(stand) == (False, "")
        stand.run()
        assert not any(node.stopped for node in stand.swarm.minds.values())

    def test_while_time_stands_still_it_says_that_nobody_has_heard_it(self, stand: Stand) -> None:
        stand.desk.driver.set_pace(running=False)
        stand.desk.stop()
        assert "0 of 20 robots report stopped. Time stands still" in safety(stand)[1]

    def test_tells_stopping_and_at_rest_apart(self, stand: Stand) -> None:
        stand.station.send("(DRIVE 5m/s 0)", everybody=True)
        stand.run(5.0)
        stand.desk.stop()
        stand.run(1.0)
        row = stand.desk.commands().rows[-1]
        assert (row.kind, row.matched, row.moving) == ("stop", 20, 20)
        said = safety(stand)[1]
        assert said.startswith("STOP: all 20 robots report stopped; 20 still move: rover")
        assert said.endswith("m to go), and 19 more.")
        assert stand.desk._robot(0).state[0].startswith("stopping (")
        stand.run(5.0)
        assert safety(stand)[1] == "STOP: all 20 robots are at rest."
        assert stand.desk.commands().rows[-1].moving == 0
        assert "at rest" in stand.desk._robot(0).state

    def test_before_time_begins_it_says_at_once_that_no_robot_moves(self, tmp_path: Path) -> None:
        swarm = Swarm(simulator(tmp_path))
        swarm.desk = station = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm)
        view, clock = SwarmAdapter(swarm), ManualClock()
        driver = Driver(view, Pace(clock, swarm, 1.0), clock, waits=True)
        waiting = Stand(swarm, station, clock, Backend(view, station, driver, clock))
        waiting.swarm.send_initial_telemetry()
        waiting.desk.stop()
        assert safety(waiting) == (
            True,
            "STOP holds: the run has not started, so no robot moves. All robots are sent STOP with the first tick.",
        )
        assert [row.waiting for row in waiting.desk.commands().rows] == ["for the start"]
        assert driver.waiting, "STOP does not let time begin"
        before = view.poses()
        station.send("(DRIVE 1m/s 0)", everybody=True)
        waiting.run()
        assert safety(waiting) == (True, "STOP: all 20 robots are at rest.")
        assert view.poses() == before, "no robot has moved by a command that was sent after it"

    def test_a_key_held_down_gives_one_stop_and_not_hundreds(self, stand: Stand) -> None:
        for _ in range(100):
            stand.desk.stop()
        assert len(stand.desk.commands().rows) == 1
        stand.clock.advance(1.0)
        stand.desk.stop()
        assert len(stand.desk.commands().rows) == 2

    def test_a_stop_right_after_a_release_is_no_repeat(self, stand: Stand) -> None:
        for act in (stand.desk.stop, stand.desk.release, stand.desk.stop):
            act()
        assert [row.kind for row in stand.desk.commands().rows] == ["stop", "release", "stop"]
        assert safety(stand)[0]


def safety(stand: Stand) -> tuple[bool, str]:
    (found,) = [each for each in stand.desk.news(-1) if type(each).__name__ == "Safety"]
    return found.latched, found.sentence


class TestWhy:
    def test_shows_the_first_test_that_failed_and_by_how_much(self, stand: Stand) -> None:
        sent = put(stand.desk, Send, 1, "(WHEN (AND (> battery 60%) (< x 2km)) (JOIN crew))", False).command
        stand.run(1.0)
        index = next(i for i, name in enumerate(stand.swarm.minds) if stand.level(name) < 0.5)
        level = f"{100 * stand.level(f'rover{index + 1}'):.4g} %"
        why = put(stand.desk, Why, 1, index, sent).why
        assert (why.matched, why.reason) == (False, f"battery = {level}, needed > 60 %")
        shown = {step.text: step for step in steps(why.root)}
        assert shown["(> battery 60%)"].state == "false"
        assert shown["(> battery 60%)"].note == why.reason
        assert shown["battery"].value == level
        assert [shown[text].state for text in ("(< x 2km)", "x", "(JOIN crew)")] == ["skipped"] * 3
        assert "60%" not in shown

    def test_shows_a_comparison_in_the_unit_that_was_written(self, stand: Stand) -> None:
        sent = put(stand.desk, Send, 1, "(WHEN (< (DIST x y house_x house_y) 2km) (JOIN crew))", False).command
        stand.run(1.0)
        why = put(stand.desk, Why, 1, 0, sent).why
        assert (why.matched, why.reason) == (True, "")
        shown = {step.text: step for step in steps(why.root)}
        assert shown["(DIST x y house_x house_y)"].value.endswith(" km")
        assert shown["(< (DIST x y house_x house_y) 2km)"].state == "true"

    def test_shows_what_is_unknown_and_what_is_a_fault(self, stand: Stand) -> None:
        text = "(WHEN (AND (OR (> ordnance 70%) (> x 0)) (/ 1 0)) (MARK))"
        sent = put(stand.desk, Send, 1, text, False, confirmed=True).command
        stand.run(1.0)
        shown = {step.text: step for step in steps(put(stand.desk, Why, 1, 0, sent).why.root)}
        assert (shown["ordnance"].state, shown["ordnance"].value) == ("unknown", "unknown")
        assert shown["(> ordnance 70%)"].state == "unknown"
        assert (shown["(/ 1 0)"].state, shown["(/ 1 0)"].fault) == ("fault", "division by zero")

    @pytest.mark.parametrize("index", [-1, 20, 10_000_000])
    def test_a_robot_that_is_not_there_gets_a_sentence(self, stand: Stand, index: int) -> None:
        with pytest.raises(MisuseError, match="numbered from 0 to 19"):
            put(stand.desk, Why, 1, index, "desk-1.1")

    def test_a_command_that_the_robot_never_heard_gets_a_sentence(self, stand: Stand) -> None:
        sent = put(stand.desk, Send, 1, FULL, False).command
        with pytest.raises(SleepcastError, match="rover1 remembers no command"):
            put(stand.desk, Why, 1, 0, sent)


class TestNames:
    def test_tell_what_each_is_and_its_values_over_the_fleet(self, stand: Stand) -> None:
        put(
            stand.desk,
            Send,
            1,
            "(PROGN (DEFVAR patience id) (DEFUN near (d) (< x d)) (JOIN crew) (RULE r (MARK)))",
            True,
        )
        stand.run()
        found = {name.name: name for name in put(stand.desk, GetNames, 1).names}
        levels = [100 * stand.level(name) for name in stand.swarm.minds]
        assert found["battery"].range == f"{min(levels):.4g} % … {max(levels):.4g} %"
        assert (found["house_x"].kind, found["house_x"].range) == ("sensor", "0.5 km")
        assert found["drive_speed"].range == "unknown"
        assert found["DIST"].usage == "(DIST x1 y1 [z1] x2 y2 [z2])"
        assert found["GOTO"].kind == "robot"
        assert (found["patience"].kind, found["patience"].range) == ("user", "1 … 20")
        assert (found["near"].kind, found["near"].usage) == ("operator", "(near d)")
        assert (found["crew"].kind, found["crew"].range) == ("group", "20 robots")
        assert found["r"].kind == "rule"
        assert found["PI"].range == "3.14159"
        assert not any(name.startswith("active") for name in found)


class TestWatchedRobot:
    def test_tells_its_values_groups_state_rules_and_reports(self, stand: Stand) -> None:
        orders = (
            "(JOIN Crew)",
            "(RULE careful (WHEN (< battery 1%) (ST)) :priority 2)",
            '(REPORT "level" battery x)',
            "(FREEZE)",
        )
        for order in orders:
            put(stand.desk, Send, 1, order, True)
        stand.run()
        (robot,) = [each for each in stand.desk.news(4) if type(each).__name__ == "WatchedRobot"]
        assert (robot.robot, robot.groups, robot.state) == (4, ["Crew"], ["frozen"])
        values = {value.name: value for value in robot.values}
        assert values["battery"].shown == f"{100 * stand.level('rover5'):.4g} %"
        assert (values["battery"].kind, values["drive_speed"].kind) == ("sensor", "actuator")
        assert not {"active1", "time", "tick"} & set(values)
        (rule,) = robot.rules
        assert (rule.name, rule.active, rule.fault, rule.priority) == ("careful", True, "", 2)
        assert robot.reports[0].text.startswith("level: 0.")

    def test_nobody_is_watched_unless_asked_for(self, stand: Stand) -> None:
        for index in (-1, 20):
            assert not any(type(each).__name__ == "WatchedRobot" for each in stand.desk.news(index))


def test_what_has_become_of_solid_things_is_news(stand: Stand) -> None:
    def told() -> list[object]:
        return [news.obstacles for news in stand.desk.news(-1) if isinstance(news, Obstacles)]

    world = stand.swarm.simulator.world
    assert told() == []
    number = world.add(Wall(((100.0, 100.0), (300.0, 100.0))))
    ((wall,),) = told()
    assert wall == (((100.0, 100.0), (300.0, 100.0)),)
    world.remove(number)
    assert told() == [()]


def test_each_robot_s_own_answer_is_told_in_its_unit(stand: Stand) -> None:
    sent = stand.station.ask("battery")
    before = stand.swarm.now()
    assert put(stand.desk, Replies, 1, sent.id, [0, 3]).texts == ["", ""]
    stand.run()
    found = put(stand.desk, Replies, 1, sent.id, [3, 0]).texts
    assert found == [value_in_words(stand.level(f"rover{number}"), "%") for number in (4, 1)]
    assert stand.desk.replies(sent.id, [3], before) == [""]
    other = stand.station.ask("(/ id (- id 1))")
    stand.run()
    assert put(stand.desk, Replies, 1, other.id, [0, 1]).texts == ["fault", "2"]
    with pytest.raises(MisuseError, match="there is no robot number 20"):
        put(stand.desk, Replies, 1, sent.id, [20])


def test_commands_are_not_answered_with_values(stand: Stand) -> None:
    """A page may hold the number of a question of an earlier program, which is that of a command now."""
    sent = put(stand.desk, Send, 1, "(SETQ seen 1)", True).command
    stand.desk.stop()
    stand.run()
    for row in stand.desk.commands().rows:
        with pytest.raises(MisuseError, match=f"{row.id} was no question"):
            put(stand.desk, Replies, 1, row.id, [0])
    assert sent in {row.id for row in stand.desk.commands().rows}


def test_answers_are_told_whatever_they_are(stand: Stand) -> None:
    texts = {"(* 1e200 1e200)": "fault", "nothing": "unknown", "(> battery 0)": "1", "1e300": "1e+300"}
    sent = {text: stand.station.ask(text).id for text in texts}
    stand.run()
    assert {text: put(stand.desk, Replies, 1, number, [0]).texts[0] for text, number in sent.items()} == texts


def test_a_page_learns_the_names_of_robots_that_come_and_go() -> None:
    table = (
        "hatch = true\n\n[robots.limits]\nspeed = 1\nturn_rate = 1\nacceleration = 1\n\n[robots.body]\nradius = 0.1\n"
    )
    world = 'format = 2\ntitle = "flock"\nseconds = 9\n\n[world]\nwidth = 9\nheight = 9\n\n'
    swarm = Swarm(Simulator(read_scenario(f'{world}[robots]\ntype = "sheep"\ncount = 2\n{table}')))
    swarm.desk = station = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm)
    view, clock = SwarmAdapter(swarm), ManualClock()
    desk = Backend(view, station, Driver(view, Pace(clock, swarm, 1.0), clock), clock)
    assert not [each for each in desk.news(0) if isinstance(each, Roll)]
    swarm.minds["sheep1"].evaluate("(PROGN (HATCH sheep 1) (DIE))")
    swarm.step()
    news = [*desk.news(0)]  # which looks at the robot that is gone
    assert [each.names[:4] for each in news if isinstance(each, Roll)] == [("", "sheep2", "sheep3", "")]
    assert not [each for each in news if isinstance(each, WatchedRobot)]
    assert desk.hello().scene.names[:3] == ("", "sheep2", "sheep3")
    assert places_of(desk.values.names).tolist() == [1, 2], "of what the table and the glance tell"
    with pytest.raises(MisuseError, match="is gone"):
        desk.name_of(0)
