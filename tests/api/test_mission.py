"""A mission in a program's hands: it is seen that there is one, and it is played."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from threading import Event

import pytest

import sleepcast as sc
from sleepcast.api.fleet import SimulatedFleet
from sleepcast.console import registry
from sleepcast.console.features.mission import Play
from sleepcast.experiments.acceptance import read_test, run_test
from sleepcast.simulator import MissionError
from small_worlds import write

SCRIPT = """\
@0.5s (WHEN (> battery 60%) (JOIN crew))
= matched at least 1, not matched 20
@1s   (DEFVAR seen)
@1s   (SETQ seen 1)   ; what the line before declares is not unknown here
@2s   ask battery
@3s   STOP
@4s   RELEASE
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(tmp_path, ('seconds = "1min"', 'seconds = "1min"\nmission = "work.sleep"'))
    (tmp_path / "work.sleep").write_text(SCRIPT, encoding="utf-8")
    return tmp_path


def played(fleet: SimulatedFleet) -> list[tuple[float, str]]:
    return [(command.message.issued, command.text) for command in fleet.station.commands()]


def test_a_fleet_says_that_it_has_a_mission_and_plays_it(folder: Path) -> None:
    fleet = sc.open(folder)
    assert repr(fleet).endswith("a mission of 6 commands, none was sent: fleet.play() sends them at their times")
    assert "fleet.play()" in fleet._repr_html_()
    assert [line.time for line in fleet.mission] == [0.5, 1.0, 1.0, 2.0, 3.0, 4.0]
    assert fleet.mission[0].wanted == "matched at least 1, not matched 20"
    sent = fleet.play()
    assert [result.text for result in sent] == [line.instruction.text or line.text for line in fleet.mission]
    assert all(line.result is not None for line in fleet.mission)
    assert fleet.mission[0].result is not None
    assert fleet.mission[0].result.matched == sent[0].matched
    (wrong,) = fleet.mission[0].unmet
    assert "wanted not matched 20, but it was " in wrong
    assert wrong in repr(fleet.mission)
    assert repr(fleet).endswith("its mission of 6 commands was sent")
    with pytest.raises(sc.errors.MisuseError, match="open the scenario again"):
        fleet.play()


def test_it_leads_where_the_mission_by_itself_leads(folder: Path) -> None:
    by_itself, by_hand, desk = sc.open(folder, mission=True), sc.open(folder), sc.open(folder, mission=True)
    assert repr(by_itself).endswith("none was sent: the rest is sent by itself while time passes")
    by_itself.run(6, quiet=True)
    assert not by_itself.mission.rest
    assert "was sent" in repr(by_itself)
    for fleet in (by_hand, desk):  # the desk does not send it once more
        fleet.play(wait=0)
        fleet.run(6 - fleet.time, quiet=True)
        assert fleet.hash == by_itself.hash
        assert len(fleet.station.commands()) == 6
    assert [text for _, text in played(by_hand)] == [text for _, text in played(by_itself)]


LOSSY = """\
@0.5s (DRIVE 2m/s 10deg/s)
@1s STOP
@6s RELEASE
@7s within 0.15s (WHEN (> battery 0) (JOIN crew))
"""


@pytest.mark.parametrize("radio", ["loss = 0.7", 'delay = "0.1s"'])
def test_on_every_radio_it_leads_where_the_mission_by_itself_leads(folder: Path, radio: str) -> None:
    """A STOP was repeated a tick earlier, and a short command was late."""
    text = (folder / "scenario.toml").read_text(encoding="utf-8").replace('[radio]\ndelay = "0s"', f"[radio]\n{radio}")
    (folder / "scenario.toml").write_text(text, encoding="utf-8")
    (folder / "work.sleep").write_text(LOSSY, encoding="utf-8")
    by_itself, by_hand, viewed = sc.open(folder, mission=True), sc.open(folder), sc.open(folder)
    registry.answer(Play(1, True), viewed._make_desk().desk)
    by_hand.play(wait=0)
    found = set()
    for fleet in (by_itself, by_hand, viewed):
        fleet.run(9 - fleet.time, quiet=True)
        matched = tuple(command.answers.codes.tobytes() for command in fleet.station.commands())
        found.add((fleet.hash, str(fleet.groups), str(fleet.swarm.radio.counts), matched))
    assert len(found) == 1


