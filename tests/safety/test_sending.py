"""Before a command leaves: for whom it is, how many may obey, and one stage after the other."""

from __future__ import annotations

import pytest

from safety.scene import Scene
from sleepcast.channel import Kind, Message
from sleepcast.channel.message import FOR, NOT
from sleepcast.console.network import PendingExplanation
from sleepcast.language import CheckError
from sleepcast.station import (
    CommandTypeError,
    CountNeededError,
    DoubtError,
    NobodyHeardError,
    NotConfirmedError,
    UnknownRobotError,
)
from sleepcast.station.asking import ask_why, look_around
from sleepcast.station.network import ABOVE, NetworkStation
from sleepcast.station.prepared import ONCE, Terms
from sleepcast.station.remote import RemoteMinds, TelemetryClient
from sleepcast.station.roster import Expectation
from sleepcast.station.staging import Stage, StagedSending, Stages
from sleepcast.station.validation import MAX_LISTED, AudienceError, SendPolicy

ALL = Terms(everybody=True)


def driven(scene: Scene) -> set[str]:
    return {name for name, robot in scene.fleet.items() if robot.body.driven}


def sends_nothing(desk: NetworkStation) -> int:
    return desk.session.delivery.next_number


# ---- for whom


@pytest.mark.parametrize(
    "text",
    ["(DRIVE 1)", "(AND 1 (DRIVE 1))", "(WHEN TRUE (DRIVE 1))", "(WHEN (>= fuel 0%) (DRIVE 1))", "(IF 1 (DRIVE 1) 0)"],
)
def test_everybody_is_never_a_default(text: str) -> None:
    """Must 6, `target 0 toggled safety on a flying aircraft`, `meant for one drone, spun the motors of all`."""
    scene = Scene()
    desk = scene.desk()
    before = sends_nothing(desk)
    with pytest.raises(NotConfirmedError, match="--all"):
        desk.send(text)
    with pytest.raises(NotConfirmedError):
        desk.send(text, but=["r1"])
    scene.run(0.5)
    assert sends_nothing(desk) == before
    assert driven(scene) == set()
    desk.send(text, everybody=True)
    scene.run(0.5)
    assert driven(scene) == set(scene.fleet)


@pytest.mark.parametrize("test", ["(> nowhere 1)", "(NOT (> nowhere 1))", "nowhere", "(= nowhere nowhere)"])
def test_a_filter_on_something_that_does_not_exist_matches_nobody(test: str) -> None:
    """`a filter on a fact that does not exist matched every node`: unknown never matches."""
    scene = Scene()
    desk = scene.desk()
    sent = desk.send(f"(WHEN {test} (DRIVE 1))")
    scene.run(0.5)
    assert (desk.accounting(sent.id).n_unknown, desk.accounting(sent.id).n_not_matched) == (3, 0)
    assert driven(scene) == set()


def test_a_command_for_one_robot_is_for_one_robot() -> None:
    """`meant for one drone`: the others neither obey nor answer, and are not told as silent."""
    scene = Scene()
    desk = scene.desk()
    sent = desk.send("(DRIVE 1)", only=["r1"])
    scene.run(0.5)
    assert driven(scene) == {"r1"}
    found = desk.accounting(sent.id)
    assert (found.matched, found.silent, found.asked) == (("r1",), (), 1)
    sent = desk.send("(DRIVE 1)", but=["r1"], everybody=True)
    scene.run(0.5)
    assert desk.accounting(sent.id).matched == ("r0", "r2")
    asked = desk.ask("x", only=["r0"])
    scene.run(0.5)
    assert desk.accounting(asked.id).matched == ("r0",)
    with pytest.raises(UnknownRobotError, match="did you mean r1"):
        desk.send("(DRIVE 1)", only=["r11"])


