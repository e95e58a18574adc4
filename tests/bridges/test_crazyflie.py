"""A Crazyflie as a body: the contract of all bridges in flight, taking off and landing, and the real library's way."""

from __future__ import annotations

import select
import signal
import socket
import struct
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from math import degrees, hypot, inf, isclose, isnan, nan
from pathlib import Path
from random import Random
from threading import Event, Thread
from threading import enumerate as enumerate_threads

import pytest

from bridges.crazyflie_peer import Peer
from bridges.mind import Mind, quadcopter
from channel.test_udp import free_port
from cli.terminal import terminal
from processes import live_in
from sleepcast.bridges import BodyError, Opening, OutOfReachError, open_robot
from sleepcast.bridges.body import ROUND
from sleepcast.bridges.crazyflie.quadcopter import LANDS_AFTER, LOGGED, CrazyflieBody, model_of
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.robot import Limits, Setpoint, hovering
from sleepcast.robot.hovering import LOCKED_MOTORS
from sleepcast.testing.robot_contract import BridgeRig, HoverContract

PATIENCE = 60.0
"""Seconds that a busy machine may take."""
LIMITS = Limits(0.5, 1.5, 1.0, climb=0.5, floor=0.1, ceiling=3.0)


class FakeCopter:
    """A way to a quadcopter in this process, that can be cut."""

    def __init__(self) -> None:
        self.peer, self.whole = Peer(), True

    def open(self) -> FakeCopter:
        self._check()
        return self

    def _check(self) -> None:
        if not self.whole:
            raise OutOfReachError("the radio hears nothing")

    def _send(self, port: int, channel: int, data: bytes) -> None:
        self._check()
        self.peer.answers(bytes([port << 4 | channel]) + data)

    def hover(self, speed: float, side: float, turn_rate: float, height: float) -> None:
        self._send(7, 0, struct.pack("<Bffff", 10, speed, side, degrees(turn_rate), height))

    def arm(self, armed: bool) -> None:
        self._send(9, 1, bytes((1, armed)))

    def stop_motors(self) -> None:
        self._send(7, 0, b"\0")

    def cut(self) -> None:
        self._send(9, 1, b"\3")

    def land(self, seconds: float) -> None:
        self._send(8, 0, struct.pack("<BBff?f", 8, 0, 0.0, 0.0, True, seconds))

    def logged(self) -> Mapping[str, float] | None:
        self._check()
        now = self.peer.values
        shown = (now[name] for name in ("x", "y", "vx", "vy", "yaw", "turn", "z", "vz", "charge"))
        return dict(zip(LOGGED, (*shown, float(self.peer.info())), strict=True))

    def close(self) -> None:
        pass


def rig_of(copter: FakeCopter) -> BridgeRig:
    clock = ManualClock()
    body = CrazyflieBody(copter.open, model_of(LIMITS), 0.5, clock=clock)

    def cut() -> None:
        copter.whole = False

    def mend() -> None:
        copter.whole = True

    return BridgeRig(body, clock, copter.peer.advance, cut, mend, resolution=0.001)


@pytest.fixture
def copter() -> FakeCopter:
    return FakeCopter()


def flying(copter: FakeCopter) -> BridgeRig:
    rig = rig_of(copter)
    take_off(rig)
    return rig


def take_off(rig: BridgeRig, *height: float) -> None:
    assert isinstance(rig.body, CrazyflieBody)
    rig.body.take_off(*height)
    rig.wait(2.0)


class TestCrazyflie(HoverContract):
    @pytest.fixture
    def rig(self, copter: FakeCopter) -> BridgeRig:
        copter.peer.advance = lambda seconds: self.without_a_fall(copter.peer, seconds)  # type: ignore[method-assign]
        return flying(copter)

    @staticmethod
    def without_a_fall(peer: Peer, seconds: float) -> None:
        """Time passes; while the way is cut for long, a real one would fall, and could not be driven afterwards."""
        peer.since = min(peer.since, 1.0)
        Peer.advance(peer, seconds)