def test_what_was_sent_already_is_not_sent_again(folder: Path) -> None:
    fleet = sc.open(folder)
    fleet.send(fleet.mission[0].text, wait=0)
    fleet.stop(wait=0)  # not the one of the mission, whose time has not come
    assert "1 sent: fleet.play() sends the rest" in repr(fleet)
    fleet.release(wait=0)
    fleet.run(2.5, quiet=True)
    sent = fleet.play()
    assert [each.text for each in sent] == [line.text.removeprefix("ask ") for line in fleet.mission[1:]]
    times = [issued for issued, _ in played(fleet)][3:]
    assert times[:3] == pytest.approx([2.5, 2.5, 2.5])  # their time had passed
    assert times[3:] == pytest.approx([2.9, 3.9])


def test_a_script_of_ones_own(folder: Path, tmp_path: Path) -> None:
    fleet = sc.open(folder)
    text = "; two lines\n@1s (JOIN crew)\n= matched 3\n@2s only rover1,rover2 (LEAVE crew)"
    for script in (sc.Mission(text), text):
        sent = fleet.send(script)
        assert isinstance(sent, list)
        assert len(sent[0].matched) == 20
        assert sent[0].unmet[0].startswith("the script:2: (JOIN crew): wanted matched 3, but it was 20")
        assert sent[1].matched == ("rover1", "rover2")
    assert len(fleet.mission.rest) == 6
    fleet.save_test(tmp_path / "saved")
    assert "@1.0s (JOIN crew)\n" in (tmp_path / "saved" / "mission.sleep").read_text(encoding="utf-8")


def test_a_fork_knows_of_a_stop_that_was_sent_late(folder: Path) -> None:
    fleet = sc.open(folder).run(5, quiet=True)
    sent = [each.id for each in fleet.play()]
    other = fleet.fork()
    assert [None if line.result is None else line.result.id for line in other.mission] == sent


def test_what_is_wrong_is_said_with_its_line(folder: Path) -> None:
    fleet = sc.open(folder)
    with pytest.raises(MissionError, match=r"^the script:2: .*not closed"):
        fleet.play("@0.2s (JOIN crew)\n@0.5s (JOIN crew")
    assert not fleet.station.commands()  # it is known before anything is sent
    assert fleet.time == 0
    with pytest.raises(MissionError, match=r"^the script:2: .*x"):
        fleet.play("@0.2s (JOIN crew)\n@0.5s (SETQ x 1)")
    assert len(fleet.groups["crew"]) == 20
    with pytest.raises(MissionError, match=r"^the script:1: wanted a time"):
        fleet.play("@soon (JOIN crew)")
    with pytest.warns(UserWarning, match="did you mean battery"):
        fleet.play("@0s (WHEN (> batery 1) (JOIN crew))")
    for wrong in (5, ["(ST)"], fleet.mission[0]):
        with pytest.raises(sc.errors.MisuseError, match=r"wanted a script, as sc\.Mission or as a text, not "):
            fleet.send(wrong)  # type: ignore[call-overload]
    with pytest.raises(sc.errors.MisuseError, match="says line by line"):
        fleet.send("@0s (JOIN crew)", standing=True)