@pytest.mark.parametrize(
    "body", [{FOR: "r0"}, {FOR: None}, {FOR: 1}, {FOR: {"r0": 1}}, {FOR: [["r0"]]}, {NOT: "r1"}, {NOT: 5}, {FOR: []}]
)
def test_an_address_that_means_nothing_is_nobodys(body: dict[str, object]) -> None:
    """Must 6: fail closed; no robot takes a broken list of names for `everybody`."""
    scene = Scene()
    scene.desk().post(Kind.COMMAND, text="(DRIVE 1)", body=body)
    scene.run(0.5)
    assert driven(scene) == set()


def test_names_in_a_message_are_bounded() -> None:
    scene = Scene(robots=1)
    desk = scene.desk(heard=(f"r{number}" for number in range(MAX_LISTED + 2)))
    with pytest.raises(AudienceError, match="too many to be named"):
        desk.ask("x", only=desk.names)


# ---- how many


def test_a_count_is_asked_for_where_many_may_obey() -> None:
    """Must 6: more than a set number, those of whom the desk cannot say included; a wrong number is refused."""
    scene = Scene(robots=ABOVE + 1)
    desk = scene.desk()
    before = sends_nothing(desk)
    for said in (None, 1, ABOVE, ABOVE + 2):
        with pytest.raises(CountNeededError) as refused:
            desk.send("(WHEN (> x 5) (DRIVE 1))", count=said)
        assert refused.value.may == ABOVE + 1
    scene.run(0.3)
    assert sends_nothing(desk) == before
    desk.send("(WHEN (> x 5) (DRIVE 1))", count=ABOVE + 1)
    scene.run(0.5)
    assert driven(scene) == {f"r{number}" for number in range(6, ABOVE + 1)}
    desk.send("(DRIVE 2)", only=["r0", "r1"])


def test_nobody_is_counted_where_nobody_was_heard() -> None:
    """Must 6: of robots that nobody knows nobody can say how many they are, and what cannot be undone is not sent."""
    scene = Scene()
    desk = scene.desk(heard=())
    for text, count in (("(DROP)", None), ("(DROP)", 3), ("(DRIVE 1)", 3)):
        with pytest.raises(NobodyHeardError, match="nothing was sent"):
            desk.send(text, everybody=True, count=count)
    scene.run(0.3)
    assert driven(scene) == set()
    assert not any(robot.body.dropped for robot in scene.fleet.values())


def test_a_function_of_which_no_robot_has_told_wants_its_count() -> None:
    """Must 6: some robot may have it, such as one of a sort that is new on the channel."""
    desk = Scene(robots=3).desk()
    with pytest.raises(CountNeededError, match="no robot has told of a function EJECT, which perhaps cannot be undone"):
        desk.send("(WHEN (> x 1) (EJECT))")
    with pytest.raises(NobodyHeardError):
        Scene().desk(heard=()).send("(EJECT)", everybody=True)
    desk.send("(WHEN (> x 1) (EJECT))", count=3)


def test_who_certainly_does_not_obey_needs_no_count() -> None:
    scene = Scene()
    desk = scene.desk()
    desk.observe(scene.clock.now(), [robot.node for robot in scene.fleet.values()])
    desk.send("(WHEN (> x 50) (DROP))")
    with pytest.raises(CountNeededError, match=r"nobody may obey, you gave 2\. Nothing was sent"):
        desk.send("(WHEN (> x 50) (DROP))", count=2)


def test_a_count_follows_what_the_desk_knows() -> None:
    """Must 1 and 6: robots that would certainly not obey are not counted; news that is too old decides nothing."""
    scene = Scene(robots=ABOVE + 5)
    desk = scene.desk()
    desk.observe(scene.clock.now(), [robot.node for robot in scene.fleet.values()])
    text = "(WHEN (< x 4) (DRIVE 1))"
    found = desk.prepare(text).forecast
    assert (list(found.yes), len(found.no), found.may) == (["r0", "r1", "r2", "r3"], ABOVE + 1, 4)
    assert desk.send(text).predicted == {"r0", "r1", "r2", "r3"}
    scene.run(desk.stale_after + 0.1)
    with pytest.raises(CountNeededError):
        desk.send(text)
    assert len(desk.prepare(text).forecast.unknown) == ABOVE + 5


