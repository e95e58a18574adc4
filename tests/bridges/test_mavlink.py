"""Vehicles behind MAVLink 2: the contract, signatures, orders, and what happens when something goes wrong."""

from __future__ import annotations

import hashlib
import socket
from collections.abc import Callable, Sequence
from contextlib import closing
from math import inf, isnan, nan, pi
from pathlib import Path
from random import Random
from threading import Event, Thread

import pytest

pytest.importorskip("pymavlink")
pytest.importorskip("pyproj")

from bridges.mavlink_vehicle import EARTH, GUIDED, HOME, LATE, Vehicle
from bridges.mind import Mind, Talking
from channel.test_udp import free_port
from cli.terminal import terminal
from processes import live_in
from sleepcast.bridges import BodyError, Opening, OutOfReachError, open_robot
from sleepcast.bridges.body import ROUND, UNATTENDED, BridgedBody
from sleepcast.bridges.mavlink.link import MavlinkConnection
from sleepcast.bridges.mavlink.model import COPTER, PLANE, ROVER
from sleepcast.bridges.mavlink.plane import MavlinkPlane
from sleepcast.bridges.mavlink.plans import Plan
from sleepcast.bridges.mavlink.vehicle import OTHERS, MavlinkVehicle
from sleepcast.channel import Kind, Message
from sleepcast.core.clock import ManualClock
from sleepcast.core.errors import MisuseError
from sleepcast.core.geodesy import Origin
from sleepcast.loop import vocabulary_of
from sleepcast.loop.real import act
from sleepcast.node.node import Node
from sleepcast.robot import FencedError, Limits, Setpoint, hovering
from sleepcast.testing.robot_contract import BridgeContract, BridgeRig, HoverContract

VEHICLE = Path(__file__).with_name("mavlink_vehicle.py")
KEY, OTHER = (hashlib.sha256(phrase).digest() for phrase in (b"fleet key", b"another"))
OF_PLANES = Limits(speed=15.0, turn_rate=1.0, acceleration=4.0, climb=1.0, floor=30.0, ceiling=120.0)
LIMITS = Limits(speed=2.0, turn_rate=1.0, acceleration=2.0, climb=1.0, floor=0.5, ceiling=30.0)


