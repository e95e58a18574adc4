"""Coming to rest under STOP: who has accepted it, who is at rest, and how far the others may still go."""

from __future__ import annotations

from math import isnan, nan

import numpy as np
import pytest

from safety.scene import Body, Scene
from sleepcast.channel import Kind
from sleepcast.channel.envelope import look
from sleepcast.channel.message import LOOK, MOTION
from sleepcast.channel.message_batch import NameIndex
from sleepcast.core.model import Quantity, RestState
from sleepcast.core.serial import SerialError
from sleepcast.language import Vocabulary
from sleepcast.mind.telemetry import motion_of, read_motion
from sleepcast.station.account import Account
from sleepcast.station.network import NetworkStation
from sleepcast.station.rest import LOOK_EVERY, REST_SECONDS, RestStates, state_in_words

BRAKES = 0.5
"""m/s2."""
BOATS = Vocabulary("boat", (Quantity("x", "m", shown_as="nmi"), Quantity("speed", "m/s", shown_as="kn")), ())


class Boat(Body):
    """A body that brakes from the moment of a STOP. asked: how often it was asked."""

    def __init__(self, scene: Scene, speed: float) -> None:
        super().__init__()
        self._scene, self._speed, self._since = scene, speed, 0.0
        self.asked = 0

    def begin(self) -> None:
        self._since = self._scene.clock.now()

    def rest_state(self) -> RestState | None:
        self.asked += 1
        speed = max(0.0, self._speed - BRAKES * (self._scene.clock.now() - self._since))
        return RestState(speed, speed * speed / (2.0 * BRAKES))


def sailing(speeds: dict[str, float], **options: float) -> tuple[Scene, NetworkStation, dict[str, Boat]]:
    """A scene in which these robots go at so many m/s, and the others do not tell."""
    scene = Scene(**options)  # type: ignore[arg-type]
    boats = {name: Boat(scene, speed) for name, speed in speeds.items()}
    for name, boat in boats.items():
        scene.fleet[name].node.body = boat
    return scene, scene.desk(), boats


def stopped(scene: Scene, desk: NetworkStation, boats: dict[str, Boat]) -> Account:
    """The account of a STOP that has just been confirmed."""
    sent = desk.stop()
    for boat in boats.values():
        boat.begin()
    scene.run(0.3)
    return desk.accounting(sent.id)


def test_a_robot_that_has_accepted_stop_is_not_yet_at_rest() -> None:
    scene, desk, boats = sailing({"r0": 0.0, "r1": 2.0})
    found = stopped(scene, desk, boats)
    assert found.rest is not None
    assert (found.complete, found.n_matched, found.stands) == (True, 3, False)
    assert (found.rest.at_rest, found.rest.accepted, list(found.rest.stopping)) == (("r0",), ("r2",), ["r1"])
    state = found.rest.stopping["r1"]
    assert state.speed == pytest.approx(2.0, abs=0.2)
    assert state.distance == pytest.approx(state.speed**2)
    assert found.to_dict()["stopping"] == 1
    scene.run(2.0 / BRAKES + 1.0)
    found = desk.accounting(found.command)
    assert found.rest is not None
    assert (found.stands, found.rest.n_stopping) == (True, 0)
    assert (found.rest.at_rest, found.rest.accepted) == (("r0", "r1"), ("r2",))


def test_only_those_are_looked_at_that_still_moved() -> None:
    scene, desk, boats = sailing({"r0": 0.0, "r1": 2.0})
    stopped(scene, desk, boats)
    scene.sent.clear()
    scene.run(10.0)
    assert boats["r0"].asked == 1, "it was at rest"
    assert 1 < boats["r1"].asked <= 2.0 / BRAKES / LOOK_EVERY
    asks = [datagram for datagram in scene.sent if look(datagram).kind is Kind.ASK]
    assert len(asks) < 5 * 2.0 / BRAKES / LOOK_EVERY, "each is sent five times"
    scene.sent.clear()
    scene.run(10.0)
    assert not [datagram for datagram in scene.sent if look(datagram).kind in (Kind.ASK, Kind.ANSWER)]


def test_a_lossy_radio_delays_the_word_and_does_not_lose_it() -> None:
    scene, desk, boats = sailing({f"r{i}": 2.0 for i in range(10)}, robots=10, loss=0.4, delay=0.05, seed=3)
    found = stopped(scene, desk, boats)
    scene.run(2.0 / BRAKES + 6.0)
    assert desk.accounting(found.command).stands