@pytest.mark.parametrize(
    ("text", "dropped"),
    [("(DROP)", 3), ("(FORGET keep)", 0), ("(ROLLBACK)", 0), ("(WHEN (> x 1) (IF (> fuel 1) 0 (DROP)))", 1)],
)
def test_what_cannot_be_undone_wants_its_count(text: str, dropped: int) -> None:
    """Must 6: forms that are marked irreversible, however deep inside, and for however few."""
    scene = Scene()
    desk = scene.desk()
    with pytest.raises(CountNeededError, match="cannot be undone: 3 may obey"):
        desk.send(text, everybody=True)
    with pytest.raises(CountNeededError, match="1 may obey"):
        desk.send(text, only=["r1"], count=3)
    desk.send(text, everybody=True, count=3)
    scene.run(0.5)
    assert sum(robot.body.dropped for robot in scene.fleet.values()) == dropped


def test_a_desk_may_be_strict() -> None:
    """What the checker only doubts is refused, and so is what no robot could run, always."""
    scene = Scene(policy=SendPolicy(strict=True))
    desk = scene.desk()
    with pytest.raises(CheckError, match="did you mean fuel"):
        desk.send("(WHEN (> feul 50%) (DRIVE 1))")
    with pytest.raises(CheckError):
        desk.send("(WHEN (> fuel 50) (DRIVE 1))")
    desk.send("(WHEN (> fuel 20%) (DRIVE 1))")
    scene.run(0.5)
    assert driven(scene) == set(scene.fleet)


DOUBTED = "(WHEN (> fuel 1%) (> x 50m) (DRIVE 1))"


def test_what_is_hardly_meant_is_sent_only_when_it_is_confirmed() -> None:
    """A comparison whose value goes nowhere lets every robot through."""
    scene = Scene()
    desk = scene.desk()
    before = sends_nothing(desk)
    with pytest.raises(DoubtError, match=r"\(AND \(> fuel 1%\) \(> x 50m\)\)") as refused:
        desk.send(DOUBTED)
    assert "^" * len("(> x 50m)") in str(refused.value)
    scene.run(0.3)
    assert sends_nothing(desk) == before
    desk.ask(DOUBTED)  # a question changes nothing
    desk.send(DOUBTED, confirmed=True)
    scene.run(0.5)
    assert driven(scene) == set(scene.fleet)


@pytest.mark.parametrize("seconds", [0.0, -1.0, 3_601.0, float("inf"), float("nan")])
def test_no_command_is_good_for_ever(seconds: float) -> None:
    """Must 7: a deadline that lies too far ahead is none."""
    scene = Scene(robots=1)
    with pytest.raises(CommandTypeError):
        scene.desk().send("(DRIVE 1)", everybody=True, deadline=seconds)


# ---- in stages


def stages(scene: Scene, text: str, terms: Terms = ONCE, count: int | None = None) -> list[Stage]:
    """All stages, while the rest of the world goes on."""
    desk = scene.desk()
    desk.gather = lambda *_: scene.run(1.0)  # type: ignore[method-assign]
    return list(Stages(desk, desk.prepare(text, terms), count=count).run(1.0))


def test_staged_sending_goes_to_one_then_a_tenth_then_all() -> None:
    """Must 6: and every robot does it once."""
    scene = Scene(robots=20)
    found = stages(scene, "(WHEN (> x 3) (DRIVE 1))", count=20)
    assert [stage.account.asked for stage in found] == [1, 2, 17]
    assert all(stage.good for stage in found)
    assert sum(stage.account.n_matched for stage in found) == 16
    assert [robot.body.driven for robot in scene.fleet.values()] == [[]] * 4 + [[1.0]] * 16


def test_staged_sending_asks_for_the_count_before_it_begins() -> None:
    scene = Scene(robots=20)
    with pytest.raises(CountNeededError):
        stages(scene, "(WHEN (> x 3) (DRIVE 1))")
    with pytest.raises(NotConfirmedError):
        stages(scene, "(DRIVE 1)", count=20)
    assert driven(scene) == set()


