"""The front door: what a script or a notebook does with a simulated fleet."""

from __future__ import annotations

import asyncio
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from counting import ONCE, counted
from sleepcast.api.fleet import SimulatedFleet
from sleepcast.language import CheckError
from sleepcast.loop.snapshots import SnapshotError
from sleepcast.simulator import Changes, SettingsError, find_scenario
from sleepcast.simulator.recording.recording import load_recording
from sleepcast.station import NotConfirmedError
from sleepcast.station.prepared import Terms
from sleepcast.station.validation import Audience
from small_worlds import IN_MAZE, SMALL

IN_A_MAZE = SMALL.replace(IN_MAZE[0], IN_MAZE[1].replace("2m", "100m"))
NEAR = "(WHEN (AND (< (DIST x y vessel_x vessel_y) 5mi) (> fuel 50%)) (JOIN bravo))"


def bravo(**changes: int) -> SimulatedFleet:
    return sc.open("bravo", **{"robots": 100, "seed": 7, **changes})


class TestCommands:
    def test_a_preview_and_what_becomes_of_the_command_agree(self) -> None:
        fleet = bravo().run(2)
        before = fleet.preview(NEAR)
        sent = fleet.send(NEAR)
        assert sent.matched == before.yes
        assert sent.matched
        assert len(sent.matched) + len(sent.not_matched) == len(fleet) == 100
        assert sent.silent == sent.fault == ()
        assert fleet.groups == {"bravo": sent.matched}

    def test_a_text_is_the_name_of_one_robot(self) -> None:
        fleet = bravo().run(1)
        name = fleet.names[3]
        assert fleet.ask("fuel", only=name).matched == (name,)
        with counted() as found:
            fleet.send("(WHEN (> fuel 50%) (MARK))", wait=0)
        assert found == ONCE
        assert fleet.send("(MARK)", only=np.array([name])).matched == (name,)  # type: ignore[arg-type]
        assert fleet.send("(MARK)", only=np.array(name)).matched == (name,)  # type: ignore[arg-type]
        assert name not in fleet.send("(MARK)", but=name, everybody=True).matched
        assert tuple(fleet.station.prepare("(MARK)", Terms(audience=Audience.of(name))).forecast.yes) == (name,)
        with pytest.raises(sc.errors.MisuseError, match='no robot "nobody"'):
            fleet.ask("fuel", only="nobody")
        for wrong in (3, [3], [name, None], name.encode(), np.array(3)):
            with pytest.raises(sc.errors.MisuseError, match=r'is no name of a robot: wanted names, such as \["scout1"'):
                fleet.send("(MARK)", only=wrong)  # type: ignore[arg-type]

    def test_a_misspelt_name_gives_a_warning_and_is_counted_as_unknown(self) -> None:
        fleet = bravo().run(2)
        with pytest.warns(UserWarning, match=r"unknown name \"fule\" at 1:10 \(did you mean fuel\?\)"):
            sent = fleet.send("(WHEN (> fule 50%) (JOIN bravo))")
        assert (len(sent.unknown), sent.matched, sent.not_matched) == (100, (), ())
        assert set(sent.table()["outcome"]) == {"unknown"}
        with pytest.warns(UserWarning, match="did you mean fuel"):
            fleet.ask("fule")
        fleet.send("(WHEN (> fule 50%) (JOIN bravo))", sure=True)  # it is meant so: no warning

    def test_what_stop_holds_is_told(self) -> None:
        fleet = bravo().run(2)
        fleet.stop()
        fleet.run(60, quiet=True)  # they come to rest
        sent = fleet.send("(WHEN (> fuel 50%) (GOTO 2mi 2mi))")
        assert sent.held == sent.matched != ()
        assert f"(held by STOP: {len(sent.held)})" in repr(sent)
        before = fleet.x.copy()
        fleet.run(5, quiet=True)
        assert (fleet.x == before).all()

    def test_what_does_nothing_is_previewed_as_a_test(self) -> None:
        fleet = bravo().run(2)
        full = fleet.preview("(> fuel 50%)")
        assert full.yes == tuple(np.array(fleet.names)[fleet["fuel"] > 0.5])
        assert 0 < len(full.yes) < 100

    def test_time_passes_only_until_all_have_answered(self) -> None:
        fleet = bravo()
        fleet.send("(JOIN a)", everybody=True)
        assert 0.0 < fleet.time < 2.0

    def test_several_commands_leave_at_the_same_moment(self) -> None:
        fleet = bravo()
        first, second = (fleet.send(text, everybody=True, wait=0.0) for text in ("(JOIN a)", "(JOIN b)"))
        assert fleet.time == 0.0
        assert len(first.silent) == len(second.silent) == 100
        fleet.run(1)
        assert len(first.matched) == len(second.matched) == 100
        assert fleet.groups.keys() == {"a", "b"}

    def test_a_question_is_answered_with_values(self) -> None:
        fleet = bravo()
        asked = fleet.ask("(* 2 fuel)", only=["scout2", "scout3"])
        assert asked.values == pytest.approx(
            dict(zip(("scout2", "scout3"), 2.0 * fleet["fuel"][1:3], strict=True)), 1e-3
        )

    def test_stop_and_release(self) -> None:
        fleet = bravo()
        fleet.send("(GOTO vessel_x vessel_y)", everybody=True)
        assert len(fleet.stop().matched) == 100
        assert fleet.stopped.all()
        x = fleet.run(60).x.copy()  # it takes a boat some time to lose its way
        assert (fleet.run(5).x == x).all()
        fleet.release()
        assert not fleet.stopped.any()

    def test_it_says_why(self) -> None:
        fleet = bravo()
        sent = fleet.send("(WHEN (> fuel 101%) (JOIN b))")
        assert fleet.why("scout1").reason == sent.why("scout1").reason
        assert "needed > 101 %" in sent.why("scout1").reason
        assert fleet.why("scout1", sent.id) == sent.why("scout1")
        fleet.send("(RULE keep (WHEN (> fuel 102%) (JOIN b)))", everybody=True)
        assert "needed > 102 %" in fleet.why("scout1", "Keep").reason
        with pytest.raises(sc.errors.MisuseError, match='no command "kept" was sent'):
            fleet.why("scout1", "kept")

    def test_it_says_what_a_robot_has_bid(self) -> None:
        fleet = bravo()
        sent = fleet.send("(BEST 2 (IF (< id 4) id UNKNOWN) TRUE (JOIN b))", everybody=True, wait=6)
        bids = [sent.why(f"scout{number}").bid for number in (1, 3, 4)]
        assert [bid and (bid.state.value, bid.better) for bid in bids] == [
            ("member", ()),
            ("outbid", (("scout1", 1.0), ("scout2", 2.0))),
            ("unknown", ()),
        ]

    def test_a_cancel_ends_what_its_sender_has_granted(self) -> None:
        fleet = bravo()
        fleet.send("(BEST 3 id TRUE (JOIN b))", everybody=True, wait=6)
        cancelled = fleet.send("(WHEN (< id 3) (CANCEL))", wait=6)
        assert (cancelled.values["scout1"], cancelled.values["scout2"]) == (1.0, 1.0)
        assert fleet.run(1).groups["b"] == ("scout3",)

    def test_it_says_that_stop_held_it(self) -> None:
        fleet = bravo()
        fleet.stop()
        sent = fleet.send("(GOTO vessel_x vessel_y)", everybody=True)
        assert sent.why("scout1").verdict == "held by STOP, so it did not move"
        fleet.release()
        sent = fleet.send("(GOTO vessel_x vessel_y)", everybody=True)
        assert sent.why("scout1").verdict == "obeyed"

    def test_the_outcome_is_a_table(self) -> None:
        table = bravo().send("(JOIN a)", everybody=True).table()
        assert len(table) == 100
        assert set(table["outcome"]) == {"matched"}

    def test_an_accident_is_refused(self) -> None:
        with pytest.raises(NotConfirmedError):
            bravo().send("(ST)")