class Loop:
    """A wire to a vehicle in this process, which can be cut, and on which what is sent may take some seconds."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle, self.whole, self.slow, self.time = vehicle, True, 0.0, 0.0
        self.waiting: list[bytes] = []
        self.going: list[tuple[float, bytes]] = []
        """What is on its way to the vehicle, and when it is there."""

    def send(self, data: bytes) -> None:
        if self.whole:
            self.going.append((self.time + self.slow, data))
            self.arrive()

    def receive(self) -> list[tuple[bytes, object]]:
        found, self.waiting = [(each, "vehicle") for each in self.waiting if self.whole], []
        return found

    def answer(self, sender: object) -> None:
        assert sender == "vehicle"

    def close(self) -> None:
        pass

    def advance(self, seconds: float) -> None:
        self.time += seconds
        self.waiting += self.vehicle.advance(seconds)
        self.arrive()

    def arrive(self) -> None:
        while self.going and self.going[0][0] <= self.time:
            self.waiting += self.vehicle.hear(self.going.pop(0)[1])


class MavlinkRig(BridgeRig):
    def __init__(
        self,
        kind: str = "rover",
        key: bytes | None = KEY,
        *,
        failsafe: str = "LOITER",
        vehicle: Vehicle | None = None,
        altitude: float = nan,
        plans: Sequence[Plan] = (),
    ) -> None:
        self.vehicle, clock = vehicle or Vehicle(kind, KEY), ManualClock(1_000.0)
        self.loop, self.time = Loop(self.vehicle), clock
        modes = {"rover": ROVER, "copter": COPTER, "plane": PLANE}[kind]
        link = MavlinkConnection(self.loop, 255, 190, key)
        body, limits = (MavlinkPlane, OF_PLANES) if kind == "plane" else (MavlinkVehicle, LIMITS)
        self.vehicle_body = body(
            link, 1, modes, limits, failsafe=failsafe, origin=Origin(*HOME), altitude=altitude, plans=plans, clock=clock
        )

        def switch(whole: bool) -> Callable[[], None]:
            def throw() -> None:
                self.loop.whole = whole

            return throw

        super().__init__(self.vehicle_body, clock, self.loop.advance, switch(False), switch(True), resolution=0.011)

    def prepare(self) -> None:
        self.ready()

    def ready(self) -> MavlinkRig:
        self.wait(0.2)
        self.vehicle_body.set_mode(GUIDED[self.vehicle.kind])
        self.vehicle_body.arm()
        self.wait(1.2)
        assert (self.vehicle.mode, self.vehicle.armed) == (GUIDED[self.vehicle.kind], True)
        return self


class TestRover(BridgeContract):
    @pytest.fixture
    def rig(self) -> MavlinkRig:
        return MavlinkRig().ready()


class TestCopter(HoverContract):
    @pytest.fixture
    def rig(self) -> MavlinkRig:
        rig = MavlinkRig("copter").ready()
        rig.vehicle_body.take_off(5.0)
        rig.wait(4.0)
        return rig


def test_what_it_senses_is_metres_around_the_origin() -> None:
    rig = MavlinkRig().ready()
    rig.robot.act(Setpoint(1.0))
    rig.wait(5.0)
    found = rig.sensed()
    assert (found["y"], found["heading"], found["speed"]) == pytest.approx((0.0, 0.0, 1.0), abs=0.02)
    assert found["x"] == pytest.approx(4.7, abs=0.3)
    assert (found["battery"], found["volts"], found["gps_fix"], found["satellites"]) == (0.8, 12.6, 3.0, 11.0)
    assert (found["armed"], found["mode"]) == (1.0, GUIDED["rover"])
    rig.robot.act(Setpoint(0.0, 0.5))
    rig.wait(pi)
    assert rig.sensed()["heading"] == pytest.approx(pi / 2, abs=0.1), "counter-clockwise"
    assert rig.sensed()["turn_rate"] == pytest.approx(0.5)


def test_a_copter_takes_off_goes_somewhere_and_does_not_leave_its_fence() -> None:
    rig = MavlinkRig("copter").ready()
    body = rig.vehicle_body
    body.take_off(5.0)
    rig.wait(4.0)
    assert rig.sensed()["height"] == pytest.approx(5.0, abs=0.3)
    assert [order for order in rig.vehicle.orders if order[0] == 22] == [(22, 0.0)], "ordered once"
    body.narrow(Limits(inf, inf, inf, fence=(-20.0, -20.0, 20.0, 20.0)))
    body.go_to(6.0, -8.0)
    rig.wait(1.0)
    assert rig.vehicle.forward == pytest.approx(2.0), "no faster than its limits"
    rig.wait(7.0)
    found = rig.sensed()
    assert (found["x"], found["y"]) == pytest.approx((6.0, -8.0), abs=0.3)
    assert found["height"] == pytest.approx(5.0, abs=0.3)
    with pytest.raises(FencedError, match="outside of the fence"):
        body.go_to(30.0, 0.0)
    with pytest.raises(MisuseError, match="there is no mode 99 here; there are STABILIZE"):
        body.set_mode(99.0)
    body.climb(1.0)
    rig.wait(40.0)
    assert rig.sensed()["height"] == pytest.approx(30.0, abs=0.2), "the ceiling"


def test_a_take_off_arms_and_chooses_the_mode_and_a_landing_ends_it() -> None:
    rig = MavlinkRig("copter")
    mind = Ticks(rig)
    mind.go_on(1.2)
    assert (rig.sensed()["armed"], rig.sensed()["flying"]) == (0.0, 0.0)
    for height in (5.0, 3.0):
        rig.vehicle.orders.clear()
        mind.say("(TAKEOFF)" if height == 5.0 else "(TAKEOFF 3m)")
        mind.go_on(4.0)
        found = rig.sensed()
        assert found["height"] == pytest.approx(height, abs=0.3)
        assert (found["armed"], found["flying"], found["mode"]) == (1.0, 1.0, COPTER["GUIDED"])
        assert [number for number, _ in rig.vehicle.orders] == [176, 400, 22], "one after the other"
        mind.say("(LAND)")
        mind.go_on(1.0)
        assert (rig.sensed()["flying"], rig.sensed()["mode"]) == (1.0, COPTER["LAND"])
        mind.go_on(6.0)
        assert (rig.sensed()["flying"], rig.sensed()["armed"]) == (0.0, 0.0)
    said = ["its motors are off; it is at rest until it is armed and a command moves it"]
    assert rig.body.complaints() == said * 2


@pytest.mark.parametrize(
    ("refused", "said"),
    [
        (400, ["the order about arming or disarming was answered: denied"]),
        (176, ["the order about the mode was answered: denied; arming or disarming, asked for with it, is left out"]),
        (22, ["the order about taking off was answered: denied"]),
    ],
)
def test_a_take_off_that_is_refused_is_told_and_goes_no_further(refused: int, said: list[str]) -> None:
    rig = MavlinkRig("copter")
    mind = Ticks(rig)
    mind.go_on(1.2)
    rig.vehicle.refuse = {refused}
    mind.say("(TAKEOFF 5m)")
    mind.go_on(3.0)
    rig.vehicle.refuse = set()
    mind.go_on(3.0)
    assert rig.sensed()["height"] == 0.0, "nothing takes effect late"
    assert [each for each in rig.body.complaints() if not each.startswith("it does not follow")] == said
    mind.say("(TAKEOFF 5m)")
    mind.go_on(4.0)
    assert rig.sensed()["height"] == pytest.approx(5.0, abs=0.3), "the same, said again"


def test_a_take_off_in_the_air_comes_to_its_height_and_takes_nothing_from_a_pilot() -> None:
    rig = MavlinkRig("copter")
    mind = Ticks(rig)
    mind.go_on(1.2)
    mind.say("(TAKEOFF 5m)")
    mind.go_on(4.0)
    mind.say("(TAKEOFF 8m)")
    mind.go_on(4.0)
    assert rig.sensed()["height"] == pytest.approx(8.0, abs=0.1)
    assert (rig.sensed()["x"], rig.sensed()["y"]) == pytest.approx((0.0, 0.0), abs=0.1)
    rig.vehicle.change_mode(COPTER["ALT_HOLD"])
    mind.go_on(1.2)
    with pytest.raises(MisuseError, match="somebody else has put it into ALT_HOLD"):
        rig.vehicle_body.take_off(5.0)
    rig.body.complaints()
    for height in (0.2, 31.0, nan):
        with pytest.raises(MisuseError, match=r"from 0.5 to 30 m high|into ALT_HOLD"):
            rig.vehicle_body.take_off(height)
    mind.go_on(1.0)
    assert rig.vehicle.mode == COPTER["ALT_HOLD"]


def test_a_rule_that_takes_off_until_it_flies_orders_it_once() -> None:
    rig = MavlinkRig("copter")
    mind = Ticks(rig)
    mind.go_on(1.2)
    mind.say("(RULE up (WHEN (NOT flying) (TAKEOFF 5m)))")
    mind.go_on(4.0)
    assert rig.sensed()["height"] == pytest.approx(5.0, abs=0.3)
    assert [number for number, _ in rig.vehicle.orders if number != 511] == [176, 400, 22]
    assert rig.body.complaints() == []


def test_its_old_names_mean_what_they_meant() -> None:
    """(LAND) was no function, and LAND the number of a mode."""
    rig = MavlinkRig("copter")
    mind = Ticks(rig)
    mind.go_on(1.2)
    mind.say("(SET_MODE GUIDED)", "(ARM)", "(TAKEOFF 5m)")
    mind.go_on(4.0)
    mind.say("(RULE down (ONCE (= mode LAND) (MARK)))", "(SET_MODE LAND)")
    mind.go_on(1.0)
    assert (rig.vehicle.mode, mind.node.evaluate("marked").value) == (COPTER["LAND"], 1.0)
    assert mind.node.evaluate("(= height z)").value == 1.0


def test_heights_above_a_shared_origin_are_those_above_the_start_of_each() -> None:
    rig = MavlinkRig("copter", altitude=100.0).ready()
    rig.vehicle_body.take_off(5.0)
    rig.wait(4.0)
    assert (rig.sensed()["height"], rig.sensed()["z"]) == pytest.approx((5.0, 25.0), abs=0.3)
    rig.vehicle_body.go_to(3.0, 0.0, 27.0)
    rig.wait(5.0)
    assert (rig.sensed()["height"], rig.sensed()["z"]) == pytest.approx((7.0, 27.0), abs=0.1)
    with pytest.raises(MisuseError, match=r"it flies from 0\.5 to 30 m high, not at 40 m"):
        rig.vehicle_body.go_to(3.0, 0.0, 60.0)


def test_a_rover_does_nothing_that_only_what_hovers_does() -> None:
    model = MavlinkRig().body.model
    assert not model.hovers
    assert [actuator.name for actuator in model.actuators] == ["drive_speed", "drive_turn"]
    assert [function.name for function in model.functions] == ["ARM", "DISARM", "SET_MODE", "GOTO"]
    assert {"z", "flying"}.isdisjoint(sensor.name for sensor in model.sensors)


def test_a_vehicle_that_moves_in_any_direction_is_not_at_rest() -> None:
    """Also one that climbs, whose speed along its heading is 0."""
    rig = MavlinkRig("copter").ready()
    body = rig.vehicle_body
    body.take_off(5.0)
    rig.wait(4.0)
    body.climb(1.0)
    rig.wait(1.0)
    assert rig.sensed()["speed"] == 0.0
    climbing = body.rest_state()
    assert climbing is not None
    assert climbing.speed == pytest.approx(1.0)
    assert climbing.distance > 0.0
    rig.body.stop()
    rig.wait(1.0)
    assert body.rest_state() == (0.0, 0.0)


def test_stop_holds_a_vehicle_that_flies_by_itself() -> None:
    rig = MavlinkRig("copter").ready()
    rig.vehicle_body.set_mode(COPTER["RTL"])
    rig.wait(0.5)
    assert rig.vehicle.mode == COPTER["RTL"]
    rig.body.stop()
    rig.wait(0.5)
    assert rig.vehicle.mode == COPTER["LOITER"]
    with pytest.raises(MisuseError, match="RELEASE it first"):
        rig.vehicle_body.arm()
    rig.vehicle_body.take_off(3.0)
    rig.vehicle_body.touch_down()
    rig.body.release()
    rig.wait(2.0)
    assert rig.vehicle.mode == COPTER["LOITER"], "nothing old resumes"


@pytest.mark.parametrize("failsafe", ["LOITER", "RTL", "LAND"])
def test_a_vehicle_without_its_mind_or_its_operator_does_what_its_setting_says(failsafe: str) -> None:
    rig = MavlinkRig("copter", failsafe=failsafe).ready()
    rig.look_away(1.5)
    assert rig.vehicle.mode == COPTER[failsafe]
    rig = MavlinkRig("copter", failsafe=failsafe).ready()
    rig.body.let_go()
    rig.wait(0.2)
    assert rig.vehicle.mode == COPTER[failsafe]
    does = hovering.FAILSAFES[{"LOITER": "hover"}.get(failsafe, failsafe.lower())]
    assert rig.body.complaints() == [f"{hovering.let_go(does)} ({failsafe})"]
    rig.body.stop()
    rig.wait(0.2)
    assert rig.vehicle.mode == COPTER["LOITER"], "STOP comes before a failsafe"


def test_what_is_not_signed_with_the_key_is_not_heard_and_that_is_told() -> None:
    for vehicle_key, said in ((None, "they are not signed"), (OTHER, "signed with another key")):
        rig = MavlinkRig(vehicle=Vehicle("rover", vehicle_key))
        rig.wait(3.0)
        assert "vehicle 1 has not been heard for 2 s" in rig.body.lost or "is not heard" in rig.body.lost
        assert any(said in sentence for sentence in rig.body.complaints())
        assert set(rig.vehicle.heard) <= {"BAD_DATA", "HEARTBEAT", "COMMAND_LONG"}


def test_a_stale_clock_of_the_vehicle_is_told() -> None:
    rig = MavlinkRig(vehicle=Vehicle("rover", KEY, stamp=1.5e9))
    rig.wait(3.0)
    assert any("the clock of the vehicle is behind ours" in sentence for sentence in rig.body.complaints())


def test_forged_timestamps_do_not_deafen_the_link_and_repeats_are_not_heard() -> None:
    rig = MavlinkRig().ready()
    mallory = Vehicle("rover", OTHER, stamp=4e9)
    rig.loop.waiting += mallory.advance(0.1)
    rig.wait(0.1)
    seen = rig.robot.sense().time
    rig.wait(1.0)
    assert rig.robot.sense().time >= seen + 0.9
    again = rig.vehicle.advance(0.05)
    rig.loop.waiting += again
    rig.wait(0.1)
    rig.loop.waiting += again
    rig.wait(0.1)
    old = [said for said in rig.vehicle_body._link.complaints() if "their timestamps are old" in said]
    assert [said.split()[0] for said in old] == [str(len(again))]


def test_its_first_place_is_the_origin_unless_it_is_none() -> None:
    vehicle = Vehicle("rover", KEY)
    rig = MavlinkRig(vehicle=vehicle)
    rig.vehicle_body._map = None
    for nowhere in ((0.0, 0.0), (106.0, -60.0), (20.0, -204.0)):
        vehicle.latitude, vehicle.longitude = nowhere
        rig.wait(0.2)
        assert isnan(rig.sensed()["x"])
        with pytest.raises(MisuseError, match="has not said yet where it is"):
            rig.vehicle_body.go_to(1.0, 1.0)
    vehicle.latitude, vehicle.longitude = HOME
    rig.wait(0.2)
    assert (rig.sensed()["x"], rig.sensed()["y"]) == pytest.approx((0.0, 0.0))


def test_bytes_of_any_kind_do_no_harm() -> None:
    chance, rig = Random(5), MavlinkRig().ready()
    signing = rig.vehicle_body._link.mav.signing
    signing.secret_key, signing.sign_outgoing = None, False  # so that they come as far as they can
    pieces = rig.vehicle.advance(0.05)
    for _ in range(1_500):
        data = bytearray(chance.choice(pieces))
        for _ in range(chance.randrange(4)):
            data[chance.randrange(len(data))] = chance.randrange(256)
        rig.loop.waiting.append(bytes(data[chance.randrange(2) * chance.randrange(9) :]))
        rig.vehicle_body.measure()
    rig.wait(0.2)
    assert rig.body.lost == ""
    assert any("they are damaged, or no MAVLink" in sentence for sentence in rig.body.complaints())


@pytest.mark.parametrize(("lease", "mode"), [(1.0, "RTL"), (inf, "GUIDED")])
def test_when_the_lease_is_over_it_does_what_its_setting_says(lease: float, mode: str) -> None:
    rig = MavlinkRig("copter", failsafe="RTL").ready()
    node = Node("v1", vocabulary_of(rig.body.model), body=rig.body, lease=lease)
    node.sense(rig.robot.sense().values, 0.0)
    node.receive(Message("desk", 1, 1, Kind.COMMAND, 0.0, text="(SETQ drive_speed 1)", role="operator"))
    for tick in range(30):
        node.think(tick, tick / 10.0)
        wanted = node.actuators()
        if wanted:
            rig.robot.act(Setpoint(wanted["drive_speed"]))
        rig.wait(0.1)
    assert rig.vehicle.mode == COPTER[mode]
    reports = [each.body["label"] for each in node.outbox if each.kind is Kind.REPORT]
    assert reports == ["at rest: nobody drives it any more"] * (lease < inf)


def test_a_vehicle_that_restarts_is_at_rest_and_says_so() -> None:
    rig = MavlinkRig().ready()
    rig.robot.act(Setpoint(1.0))
    rig.wait(3.0)
    rig.vehicle.reboot()
    rig.wait(0.5)
    assert "the vehicle has restarted; it is at rest until a command moves it" in rig.body.complaints()
    rig.ready()
    assert rig.sensed()["speed"] == 0.0, "nothing old resumes"
    rig.robot.act(Setpoint(1.0))
    rig.wait(3.0)
    assert rig.sensed()["speed"] == pytest.approx(1.0)


def test_a_restart_elsewhere_with_everything_reset_leaves_the_frame_as_it_is() -> None:
    rig = MavlinkRig("copter").ready()
    body = rig.vehicle_body
    body.take_off(5.0)
    rig.wait(4.0)
    away = EARTH.fwd(HOME[1], HOME[0], 90.0, 25.0)
    rig.vehicle.longitude, rig.vehicle.latitude, rig.vehicle.height = away[0], away[1], 0.0  # its new home
    rig.vehicle.reboot()
    rig.wait(0.2)
    rig.robot.act(Setpoint(1.0))
    rig.wait(0.2)
    assert body.complaints()[-1] == (
        "it does not follow: it is in STABILIZE, not armed; (SET_MODE GUIDED) and (ARM) come first"
    )
    found = rig.sensed()
    assert (found["x"], found["y"], found["height"]) == pytest.approx((25.0, 0.0, 0.0), abs=0.1)
    assert (found["armed"], found["mode"]) == (0.0, COPTER["STABILIZE"])
    rig.ready()
    body.go_to(20.0, 0.0, 3.0)
    rig.wait(8.0)
    assert (rig.sensed()["x"], rig.sensed()["height"]) == pytest.approx((20.0, 3.0), abs=0.3)


def test_a_link_that_dies_in_motion_stops_the_vehicle_by_itself_and_nothing_old_resumes() -> None:
    rig = MavlinkRig().ready()
    rig.robot.act(Setpoint(1.0))
    rig.wait(2.0)
    assert rig.vehicle.forward == pytest.approx(1.0)
    rig.cut()
    rig.wait(2.5)
    assert rig.body.lost == "vehicle 1 has not been heard for 2 s"
    with pytest.raises(OutOfReachError, match="the body is out of reach, and does nothing"):
        rig.vehicle_body.go_to(1.0, 1.0)
    rig.wait(LATE)
    assert rig.vehicle.forward == 0.0, "its setpoints count for this long"
    rig.mend()
    rig.wait(11.0)
    assert rig.body.lost == ""
    assert rig.sensed()["speed"] == 0.0
    assert rig.body.complaints() == [
        "the body is out of reach: vehicle 1 has not been heard for 2 s",
        "the body is still out of reach: vehicle 1 is not heard",
        "the body is within reach again, and at rest until a command moves it",
    ]


def test_a_setpoint_that_is_not_followed_and_a_refused_order_are_told() -> None:
    rig = MavlinkRig()
    rig.wait(0.2)
    rig.robot.act(Setpoint(1.0))
    rig.wait(0.5)
    assert rig.body.complaints() == [
        "it does not follow: it is in MANUAL, not armed; (SET_MODE GUIDED) and (ARM) come first"
    ]
    rig.vehicle.refuse.add(400)
    rig.vehicle_body.arm()
    rig.wait(0.2)
    assert rig.body.complaints() == ["the order about arming or disarming was answered: denied"]


def test_an_order_that_nobody_answers_is_given_up_and_never_takes_effect_late() -> None:
    rig = MavlinkRig().ready()
    rig.vehicle_body.disarm()
    rig.cut()
    rig.wait(1.9)
    assert "it has not answered the order about arming or disarming" in rig.body.complaints()
    rig.mend()
    before = len(rig.vehicle.orders)
    rig.wait(1.0)
    assert (400, 0.0) not in rig.vehicle.orders[before:]
    assert rig.vehicle.armed


def test_a_stop_ends_orders_that_wait_for_an_answer() -> None:
    rig = MavlinkRig()
    rig.wait(0.2)
    rig.vehicle.deaf = {400}
    rig.vehicle_body.arm()
    rig.wait(0.4)
    rig.body.stop()
    rig.wait(0.1)
    rig.vehicle.deaf = set()
    rig.wait(2.0)
    assert not rig.vehicle.armed
    rig.body.release()
    rig.vehicle_body.arm()
    rig.body.stop()
    rig.wait(2.0)
    assert not rig.vehicle.armed, "it was stopped before this was sent"


# ---- a mode and a motion of one tick


class Ticks:
    """A mind whose ticks come with the body's rounds, ten a second."""

    def __init__(self, rig: MavlinkRig) -> None:
        self.rig, self.count, self.began = rig, 0, rig.time.now()
        self.node = Node("v1", vocabulary_of(rig.body.model), body=rig.body)

    def say(self, *texts: str) -> None:
        """All in one tick, with its rules after them."""
        now = self.rig.time.now() - self.began
        self.node.sense(self.rig.robot.sense().values, now)
        for text in texts:
            self.count += 1
            self.node.receive(Message("desk", 1, self.count, Kind.COMMAND, now, text=text, role="commander"))
        self.node.think(self.count, now)
        act(self.node, self.rig.robot)
        self.rig.look_away(0.1)

    def go_on(self, seconds: float) -> None:
        for _ in range(round(seconds * 10)):
            self.say()