def test_it_takes_off_and_lands_as_told(copter: FakeCopter) -> None:
    rig = rig_of(copter)
    assert isnan(rig.sensed()["flying"]), "it has not said anything yet"
    rig.wait(0.1)
    assert rig.sensed()["flying"] == 0.0
    take_off(rig)
    assert copter.peer.said == ["is armed", "takes off"]
    assert isclose(rig.sensed()["z"], 0.5)
    assert rig.sensed()["flying"] == 1.0
    take_off(rig, 1.0)
    assert isclose(rig.sensed()["z"], 1.0)
    rig.body.act(Setpoint(speed=0.3))
    rig.wait(2.0)
    assert isclose(rig.sensed()["z"], 1.0), "it is driven at its height"
    assert rig.sensed()["x"] > 0.3
    assert isinstance(rig.body, CrazyflieBody)
    rig.body.touch_down()
    rig.wait(1.0)
    assert 0.5 < rig.sensed()["z"] < 1.0, "slowly"
    rig.wait(3.0)
    assert rig.sensed()["flying"] == rig.sensed()["z"] == 0.0
    assert copter.peer.said[-1].startswith("stops its motors at 0.0")


def test_what_moves_it_in_the_tick_of_a_take_off_or_a_landing_does_not_take_its_place(copter: FakeCopter) -> None:
    rig = rig_of(copter)
    body = rig.body
    assert isinstance(body, CrazyflieBody)
    rig.wait(0.1)
    body.take_off()
    body.act(Setpoint(speed=0.3))
    rig.wait(2.0)
    assert isclose(rig.sensed()["z"], 0.5)
    assert isclose(rig.sensed()["speed"], 0.3, abs_tol=1e-6)
    body.touch_down()
    for _ in range(40):  # as a rule would that drives it in each tick
        body.act(Setpoint(speed=0.3))
        rig.wait(0.1)
    assert rig.sensed()["flying"] == rig.sensed()["z"] == 0.0
    there = rig.sensed()["x"]
    body.act(Setpoint(speed=0.3))
    rig.wait(1.0)
    assert rig.sensed()["x"] == there


def test_stop_in_the_air_holds_the_height(copter: FakeCopter) -> None:
    rig = rig_of(copter)
    assert isinstance(rig.body, CrazyflieBody)
    rig.body.take_off(2.0)
    rig.wait(1.0)
    rig.body.stop()
    rig.wait(0.2)
    height = rig.sensed()["z"]
    assert 0.3 < height < 0.8
    rig.body.touch_down()
    rig.wait(3.0)
    assert rig.sensed()["z"] == height
    rig.body.release()
    rig.wait(1.0)
    assert rig.sensed()["z"] == height, "nothing old resumes"
    rig.body.touch_down()
    rig.wait(4.0)
    assert not copter.peer.flying


def test_what_it_has_begun_it_ends_though_nobody_drives_it_any_more(copter: FakeCopter) -> None:
    rig = rig_of(copter)
    assert isinstance(rig.body, CrazyflieBody)
    for ask, height in ((lambda: rig.body.take_off(1.0), 1.0), (rig.body.touch_down, 0.0)):
        ask()
        rig.wait(0.5)
        rig.body.drive(0.0, 0.0)  # as a node does when its operator is not heard
        rig.wait(4.0)
        assert isclose(rig.sensed()["z"], height)


def test_on_the_ground_it_is_not_driven_and_says_so_once(copter: FakeCopter) -> None:
    rig = rig_of(copter)
    rig.body.act(Setpoint(speed=0.5))
    rig.wait(1.0)
    assert not copter.peer.said
    assert rig.body.complaints() == ["it stands on the ground: send (TAKEOFF) before it is driven"]


