"""What robots tell each other: motion under the lease of the operator who drives the teller, and what a robot's host
allows."""

from __future__ import annotations

import pytest

from safety.scene import KEYS, Scene
from sleepcast.channel import Kind, Message
from sleepcast.channel.message import DRIVER, HOPS, MAX_NAME
from sleepcast.mind.authority import NO_MOTION, NO_TELLS, Tells, driver_of
from sleepcast.station.network import LEASE, NetworkStation

MOVE_ALL = "(WHEN (= id 0) (PROGN (DRIVE 1) (TELL (DRIVE 2))))"
"""r0 drives, and has its neighbours drive."""


def driven(scene: Scene) -> list[bool]:
    return [robot.node.driven for robot in scene.fleet.values()]


def reports(desk: NetworkStation) -> dict[str, object]:
    return {report.robot: report.body["label"] for report in desk.reports}


@pytest.mark.parametrize(
    "texts",
    [
        (MOVE_ALL,),
        ("(WHEN (= id 0) (TELL (DRIVE 2)))",),  # who tells it need not move itself
        ("(WHEN (= id 0) (DRIVE 1))", "(RULE calls (WHEN (AND (= id 0) (= 1 (ONCE TRUE))) (TELL (DRIVE 2))))"),
        ("(WHEN (= id 0) (TELL (WHEN (= id 1) (TELL (WHEN (/= id 1) (DRIVE 2)))) :hops 2))",),  # told on
    ],
)
def test_whom_a_neighbour_has_moved_rests_when_its_operator_is_gone(texts: tuple[str, ...]) -> None:
    scene = Scene(lease=LEASE, on_air=True)
    desk = scene.desk()
    desk.holding = True
    for text in texts:
        desk.send(text, everybody=True, standing="RULE" in text)
    scene.run(1.0)
    moved = {name for name, robot in scene.fleet.items() if 2.0 in robot.body.driven}
    assert moved
    assert moved <= {name for name, robot in scene.fleet.items() if robot.node.driven}
    scene.run(10.0)
    assert moved <= {name for name, robot in scene.fleet.items() if robot.node.driven}, "heartbeats renew it"
    desk.holding = False
    scene.run(2.0 * LEASE + 0.2)
    assert driven(scene) == [False] * 3
    assert {name: label for name, label in reports(desk).items() if name in moved} == dict.fromkeys(
        moved, "at rest: nobody drives it any more"
    )


def test_another_operator_renews_no_lease_of_what_was_told() -> None:
    scene = Scene(lease=LEASE, on_air=True)
    anna, bert = scene.desk("anna"), scene.desk("bert")
    anna.holding = bert.holding = True
    anna.send(MOVE_ALL)
    scene.run(1.0)
    bert.send("(WHEN (= id 2) (DRIVE 3))")
    scene.run(5.0)
    assert driven(scene) == [True] * 3
    anna.holding = False
    scene.run(2.0 * LEASE + 0.2)
    assert driven(scene) == [True, False, True], "whom an operator drives is kept going by any operator"
    bert.send("(WHEN (= id 1) (DRIVE 3))")
    scene.run(3.0)
    assert driven(scene)[1], "and so is one that he takes over"


def test_a_robot_that_nobody_drives_needs_nobody() -> None:
    """A teller on a mission of its own: nobody is there who could be heard."""
    scene = Scene(lease=LEASE, on_air=True)
    for robot in scene.fleet.values():
        robot.node.install("calls", "(WHEN (AND (= id 0) (= 1 (ONCE TRUE))) (TELL (DRIVE 2)))")
    scene.run(5.0)
    assert [robot.body.driven for robot in scene.fleet.values()] == [[], [2.0], [2.0]]
    assert driven(scene) == [False] * 3


@pytest.mark.parametrize("name", [None, 7, "", "a" * (MAX_NAME + 1), "a\nb", ["anna"]])
def test_whom_a_robot_names_is_a_name(name: object) -> None:
    told = Message("r1", 1, 1, Kind.COMMAND, 0.0, text="(DRIVE 1)", body={HOPS: 1, DRIVER: name}, role="robot")
    assert driver_of(told) == ""


def test_only_robots_name_somebody_else() -> None:
    body: dict[str, object] = {HOPS: 1, DRIVER: "anna"}
    named = {
        role: driver_of(Message("r1", 1, 1, Kind.COMMAND, 0.0, text="(DRIVE 1)", body=body, role=role))
        for role in ("robot", "operator", "observer", "")
    }
    assert named == {"robot": "anna", "operator": "r1", "observer": "", "": ""}


# ---- what a host allows


def test_no_tell_is_obeyed_where_the_host_says_none() -> None:
    scene = Scene(tells=Tells.NONE)
    scene.desk().send("(WHEN (= id 0) (PROGN (DRIVE 1) (TELL (JOIN bravo)) (TELL (DRIVE 2))))")
    scene.run(1.0)
    assert [robot.body.driven for robot in scene.fleet.values()] == [[1.0], [], []]
    assert [robot.node.groups for robot in scene.fleet.values()] == [frozenset()] * 3
    told = Message("r9", 1, 1, Kind.COMMAND, 0.0, text="(JOIN bravo)", body={HOPS: 1})
    node = scene.fleet["r1"].node
    node.receive(told)  # also where nobody signs
    node.think(10_000, 0.0)
    assert node.outbox[-1].body["fault"] == NO_TELLS


@pytest.mark.parametrize("moving", ["(DRIVE 2)", "(SETQ throttle 1)", "(DROP)", "(go)"])
def test_marks_are_set_where_the_host_says_marks_and_nothing_moves(moving: str) -> None:
    """Nor by what the robot has learned, nor by a function that only acts."""
    scene = Scene(tells=Tells.MARKS)
    desk = scene.desk()
    desk.send("(DEFUN go () (DRIVE 2))", standing=True, everybody=True)
    desk.send(f"(WHEN (= id 0) (TELL (PROGN (JOIN bravo) (DEFVAR seen 7) (MARK) {moving})))")
    scene.run(1.0)
    for name in ("r1", "r2"):
        robot = scene.fleet[name]
        assert (robot.body.driven, robot.body.dropped, robot.node.actuators()) == ([], 0, {})
        assert robot.node.groups == {"bravo"}
        assert dict(robot.node.variables())["seen"] == 7.0
        assert robot.node.evaluated[-1][1] == "fault"
        assert NO_MOTION in str(robot.node.why().faults)
    assert scene.fleet["r0"].node.groups == frozenset()
    desk.send("(WHEN (IN bravo) (DRIVE 3))")
    scene.run(1.0)
    assert [robot.body.driven for robot in scene.fleet.values()] == [[], [3.0], [3.0]], "operators move it"


def test_a_key_of_a_robot_moves_nobody_where_tells_are_marks() -> None:
    """Also one that says nothing of hops, or of an operator."""
    for tells, moved in ((Tells.ALL, [5.0]), (Tells.MARKS, []), (Tells.NONE, [])):
        scene = Scene(robots=1, tells=tells)
        now = scene.clock.now()
        scene.say(Message("r9", 1, 1, Kind.COMMAND, now, now + 5.0, "(DRIVE 5)"), KEYS["r*"])
        scene.run(0.5)
        assert scene.fleet["r0"].body.driven == moved