@pytest.mark.parametrize("deaf", [set(), {176}, {400}])
@pytest.mark.parametrize(
    "texts",
    [
        ("(SETQ drive_speed 1m/s)", "(SET_MODE GUIDED)", "(ARM)"),
        ("(SET_MODE GUIDED)", "(ARM)", "(SETQ drive_speed 1m/s)"),
    ],
)
def test_a_mode_arming_and_a_speed_of_one_tick_take_effect_in_that_order(
    deaf: set[int], texts: tuple[str, ...]
) -> None:
    rig = MavlinkRig()
    mind = Ticks(rig)
    mind.go_on(1.2)
    rig.vehicle.heard.clear()
    rig.vehicle.deaf = deaf
    mind.say(*texts)
    assert rig.vehicle.forward == 0.0 if deaf else rig.vehicle.mode == GUIDED["rover"]
    rig.vehicle.deaf = set()
    mind.go_on(2.5)
    assert rig.sensed()["speed"] == pytest.approx(1.0)
    orders = [order for order in rig.vehicle.orders if order[0] in (176, 400)]
    assert orders == [(176, 15.0), (400, 1.0)]
    assert rig.body.complaints() == []


def test_a_place_and_a_take_off_wait_for_the_mode_of_their_tick() -> None:
    rig = MavlinkRig("copter")
    mind = Ticks(rig)
    mind.go_on(1.2)
    mind.say("(SET_MODE GUIDED)", "(ARM)", "(TAKEOFF 5m)")
    mind.go_on(4.0)
    assert rig.sensed()["height"] == pytest.approx(5.0, abs=0.3)
    mind.say("(SET_MODE LOITER)")
    mind.go_on(0.5)
    mind.say("(GOTO 6m -8m)", "(SET_MODE GUIDED)")
    mind.go_on(8.0)
    assert (rig.sensed()["x"], rig.sensed()["y"]) == pytest.approx((6.0, -8.0), abs=0.3)
    assert rig.body.complaints() == []