def test_it_goes_to_places_within_its_limits_and_waits_there(copter: FakeCopter) -> None:
    rig = flying(copter)
    body = rig.body
    assert isinstance(body, CrazyflieBody)
    body.narrow(Limits(inf, inf, inf, fence=(-2.0, -2.0, 2.0, 2.0)))
    for x, y, z in ((1.5, -1.0, 1.2), (-2.0, 2.0, nan)):  # the second is a corner of its fence
        body.go_to(x, y, z)
        for _ in range(60):
            rig.wait(0.2)
            assert hypot(*body.drift_measured()) <= 0.5 * 1.001
        found = rig.sensed()
        assert (found["x"], found["y"]) == pytest.approx((x, y), abs=0.02)
        assert found["height"] == found["z"] == pytest.approx(1.2)
    assert body.complaints() == []
    for place, complaint in (
        ((2.5, 0.0), "outside of the fence"),
        ((0.0, 0.0, 3.5), "it flies from 0.1 to 3 m high, not at 3.5 m"),
        ((0.0, 0.0, 0.01), "it flies from 0.1 to 3 m high"),
        ((nan, 0.0), "outside of the fence"),
    ):
        with pytest.raises(SleepcastError, match=complaint):
            body.go_to(*place)
    body.go_to(0.0, 0.0)
    rig.wait(1.0)
    body.stop()
    with pytest.raises(MisuseError, match="RELEASE it first"):
        body.arm()
    rig.wait(1.0)
    there = rig.sensed()
    body.release()
    rig.wait(2.0)
    assert rig.sensed()["x"] == pytest.approx(there["x"], abs=1e-3), "nothing old resumes"


def test_a_place_is_for_one_that_flies(copter: FakeCopter) -> None:
    rig = rig_of(copter)
    body = rig.body
    assert isinstance(body, CrazyflieBody)
    rig.wait(0.1)
    with pytest.raises(MisuseError, match="stands on the ground"):
        body.go_to(1.0, 0.0)
    body.take_off()
    body.go_to(1.0, 0.0)  # in the same tick
    rig.wait(6.0)
    assert rig.sensed()["x"] == pytest.approx(1.0, abs=0.02)
    body.touch_down()
    rig.wait(0.2)
    with pytest.raises(MisuseError, match="it is landing: say at which height"):
        body.go_to(0.0, 0.0)
    body.go_to(0.0, 0.0, 0.6)
    rig.wait(6.0)
    assert (rig.sensed()["x"], rig.sensed()["z"]) == pytest.approx((0.0, 0.6), abs=0.02)


def test_it_climbs_on_the_spot_between_its_floor_and_its_ceiling(copter: FakeCopter) -> None:
    rig = flying(copter)
    rig.body.climb(9.0)
    rig.wait(1.0)
    assert rig.sensed()["climb_rate"] == pytest.approx(0.5, abs=1e-3)
    rig.wait(9.0)
    assert rig.sensed()["height"] == pytest.approx(3.0, abs=0.01)
    rig.body.climb(-0.2)
    rig.wait(20.0)
    assert 0.1 <= rig.sensed()["height"] < 0.12, "only a landing goes to the ground"
    assert copter.peer.flying


def test_it_is_armed_by_a_take_off_and_disarmed_on_the_ground_alone(copter: FakeCopter) -> None:
    rig = rig_of(copter)
    body = rig.body
    assert isinstance(body, CrazyflieBody)
    rig.wait(0.1)
    assert body.arm() == 1.0
    assert rig.sensed()["armed"] == 0.0
    body.take_off()
    with pytest.raises(MisuseError, match=r"\(LAND\) first, or \(MOTORS-OFF\)"):
        body.disarm()
    rig.wait(2.0)
    assert rig.sensed()["armed"] == 1.0
    with pytest.raises(MisuseError, match="in the air, where"):
        body.disarm()
    body.touch_down()
    rig.wait(3.0)
    assert (rig.sensed()["armed"], rig.sensed()["flying"]) == (1.0, 0.0)
    body.disarm()
    rig.wait(0.2)
    assert rig.sensed()["armed"] == 0.0
    body.disarm()
    body.take_off()  # comes first: it would fall
    rig.wait(2.0)
    assert copter.peer.flying


def test_without_a_mind_it_lands_after_a_while(copter: FakeCopter) -> None:
    rig = flying(copter)
    rig.look_away(LANDS_AFTER - 1.0)
    assert copter.peer.flying
    rig.look_away(4.0)
    assert not copter.peer.flying
    assert rig.body.complaints() == [hovering.let_go("lands")]