def test_who_is_heard_late_is_waited_for_as_long_as_others() -> None:
    scene, desk, boats = sailing({"r1": 2.0})
    scene.isolate("r1")
    found = stopped(scene, desk, {})
    scene.run(REST_SECONDS + 5.0)
    scene.join("r1")
    boats["r1"].begin()
    scene.run(2.0)
    late = desk.accounting(found.command)
    assert late.rest is not None
    assert late.rest.n_stopping == 1
    scene.run(5.0)
    assert desk.accounting(found.command).stands


def test_nobody_is_asked_for_ever() -> None:
    scene, desk, boats = sailing({"r1": 1e6})
    found = stopped(scene, desk, boats)
    scene.run(REST_SECONDS + 1.0)
    asked = boats["r1"].asked
    scene.run(20.0)
    assert boats["r1"].asked == asked
    assert not desk.accounting(found.command).stands


def test_a_new_stop_is_looked_after_anew_and_a_release_ends_it() -> None:
    scene, desk, boats = sailing({"r1": 2.0})
    stopped(scene, desk, boats)
    desk.release()
    scene.run(0.2)
    asked = boats["r1"].asked
    scene.run(5.0)
    assert boats["r1"].asked == asked
    found = stopped(scene, desk, boats)
    assert found.rest is not None
    assert found.rest.n_stopping == 1
    scene.run(6.0)
    assert desk.accounting(found.command).stands


def test_what_a_robot_does_not_know_is_not_rest() -> None:
    """Its body is out of reach, for instance."""
    assert motion_of(RestState(nan, nan)) == (None, None)
    found = read_motion([None, None])
    assert found is not None
    assert isnan(found.speed)
    assert not found.at_rest
    assert [read_motion(odd) for odd in (None, 7, [], [0.0], "ab", {"speed": 0})] == [None] * 6
    odd = read_motion([-1.0, "far"])
    assert odd is not None
    assert isnan(odd.speed)
    assert isnan(odd.distance)


def test_only_a_stopped_robot_tells_how_it_moves() -> None:
    scene, desk, boats = sailing({"r1": 2.0})
    boats["r1"].begin()
    heard: list[object] = []
    desk.listeners.append(lambda messages: heard.extend(m.body for m in messages))
    desk.post(Kind.ASK, body={LOOK: "telemetry"}, only=["r1"])
    scene.run(0.5)
    assert len(heard) == 1
    assert MOTION not in str(heard), "older desks read what they always did"


def test_the_account_names_those_that_go_farthest_in_the_units_of_the_fleet() -> None:
    states = RestStates(NameIndex(f"r{i}" for i in range(6)))
    for at, (speed, distance) in enumerate([(0.0, 0.0), (6.482, 33.0), (1.0, 400.0), (nan, nan), (2.0, nan)]):
        states.add(at, RestState(speed, distance))
    found = states.among(np.ones(6, np.bool_))
    assert found.sentence(BOATS, 2) == (
        "at rest 1, still moving 4: r3 (speed unknown), r4 (3.89 kn), and 2 more, rest unknown 1"
    )
    assert found.who_moves(BOATS, 9) == (
        "r1 (12.6 kn, 33 m to go), r2 (1.94 kn, 0.216 nmi to go), r3 (speed unknown), r4 (3.89 kn)"
    )
    assert state_in_words(RestState(1.0, 2.0), "m/s", "m") == "1 m/s, 2 m to go"
    nobody = states.among(np.zeros(6, np.bool_))
    assert (nobody.n_at_rest, nobody.n_stopping, nobody.n_accepted) == (0, 0, 0), "who has not accepted is silent"


def test_a_name_that_several_robots_have_is_not_known_to_be_at_rest() -> None:
    """One of them may be, while the other one moves."""
    scene, desk, boats = sailing({"r0": 0.0, "r1": 0.0})
    sent = stopped(scene, desk, boats)
    desk.commands()[-1].conflicts["r1"] = "two robots are called r1"
    found = desk.accounting(sent.command).rest
    assert found is not None
    assert (found.at_rest, found.accepted) == (("r0",), ("r1", "r2"))


def test_it_is_kept_in_a_snapshot() -> None:
    states = RestStates(NameIndex(["r0", "r1"]))
    assert states.state() is None
    states.add(1, RestState(1.5, nan))
    kept, again = states.state(), RestStates(states.names)
    assert kept is not None
    again.restore(kept)
    everybody = np.ones(2, np.bool_)
    assert again.among(everybody).sentence(BOATS, 3) == states.among(everybody).sentence(BOATS, 3)
    states.add(0, RestState(-1.0, 0.0))
    worse = states.state()
    assert worse is not None
    with pytest.raises(SerialError):
        again.restore(worse)