class TestReading:
    def test_reading_changes_nothing(self) -> None:
        """Asking set the clocks of idle robots, which then told another time than those that nobody had asked."""
        asked, left_alone = bravo(), bravo()
        for _ in range(3):
            asked.run(1)
            left_alone.run(1)
            assert (asked["(+ time (* 0s fuel))"] == asked.time).all()
        assert asked.snapshot() == left_alone.snapshot()

    def test_expressions_are_read_without_a_radio_and_change_nothing(self) -> None:
        fleet = bravo().run(1)
        before = fleet.hash
        away = fleet["(DIST x y 0 0)"]
        assert away == pytest.approx(np.hypot(fleet.x, fleet.y), rel=0.01)
        assert fleet.hash == before
        assert fleet.time == 1.0

    def test_the_time_is_known_to_robots_that_have_nothing_to_do(self) -> None:
        assert set(bravo().run(3)["time"]) == {3.0}

    def test_robots_that_have_learned_different_things(self) -> None:
        fleet = bravo()
        fleet.send("(IF (> fuel 50%) (DEFVAR mine 2) (DEFVAR mine (+ 1 2)))", sure=True)
        assert set(fleet["mine"]) == {2.0, 3.0}

    def test_arrays_cannot_be_written(self) -> None:
        fleet = bravo()
        for array in (fleet.x, fleet.y, fleet.heading, fleet["fuel"], fleet.stopped):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1

    def test_arrays_stay_as_they_were_when_time_goes_on(self) -> None:
        fleet = bravo()
        fleet.send("(RULE go (DRIVE 5m/s 2deg/s))", everybody=True)
        x, y, heading, stopped = fleet.run(1).x, fleet.y, fleet.heading, fleet.stopped
        fleet.run(10)
        assert np.hypot(fleet.x - x, fleet.y - y).mean() > 5.0
        assert np.abs(fleet.heading - heading).mean() > 0.1
        fleet.stop()
        assert not stopped.any()

    @pytest.mark.parametrize(
        ("text", "complaint"),
        [
            ("fule", "fuel"),
            ("(", "is not closed"),
            ("(JOIN a)", "cannot be previewed"),
            ("(RANDOM 0 1)", "cannot be previewed"),
        ],
    )
    def test_what_cannot_be_read_is_refused(self, text: str, complaint: str) -> None:
        with pytest.raises(sc.errors.SleepcastError, match=complaint):
            bravo()[text]

    def test_history_is_sampled_while_it_runs(self) -> None:
        fleet = bravo()
        history = fleet.history("fuel", "x", every=0.5)
        fleet.run(2)
        assert history.times.tolist() == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0])
        assert history["fuel"].shape == (5, 100)
        assert (history["fuel"][-1] == fleet["fuel"]).all()
        assert len(history.table()) == 500
        with pytest.raises(sc.errors.MisuseError, match="did you mean fuel"):
            history["fule"]

    def test_history_is_sampled_on_the_first_tick_at_each_multiple(self) -> None:
        fleet = bravo()
        history = fleet.history("fuel", every=0.25)
        fleet.run(1)
        assert history.times.tolist() == pytest.approx([0.0, 0.3, 0.5, 0.8, 1.0])
        assert history.every == 0.25

    def test_what_was_asked_before_is_checked_anew_when_robots_have_learned(self) -> None:
        fleet = bravo()
        for _ in range(2):
            with pytest.raises(CheckError, match="unknown name"):
                fleet["helpers"]
        fleet.send("(DEFVAR helpers 3)", everybody=True)
        assert (fleet["helpers"] == 3.0).all()
        fleet.send("(WHEN (> fuel 50%) (DEFUN twice (x) (* 2 x)))", sure=True)
        found = fleet["(twice helpers)"]
        assert set(found[~np.isnan(found)]) == {6.0}
        assert np.isnan(found).any()

    @pytest.mark.parametrize("every", [0.0, -1.0, float("nan"), 1e-9])
    def test_a_time_that_is_no_tick_is_refused(self, every: float) -> None:
        with pytest.raises(sc.errors.MisuseError, match="a tick"):
            bravo().history("fuel", every=every)

    def test_a_history_that_is_full_says_so(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("sleepcast.api.history.MAX_VALUES", 250)
        fleet = bravo()
        history = fleet.history("fuel")
        with pytest.raises(sc.errors.MisuseError, match="the history is full: it holds 200 values"):
            fleet.run(5)
        assert len(history) == 2


def few(tick: str) -> SimulatedFleet:
    return sc.open("stop", over={"tick": tick}, robots=3)


class TestRuns:
    @pytest.mark.parametrize(
        ("tick", "seconds", "times", "ticks"),
        [
            *[("0.1s", 0.05, 1, 0), ("0.1s", 0.05, 2, 1), ("0.1s", 0.25, 4, 10), ("0.07s", 1.0, 1, 14)],
            *[("0.07s", 0.1, 100, 143), ("0.1s", 0.001, 200, 2), ("0.03s", 0.01, 90, 30)],
        ],
    )
    def test_what_is_less_than_a_tick_is_carried_over(self, tick: str, seconds: float, times: int, ticks: int) -> None:
        fleet = few(tick)
        for _ in range(times):
            fleet.run(seconds, quiet=True)
        assert fleet.swarm.simulator.tick == ticks
        assert fleet.hash == few(tick).run(ticks * fleet.swarm.simulator.scenario.tick, quiet=True).hash

    def test_a_snapshot_and_a_fork_carry_it_on(self) -> None:
        fleet = few("0.1s").run(0.04)
        for other in (fleet.fork(), fleet.fork(seed=5), sc.resume(fleet.snapshot())):
            assert other.run(0.04).time == 0.1
        assert fleet.run(0.04).time == 0.1

    def test_equal_seeds_make_equal_runs(self) -> None:
        first, second, other = (bravo(seed=seed).run(2).hash for seed in (3, 3, 4))
        assert first == second != other

    def test_a_fork_has_the_same_past(self) -> None:
        fleet = bravo().run(1)
        fleet.send("(RULE roam (WHEN (PROB 50%) (DRIVE 5m/s (RANDOM -0.1 0.1))))", everybody=True)
        same, other = fleet.fork(), fleet.fork(seed=8)
        assert fleet.hash == same.hash
        hashes = [each.run(2).hash for each in (fleet, same, other)]
        assert hashes[0] == hashes[1] != hashes[2]

    def test_a_run_goes_on_from_a_file(self, tmp_path: Path) -> None:
        fleet = bravo().run(1)
        fleet.save(tmp_path / "kept.snap")
        assert (
            sc.resume(tmp_path / "kept.snap").run(1).hash
            == sc.resume(fleet.snapshot()).run(1).hash
            == fleet.run(1).hash
        )
        (tmp_path / "kept.snap").write_bytes(b"")
        with pytest.raises(SnapshotError, match=r"kept\.snap"):
            sc.resume(tmp_path / "kept.snap")

    def test_it_runs_beside_other_work(self) -> None:
        async def both() -> tuple[float, float]:
            first, second = await asyncio.gather(bravo().arun(1), bravo().arun(2))
            return first.time, second.time

        assert asyncio.run(both()) == pytest.approx((1.0, 2.0))

    def test_what_is_cancelled_ends(self) -> None:
        async def impatient(fleet: SimulatedFleet) -> None:
            running = asyncio.ensure_future(fleet.arun(1e6))
            while fleet.time == 0.0:
                await asyncio.sleep(0.01)
            running.cancel()
            await running

        fleet = bravo()
        with pytest.raises(asyncio.CancelledError):
            asyncio.run(impatient(fleet))  # waits until its threads have ended
        assert 0.0 < fleet.time < 1e6

    def test_a_scenario_may_be_an_object_a_path_or_a_text(self) -> None:
        scenario = find_scenario("flood")
        text = scenario.path.read_text()
        found = [sc.open(each).hash for each in ("flood", scenario, scenario.path.parent, str(scenario.path))]
        assert len(set(found)) == 1
        assert len(sc.open(text.replace("mission =", "# mission ="), robots=5)) == 5

    def test_any_key_of_a_scenario_can_be_changed(self) -> None:
        over = {"radio.loss": 0.25, "robots.count": np.int64(30), "radio.reach": "3km", "places.vessel.title": "home"}
        scenario = sc.open("bravo", over=over).swarm.simulator.scenario
        assert (scenario.radio.loss, scenario.robots.count, scenario.radio.reach) == (0.25, 30, 3000.0)
        assert [place.title for place in scenario.places] == ["home"]
        assert sc.open("bravo", over={"radio.loss": 0.5}, robots=5).swarm.simulator.scenario.robots.count == 5

    @pytest.mark.parametrize(
        ("key", "value", "complaint"),
        [
            ("radio.los", 0.1, r"over radio\.los: unknown key \(did you mean loss\?\)"),
            ("radoi.loss", 0.1, r"over radoi: unknown key \(did you mean radio\?\)"),
            ("radio.loss", 2, r"over radio\.loss: .*not 2"),
            ("radio.loss", "much", r"over radio\.loss: wanted"),
            ("radio.loss", None, r"over radio\.loss: wanted"),
            ("title.more", 1, r"over title\.more: there is no such place"),
            ("commands[99].title", "x", r"over commands\[99\]: there is no such place"),
            ("radio..loss", 1, "wanted a key such as"),
            ("", 1, "wanted a key such as"),
            ("title", float("nan"), "over title: wanted a text"),
            ("robots", 1, r"over robots: wanted a table \[robots\], not 1"),
            ("robots.stores", 5, r"over robots\.stores: wanted a table"),
            ("SEED", 4, r"over SEED: unknown key \(did you mean seed\?\)"),
        ],
    )
    def test_what_cannot_be_changed_is_refused(self, key: str, value: object, complaint: str) -> None:
        with pytest.raises(SettingsError, match=complaint):
            sc.open("bravo", over={key: value})

    @pytest.mark.parametrize(
        ("key", "value", "complaint"),
        [
            ("constants.DROPP", 1, r"over constants\.DROPP: the file has no such name"),
            (
                "places.vesel.x",
                1,
                r"over places\.vesel: the file has no such name \(did you mean vessel\?\): wanted one of",
            ),
            ("places", {"vesel": {"x": 1, "y": 1}}, r"over places\.vesel: the file has no such name"),
            ("robots.stores.fule.reach", "5mi", r"over robots\.stores\.fule: .*did you mean fuel"),
            ("sliders.neer.value", 1, r"over sliders\.neer: .*did you mean near"),
        ],
    )
    def test_a_name_that_the_file_does_not_have_is_refused(self, key: str, value: object, complaint: str) -> None:
        with pytest.raises(SettingsError, match=complaint):
            sc.open("bravo", over={key: value})

    @pytest.mark.parametrize(
        ("over", "options", "complaint"),
        [
            ({"seed": 5}, {"seed": 7}, "over seed: the seed is given as well, and decides"),
            ({"robots.count": 5}, {"robots": 6}, "over robots.count: the number of robots is given as well"),
            ({"world.width": "5km"}, {"area_per_robot": 60.0}, "over world.width: the area per robot is given as well"),
            ({"radio": {"loss": 1}, "radio.loss": 0}, {}, "over radio.loss: radio is given as well"),
        ],
    )
    def test_what_something_else_decides_is_refused(
        self, over: dict[str, object], options: dict[str, int], complaint: str
    ) -> None:
        with pytest.raises(sc.errors.MisuseError, match=complaint):
            sc.open("bravo", over=over, **options)  # type: ignore[arg-type]
        assert sc.open("bravo", robots=5, over={"seed": 7}, seed=7).swarm.simulator.seed == 7, "no contradiction"

    def test_changes_are_keys_with_their_values(self) -> None:
        loss = sc.open("bravo", over={"radio.loss": np.array(0.5)}).swarm.simulator.scenario.radio.loss
        assert (loss, type(loss)) == (0.5, float)
        with pytest.raises(sc.errors.MisuseError, match="over 3: wanted a key such as"):
            sc.open("bravo", over={3: 0.5})  # type: ignore[dict-item]
        for wrong in ("radio.loss=0.5", [("radio.loss", 0.5)], 3):
            with pytest.raises(sc.errors.MisuseError, match=r'over .+: wanted keys with .*\{"radio.loss": 0.3\}'):
                sc.open("bravo", over=wrong)  # type: ignore[arg-type]

    def test_every_integer_type_is_the_same_seed(self) -> None:
        hashes = {sc.open(IN_A_MAZE, seed=seed).run(1).hash for seed in (7, np.uint64(7), np.int16(7))}
        assert len(hashes) == 1
        fleet = sc.open(find_scenario("bravo", Changes(robots=np.int64(5))), seed=np.int32(7))  # type: ignore[arg-type]
        assert fleet.swarm.simulator.scenario.robots.count == 5
        forks = {fleet.fork(seed=seed).run(1).hash for seed in (8, np.uint64(8))}
        assert len(forks) == 1

    @pytest.mark.parametrize("seed", [7.0, "7", True, -1, 2**63, np.float64(7)])
    def test_what_is_no_seed_is_refused(self, seed: int) -> None:
        fleet = sc.open(IN_A_MAZE)
        said = r"^seed .+: wanted a whole number from 0 to 9223372036854775807$"
        for attempt in (
            lambda: sc.open("bravo", seed=seed),
            lambda: fleet.fork(seed),
            lambda: sc.resume(b"", seed=seed),
        ):
            with pytest.raises(sc.errors.MisuseError, match=said):
                attempt()

    @pytest.mark.parametrize("robots", [7.0, True, 0, -1, 1_000_001, np.float64(7)])
    def test_what_is_no_number_of_robots_is_refused(self, robots: int) -> None:
        with pytest.raises(sc.errors.MisuseError, match=r"^robots .+: wanted a whole number from 1 to 1000000$"):
            sc.open("bravo", robots=robots)

    def test_the_mission_is_sent_where_it_is_wanted(self) -> None:
        assert sc.open("bravo", robots=20, mission=True).run(60).station.commands()
        assert not bravo().run(60).station.commands()

    @pytest.mark.parametrize("seconds", [-1.0, float("nan"), float("inf"), "5", True, None, 1e8])
    def test_a_time_that_is_none_is_refused(self, seconds: float) -> None:
        with pytest.raises(sc.errors.MisuseError, match="cannot run for"):
            bravo().run(seconds)

    def test_what_is_no_scenario_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(sc.errors.MisuseError, match="did you mean bravo"):
            sc.open("brvao")
        with pytest.raises(SettingsError, match=r"scenario.toml:\d+"):
            sc.open("format = 1\ntitle = 5\n")
        with pytest.raises(SettingsError, match="too long"):
            sc.open("\n" * 10_000_000)
        with pytest.raises(sc.errors.MisuseError, match="taken as it is"):
            sc.open(find_scenario("bravo"), robots=5)


class TestEvents:
    def test_events_come_as_time_passes(self) -> None:
        async def watch(fleet: SimulatedFleet) -> tuple[sc.CommandResult, list[sc.FleetEvent]]:
            sent = fleet.send('(WHEN (> fuel 50%) (PROGN (JOIN full) (REPORT "fuel" fuel)))', wait=0)
            return sent, [event async for event in fleet.events(1.0)]

        fleet = bravo()
        sent, events = asyncio.run(watch(fleet))
        assert fleet.time == pytest.approx(1.0)
        of = {kind: [each for each in events if each.kind == kind] for kind in ("answer", "fault", "say", "join")}
        assert {each.robot for each in of["answer"]} == set(fleet.names)
        assert {each.command for each in of["answer"]} == {sent.id}
        assert {each.robot for each in of["answer"] if each.text == "matched"} == set(sent.matched)
        assert [(each.robot, each.text) for each in of["join"]] == [(name, "full") for name in sent.matched]
        assert sorted(each.robot for each in of["say"]) == sorted(sent.matched)
        assert all(each.text.startswith("fuel 0.") for each in of["say"])
        assert of["fault"] == []
        assert [each.time for each in events] == sorted(each.time for each in events)
        assert fleet.station.listeners == []

    def test_what_goes_wrong_is_an_event_and_may_be_acted_upon(self) -> None:
        async def watch(fleet: SimulatedFleet) -> sc.CommandResult:
            fleet.send("(/ 1 0)", only=["scout3"], wait=0)
            async for event in fleet.events():
                if event.kind == "fault":
                    return await fleet.asend("(JOIN again)", only=[event.robot])
            raise AssertionError

        fleet = bravo()
        assert asyncio.run(watch(fleet)).matched == ("scout3",)

    def test_a_time_that_is_none(self) -> None:
        async def watch() -> None:
            async for _ in bravo().events(float("nan")):
                pass

        with pytest.raises(sc.errors.MisuseError, match="events of nan s"):
            asyncio.run(watch())


class TestRecorded:
    def test_a_recording_is_that_of_the_command_line(self, tmp_path: Path) -> None:
        file = tmp_path / "run.mcap"
        with bravo() as fleet:
            recording = fleet.record(file)
            fleet.send(NEAR)
            fleet.run(5)
            assert not recording.failed
        found = load_recording(file)
        assert found.complete
        assert [posted.message.text for posted in found.posted] == [NEAR]
        assert recording.file == file

    def test_it_may_begin_later_and_end_earlier(self, tmp_path: Path) -> None:
        fleet = bravo().run(1)
        with fleet.record(tmp_path / "first.mcap", pictures=0.1, readings=0.5):
            fleet.run(1)
            with pytest.raises(sc.errors.MisuseError, match="recorded already"):
                fleet.record(tmp_path / "second.mcap")
        fleet.run(1)
        found = load_recording(tmp_path / "first.mcap")
        assert (found.complete, found.seconds) == (True, pytest.approx(2.0))
        fleet.record(tmp_path / "second.mcap").close()

    def test_what_cannot_be_recorded(self, tmp_path: Path) -> None:
        fleet = bravo()
        fleet.record(tmp_path / "run.mcap").close()
        with pytest.raises(sc.errors.MisuseError, match=r"run\.mcap"):
            fleet.record(tmp_path / "run.mcap")
        with pytest.raises(sc.errors.MisuseError, match="every nan s"):
            fleet.record(tmp_path / "other.mcap", pictures=float("nan"))
        with pytest.raises(sc.errors.MisuseError):
            fleet.record(tmp_path / "other.mcap", rotate="often")
        with pytest.raises(sc.errors.SleepcastError, match="nowhere"):
            fleet.record(tmp_path / "nowhere" / "run.mcap")


class TestShown:
    def test_in_words(self) -> None:
        fleet = bravo()
        fleet.send("(JOIN a)", everybody=True)
        assert repr(fleet).startswith("bravo: 100 robots after 0.")
        mission = "a mission of 3 commands, none was sent: fleet.play() sends them at their times"
        assert repr(fleet).endswith(f"seed 7; groups: a 100; {mission}")
        assert repr(fleet.ask("fuel")).startswith("fuel: matched 100")

    def test_in_a_notebook(self) -> None:
        fleet = sc.open("flood", seed=1)
        fleet.send("(WHEN (PROB 50%) (JOIN a))")
        html = fleet._repr_html_()
        counts = count_tags(html)
        assert counts["svg"] == 2, "the swarm and one entry of the legend"
        assert html.count("Z") - 1 >= len(fleet), "every robot is drawn"

    def test_robots_together_in_a_large_world_are_drawn_closer(self) -> None:
        def across(disc: str) -> float:
            fleet = sc.open("couzin", over={"robots.disc.radius": disc})
            path = re.search(r'<path d="M([^"]*)"', fleet._repr_html_())
            assert path
            places = [float(corner.split()[0]) for corner in re.findall(r"[\d.-]+ [\d.-]+", path[1])]
            return max(places) - min(places)

        assert across("6m") > 300
        assert across("500m") == pytest.approx(480 * 1000 / 4000, abs=20)

    def test_names_are_no_markup(self) -> None:
        fleet = sc.open("bravo", robots=3)
        text = find_scenario("bravo").path.read_text().replace('title = "', 'title = "<b>&')
        fleet = sc.open(text.replace("mission =", "# mission ="), robots=3)
        assert "<b>" not in fleet._repr_html_()

    def test_the_language_is_there_for_other_programs(self) -> None:
        assert sc.language.show(sc.language.read("(+ 1  2)")) == "(+ 1 2)"

    def test_the_package_names_what_it_has(self) -> None:
        assert all(getattr(sc, name) for name in sc.__all__)
        with pytest.raises(AttributeError, match="no attribute 'fleets'"):
            sc.fleets  # noqa: B018


def count_tags(html: str) -> dict[str, int]:
    """How often each tag is opened; every one is closed."""
    found: dict[str, int] = {}
    opened: list[str] = []

    class Parser(HTMLParser):
        def handle_starttag(self, tag: str, attrs: object) -> None:
            found[tag] = found.get(tag, 0) + 1
            opened.append(tag)

        def handle_endtag(self, tag: str) -> None:
            assert opened.pop() == tag

        def handle_startendtag(self, tag: str, attrs: object) -> None:
            found[tag] = found.get(tag, 0) + 1

    Parser().feed(html)
    assert not opened
    return found


def test_times_may_be_texts_with_their_units() -> None:
    fleet = bravo()
    history = fleet.history("fuel", every="500ms")
    fleet.run("2s", quiet=True)
    assert (round(fleet.time, 6), history.every) == (2.0, 0.5)
    sent = fleet.send(NEAR, wait="1s", deadline="1min")
    assert sent.matched
    for wrong in ("5m", "5", "soon"):
        for call in (fleet.run, lambda text: fleet.send(NEAR, wait=text), lambda text: fleet.stop(wait=text)):
            with pytest.raises(sc.errors.MisuseError, match=f"'{wrong}': wanted .*\"30s\""):
                call(wrong)
    assert len(fleet.station.commands()) == 1  # nothing was sent in vain