def test_without_its_operator_it_hovers_and_says_so(copter: FakeCopter) -> None:
    rig = flying(copter)
    rig.body.act(Setpoint(speed=0.3))
    rig.wait(0.5)
    rig.body.let_go()
    rig.wait(1.0)
    assert rig.body.complaints() == [hovering.let_go("hovers")]
    assert copter.peer.flying


def test_at_its_end_it_lands_by_itself(copter: FakeCopter) -> None:
    rig = flying(copter)
    rig.body.close()
    for _ in range(60):
        copter.peer.advance(ROUND)
    assert copter.peer.said[-2:] == ["lands by itself", "has landed by itself"]


def test_its_motors_can_be_cut_and_it_flies_no_more(copter: FakeCopter) -> None:
    rig = flying(copter)
    assert isinstance(rig.body, CrazyflieBody)
    rig.body.act(Setpoint(speed=0.3))
    rig.wait(1.0)
    assert rig.sensed()["flying"] == 1.0
    rig.body.cut_motors()
    rig.wait(0.2)
    assert rig.sensed()["flying"] == 0.0
    assert rig.body.complaints() == [LOCKED_MOTORS]
    with pytest.raises(MisuseError, match="switch it off and on before it flies again"):
        rig.body.take_off()
    rig.wait(2.0)
    assert copter.peer.said == ["is armed", "takes off", "cuts its motors"]
    assert rig.body.complaints() == []
    copter.peer = Peer()  # it was switched off and on
    rig.wait(0.2)
    assert rig.sensed()["flying"] == 0.0
    rig.wait(2.0)
    assert copter.peer.said == [], "nothing old resumes"


def test_motors_that_were_cut_by_others_and_ones_that_never_turn_are_told(copter: FakeCopter) -> None:
    rig = flying(copter)
    copter.peer.answers(b"\x91\3")  # as from the radio's broadcast
    rig.wait(0.2)
    assert rig.sensed()["flying"] == 0.0
    assert rig.body.complaints() == [LOCKED_MOTORS]
    copter.peer = Peer()
    copter.peer.answers = lambda packet: []  # type: ignore[method-assign]  # it lies on its back, and is not armed
    rig.wait(0.2)
    take_off(rig)
    rig.wait(1.0)
    assert rig.sensed()["flying"] == 0.0
    assert rig.body.complaints() == ["its motors do not turn: it has not taken off, or has come down by itself"]
    rig.wait(5.0)
    assert rig.body.complaints() == []


@pytest.mark.parametrize("height", [0.0, -1.0, 99.0, float("inf")])
def test_it_flies_neither_in_the_ground_nor_through_the_ceiling(copter: FakeCopter, height: float) -> None:
    body = rig_of(copter).body
    assert isinstance(body, CrazyflieBody)
    with pytest.raises(MisuseError, match=r"it flies from 0\.1 to 3 m high, not at"):
        body.take_off(height)


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("crazyflie://radio0", "wanted the radio, its channel"),
        ("crazyflie://radio0:126#E7E7E7E7E7", "channel up to 125"),
        ("crazyflie://radio0:80#E7", "an address"),
        ("crazyflie://radiox:80#E7E7E7E7E7", "wanted the radio"),
        ("crazyflie://radio0:80?rate=3M#E7E7E7E7E7", "there is no rate '3M'"),
        ("crazyflie://127.0.0.1", "wanted a port"),
        ("crazyflie://127.0.0.1:19850?height=9", "height is a number above 0.1 and up to 3, in m"),
        ("crazyflie://127.0.0.1:19850?hight=1", "did you mean height?"),
    ],
)
def test_an_address_that_means_nothing_is_refused(uri: str, complaint: str) -> None:
    with pytest.raises(BodyError, match=complaint.replace("?", r"\?")):
        open_robot(uri)


def test_it_does_not_wait_for_its_mind() -> None:
    with pytest.raises(MisuseError, match="does not wait for its mind"):
        open_robot("crazyflie://127.0.0.1:19850", Opening(in_step=True))


