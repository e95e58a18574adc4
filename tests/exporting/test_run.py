"""What an export reads of a recording."""

from __future__ import annotations

from pathlib import Path

import pytest

from exporting.recorded import YARD, one_picture, recorded
from sleepcast.channel import Kind, Message
from sleepcast.core.errors import MisuseError
from sleepcast.exporting.run import (
    CommandEvent,
    Event,
    LogLineEvent,
    MarksEvent,
    PosesEvent,
    RecordedRun,
    SolidsEvent,
)
from sleepcast.simulator.recording.foxglove import Level
from sleepcast.simulator.recording.recorder import STATE, Recorder, WorldChange
from sleepcast.simulator.recording.recording import NoRecordingError, load_recording
from sleepcast.simulator.world.world import Circle


def events(run: RecordedRun) -> list[Event]:
    return [event for event in run.events() if event is not None]


def test_every_entry_is_counted_and_what_matters_is_an_event() -> None:
    recording = load_recording(YARD)
    run = RecordedRun(recording)
    all_of_it = list(run.events())
    assert len(all_of_it) == 1 + sum(recording.counts.values()), "the solid things of the start, and each entry"
    poses = [event for event in all_of_it if isinstance(event, PosesEvent)]
    assert [event.time for event in poses] == [float(second) for second in range(11)]
    assert poses[0].poses.shape == (3, 3)
    assert [e.message.kind for e in all_of_it if isinstance(e, CommandEvent)] == [Kind.COMMAND, Kind.COMMAND, Kind.STOP]
    marks = [event for event in all_of_it if isinstance(event, MarksEvent)][-1]
    assert [marks.name_of(number) for number in marks.group.tolist()] == ["", "east", ""]
    assert (marks.flags & 1).tolist() == [1, 1, 1]


def test_robots_can_be_chosen_by_name() -> None:
    run = RecordedRun(load_recording(YARD), ["scout3", "scout1", "scout3"])
    assert run.chosen_names == ["scout3", "scout1"]
    assert run.chosen.tolist() == [2, 0]
    assert (run.wants("scout1"), run.wants("scout2"), run.wants("nobody")) == (True, False, False)
    with pytest.raises(MisuseError, match=r'no robot "scuot2" was recorded \(did you mean scout2\?\): there are 3'):
        RecordedRun(load_recording(YARD), ["scuot2"])


def test_solid_things_are_those_of_the_start_as_they_were_changed(tmp_path: Path) -> None:
    def fill(recorder: Recorder) -> None:
        recorder.obstacles(1.0, WorldChange(10, {"7": Circle(1.0, 1.0, 0.5)}, ()))
        recorder.obstacles(2.0, WorldChange(20, {}, (7, 99)))

    solids = [event for event in events(RecordedRun(recorded(tmp_path, fill))) if isinstance(event, SolidsEvent)]
    assert [(event.time, sorted(event.put), list(event.gone)) for event in solids] == [
        (0.0, [], []),
        (1.0, [7], []),
        (2.0, [], [7, 99]),
    ]


def test_the_level_of_a_line_is_read(tmp_path: Path) -> None:
    run = RecordedRun(recorded(tmp_path, lambda recorder: recorder.log(1.0, "left-1", "too hot", Level.ERROR)))
    assert [event for event in events(run) if isinstance(event, LogLineEvent)] == [
        LogLineEvent(1.0, Level.ERROR, "left-1", "too hot")
    ]


def test_commands_of_earlier_parts_are_left_to_their_exports(tmp_path: Path) -> None:
    def fill(recorder: Recorder) -> None:
        recorder.turn(5.0)
        for tick, sequence in ((10, 1), (50, 2)):
            message = Message("desk", 1, sequence, Kind.COMMAND, tick * 0.1, text="(ST)")
            recorder.posted(5.0, tick, message)

    recorded(tmp_path, fill)
    run = RecordedRun(load_recording(tmp_path / "run-0002.mcap"))
    assert [event.tick for event in events(run) if isinstance(event, CommandEvent)] == [50]
    assert run.earlier == 1


@pytest.mark.parametrize(
    ("topic", "body", "words"),
    [
        ("/readings", {"x": [1.0, 2.0]}, "2 values of 'x', wanted those of 3 robots"),
        ("/readings", {"x": ["a", "b", "c"]}, "/readings at 1 s holds something else"),
        ("/sleepcast/marks", {"tick": 1, "groups": "AA==", "flags": "AAAA", "names": []}, "marks of 3 robots"),
        ("/rules", {"robot": 5, "rules": []}, "/rules at 1 s holds something else"),
        ("/failing", {"rules": [{"rule": "r"}]}, "/failing at 1 s holds something else"),
    ],
)
def test_what_is_no_recording_is_refused_with_its_place(tmp_path: Path, topic: str, body: object, words: str) -> None:
    run = RecordedRun(recorded(tmp_path, lambda recorder: recorder.note(topic, 1.0, body)))
    with pytest.raises(NoRecordingError, match=r"run\.mcap: ") as caught:
        events(run)
    assert words in str(caught.value)


def test_times_have_a_bound(tmp_path: Path) -> None:
    def fill(recorder: Recorder) -> None:
        one_picture(recorder)
        recorder.note(STATE, 3e9, {"tick": 1, "hash": ""})

    with pytest.raises(NoRecordingError, match="an export can name times up to 2147483647 s"):
        events(RecordedRun(recorded(tmp_path, fill)))