def test_a_rule_that_drives_in_every_tick_does_not_keep_it_from_another_mode() -> None:
    rig = MavlinkRig("copter").ready()
    mind = Ticks(rig)
    mind.say(
        "(RULE drive (SETQ drive_speed 1m/s))", "(RULE ready (WHEN (AND (= mode GUIDED) (< x 1m)) (SET_MODE GUIDED)))"
    )
    mind.go_on(2.0)
    assert rig.sensed()["speed"] == pytest.approx(1.0), "the mode that it is in already changes nothing"
    mind.say("(SET_MODE RTL)")
    mind.go_on(3.0)
    assert rig.vehicle.mode == COPTER["RTL"]
    assert rig.body.complaints() == ["it does not follow: it is in RTL, armed; (SET_MODE GUIDED) and (ARM) come first"]


def test_a_mode_that_is_refused_or_not_answered_leaves_out_what_was_to_follow_it_and_is_not_asked_for_again() -> None:
    rig = MavlinkRig()
    mind = Ticks(rig)
    mind.go_on(1.2)
    for rig.vehicle.refuse, rig.vehicle.deaf, said in (
        ({176}, set(), "the order about the mode was answered: denied"),
        (set(), {176}, "it has not answered the order about the mode"),
    ):
        rig.vehicle.orders.clear()
        mind.say("(SET_MODE GUIDED)", "(ARM)", "(SETQ drive_speed 1m/s)")
        mind.go_on(1.8)
        rig.vehicle.refuse, rig.vehicle.deaf = set(), set()
        mind.go_on(3.0)
        assert len(rig.vehicle.orders) <= 1
        assert (rig.vehicle.mode, rig.vehicle.armed) == (0, False)
        assert rig.body.complaints() == [
            f"{said}; arming or disarming, asked for with it, is left out",
            "it does not follow: it is in MANUAL, not armed; (SET_MODE GUIDED) and (ARM) come first",
        ]
        mind.go_on(5.1)