# ---- over UDP, with Bitcraze's library


@pytest.fixture
def port() -> int:
    return free_port()


@pytest.fixture
def process(port: int) -> Iterator[subprocess.Popen[str]]:
    with quadcopter(port) as found:
        yield found


def until(true: Callable[[], bool], otherwise: Callable[[], object] = str) -> None:
    """otherwise: what to tell where it never becomes true."""
    ends = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < ends, otherwise()
        time.sleep(0.02)


@pytest.mark.counterpart("cflib")
def test_the_real_library_flies_it_loses_it_and_finds_it_again(process: subprocess.Popen[str], port: int) -> None:
    with closing(open_robot(f"crazyflie://127.0.0.1:{port}?height=0.4")) as body:
        assert isinstance(body, CrazyflieBody)
        names = [sensor.name for sensor in body.model.sensors]

        def sensed(name: str) -> float:
            return body.sense().values[names.index(name)]

        until(lambda: isclose(sensed("battery"), 0.8))
        body.take_off()
        until(lambda: isclose(sensed("z"), 0.4, abs_tol=1e-3))

        def driven() -> bool:
            """As it is asked to, time and again: on a busy machine it may be out of reach for a moment, and hover."""
            body.act(Setpoint(speed=0.4, turn_rate=0.5, side=0.2))
            wanted, found = (0.4, 0.2, 0.5), (*body.drift_measured(), sensed("turn_rate"))
            return all(isclose(one, other, abs_tol=1e-3) for one, other in zip(wanted, found, strict=True))

        until(lambda: driven() and sensed("heading") > 0.2, lambda: (body.complaints(), body.sense()))
        body.stop()
        until(lambda: sensed("speed") == 0.0)
        process.kill()
        until(lambda: bool(body.lost))
        with quadcopter(port) as again:
            until(lambda: not body.lost and sensed("battery") > 0.0)
            said = body.complaints()
            assert said[0].startswith("the body is out of reach: ")
            assert said[-1].startswith("the body is within reach again")
            body.release()
            body.take_off()
            until(lambda: sensed("z") > 0.1)
            body.close()
            assert again.stdout is not None
            lines = [again.stdout.readline().strip() for _ in range(4)]
            assert lines == ["is armed", "takes off", "lands by itself", "has landed by itself"]


