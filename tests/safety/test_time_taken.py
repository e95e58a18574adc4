"""A robot without a real-time clock wakes in 1970, takes its time from an operator, and from nobody else."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import pytest

from safety.scene import FLEET, KEYS, Scene
from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import TIMES_A_SECOND
from sleepcast.channel.clock_sync import MAX_TRIP, SLOWEST
from sleepcast.channel.envelope import encode, look, read_message, read_piece
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import TIME, TOOK, Role
from sleepcast.channel.reliable import TIME_REPLIES_A_SECOND
from sleepcast.core.clock import ManualClock, epoch_at

TODAY = 1_795_000_000.0
WAKES = 600.0
"""Ten minutes after 1970 began."""


@dataclass
class Woken:
    """A scene in which robot r0 has no clock. taken: whose time it took, and by how many s it was behind."""

    scene: Scene
    taken: list[tuple[str, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        session, clock = self.scene.fleet["r0"].session, self.scene._clocks["r0"]
        self.scene.set_clock("r0", WAKES - TODAY)

        def take(behind: float, whose: str) -> None:
            clock.by += behind
            session.zero += behind
            self.taken.append((whose, behind))
            session.delivery.post(Kind.REPORT, clock.now(), body={"label": "clock", "values": [behind], TOOK: whose})

        session.delivery.seek_time(take)

    @property
    def wrong(self) -> float:
        """By how many s the clock of r0 is wrong."""
        return abs(self.scene._clocks["r0"].by)

    def answer(self, key: KeyPair, ahead: float = 0.0, nonce: bytes | None = None, number: int = 1) -> Message:
        """What a party with this key would answer now."""
        now = self.scene.clock.now() + ahead
        body: dict[str, object] = {TIME: self.scene.admission("r0").nonce if nonce is None else nonce}
        return Message(
            "r9" if key is KEYS["r*"] else key.public.owner, 5, number, Kind.HEARTBEAT, now, now + 1.0, body=body
        )


@pytest.fixture
def woken() -> Woken:
    return Woken(Scene(robots=2, clock=ManualClock(TODAY)))


def questions(sent: list[bytes]) -> list[bytes]:
    """The nonces of those that were sent."""
    found = []
    for datagram in sent:
        part = look(datagram)
        piece = read_piece(part)
        nonce = read_message(part, piece.sender, piece.content).body.get(TIME)
        if part.kind is Kind.REPORT and isinstance(nonce, bytes):
            found.append(nonce)
    return found


def test_it_takes_the_time_from_an_operator_and_obeys_deadlines_as_others_do(woken: Woken) -> None:
    scene = woken.scene
    desk = scene.desk("anna")
    scene.run(1.0)
    assert [whose for whose, _ in woken.taken] == ["anna"]
    assert woken.wrong <= MAX_TRIP / 2.0
    sent = desk.send("(DRIVE 1)", everybody=True)
    scene.run(1.0)
    assert desk.accounting(sent.id).n_matched == 2
    assert scene.fleet["r0"].body.driven == [1.0]
    assert desk.notices() == ["r0 took its time from anna: its clock was 57 years behind"]
    assert scene.admission("r0").clocks.of_operators() == []
    old = Message("anna", 9, 1, Kind.COMMAND, TODAY - 60.0, TODAY - 50.0, "(DRIVE 2)")
    scene.say(old, KEYS["anna"])
    scene.run(1.0)
    assert scene.fleet["r0"].body.driven == [1.0], "a command whose deadline is over"
    before = len(questions(scene.sent))
    scene.run(40.0)
    assert len(questions(scene.sent)) == before, "it asks no more"


def test_it_goes_on_where_its_own_time_was(woken: Woken) -> None:
    scene, times = woken.scene, list[float]()
    session = scene.fleet["r0"].session
    for _ in range(8):
        if len(times) == 2:
            scene.desk("anna")
        scene.run(1.0)
        times.append(scene._clocks["r0"].now() - session.zero)
    assert woken.taken
    assert all(0.9 < later - sooner < 1.1 for sooner, later in pairwise(times))


def test_a_robot_that_had_the_time_in_a_life_before_obeys_what_is_sent_now(woken: Woken) -> None:
    """When it began to listen is known from then, by a clock that was right."""
    scene = woken.scene
    scene.fleet["r0"].session.delivery.sequencer.since = TODAY - 3_600.0
    desk = scene.desk("anna")
    scene.run(1.0)
    sent = desk.send("(DRIVE 1)", everybody=True)
    scene.run(1.0)
    assert desk.accounting(sent.id).n_matched == 2
    assert scene.fleet["r0"].body.driven == [1.0]


def test_it_asks_seldom_while_nobody_answers_and_at_once_when_it_hears_a_command(woken: Woken) -> None:
    scene = woken.scene
    scene.run(120.0)
    asked = questions(scene.sent)
    assert 120.0 / SLOWEST < len(asked) < 15
    assert len(set(asked)) == len(asked)
    assert all(len(nonce) == 16 for nonce in asked)
    desk = scene.desk("anna")
    desk.send("(DRIVE 1)", everybody=True)
    scene.run(0.1)
    assert woken.taken, "it does not wait until the pause is over"
    sent = desk.send("(DRIVE 2)", everybody=True)
    scene.run(1.0)
    assert desk.accounting(sent.id).n_matched == 2, "nor for the command that it has turned away"
    assert scene.fleet["r0"].body.driven == [2.0]


def test_it_asks_whoever_commands_it_before_he_is_gone(woken: Woken) -> None:
    """`send` ends as soon as everybody has answered, if only that his clock is wrong."""
    scene = woken.scene
    scene.run(0.5)
    desk = scene.desk("anna")
    desk.send("(DRIVE 1)", everybody=True)
    scene.run(0.1)
    assert woken.taken


@pytest.mark.parametrize("who", ["watch", "r*", "stranger"])
def test_nobody_but_an_operator_tells_the_time(woken: Woken, who: str) -> None:
    woken.scene.run(0.1)
    key = KEYS.get(who) or KeyPair("anna", Role.OPERATOR, b"x" * 32)
    woken.scene.say(woken.answer(key), key)
    woken.scene.run(0.5)
    assert not woken.taken
    woken.scene.say(woken.answer(KEYS["anna"]), KEYS["anna"])
    woken.scene.run(0.1)
    assert woken.taken, "the same of an operator"


def test_an_observers_desk_answers_nothing_and_an_operator_without_a_clock_neither(woken: Woken) -> None:
    woken.scene.desk("watch")
    woken.scene.set_clock("anna", WAKES - TODAY)
    woken.scene.desk("anna")
    woken.scene.run(5.0)
    assert not woken.taken


def test_an_answer_to_an_older_question_or_a_recorded_one_tells_nothing(woken: Woken) -> None:
    scene = woken.scene
    scene.run(0.1)
    old = scene.admission("r0").nonce
    scene.run(2.1)
    assert scene.admission("r0").nonce not in (old, b"")
    scene.say(woken.answer(KEYS["anna"], nonce=old), KEYS["anna"])
    scene.say(woken.answer(KEYS["anna"], nonce=b"", number=2), KEYS["anna"])
    scene.run(0.2)
    assert not woken.taken
    desk = scene.desk("anna")
    scene.run(5.0)
    assert len(woken.taken) == 1
    recorded = list(scene.sent)
    assert desk is scene.desk("anna")
    again = Woken(Scene(robots=2, clock=ManualClock(TODAY + 3_600.0)))
    again.scene.run(0.1)
    for datagram in recorded:
        again.scene.fly("stranger", datagram)
    again.scene.run(1.0)
    assert not again.taken


def test_an_answer_that_was_kept_back_tells_nothing(woken: Woken) -> None:
    scene = woken.scene
    scene.run(0.1)
    kept = encode(woken.answer(KEYS["anna"]), FLEET, KEYS["anna"])
    scene.run(MAX_TRIP + 0.1)
    for datagram in kept:
        scene.fly("stranger", datagram)
    scene.run(0.2)
    assert not woken.taken


def test_of_two_operators_who_differ_the_first_counts_and_nothing_moves_it_afterwards(woken: Woken) -> None:
    scene = woken.scene
    scene.run(0.1)
    nonce = scene.admission("r0").nonce
    scene.say(woken.answer(KEYS["anna"]), KEYS["anna"])
    scene.run(0.1)
    scene.say(woken.answer(KEYS["bert"], ahead=3_600.0, nonce=nonce), KEYS["bert"])
    scene.say(woken.answer(KEYS["bert"], ahead=1.5, nonce=nonce, number=2), KEYS["bert"])
    scene.run(1.0)
    assert [whose for whose, _ in woken.taken] == ["anna"]
    assert woken.wrong < 0.5


def test_a_robot_whose_clock_is_good_takes_nobodys_time() -> None:
    scene = Scene(robots=1, clock=ManualClock(TODAY))
    now = TODAY + 3_600.0
    scene.say(Message("anna", 1, 1, Kind.HEARTBEAT, now, now + 1.0, body={TIME: b"n" * 16}), KEYS["anna"])
    scene.say(Message("anna", 1, 2, Kind.HEARTBEAT, TODAY, TODAY + 1.0, body={TIME: b"n" * 16}), KEYS["anna"])
    scene.run(1.0)
    assert scene._clocks["r0"].by == 0.0
    assert not questions(scene.sent)


def test_no_flood_of_forged_answers_keeps_the_time_away(woken: Woken) -> None:
    """They name an operator's key, but not the nonce, so none of them is looked at; and if they name the nonce, no more
    are looked at than there is time for."""
    scene, admission = woken.scene, woken.scene.admission("r0")
    forger = KeyPair("anna", Role.OPERATOR, b"x" * 32)
    known = KEYS["anna"].public.id

    def forged(nonce: bytes) -> bytes:
        (datagram,) = encode(woken.answer(forger, nonce=nonce), FLEET, forger)
        return datagram.replace(forger.public.id, known)

    scene.run(0.1)
    for datagram in [forged(b"?" * 16)] * 5_000:
        assert admission.enter(datagram) is None
    assert not admission.counts.get("forged")
    for datagram in [forged(admission.nonce)] * 5_000:
        assert admission.enter(datagram) is None
    assert 0 < admission.counts["forged"] <= TIMES_A_SECOND
    scene.desk("anna")
    scene.run(5.0)
    assert woken.taken


def test_nobody_makes_an_operator_talk_by_playing_questions() -> None:
    scene = Scene(robots=0, clock=ManualClock(TODAY))
    scene.desk("anna")
    scene.run(0.1)
    before = len(scene.sent)
    for number in range(500):
        asks = Message("r9", 1, number + 1, Kind.REPORT, WAKES, WAKES + 5.0, body={TIME: number.to_bytes(16)})
        for _ in range(2):
            scene.say(asks, KEYS["r*"])
    scene.run(1.0)
    assert 0 < len(scene.sent) - before <= 2 * TIME_REPLIES_A_SECOND


def test_a_heartbeat_that_tells_the_time_keeps_no_body_going() -> None:
    scene = Scene(robots=1, clock=ManualClock(TODAY), lease=1.0)
    scene.desk("anna").send("(DRIVE 1)", everybody=True)
    scene.run(0.5)
    heard: list[Message] = []
    for number in range(20):
        now = scene.clock.now()
        beat = Message("bert", 1, number + 1, Kind.HEARTBEAT, now, now + 1.0, body={TIME: b"n" * 16})
        for datagram in encode(beat, FLEET, KEYS["bert"]):
            heard += scene.fleet["r0"].session.delivery.take(datagram, now)
    assert heard == []


def test_lives_that_begin_at_the_same_moment_of_1970_have_numbers_of_their_own() -> None:
    assert len({epoch_at(WAKES) for _ in range(10)}) == 10
    assert epoch_at(TODAY) == int(TODAY * 1000.0)