def test_a_fault_ends_staged_sending() -> None:
    """Must 6: what goes wrong on the first robot never reaches the others."""
    scene = Scene(robots=20)
    (stage,) = stages(scene, "(PROGN (DRIVE 1) (/ 1 0))", ALL, count=20)
    assert (stage.account.n_fault, stage.last, stage.good) == (1, False, False)
    assert driven(scene) == {"r0"}


def test_silence_ends_staged_sending() -> None:
    scene = Scene(robots=20)
    scene.desk()
    scene.isolate("r2")
    found = stages(scene, "(DRIVE 1)", ALL, count=20)
    assert [stage.good for stage in found] == [True, False]
    assert driven(scene) == {"r0", "r1"}


def test_rules_in_stages_end_with_all_robots_alike() -> None:
    """What stands is filtered by name on each robot, and reaches those that come later as well."""
    scene = Scene(robots=12)
    found = stages(scene, "(RULE go (SETQ throttle 1))", Terms(standing=True, everybody=True), count=12)
    assert found[-1].last
    assert {len(robot.node.rules()) for robot in scene.fleet.values()} == {1}


# ---- who is asked for what it was meant


def test_an_acknowledgement_says_what_it_answers() -> None:
    """`an acknowledgement that cannot say what it answers`: answers name their command, and a late one of an old
    command counts for that one only."""
    scene = Scene()
    desk = scene.desk()
    scene.deaf.add(("r1", "chief"))
    first = desk.send("(WHEN (> x 0) (DRIVE 1))")
    scene.run(0.5)
    second = desk.send("(WHEN (> x 5) (DRIVE 1))")
    scene.deaf.clear()
    scene.run(2.0)
    assert desk.accounting(first.id).matched == ("r1", "r2")
    assert desk.accounting(second.id).n_not_matched == 3


def test_an_answer_of_a_robot_that_was_not_asked_counts_for_nothing_it_was_not() -> None:
    scene = Scene()
    desk = scene.desk()
    sent = desk.send("(DRIVE 1)", only=["r0"])
    desk.hear(Message("r9", 1, 1, Kind.ANSWER, 0.0, body={"command": "chief-1.999", "outcome": "matched"}))
    scene.run(0.3)
    assert desk.accounting(sent.id).matched == ("r0",)


def test_a_lone_command_that_somebody_missed_reaches_him_while_it_is_good() -> None:
    """`fleetdm/fleet#211`: whoever did not answer gets the same command again, and nobody does it twice."""
    scene = Scene(robots=3)
    desk = scene.desk()
    scene.deaf = {("chief", "r2")}
    sent = desk.send("(PROGN (DEFVAR n 0) (SETQ n (+ n 1)))", everybody=True)
    scene.run(0.4)
    assert desk.accounting(sent.id).silent == ("r2",)
    scene.deaf.clear()
    scene.run(3.0)
    assert desk.accounting(sent.id).matched == ("r0", "r1", "r2")
    assert [robot.node.evaluate("n").value for robot in scene.fleet.values()] == [1.0, 1.0, 1.0]


def test_answers_that_came_in_time_count_though_nobody_listened_meanwhile() -> None:
    """A process that stood still after it had sent said that all robots were silent."""
    scene = Scene(robots=3)
    desk = scene.desk()
    sent = desk.send("(WHEN (> x 0) (DRIVE 1))")
    scene.run(5.0, busy=("chief",))
    desk.gather(sent, 1.0)
    assert desk.accounting(sent.id).matched == ("r1", "r2")


# ---- waiting, though the desk stood still