def test_another_mode_takes_the_place_of_one_that_is_not_answered() -> None:
    rig = MavlinkRig("copter").ready()
    mind = Ticks(rig)
    rig.vehicle.deaf = {176}
    mind.say("(SET_MODE LOITER)", "(SETQ drive_speed 1m/s)")
    mind.go_on(0.5)
    mind.say("(SET_MODE RTL)")
    rig.vehicle.deaf = set()
    mind.go_on(2.0)
    assert rig.vehicle.mode == COPTER["RTL"]
    assert rig.body.complaints() == []


def test_orders_without_end_find_no_room() -> None:
    rig = MavlinkRig("copter").ready()
    mind = Ticks(rig)
    rig.vehicle.deaf = {176}
    mind.say(*("(SET_MODE RTL)", "(SET_MODE LAND)") * 20)
    assert any("too many orders wait for an answer" in sentence for sentence in rig.body.complaints())
    rig.vehicle.deaf = set()
    mind.go_on(8.0)
    mind.say("(SET_MODE GUIDED)")
    mind.go_on(1.0)
    assert rig.vehicle.mode == GUIDED["copter"]


# ---- somebody else


def test_a_pilot_who_takes_over_is_left_alone_and_nothing_old_resumes() -> None:
    rig = MavlinkRig("copter").ready()
    rig.robot.act(Setpoint(1.0))
    rig.wait(2.0)
    rig.vehicle.change_mode(COPTER["ALT_HOLD"])
    rig.wait(1.2)
    assert rig.body.complaints() == [f"{OTHERS} has put it into ALT_HOLD: it is left alone"]
    rig.vehicle.heard.clear()
    rig.wait(5.0)
    assert set(rig.vehicle.heard) == {"HEARTBEAT"}
    rig.vehicle.change_mode(COPTER["GUIDED"])
    rig.wait(2.0)
    assert rig.body.complaints() == [f"{OTHERS} has put it into GUIDED: it is at rest"]
    assert rig.vehicle.forward == 0.0
    rig.robot.act(Setpoint(1.0))
    rig.wait(2.0)
    assert rig.sensed()["speed"] == pytest.approx(1.0)