def test_a_link_that_dies_in_flight_is_told_at_node_and_desk_and_comes_back_by_itself(
    port: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live_in(tmp_path, monkeypatch)
    air = f"udp://239.255.83.86:{free_port()}?interface=lo"
    fly = ("(TAKEOFF 0.4m)", '(RULE say (WHEN (AND flying (> z 0.3)) (REPORT "in the air")))')
    drive = "(WHEN flying (SETQ drive_speed 0.2m/s))"
    with (
        quadcopter(port) as lost,
        closing(Mind(f"crazyflie://127.0.0.1:{port}", tmp_path, "--channel", air)) as mind,
        terminal(("desk", "--channel", air), tmp_path, size=(160, 40)) as desk,
    ):
        mind.wait_for("v1 is up")
        mind.say(*fly)
        mind.wait_for("in the air")
        mind.say(drive)
        desk.wait_to_see("o  v1")
        lost.kill()
        mind.wait_for("the body is out of reach: ")
        desk.wait_to_see("the body is out of reach: ")
        with quadcopter(port) as again:
            mind.wait_for("the body is within reach again, and at rest until a command moves it")
            desk.wait_to_see("the body is within reach again")
            mind.say(*fly)
            mind.wait_for("in the air")
            assert again.stdout is not None
            assert [again.stdout.readline().strip() for _ in range(2)] == ["is armed", "takes off"]


def test_one_that_freezes_or_speaks_garbage_in_flight_is_told_and_stopped(
    port: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live_in(tmp_path, monkeypatch)
    fly = ("(TAKEOFF 0.4m)", '(RULE say (ONCE (AND flying (> z 0.3)) (REPORT "in the air")))')
    rules = (
        '(RULE go (ONCE (> speed 0.1m/s) (REPORT "it moves")))',
        '(RULE calm (ONCE (< speed 0.05m/s) (REPORT "it hovers")))',
    )
    with (
        quadcopter(port) as copter,
        closing(Mind(f"crazyflie://127.0.0.1:{port}", tmp_path)) as mind,
    ):
        mind.wait_for("v1 is up")
        mind.say(*fly, *rules)
        mind.wait_for("in the air")
        mind.insist("it moves", "(SETQ drive_speed 0.2m/s)")
        copter.send_signal(signal.SIGUSR1)
        mind.say("STOP")
        mind.wait_for("stopped, and at rest until RELEASE", "it hovers")
        copter.send_signal(signal.SIGUSR1)
        mind.say("RELEASE")
        mind.insist("it moves", "(SETQ drive_speed 0.2m/s)")
        copter.send_signal(signal.SIGSTOP)
        mind.wait_for("the body is out of reach: ")
        mind.say("STOP")
        mind.wait_for("stopped, and at rest until RELEASE")
        copter.send_signal(signal.SIGCONT)
        mind.wait_for("the body is within reach again")


def test_a_link_that_goes_while_something_is_sent_keeps_nobody_waiting(
    port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As it does where another thread lets go of it in the middle."""
    from sleepcast.bridges.crazyflie.link import CflibQuadcopter

    def gone(packet: object) -> None:
        raise AttributeError("'NoneType' object has no attribute 'send_packet'")

    with quadcopter(port):
        copter = CflibQuadcopter(f"udp://127.0.0.1:{port}", LOGGED)
        assert "ping_thread" not in [thread.name for thread in enumerate_threads()], "it may wait for whoever sends"
        monkeypatch.setattr(copter._copter.link, "send_packet", gone)
        sending = [Thread(target=copter.hover, args=(0.0, 0.0, 0.0, 0.4), daemon=True) for _ in range(2)]
        for each in sending:
            each.start()
            each.join(PATIENCE)
        assert not any(each.is_alive() for each in sending)
        copter.close()


@contextmanager
def losing_a_third(port: int, seed: int) -> Iterator[int]:
    """A port whose datagrams go on to this one, and answers back, but for a third of them."""
    near, far = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    ended, chance, nodes = Event(), Random(seed), [("", 0)]
    near.bind(("127.0.0.1", 0))
    far.connect(("127.0.0.1", port))

    def carry() -> None:
        while not ended.is_set():
            for line in select.select([near, far], [], [], 0.1)[0]:
                data, sender = line.recvfrom(64)
                if line is near:
                    nodes[:] = [sender]
                if chance.random() > 1.0 / 3.0:
                    far.send(data) if line is near else near.sendto(data, nodes[0])

    carrying = Thread(target=carry)
    carrying.start()
    with near, far:
        try:
            yield near.getsockname()[1]
        finally:
            ended.set()
            carrying.join(PATIENCE)


@pytest.mark.counterpart("cflib")
def test_values_come_as_often_as_is_said() -> None:
    """cflib rounds a period down to tens of milliseconds, without a word."""
    from cflib.crazyflie.log import LogConfig

    from sleepcast.bridges.crazyflie.link import PERIOD

    assert 10 * LogConfig("ours", PERIOD).period == PERIOD
    assert 10 * LogConfig("another", 55).period == 50


@pytest.mark.parametrize("seed", range(2))
def test_over_a_link_that_loses_datagrams_it_is_met(port: int, seed: int) -> None:
    """Of cflib, only radios ask again."""
    from sleepcast.bridges.crazyflie.link import CflibQuadcopter

    with (
        quadcopter(port),
        losing_a_third(port, seed) as way,
        closing(CflibQuadcopter(f"udp://127.0.0.1:{way}", LOGGED)) as copter,
    ):
        until(lambda: copter.logged() is not None)


def test_nobody_there_is_told(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    from sleepcast.bridges.crazyflie import link

    monkeypatch.setattr(link, "SOON", 0.2)
    with pytest.raises(OutOfReachError, match=f"127.0.0.1:{port} does not answer"):
        open_robot(f"crazyflie://127.0.0.1:{port}")