def test_a_stop_by_somebody_else_ends_it(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stopped = Event()

    def reach(fleet: SimulatedFleet, time: float, usual: Callable[..., None] = SimulatedFleet._reach) -> None:
        """The second line waits for the STOP: a simulated mission is over before a busy machine comes to send one."""
        assert not fleet.station.commands() or stopped.wait(60.0)
        usual(fleet, time)

    async def both() -> SimulatedFleet:
        fleet = sc.open(folder)
        playing = asyncio.create_task(fleet.aplay())
        while not fleet.station.commands():
            await asyncio.sleep(0)
        await fleet.astop(wait=0)
        stopped.set()
        with pytest.raises(MissionError, match=r"work\.sleep:\d: STOP ended the script"):
            await playing
        return fleet

    monkeypatch.setattr(SimulatedFleet, "_reach", reach)
    fleet = asyncio.run(both()).run(0.5, quiet=True)
    assert fleet.stopped.all()
    fleet.release()
    fleet.play()
    assert not fleet.mission.rest


def test_a_stop_by_a_person_ends_a_mission_that_the_desk_sends(folder: Path, tmp_path: Path) -> None:
    fleet = sc.open(folder, mission=True).run(2.2, quiet=True)
    fleet.stop(wait=0)
    fleet.run(3, quiet=True)
    assert fleet.stopped.all()
    assert [line.text for line in fleet.mission.rest] == ["STOP", "RELEASE"]
    assert "4 sent: STOP ended it; fleet.release(), then fleet.play() sends the rest" in repr(fleet)
    assert run_test(read_test(fleet.save_test(tmp_path / "saved", exact=True)), threads=1).missed == ()
    with pytest.raises(MissionError, match=r"work\.sleep:\d: STOP holds, which no script has sent"):
        fleet.play()
    assert fleet.stopped.all()
    fleet.release()
    fleet.play()
    assert not fleet.stopped.any()


def test_a_release_of_a_script_ends_only_stops_of_scripts(folder: Path) -> None:
    fleet = sc.open(folder)
    fleet.play("@0.2s STOP")
    fleet.play("@0.5s RELEASE")
    fleet.stop()
    with pytest.raises(MissionError, match="the script:2: STOP holds, which no script has sent"):
        fleet.play("@1s STOP\n@2s RELEASE")
    assert fleet.stopped.all()


def test_a_snapshot_knows_which_late_stop_was_the_missions(folder: Path, tmp_path: Path) -> None:
    fleet = sc.open(folder).run(5, quiet=True)
    sent = [each.id for each in fleet.play()]
    fleet.save(tmp_path / "late.snap")
    other = sc.resume(tmp_path / "late.snap")
    assert [None if line.result is None else line.result.id for line in other.mission] == sent


def test_a_view_and_a_program_know_the_same_of_it(folder: Path) -> None:
    fleet = sc.open(folder)
    fleet.run(5, quiet=True)
    registry.answer(Play(1, True), fleet._make_desk().desk)  # as if somebody pressed its button
    fleet.run(1, quiet=True)
    assert not fleet.mission.rest  # STOP and RELEASE, too, though they came late


def test_a_run_is_saved_as_a_test_however_its_folder_was_written(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder.parent)
    fleet = sc.open(folder.name)
    fleet.play()
    assert run_test(read_test(fleet.save_test(folder / "again", exact=True)), threads=1).missed == ()


def test_without_a_mission_nothing_is_said_of_one(tmp_path: Path) -> None:
    write(tmp_path)
    fleet = sc.open(tmp_path)
    assert "a mission" not in repr(fleet)
    assert not fleet.mission
    with pytest.raises(sc.errors.MisuseError, match=r"fleet\.play\('@5s \(ST\)'\)"):
        fleet.play()


def test_a_snapshot_knows_what_was_sent(folder: Path) -> None:
    fleet = sc.open(folder)
    fleet.send(fleet.mission[:3], wait=0)
    other = fleet.fork()
    assert [line.result is not None for line in other.mission] == [True] * 3 + [False] * 3
    assert len(other.play()) == 3
    assert len(fleet.mission.rest) == 3