def test_a_pilot_who_takes_over_under_stop_is_left_alone() -> None:
    rig = MavlinkRig("copter").ready()
    rig.vehicle_body.set_mode(COPTER["RTL"])
    rig.wait(0.5)
    rig.body.stop()
    rig.wait(1.2)
    assert rig.vehicle.mode == COPTER["LOITER"]
    rig.vehicle.change_mode(COPTER["STABILIZE"])
    rig.wait(3.0)
    assert rig.vehicle.mode == COPTER["STABILIZE"]
    assert rig.body.complaints() == [f"{OTHERS} has put it into STABILIZE: STOP does not hold it there"]
    rig.body.stop()
    rig.wait(1.0)
    assert rig.vehicle.mode == COPTER["STABILIZE"], "the same STOP, said again to others"
    rig.body.release()
    rig.wait(0.2)
    rig.body.stop()
    rig.wait(1.0)
    assert rig.vehicle.mode == COPTER["LOITER"], "another STOP"


@pytest.mark.parametrize("end", ["lease", "mind", "node"])
def test_a_failsafe_leaves_what_somebody_else_flies_alone(end: str) -> None:
    rig = MavlinkRig("copter", failsafe="RTL").ready()
    rig.vehicle.change_mode(COPTER["STABILIZE"])
    rig.wait(1.2)
    rig.body.complaints()
    if end == "lease":
        rig.body.let_go()
        rig.wait(3.0)
    elif end == "mind":
        rig.look_away(3.0)
    else:
        rig.body.close()
    assert rig.vehicle.mode == COPTER["STABILIZE"]
    said = "nobody drives it any more; it stays in STABILIZE, into which somebody else has put it"
    assert rig.body.complaints() == ([said] if end != "node" else [])


def test_a_failsafe_is_not_repeated_against_a_pilot() -> None:
    rig = MavlinkRig("copter", failsafe="RTL").ready()
    rig.body.let_go()
    rig.wait(1.5)
    assert rig.vehicle.mode == COPTER["RTL"]
    rig.vehicle.change_mode(COPTER["LOITER"])
    rig.wait(3.0)
    assert rig.vehicle.mode == COPTER["LOITER"]


def test_its_own_failsafe_on_a_slow_link_is_not_taken_for_somebody_else() -> None:
    """The computer stood still for a moment, and meanwhile the vehicle has restarted."""
    rig = MavlinkRig("copter", failsafe="RTL").ready()
    rig.wait(2.0)
    rig.vehicle.reboot()
    rig.loop.slow = 0.5
    for stand_still in (rig.time.advance, rig.loop.advance):
        stand_still(UNATTENDED + 0.1)
    rig.body.round()
    rig.sensed()
    rig.vehicle_body.set_mode(COPTER["GUIDED"])
    rig.vehicle_body.arm()
    for _ in range(20):
        rig.wait(ROUND)
        if rig.vehicle.mode == COPTER["RTL"]:
            rig.vehicle.due["heartbeat"] = 0.0
    rig.wait(3.0)
    assert (rig.vehicle.mode, rig.vehicle.armed) == (COPTER["GUIDED"], True)
    assert not [said for said in rig.body.complaints() if OTHERS in said]


def test_stop_and_failsafe_are_ordered_until_they_have_taken_effect() -> None:
    for begin, mode in ((BridgedBody.let_go, "RTL"), (BridgedBody.stop, "LOITER")):
        rig = MavlinkRig("copter", failsafe="RTL").ready()
        rig.vehicle_body.set_mode(COPTER["AUTO"])
        rig.wait(0.5)
        rig.vehicle.deaf, rig.vehicle.refuse = {176}, {176}
        begin(rig.body)
        rig.wait(4.0)
        rig.vehicle.deaf = set()
        rig.wait(4.0)
        assert rig.vehicle.mode == COPTER["AUTO"]
        rig.vehicle.refuse = set()
        rig.wait(2.0)
        assert rig.vehicle.mode == COPTER[mode]
        said = rig.body.complaints()
        assert [each for each in said if "the order about the mode" in each][:2] == [
            "it has not answered the order about the mode",
            "the order about the mode was answered: denied",
        ]


