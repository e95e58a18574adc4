"""What befalls bodies becomes reports of their robots: once each, in the tick in which it happens, and recorded."""

from __future__ import annotations

from pathlib import Path

import sleepcast as sc
from sleepcast.loop import Swarm, resume, snapshot
from sleepcast.robot import FENCE_AHEAD, brought_to_rest, hovering
from sleepcast.simulator import read_scenario
from sleepcast.simulator.recording.foxglove import read_log
from sleepcast.simulator.recording.recorder import LOG
from sleepcast.simulator.recording.recording import entries, load_recording
from swarms import desk_of, station_of, swarm_of

SKY = """
format = 2
title = "a sky"
seconds = "1min"
tick = "0.1s"

[world]
width = "60m"
height = "60m"

[robots]
like = "crazyflie"
starts = [["10m", "10m", "0deg", "a", "2m"], ["11m", "10m", "0deg", "b", "2m"], ["40m", "40m", "0deg", "c", "2m"]]

[robots.flight]
hovers = "9s"
"""
HITS = "(WHEN (= id 1) (GOTO 20m 10m))"


def heard(swarm: Swarm) -> list[tuple[float, str, object]]:
    return [(round(each.heard, 3), each.robot, each.body["label"]) for each in desk_of(swarm).reports]


def test_robots_that_nobody_has_told_anything_report_in_the_tick_in_which_it_happens() -> None:
    swarm = swarm_of(read_scenario(SKY.replace('"9s"', '"3.05s"')))
    swarm.run(4.0)
    assert heard(swarm) == [(3.1, name, hovering.exhausted(in_air=True)) for name in "abc"]
    assert swarm.simulator.news == []


def test_what_befalls_many_at_once_is_one_batch_of_messages() -> None:
    swarm = swarm_of(read_scenario(SKY))
    batches = []
    swarm.radio.send_all = batches.append  # type: ignore[method-assign]
    for robot in (2, 0):
        swarm.simulator.robots[robot].cut_motors()
    swarm.step()
    assert [batch.robots.tolist() for batch in batches] == [[0, 2]]


def test_a_snapshot_between_an_event_and_its_report_holds_it() -> None:
    swarm = swarm_of(read_scenario(SKY))
    swarm.run(1.0)
    swarm.simulator.robots[0].cut_motors()
    assert [news.text for news in swarm.simulator.news] == [hovering.LOCKED_MOTORS]
    other = resume(snapshot(swarm), desk=station_of)
    for each in (swarm, other):
        each.run(12.0)
    assert snapshot(other) == snapshot(swarm)
    assert heard(other)[0] == (1.1, "a", hovering.LOCKED_MOTORS)


def test_a_snapshot_holds_who_was_told_that_its_fence_is_ahead() -> None:
    swarm = swarm_of(read_scenario(SKY.replace('"9s"', '"1min"')))
    desk_of(swarm).send("(RULE on (WHEN (= id 3) (SETQ drive_speed 1m/s)))", everybody=True)
    while not heard(swarm):
        swarm.step()
    swarm.run(1.0)
    other = resume(snapshot(swarm), desk=station_of)
    for each in (swarm, other):
        each.run(10.0)
    assert snapshot(other) == snapshot(swarm)
    assert [label for _, _, label in heard(swarm)] == [brought_to_rest(FENCE_AHEAD)]
    assert heard(other) == heard(swarm), "it was told before"


def test_a_recording_has_each_of_them_once_and_what_robots_speak_too(tmp_path: Path) -> None:
    with sc.open(SKY) as fleet:
        fleet.record(tmp_path / "run.mcap")
        fleet.send(HITS, wait=0)
        fleet.send('(WHEN (= id 3) (TK "hello"))', wait=0)
        fleet.run(4.0)
    file = tmp_path / "run.mcap"
    logged = [read_log(each.data)[:2] for each in entries(file, load_recording(file)) if each.topic == LOG]
    said = [line for line in logged if line[0] in ("a", "b", "c")]
    assert sorted(said) == [("a", "has crashed into b"), ("b", "has crashed into a"), ("c", "hello")]