def test_a_wait_ends_when_all_was_heard_that_came_in_time() -> None:
    """Whatever waits, waits by the desk's one rule: by what it has heard, never by the clock alone."""
    scene = Scene(robots=3)
    desk = scene.desk()
    heard: list[str] = []
    desk.listeners.append(lambda messages: heard.extend(message.sender for message in messages))
    until = scene.clock.now() + 1.0
    desk.send("(WHEN (> x 0) (DRIVE 1))")
    scene.run(5.0, busy=("chief",))
    desk.wait_until(lambda: {"r0", "r1", "r2"} <= set(heard), until)
    assert {"r0", "r1", "r2"} <= set(heard)


def test_a_wait_whose_time_was_listened_to_already_hears_no_more() -> None:
    scene = Scene(robots=1)
    desk = scene.desk()
    desk.pump()
    until = scene.clock.now()
    looked: list[float] = []

    def done() -> bool:
        looked.append(scene.clock.now())
        return False

    desk.wait_until(done, until)
    assert looked == [until]


@pytest.mark.parametrize(
    ("robots", "threads", "gathers"), [(3, 1, 0.02), (500, 1, 0.05), (3_000, 1, 0.1), (3_000, 2, 0.02)]
)
def test_a_desk_looks_as_seldom_as_answers_allow(
    robots: int, threads: int, gathers: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each look costs; but few robots answer at once, and a STOP of another thread waits for the next look."""
    scene = Scene()
    desk = scene.desk(expected=Expectation(size=robots))
    looks: list[float] = []

    def listen(seconds: float, gather: float) -> None:
        looks.append(gather)
        scene.run(seconds)

    monkeypatch.setattr(desk.session, "listen", listen)
    if threads > 1:
        desk.between = lambda: None
    asked = desk.ask("x")
    desk.gather(asked, 0.5)
    assert set(looks) == {gathers}
    assert asked.n_silent == robots - 3


def test_what_robots_tell_counts_though_nobody_listened_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    """`look_around` and `ask_why` ended without having listened once, and said that the robots were silent."""
    scene = Scene(robots=2)
    minds = RemoteMinds()
    desk = scene.desk(minds=minds)
    telemetry = TelemetryClient(desk, minds)
    desk.listeners.append(telemetry.hear)
    monkeypatch.setattr(desk.session, "listen", lambda seconds, _: scene.run(seconds))

    def stand_still_after(name: str) -> None:
        """The desk's process stands still for 3 s after its first call of this."""
        whole, left = getattr(telemetry, name), [3.0]

        def slow(*given: object) -> object:
            found = whole(*given)
            if left:
                scene.run(left.pop(), busy=("chief",))
            return found

        monkeypatch.setattr(telemetry, name, slow)

    stand_still_after("learning")
    look_around(desk, telemetry)
    assert set(minds) == {"r0", "r1"}  # their names were heard, too
    sent = desk.send("(WHEN (> x 0) (DRIVE 1))")
    scene.run(1.0)
    stand_still_after("explanation")
    assert ask_why(desk, telemetry, "r1", sent.id).matched


def test_a_stage_is_judged_by_answers_that_came_in_time_though_nobody_listened_meanwhile() -> None:
    scene = Scene(robots=12)
    desk = scene.desk()
    staged = StagedSending(desk, desk.prepare("(DRIVE 1)", ALL), 1.0, count=12)
    scene.run(5.0, busy=("chief",))
    staged.attend()
    assert (staged.done, staged.current) == ([], staged.first)
    desk.pump()
    staged.attend()
    assert [stage.good for stage in staged.done] == [True]


def test_a_page_waits_for_an_explanation_until_it_has_heard_what_came_in_time() -> None:
    scene = Scene(robots=1)
    minds = RemoteMinds()
    desk = scene.desk(minds=minds)
    telemetry = TelemetryClient(desk, minds)
    desk.listeners.append(telemetry.hear)
    desk.send("(JOIN bravo)", everybody=True)
    scene.run(0.5)
    asked = PendingExplanation(desk, telemetry, telemetry.ask_why("r0", None), "r0")
    scene.run(5.0, busy=("chief",))
    assert (asked.answer(), asked.waited(3.0)) == (None, False)
    desk.pump()
    assert asked.waited(3.0)
    assert asked.answer() is not None