def test_a_failsafe_that_the_link_has_cut_off_takes_effect_when_it_is_back() -> None:
    rig = MavlinkRig("copter", failsafe="RTL").ready()
    rig.robot.act(Setpoint(1.0))
    rig.wait(1.0)
    rig.cut()
    rig.body.let_go()
    rig.wait(4.0)
    assert rig.body.lost
    rig.mend()
    rig.wait(12.0)
    assert rig.body.lost == ""
    assert rig.vehicle.mode == COPTER["RTL"]


@pytest.mark.parametrize("stopped", [False, True])
def test_what_the_vehicle_has_decided_without_a_link_is_told_and_a_stop_holds(stopped: bool) -> None:
    rig = MavlinkRig("copter", failsafe="LOITER").ready()
    rig.robot.act(Setpoint(1.0))
    rig.wait(1.0)
    rig.cut()
    rig.wait(3.0)
    if stopped:
        rig.body.stop()
    rig.vehicle.change_mode(COPTER["RTL"])  # its failsafe for a lost ground station
    rig.mend()
    rig.wait(12.0)
    assert rig.body.lost == ""
    holds = "STOP ends that" if stopped else "it is left alone"
    assert f"{OTHERS} has put it into RTL: {holds}" in rig.body.complaints()
    assert rig.vehicle.mode == COPTER["LOITER" if stopped else "RTL"]
    rig.vehicle.change_mode(COPTER["ALT_HOLD"])
    rig.wait(3.0)
    rig.cut()
    rig.wait(4.0)
    rig.mend()
    rig.wait(12.0)
    assert rig.vehicle.mode == COPTER["ALT_HOLD"], "a pilot who had it before is left alone"


def test_what_is_held_still_takes_orders_and_does_not_leave_its_place() -> None:
    rig = MavlinkRig("copter").ready()
    rig.body.hold(True)
    rig.wait(0.2)
    rig.vehicle_body.set_mode(COPTER["AUTO"])
    rig.wait(2.0)
    assert rig.vehicle.mode == COPTER["LOITER"]
    rig.body.hold(False)
    rig.vehicle_body.set_mode(COPTER["AUTO"])
    rig.wait(2.0)
    assert rig.vehicle.mode == COPTER["AUTO"]
    assert rig.body.complaints() == []
    rig.vehicle.change_mode(COPTER["STABILIZE"])
    rig.wait(1.2)
    rig.body.hold(True)
    rig.wait(2.0)
    assert rig.vehicle.mode == COPTER["STABILIZE"], "as its pilot wants it"


def test_a_mode_that_comes_after_the_stop_that_was_to_prevent_it_does_not_last() -> None:
    rig = MavlinkRig("copter").ready()
    rig.vehicle_body.set_mode(COPTER["AUTO"])
    rig.vehicle.deaf = {176}  # it has got it, but is slow
    rig.wait(0.1)
    rig.body.stop()
    rig.wait(0.1)
    rig.vehicle.deaf = set()
    rig.vehicle.change_mode(COPTER["AUTO"])
    rig.wait(2.0)
    assert rig.vehicle.mode == COPTER["LOITER"]
    assert rig.body.complaints() == []


def test_motors_that_somebody_else_switches_off_and_on_again_move_nothing() -> None:
    rig = MavlinkRig().ready()
    rig.robot.act(Setpoint(1.0))
    rig.wait(1.0)
    rig.vehicle.armed, rig.vehicle.forward = False, 0.0
    rig.wait(1.2)
    assert rig.body.complaints() == ["its motors are off; it is at rest until it is armed and a command moves it"]
    rig.vehicle.armed = True
    rig.wait(2.0)
    assert rig.vehicle.forward == 0.0


def test_answers_to_another_ground_station_are_not_ours() -> None:
    rig = MavlinkRig("copter").ready()
    rig.vehicle.deaf = {176}
    rig.vehicle_body.set_mode(COPTER["RTL"])
    rig.wait(0.1)
    theirs = rig.vehicle.mav.command_ack_encode(176, 0, target_system=255, target_component=230)
    rig.loop.waiting.append(rig.vehicle.pack(theirs))
    rig.wait(0.1)
    rig.vehicle.deaf = set()
    rig.wait(0.5)
    assert rig.vehicle.mode == COPTER["RTL"], "it was ordered again"


def test_a_failsafe_leaves_what_is_not_armed_alone() -> None:
    rig = MavlinkRig("copter", failsafe="RTL")
    rig.look_away(2.0)
    assert rig.vehicle.mode == COPTER["STABILIZE"]


def test_its_mind_commands_it_by_name() -> None:
    rig = MavlinkRig("copter")
    rig.wait(1.2)
    node = Node("v1", vocabulary_of(rig.body.model), body=rig.body)
    node.sense(rig.robot.sense().values, 0.0)
    result = node.evaluate("(WHEN (AND (> battery 50%) (>= gps_fix 3)) (SET_MODE GUIDED) (ARM))")
    assert not result.faults
    rig.wait(1.2)
    node.sense(rig.robot.sense().values, 1.0)
    assert node.evaluate("(AND (= mode GUIDED) (= armed 1))").value == 1.0


@pytest.mark.parametrize(
    ("tail", "error"),
    [
        ("", "wanted either key=FILE, with the phrase of the vehicle's signing key, or unsigned=yes"),
        ("?key=vehicle.key&unsigned=yes", "wanted either key=FILE"),
        ("?key=nothing", "key=nothing: it cannot be read"),
        ("?key=empty.key", "wanted a file with one phrase"),
        ("?unsigned=yes&failsafe=rt", "there is no failsafe 'rt'.*there are loiter, rtl, land"),
        ("?unsigned=yes&origin=91,0", "is no place on the Earth"),
        ("?unsigned=yes#255", "vehicles are numbered from 1 to 254"),
        ("?unsigned=yes&speed=0", "speed is a number above 0"),
        ("?unsigned=maybe", "there is no unsigned 'maybe'"),
    ],
)
def test_an_address_that_is_wrong(tail: str, error: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("vehicle.key").write_text("fleet key\n")
    Path("empty.key").write_text("\n")
    with pytest.raises(MisuseError, match=error):
        open_robot(f"mavlink://127.0.0.1:14550{tail}")


def test_a_vehicle_that_there_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sleepcast.bridges.mavlink.opening.PATIENCE", 0.2)
    with pytest.raises(OutOfReachError, match=r"vehicle 3 was not heard at 127\.0\.0\.1:9 in 0.2 s"):
        open_robot("mavlink://127.0.0.1:9?unsigned=yes#3")
    with pytest.raises(BodyError, match="no --lockstep"):
        open_robot("mavlink://127.0.0.1:9?unsigned=yes", Opening(in_step=True))


def test_a_flight_controller_that_only_sends_telemetry_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """As Betaflight 4.6 does: in MAVLink 1, from system 0."""
    from pymavlink.dialects.v10 import common

    monkeypatch.setattr("sleepcast.bridges.mavlink.opening.PATIENCE", 2.0)
    port, stranger, ended = free_port(), common.MAVLink(None, 0, 200), Event()
    beat = stranger.heartbeat_encode(2, 0, 64, 1, 3).pack(stranger)

    def tell() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            while not ended.wait(0.02):
                line.sendto(beat, ("127.0.0.1", port))

    thread = Thread(target=tell)
    thread.start()
    try:
        with pytest.raises(OutOfReachError, match=r"in 2 s; heard were 0 \(its component 200\)$"):
            open_robot(f"mavlink://127.0.0.1:{port}?unsigned=yes&listen=yes#1")
    finally:
        ended.set()
        thread.join()


# ---- with a vehicle in another process


class Process(Talking):
    """A vehicle in a process of its own, which prints its modes, and a file with the phrase of its key."""

    def __init__(self, folder: Path, kind: str = "copter") -> None:
        (folder / "vehicle.key").write_text("fleet key\n")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.uri = f"mavlink://127.0.0.1:{self.port}?listen=yes&key={folder / 'vehicle.key'}&failsafe=rtl#1"
        super().__init__(folder / "vehicle", VEHICLE, self.port, "fleet key", kind)

    def close(self) -> None:
        self.kill()


def test_a_node_commands_a_vehicle_in_another_process_and_finds_it_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live_in(tmp_path, monkeypatch)
    drive = "(RULE drive (WHEN (AND (= mode GUIDED) (= armed 1)) (SETQ drive_speed 1m/s)))"
    tell = '(RULE say (WHEN (> speed 0.5m/s) (REPORT "rolling")))'
    ready = ("(SET_MODE GUIDED)", "(ARM)")
    air = f"udp://239.255.83.85:{free_port()}?interface=lo"
    with (
        closing(Process(tmp_path, "rover")) as vehicle,
        closing(Mind(vehicle.uri, tmp_path, "--channel", air)) as mind,
        terminal(("desk", "--channel", air), tmp_path, size=(160, 40)) as desk,
    ):
        mind.wait_for("v1 is up")
        desk.wait_to_see("o  v1")
        mind.say(drive, tell)
        mind.insist("rolling", *ready)
        vehicle.say("mute")
        mind.wait_for("the body is out of reach: vehicle 1 has not been heard for 2 s")
        desk.wait_to_see("the body is out of reach: vehicle 1 has not been heard for 2 s")
        vehicle.say("speak")
        mind.wait_for("the body is within reach again, and at rest until a command moves it")
        desk.wait_to_see("the body is within reach again")
        vehicle.say("reboot")
        mind.wait_for("the vehicle has restarted; it is at rest until a command moves it")
        desk.wait_to_see("the vehicle has restarted; it is at rest until a command moves it")
        mind.insist("rolling", *ready)
        mind.say("STOP")
        mind.wait_for("stopped, and at rest until RELEASE")


def test_what_a_pilot_and_the_vehicle_itself_decide_is_told_at_node_and_desk_and_its_end_is_safe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live_in(tmp_path, monkeypatch)
    air = f"udp://239.255.83.85:{free_port()}?interface=lo"
    with (
        closing(Process(tmp_path)) as vehicle,
        closing(Mind(vehicle.uri, tmp_path, "--channel", air)) as mind,
        terminal(("desk", "--channel", air), tmp_path, size=(160, 40)) as desk,
    ):

        def told(*sentences: str) -> None:
            mind.wait_for(*sentences)
            for sentence in sentences:
                desk.wait_to_see(sentence)

        mind.wait_for("v1 is up")
        desk.wait_to_see("o  v1")
        mind.say('(RULE say (ONCE (> speed 0.5m/s) (REPORT "flying")))')
        vehicle.say("refuse")
        up, drive = "(WHEN 1 (SET_MODE GUIDED) (ARM) (TAKEOFF 3m))", ("(SET_MODE GUIDED)", "(SETQ drive_speed 1m/s)")
        mind.say(up)
        vehicle.wait_for("mode 4")
        vehicle.say("text PreArm: Compass not calibrated")
        told(
            "the vehicle says: PreArm: Compass not calibrated",
            "the order about arming or disarming was answered: denied",
            "it does not follow: it is in GUIDED, not armed",
        )
        vehicle.say("allow")
        mind.say('(RULE high (ONCE (> height 2m) (REPORT "high")))')
        mind.insist("high", up)
        mind.insist("flying", *drive)
        vehicle.say("mode 2")
        told(f"{OTHERS} has put it into ALT_HOLD: it is left alone")
        mind.say("(SET_MODE GUIDED)")
        vehicle.wait_for("mode 4")
        vehicle.say("text Battery 1 is low 10.5V")
        told("the vehicle says: Battery 1 is low 10.5V")
        vehicle.say("mode 9")
        told(f"{OTHERS} has put it into LAND: it is left alone")
        mind.insist("flying", *drive)
        mind.close()
        vehicle.wait_for("mode 6")
