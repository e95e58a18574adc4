"""A robot as a vehicle of a ground station, which is made of pymavlink alone."""

from __future__ import annotations

import hashlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from math import inf, nan, pi
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

import forkserver

pytest.importorskip("pymavlink")
pytest.importorskip("pyproj")

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as dialect

from bridges.mind import PATIENCE
from channel.test_udp import free_port
from sleepcast.bridges import UNLIMITED, Opening, open_robot
from sleepcast.bridges.address import BodyError
from sleepcast.bridges.mavlink.ground_station import QUIET, GroundStation, PilotRequest, open_ground_station
from sleepcast.bridges.mavlink.link import GONE, MAX_PEERS, MavlinkConnection, UdpWire
from sleepcast.channel import Kind
from sleepcast.cli.local_input import LocalInput, request_text
from sleepcast.cli.node_life import NodeProcess, StartScript
from sleepcast.core.clock import ManualClock
from sleepcast.core.geodesy import Origin

KEY = hashlib.sha256(b"fleet key").digest()
ROBOT = 7
VELOCITY, PLACE = 0x5C7, 0xDF8


class Desk:
    """The ground station: what it sees, and what it sends."""

    def __init__(self, key: bytes | None = KEY) -> None:
        self.mav = dialect.MAVLink(None, 255, 190)
        self.mav.robust_parsing = True
        if key is not None:
            self.mav.signing.secret_key, self.mav.signing.sign_outgoing = key, True
        self.seen: dict[str, Any] = {}
        """The last message of each type; that of a type which came later stands behind."""
        self.waiting: list[bytes] = []

    def look(self, data: bytes) -> None:
        for message in self.mav.parse_buffer(bytearray(data)) or ():
            self.seen.pop(message.get_type(), None)
            self.seen[message.get_type()] = message

    def pack(self, message: Any) -> bytes:
        signing = self.mav.signing
        signing.timestamp = max(signing.timestamp, int((time.time() - 1_420_070_400) * 1e5))
        self.mav.seq = (self.mav.seq + 1) % 256
        return bytes(message.pack(self.mav))

    # ---- a wire, seen from the robot

    def send(self, data: bytes) -> None:
        self.look(data)

    def receive(self) -> list[tuple[bytes, object]]:
        found, self.waiting = [(each, "desk") for each in self.waiting], []
        return found

    def answer(self, sender: object) -> None:
        assert sender == "desk"

    def close(self) -> None:
        pass

    def order(self, command: int, *parameters: float, to: int = ROBOT) -> None:
        filled = (*parameters, *(0.0,) * (7 - len(parameters)))
        self.waiting.append(self.pack(self.mav.command_long_encode(to, 1, command, 0, *filled)))

    def velocity(self, ahead: float, turn: float, *, to: int = ROBOT) -> bytes:
        rest = (0.0, 0.0, 0.0, ahead, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, turn)
        return self.pack(self.mav.set_position_target_local_ned_encode(0, to, 1, 8, VELOCITY, *rest))


@pytest.fixture
def desk() -> Desk:
    return Desk()


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(100.0)


@pytest.fixture
def ground(desk: Desk, clock: ManualClock) -> GroundStation:
    return GroundStation(MavlinkConnection(desk, ROBOT, 1, KEY), Origin(36.6, -121.9), (1.0, 2.0), clock=clock)


def test_it_is_seen_as_a_rover_where_it_is(ground: GroundStation, desk: Desk, clock: ManualClock) -> None:
    there = {"x": 30.0, "y": 40.0, "heading": pi / 2.0, "speed": 0.5, "fuel": 0.75, "motor_volts": 12.5}
    ground.tell(there, stopped=False)
    beat, place, state = (desk.seen[name] for name in ("HEARTBEAT", "GLOBAL_POSITION_INT", "SYS_STATUS"))
    assert (beat.get_srcSystem(), beat.type, beat.custom_mode, beat.base_mode) == (ROBOT, 10, 15, 129)
    assert (place.lat / 1e7, place.lon / 1e7) == pytest.approx((36.60036, -121.899665), abs=2e-6)
    assert (place.hdg, place.vx, place.vy) == (0, 50, 0), "north"
    local = desk.seen["LOCAL_POSITION_NED"]
    assert (local.x, local.y) == (40.0, 30.0), "north comes first"
    assert (state.battery_remaining, state.voltage_battery) == (75, 12_500)
    ground.tell(there, stopped=True)
    assert (desk.seen["HEARTBEAT"].custom_mode, desk.seen["HEARTBEAT"].base_mode) == (4, 1), "told at once"
    desk.seen.clear()
    clock.advance(0.3)
    ground.tell({**there, "x": nan}, stopped=True)
    assert not desk.seen, "nobody knows where it is"
    ground.say("it is done")
    assert desk.seen["STATUSTEXT"].text == "it is done"


@pytest.mark.parametrize(
    ("order", "wanted", "result"),
    [
        ((176, 1.0, 4.0), "stop", 0),
        ((176, 1.0, 15.0), "release", 0),
        ((176, 1.0, 11.0), "", 2),
        ((400, 0.0, 21196.0), "stop", 0),
        ((400, 1.0), "release", 0),
        ((185, 1.0), "stop", 0),
        ((22, 0.0), "", 3),
    ],
)
def test_orders(ground: GroundStation, desk: Desk, order: tuple[float, ...], wanted: str, result: int) -> None:
    desk.order(int(order[0]), *order[1:])
    assert [each.type for each in ground.requests()] == [wanted] * bool(wanted)
    assert (desk.seen["COMMAND_ACK"].command, desk.seen["COMMAND_ACK"].result) == (order[0], result)


@pytest.mark.parametrize("to", [0, 8])
def test_what_is_for_everybody_or_for_another_is_not_obeyed(ground: GroundStation, desk: Desk, to: int) -> None:
    desk.order(176, 1.0, 15.0, to=to)
    desk.waiting.append(desk.velocity(1.0, 0.0, to=to))
    assert ground.requests() == []
    assert "COMMAND_ACK" not in desk.seen


def test_a_ground_station_that_drives_must_go_on(ground: GroundStation, desk: Desk, clock: ManualClock) -> None:
    desk.waiting += [desk.velocity(0.1, 0.0), desk.velocity(0.5, -0.25)]
    assert ground.requests() == [PilotRequest("drive", (0.5, 0.25))], "the last one, counter-clockwise"
    for _ in range(5):
        clock.advance(0.8 * QUIET)
        desk.waiting.append(desk.velocity(0.5, -0.25))
        assert ground.requests() == [], "nothing new"
    clock.advance(1.1 * QUIET)
    assert ground.requests() == [PilotRequest("drive", (0.0, 0.0))]
    assert ground.complaints() == ["the ground station no longer drives it: it comes to rest"]
    stick = desk.mav.manual_control_encode(ROBOT, 500, 0, 0, 1000, 0)
    desk.waiting.append(desk.pack(stick))
    assert ground.requests() == [PilotRequest("drive", (0.5, -2.0))]


def test_places_become_variables_of_its_rules(ground: GroundStation, desk: Desk) -> None:
    to = 366_003_604, -1_218_996_646, 0.0
    desk.waiting.append(
        desk.pack(desk.mav.set_position_target_global_int_encode(0, ROBOT, 1, 6, PLACE, *to, *(0.0,) * 8))
    )
    (request,) = ground.requests()
    assert request.values == pytest.approx((30.0, 40.0, 0.0), abs=0.02)
    text = request_text(PilotRequest("goal", (30.0, -4.0)), ["drive_speed", "drive_turn"])
    assert "(SETQ goal_x 30.000)" in text
    assert "(SETQ goal_y -4.000)" in text
    assert "height" not in text, "it has said none"
    assert "(SETQ goal_height 7.500)" in request_text(
        PilotRequest("goal", (30.0, -4.0, 7.5)), ["drive_speed", "drive_turn"]
    )
    far = desk.mav.set_position_target_local_ned_encode(0, ROBOT, 1, 1, PLACE, nan, 1e9, *(0.0,) * 9)
    desk.waiting.append(desk.pack(far))
    assert ground.requests() == []


def test_places_that_ground_stations_send_in_other_ways(ground: GroundStation, desk: Desk) -> None:
    """Relative to the robot, and as what a click on the map becomes in MAVProxy and in QGroundControl."""
    ground.tell({"x": 10.0, "y": 20.0, "heading": pi / 2.0}, stopped=False)

    def goals(message: Any) -> list[tuple[float, ...]]:
        desk.waiting.append(desk.pack(message))
        return [each.values[:2] for each in ground.requests()]

    def near(frame: int) -> Any:
        return desk.mav.set_position_target_local_ned_encode(0, ROBOT, 1, frame, PLACE, 3.0, 1.0, *(0.0,) * 9)

    assert goals(near(1)) == [(1.0, 3.0)], "north comes first"
    assert goals(near(7)) == [(11.0, 23.0)], "north and east of where it is"
    assert goals(near(8)) == [pytest.approx((11.0, 23.0))], "ahead, which is north, and to its right"
    there = (366_003_604, -1_218_996_646, 0.0)
    waypoint = desk.mav.mission_item_int_encode(ROBOT, 1, 0, 3, 16, 2, 0, 0, 0, 0, 0, *there)
    reposition = desk.mav.command_int_encode(ROBOT, 1, 3, 192, 0, 0, -1, 1, 0, 0, *there)
    long = desk.mav.command_long_encode(ROBOT, 1, 192, 0, -1, 1, 0, 0, 36.6003604, -121.8996646, 0)
    for message in (waypoint, reposition, long):
        assert goals(message) == [pytest.approx((30.0, 40.0), abs=0.5)]
    assert (desk.seen["MISSION_ACK"].type, desk.seen["COMMAND_ACK"].result) == (0, 0)
    part_of_a_mission = desk.mav.mission_item_int_encode(ROBOT, 1, 0, 3, 16, 0, 0, 0, 0, 0, 0, *there)
    assert goals(part_of_a_mission) == []
    assert desk.seen["MISSION_ACK"].type == 14
    ground.tell({}, stopped=True)
    assert goals(reposition) == goals(near(1)) == [], "nor does it begin with this after a RELEASE"
    assert desk.seen["COMMAND_ACK"].result == 2


def test_a_place_ends_the_velocity_of_before_at_once(ground: GroundStation, desk: Desk, clock: ManualClock) -> None:
    """As when a program of MAVSDK goes on from velocities to places: it drove on for a second, and was then said not to
    be driven any more."""
    ground.tell({"x": 0.0, "y": 0.0, "heading": 0.0}, stopped=False)
    desk.waiting.append(desk.velocity(0.5, 0.0))
    assert ground.requests() == [PilotRequest("drive", (0.5, 0.0))]
    place = desk.mav.set_position_target_local_ned_encode(0, ROBOT, 1, 1, PLACE, 3.0, 2.0, -1.0, *(0.0,) * 8)
    desk.waiting.append(desk.pack(place))
    assert ground.requests() == [PilotRequest("goal", (2.0, 3.0, 1.0)), PilotRequest("drive", (0.0, 0.0))]
    clock.advance(1.1 * QUIET)
    assert (ground.requests(), ground.complaints()) == ([], [])


def test_numbers_of_any_kind_do_no_harm(ground: GroundStation, desk: Desk) -> None:
    for odd in (nan, inf, -inf, 3e38):
        for command in (176, 400, 185, 192, 16):
            desk.order(command, *(odd,) * 7)
        desk.waiting.append(desk.velocity(odd, odd))
        local = desk.mav.set_position_target_local_ned_encode(0, ROBOT, 1, 8, PLACE, *(odd,) * 11)
        desk.waiting.append(desk.pack(local))
    assert {each.type for each in ground.requests()} <= {"stop", "drive"}


@pytest.mark.parametrize("name", ["x", "height", "climb_rate", "turn_rate", "speed", "heading", "volts"])
@pytest.mark.parametrize("value", [1e39, -1e300, inf, nan])
def test_values_without_room_in_a_message_end_nobody(
    ground: GroundStation, desk: Desk, name: str, value: float
) -> None:
    """A ROS robot's place is a double, and a robot may have a variable that is called `height`."""
    ground.tell({"x": 1.0, "y": 2.0, "heading": 0.3, name: value}, stopped=False)
    assert "SYS_STATUS" in desk.seen


def test_nobody_without_the_key_is_heard(ground: GroundStation, desk: Desk) -> None:
    for stranger in (Desk(None), Desk(hashlib.sha256(b"another").digest())):
        stranger.order(176, 1.0, 15.0)
        desk.waiting += [*stranger.waiting, b"no MAVLink at all", b""]
    assert ground.requests() == []
    (first, *others) = ground.complaints()
    assert "from the ground station were refused" in first
    assert len(others) == 2


def test_an_address_of_no_ground_station() -> None:
    with pytest.raises(BodyError, match="did you mean origin"):
        open_ground_station("mavlink://127.0.0.1?orign=1,2", 1, (1.0, 1.0))


def test_a_mode_does_not_end_a_stop_by_disarming_but_arming_does(ground: GroundStation, desk: Desk) -> None:
    """Programs choose GUIDED before they say where to go, also after they have switched off the motors."""
    for off in ((400, 0.0, 21196.0), (185, 1.0)):
        ground.tell({}, stopped=False)
        desk.order(*off)
        assert ground.requests() == [PilotRequest("stop")]
        ground.tell({}, stopped=True)
        desk.order(176, 1.0, 15.0)
        assert ground.requests() == [], "it stays stopped"
        ground.tell({}, stopped=True)
        beat = desk.seen["HEARTBEAT"]
        assert (desk.seen["COMMAND_ACK"].result, beat.custom_mode, beat.base_mode) == (0, 15, 1), "not armed, in GUIDED"
        desk.order(192, 0.0, 1.0, 0.0, 0.0, 36.6003604, -121.8996646)
        assert (ground.requests(), desk.seen["COMMAND_ACK"].result) == ([], 2)
        assert desk.seen["STATUSTEXT"].text == "it is stopped, so it goes nowhere"
        desk.order(400, 1.0)
        assert ground.requests() == [PilotRequest("release")]
    desk.order(176, 1.0, 4.0)
    ground.requests()
    ground.tell({}, stopped=True)
    desk.order(176, 1.0, 15.0)
    assert ground.requests() == [PilotRequest("release")], "a STOP by a mode ends by one"


HOLD, GUIDED, ARM = (176, 1.0, 4.0), (176, 1.0, 15.0), (400, 1.0)


@pytest.mark.parametrize("orders", [(HOLD,), ((400, 0.0),), ((185, 1.0),), (HOLD, GUIDED), (HOLD, ARM)])
def test_a_new_mode_is_shown_before_it_is_acknowledged(
    ground: GroundStation, desk: Desk, orders: tuple[tuple[float, ...], ...]
) -> None:
    """A program that is answered says where to go at once, and leaves out GUIDED where it believes that it is so."""
    ground.tell({}, stopped=False)
    for number, *parameters in orders:
        desk.seen.clear()
        desk.order(int(number), *parameters)
        (request,) = ground.requests()
        assert list(desk.seen) == ["HEARTBEAT", "COMMAND_ACK"]
        assert (desk.seen["HEARTBEAT"].base_mode >= 128) == (request.type == "release"), "armed"


def test_a_mode_that_it_has_already_is_not_shown_anew_with_every_command(ground: GroundStation, desk: Desk) -> None:
    ground.tell({}, stopped=False)
    desk.seen.clear()
    for _ in range(3):
        desk.order(176, 1.0, 15.0)
    ground.requests()
    assert list(desk.seen) == ["COMMAND_ACK"]


def test_a_release_that_was_read_before_a_stop_does_not_count_after_it(
    ground: GroundStation, desk: Desk, clock: ManualClock
) -> None:
    """Else a robot that was disarmed would be told to be armed, and GUIDED would set it free."""
    mine = LocalInput("v1", clock, (), None, None, ground=ground)
    ground.tell({}, stopped=False)
    desk.order(176, 1.0, 15.0)
    desk.order(400, 0.0)
    (stop,) = mine.stops()
    assert stop.kind is Kind.STOP
    assert not mine.is_releasing
    desk.order(400, 1.0)
    assert mine.stops() == []
    assert mine.is_releasing


def test_what_was_sent_before_a_stop_or_comes_with_it_moves_nothing_after_it(
    ground: GroundStation, desk: Desk, clock: ManualClock
) -> None:
    """All of it may be read in one tick."""
    ground.tell({"x": 0.0, "y": 0.0, "heading": 0.0}, stopped=False)
    desk.waiting.append(desk.velocity(0.5, 0.0))
    desk.order(176, 1.0, 4.0)
    desk.order(192, 0.0, 1.0, 0.0, 0.0, 36.6003604, -121.8996646)
    assert ground.requests() == [PilotRequest("stop")]
    assert desk.seen["COMMAND_ACK"].result == 2
    desk.order(176, 1.0, 15.0)
    assert ground.requests() == [PilotRequest("release")]
    clock.advance(1.1 * QUIET)
    assert (ground.requests(), ground.complaints()) == ([], [])


@pytest.mark.parametrize("free", [(400, 1.0), (176, 1.0, 15.0)])
@pytest.mark.parametrize("held", [False, True])
def test_a_place_that_is_said_as_soon_as_it_is_free_is_taken(
    ground: GroundStation, desk: Desk, free: tuple[float, ...], held: bool
) -> None:
    """Its own STOP has ended with the acknowledgement; somebody else's has not."""
    ground.tell({}, stopped=False)
    desk.order(176, 1.0, 4.0)
    ground.requests()
    ground.tell({}, stopped=True, held=held)
    desk.order(int(free[0]), *free[1:])
    assert ground.requests() == [PilotRequest("release")]
    desk.order(192, 0.0, 1.0, 0.0, 0.0, 36.6003604, -121.8996646)
    assert [each.type for each in ground.requests()] == ["goal"] * (not held)
    assert desk.seen["COMMAND_ACK"].result == (2 if held else 0)


def test_arming_under_a_stop_of_somebody_else_is_refused_with_the_reason(ground: GroundStation, desk: Desk) -> None:
    """It was acknowledged, and the robot stayed stopped."""
    ground.tell({}, stopped=True, held=True)
    desk.order(400, 1.0)
    assert ground.requests() == [PilotRequest("release")], "of its own, which ends"
    assert desk.seen["COMMAND_ACK"].result == 2
    assert desk.seen["STATUSTEXT"].text == "it stays stopped: a STOP of somebody else holds"
    ground.tell({}, stopped=False)
    desk.order(400, 1.0)
    ground.requests()
    assert desk.seen["COMMAND_ACK"].result == 0


@pytest.mark.parametrize("batch", [[(185, 1.0), (400, 1.0)], [(176, 1.0, 4.0), (176, 1.0, 15.0)]])
@pytest.mark.parametrize("early", [False, True])
def test_a_stop_is_ended_by_what_comes_with_it_in_one_batch(
    ground: GroundStation, desk: Desk, batch: list[tuple[float, ...]], early: bool
) -> None:
    robot = open_robot("sim", Opening(False, UNLIMITED, 1, 0))
    life = NodeProcess("r1", robot, None, None, None, number=1, seed=0, lease=inf, ground=ground, typed=False)
    life.begin(StartScript(), StartScript())
    mind = life.mind(in_step=True)
    for each in batch:
        desk.order(int(each[0]), *each[1:])
    if early:  # while a mind thinks
        mind.hear_stops()
        assert life.node.stopped
    mind.deliver()
    assert not life.node.stopped
    robot.close()


def test_it_is_free_between_two_ticks_in_which_it_is_armed(ground: GroundStation, desk: Desk) -> None:
    """Arming that comes while a mind thinks is acknowledged, and ends the STOP in the next tick: before that, the
    ground station is told once more how the robot is."""
    robot = open_robot("sim", Opening(False, UNLIMITED, 1, 0))
    life = NodeProcess("r1", robot, None, None, None, number=1, seed=0, lease=inf, ground=ground, typed=False)
    life.begin(StartScript(), StartScript())
    mind = life.mind(in_step=True)
    desk.order(185, 1.0)
    mind.deliver()
    life.tend()
    assert life.node.stopped
    desk.order(400, 1.0)
    mind.hear_stops()
    life.tend()
    assert life.node.stopped, "only STOPs act while a mind thinks"
    desk.order(192, 0.0, 1.0, 0.0, 0.0, 36.6003604, -121.8996646)
    mind.deliver()
    assert desk.seen["COMMAND_ACK"].result == 0
    assert not life.node.stopped
    robot.close()


def test_of_many_places_the_last_one_counts(ground: GroundStation, desk: Desk) -> None:
    desk.waiting += [setpoint(desk, 1, PLACE, place=(1.0, each, 0.0), pace=(0.0, 0.0, 0.0)) for each in range(50)]
    assert ground.requests() == [PilotRequest("goal", (49.0, 1.0, 0.0))]


def test_a_robot_that_begins_under_a_stop_counts_as_disarmed(ground: GroundStation, desk: Desk) -> None:
    """Before it was restarted it may have been."""
    ground.tell({}, stopped=True)
    assert (desk.seen["HEARTBEAT"].custom_mode, desk.seen["HEARTBEAT"].base_mode) == (4, 1)
    desk.order(176, 1.0, 15.0)
    assert ground.requests() == []
    desk.order(400, 1.0)
    assert ground.requests() == [PilotRequest("release")]


def test_what_programs_wait_for_before_they_command_anything(
    ground: GroundStation, desk: Desk, clock: ManualClock
) -> None:
    """That it knows its place and its heading, and where its home is, unasked and when they ask."""
    ground.tell({}, stopped=False)
    assert desk.seen["SYS_STATUS"].onboard_control_sensors_health == 0x1000_0000, "it does not know where it is"
    clock.advance(1.1)
    ground.tell({"x": 30.0, "y": 40.0, "heading": 0.0, "height": 2.5, "climb_rate": 0.5}, stopped=False)
    state, home, place = (desk.seen[each] for each in ("SYS_STATUS", "HOME_POSITION", "GLOBAL_POSITION_INT"))
    assert state.onboard_control_sensors_health == state.onboard_control_sensors_present == 0x1000_0027
    assert (home.latitude, home.longitude, home.altitude) == (366_000_000, -1_219_000_000, 0)
    assert (place.alt, place.relative_alt, place.vz, desk.seen["LOCAL_POSITION_NED"].z) == (2_500, 2_500, -50, -2.5)
    del desk.seen["HOME_POSITION"]
    for number, name, result in (
        (242.0, "HOME_POSITION", 0),
        (148.0, "AUTOPILOT_VERSION", 0),
        (26.0, "", 3),
        (nan, "", 3),
    ):
        desk.order(512, number)
        assert ground.requests() == []
        assert (not name or name in desk.seen, desk.seen["COMMAND_ACK"].result) == (True, result)
    assert desk.seen["AUTOPILOT_VERSION"].capabilities & 0x2008 == 0x2008, "MAVLink 2, and exact places"
    nowhere = Desk()
    lost = GroundStation(MavlinkConnection(nowhere, ROBOT, 1, KEY), None, (1.0, 2.0), clock=clock)
    lost.tell({"x": 30.0, "y": 40.0, "heading": 0.0}, stopped=False)
    assert "HOME_POSITION" not in nowhere.seen
    assert nowhere.seen["SYS_STATUS"].onboard_control_sensors_health == 0x1000_0007


def setpoint(desk: Desk, frame: int, mask: int, *, place: tuple[float, ...], pace: tuple[float, ...]) -> bytes:
    rest = (*place, *pace, 0.0, 0.0, 0.0, 0.0, 0.0)
    return desk.pack(desk.mav.set_position_target_local_ned_encode(0, ROBOT, 1, frame, mask, *rest))


def test_a_velocity_to_north_and_east_is_driven_by_turning_there(
    ground: GroundStation, desk: Desk, clock: ManualClock
) -> None:
    north = setpoint(desk, 1, VELOCITY, place=(0.0, 0.0, 0.0), pace=(0.5, 0.0, 0.0))

    def driven(heading: float) -> tuple[float, ...]:
        ground.tell({"x": 0.0, "y": 0.0, "heading": heading}, stopped=False)
        desk.waiting.append(desk.mav and setpoint(desk, 1, VELOCITY, place=(0.0, 0.0, 0.0), pace=(0.5, 0.0, 0.0)))
        return next((each.values for each in ground.requests()), ())

    ground.tell({}, stopped=False)
    desk.waiting.append(north)
    assert ground.requests() == []
    assert desk.seen["STATUSTEXT"].text == "it does not know its heading"
    assert driven(0.0) == pytest.approx((0.0, 2.0)), "to its left, as fast as it may"
    assert driven(pi) == pytest.approx((0.0, -2.0)), "to its right"
    assert driven(pi / 2.0 - 0.1) == pytest.approx((0.5, 0.2), abs=0.01)
    clock.advance(1.1 * QUIET)
    assert ground.requests() == [PilotRequest("drive", (0.0, 0.0))], "nobody goes on driving it"
    assert ground.complaints() == ["the ground station no longer drives it: it comes to rest"]
    assert ground.complaints() == []


@pytest.mark.parametrize(
    ("frame", "mask", "pace", "said"),
    [
        (8, VELOCITY, (0.1, 0.2, 0.0), "it moves along its heading only"),
        (8, VELOCITY, (0.1, 0.0, -0.2), "it moves along its heading only"),
        (1, VELOCITY, (0.1, 0.0, -0.2), "it has no velocity up or down"),
        (12, VELOCITY, (0.1, 0.0, 0.0), "it takes no setpoints in frame 12"),
        (1, 0xFFF, (0.1, 0.0, 0.0), "it takes setpoints with a place or a velocity"),
        (1, VELOCITY, (nan, 0.1, 0.0), "it takes velocities that are numbers"),
        (1, VELOCITY, (0.1, 0.1, nan), "it has no velocity up or down"),
        (8, VELOCITY, (inf, 0.0, 0.0), "it takes velocities that are numbers"),
        (9, VELOCITY, (0.1, nan, 0.0), "it moves along its heading only"),
    ],
)
def test_a_setpoint_that_it_cannot_follow_is_refused_with_a_text_and_ends_the_one_before(
    ground: GroundStation, desk: Desk, frame: int, mask: int, pace: tuple[float, ...], said: str
) -> None:
    ground.tell({"x": 0.0, "y": 0.0, "heading": 0.0}, stopped=False)
    desk.waiting.append(desk.velocity(0.5, 0.0))
    ground.requests()
    desk.waiting += [setpoint(desk, frame, mask, place=(1.0, 1.0, 0.0), pace=pace)] * 1
    assert ground.requests() == [PilotRequest("drive", (0.0, 0.0))]
    assert desk.seen.pop("STATUSTEXT").text == said
    desk.waiting.append(setpoint(desk, frame, mask, place=(1.0, 1.0, 0.0), pace=pace))
    ground.requests()
    assert "STATUSTEXT" not in desk.seen, "it is not said twenty times a second"


@pytest.mark.parametrize(
    ("here", "frame", "place", "said"),
    [
        ({"x": 0.0, "y": 0.0}, 1, (nan, 1.0, 0.0), "there is no such place here"),
        ({"x": 0.0, "y": 0.0}, 7, (1e9, 1.0, 0.0), "there is no such place here"),
        ({"x": 0.0, "y": 0.0}, 8, (1.0, 1.0, 0.0), "it does not know its heading"),
        ({"heading": 0.0}, 7, (1.0, 1.0, 0.0), "it does not know where it is"),
    ],
)
def test_a_place_that_it_cannot_find_is_refused_with_a_text(
    ground: GroundStation, desk: Desk, here: dict[str, float], frame: int, place: tuple[float, ...], said: str
) -> None:
    ground.tell(here, stopped=False)
    desk.waiting.append(setpoint(desk, frame, PLACE, place=place, pace=(0.0, 0.0, 0.0)))
    assert ground.requests() == []
    assert desk.seen["STATUSTEXT"].text == said


def test_a_mode_that_it_has_not_got_is_refused_with_a_text_however_it_is_asked_for(
    ground: GroundStation, desk: Desk
) -> None:
    desk.waiting.append(desk.pack(desk.mav.set_mode_encode(ROBOT, 1, 11)))
    assert ground.requests() == []
    assert desk.seen["STATUSTEXT"].text == "it has no such mode, only HOLD, LOITER and GUIDED"


@pytest.mark.parametrize("frame", [0, 3, 5, 6, 10, 11])
def test_places_on_the_earth_have_a_height_in_every_frame(ground: GroundStation, desk: Desk, frame: int) -> None:
    there = (366_003_604, -1_218_996_646, 12.5)
    desk.waiting.append(desk.pack(desk.mav.command_int_encode(ROBOT, 1, frame, 192, 0, 0, -1, 1, 0, 0, *there)))
    (request,) = ground.requests()
    assert request.values == pytest.approx((30.0, 40.0, 12.5), abs=0.5)


def test_a_place_in_another_frame_or_without_an_origin_is_refused_with_a_text(
    ground: GroundStation, desk: Desk, clock: ManualClock
) -> None:
    """Metres are not taken for degrees."""
    desk.waiting.append(
        desk.pack(desk.mav.command_int_encode(ROBOT, 1, 1, 192, 0, 0, -1, 1, 0, 0, 300_000, 20_000, 0.0))
    )
    assert (ground.requests(), desk.seen["COMMAND_ACK"].result) == ([], 2)
    assert desk.seen["STATUSTEXT"].text == "it goes to no place in frame 1"
    other = Desk()
    lost = GroundStation(MavlinkConnection(other, ROBOT, 1, KEY), None, (1.0, 2.0), clock=clock)
    other.order(192, 0.0, 1.0, 0.0, 0.0, 36.6003604, -121.8996646)
    assert (lost.requests(), other.seen["COMMAND_ACK"].result) == ([], 2)
    assert other.seen["STATUSTEXT"].text == "it has no origin, so no place on the Earth"


def test_of_messages_with_one_timestamp_the_first_is_taken(ground: GroundStation, desk: Desk) -> None:
    """Programs of node-mavlink sign by whole milliseconds: what comes later in one looks like a repeat."""
    stamp = int((time.time() - 1_420_070_400) * 1e3) * 100
    for mode in (4.0, 15.0):
        order = desk.mav.command_long_encode(ROBOT, 1, 176, 0, 1.0, mode, *(0.0,) * 5)
        desk.mav.signing.timestamp = stamp
        desk.waiting.append(bytes(order.pack(desk.mav)))
    assert [each.type for each in ground.requests()] == ["stop"]
    (said,) = ground.complaints()
    assert "1 messages from the ground station were refused: their timestamps are old: they are repeated" in said


@pytest.mark.counterpart("pymavlink")
def test_one_whose_clock_is_ahead_is_named_and_makes_nobody_else_look_old(ground: GroundStation, desk: Desk) -> None:
    ahead = Desk()
    ahead.mav.srcSystem = 254
    ahead.mav.signing.timestamp = int((time.time() + 3_600.0 - 1_420_070_400) * 1e5)
    ahead.order(176, 1.0, 4.0)
    desk.waiting += ahead.waiting
    desk.order(176, 1.0, 15.0)
    assert [each.type for each in ground.requests()] == ["stop", "release"], "both are heard"
    (said,) = ground.complaints()
    assert said.startswith("the clock of the ground station (system 254) is 1 h ahead of ours")
    desk.waiting += ahead.waiting
    ground.requests()
    assert ground._link.complaints("the ground station") == [
        "1 messages from the ground station were refused: their timestamps are old: they are repeated, or the clock of "
        "the ground station is behind ours by more than a minute (system 254)"
    ]


def test_two_ground_stations_are_both_answered() -> None:
    """Whoever of them has spoken last."""
    with closing(UdpWire("127.0.0.1", 0, listening=True)) as end, ExitStack() as stack:
        link = MavlinkConnection(end, ROBOT, 1, None)
        ground = GroundStation(link, None, (1.0, 2.0))
        lines = [stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(2)]
        desks = [Desk(None), Desk(None)]
        for number, (each, line) in enumerate(zip(desks, lines, strict=True)):
            line.settimeout(PATIENCE)
            each.mav.srcSystem = 254 + number
            each.order(176, 1.0, 4.0)
            line.sendto(each.waiting.pop(), ("127.0.0.1", end.port))
        found: list[PilotRequest] = []
        while len(found) < 2:
            found += ground.requests()
        for each, line in zip(desks, lines, strict=True):
            acks: set[int] = set()
            while each.mav.srcSystem not in acks:
                each.look(line.recv(2048))
                if "COMMAND_ACK" in each.seen:
                    acks.add(each.seen["COMMAND_ACK"].target_system)


def test_who_is_silent_is_not_sent_to_for_ever_but_the_last_one_is(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr("sleepcast.bridges.mavlink.link.monotonic", lambda: now[0])
    with closing(UdpWire("127.0.0.1", 0, listening=True)) as end:
        for number in range(MAX_PEERS + 3):
            end.answer(("127.0.0.1", 1000 + number))
        assert [port for _, port in end.peers] == [1003 + each for each in range(MAX_PEERS)]
        now[0] = GONE + 1.0
        end.answer(("127.0.0.1", 1005))
        assert end.peers == [("127.0.0.1", 1005)]


# ---- a node with a body in the simulator


@pytest.fixture
def wire() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind(("127.0.0.1", 0))
        found.settimeout(0.05)
        yield found


def test_a_simulated_robot_is_stopped_released_and_driven_from_a_ground_station(
    wire: socket.socket, desk: Desk, tmp_path: Path
) -> None:
    (tmp_path / "key").write_text("fleet key")
    uri = f"mavlink://127.0.0.1:{wire.getsockname()[1]}?key={tmp_path / 'key'}"
    store = str(tmp_path / "store")
    command = ("node", "--name", "r7", "--body", "sim:maze", "--store", store, "--ground-station", uri)

    def start() -> subprocess.Popen[bytes]:
        with (tmp_path / "screen").open("a") as screen:
            return forkserver.Popen(
                [sys.executable, "-m", "sleepcast", *command],
                stdin=subprocess.DEVNULL,
                stdout=screen,
                stderr=subprocess.STDOUT,
            )

    def until(true: Callable[[dict[str, Any]], bool], message: Callable[[], bytes]) -> None:
        end, peer, again = time.monotonic() + PATIENCE, None, 0.0
        while not true(desk.seen):
            assert time.monotonic() < end, (tmp_path / "screen").read_text()
            try:
                data, peer = wire.recvfrom(2048)
            except TimeoutError:
                continue
            desk.look(data)
            if time.monotonic() > again:
                again = time.monotonic() + 0.2
                wire.sendto(message(), peer)

    def mode(number: int) -> bytes:
        return desk.pack(desk.mav.command_long_encode(ROBOT, 1, 176, 0, 1.0, number, 0, 0, 0, 0, 0))

    def arm() -> bytes:
        return desk.pack(desk.mav.command_long_encode(ROBOT, 1, 400, 0, 1.0, 0, 0, 0, 0, 0, 0))

    def free(seen: dict[str, Any]) -> bool:
        return "HEARTBEAT" in seen and bool(seen["HEARTBEAT"].base_mode & 128)

    def speed(seen: dict[str, Any]) -> float:
        found = seen["LOCAL_POSITION_NED"]
        return float((found.vx**2 + found.vy**2) ** 0.5)

    node = start()
    try:
        until(lambda seen: "HEARTBEAT" in seen and seen["HEARTBEAT"].custom_mode == 4, lambda: mode(4))
        until(lambda seen: seen["HEARTBEAT"].custom_mode == 15, lambda: mode(15))
        until(lambda seen: speed(seen) > 0.2, lambda: desk.velocity(0.4, 0.0))
        until(lambda seen: seen["HEARTBEAT"].custom_mode == 4 and speed(seen) == 0.0, lambda: mode(4))
        node.kill()
        node.wait(PATIENCE)
        node = start()
        desk.seen.clear()
        until(
            lambda seen: {"COMMAND_ACK", "HEARTBEAT"} <= seen.keys() and seen["HEARTBEAT"].custom_mode == 15,
            lambda: mode(15),
        )
        assert not free(desk.seen), "it may have been disarmed before the restart"
        until(free, arm)
    finally:
        os.kill(node.pid, signal.SIGINT)
        assert node.wait(PATIENCE) == 130
    printed = (tmp_path / "screen").read_text()
    assert "stopped, and at rest until RELEASE" in printed
    assert "released, and free to be moved again" in printed


def test_a_message_comes_as_often_as_the_ground_station_asks(
    ground: GroundStation, desk: Desk, clock: ManualClock
) -> None:
    def told(seconds: float) -> Counter[str]:
        """How often each came."""
        counts: Counter[str] = Counter()
        for _ in range(round(seconds / 0.1)):
            desk.seen.clear()
            ground.tell({"x": 1.0, "y": 2.0, "heading": 0.0}, stopped=False)
            counts.update(desk.seen.keys())
            clock.advance(0.1001)
        return counts

    def every(number: int, interval: float) -> int:
        desk.order(511, number, interval)
        assert ground.requests() == []
        return int(desk.seen["COMMAND_ACK"].result)

    usual = told(4.0)
    assert (usual["GLOBAL_POSITION_INT"], usual["VFR_HUD"], usual["HEARTBEAT"], usual["BATTERY_STATUS"]) == (
        20,
        20,
        4,
        4,
    )
    assert [every(33, 1e5), every(30, -1.0), every(1, 2e6)] == [0, 0, 0]
    changed = told(4.0)
    assert (changed["GLOBAL_POSITION_INT"], changed["ATTITUDE"], changed["SYS_STATUS"]) == (40, 0, 2)
    assert (changed["VFR_HUD"], changed["HOME_POSITION"]) == (20, 4), "as before"
    assert [every(33, 0.0), every(30, 0.0)] == [0, 0]
    again = told(4.0)
    assert (again["GLOBAL_POSITION_INT"], again["ATTITUDE"]) == (20, 20)
    assert [every(0, -1.0), every(33, nan), every(26, 1e5)] == [2, 2, 3], "heartbeats stay, others there are not"
    assert told(1.0)["HEARTBEAT"] == 1


def test_what_is_asked_for_by_name_or_by_number(ground: GroundStation, desk: Desk) -> None:
    for name, index, answered in ((b"SYSID_THISMAV", -1, True), (b"", 0, True), (b"SYSID_MYGCS", -1, False)):
        desk.seen.clear()
        desk.waiting.append(desk.pack(desk.mav.param_request_read_encode(ROBOT, 1, name, index)))
        assert ground.requests() == []
        assert ("PARAM_VALUE" in desk.seen) is answered
    desk.waiting.append(desk.pack(desk.mav.param_set_encode(ROBOT, 1, b"SYSID_THISMAV", 9.0, 9)))
    ground.requests()
    assert desk.seen["PARAM_VALUE"].param_value == ROBOT, "as it was"
    ground.tell({"x": 1.0, "y": 2.0, "heading": 0.0}, stopped=False)
    desk.seen.clear()
    desk.order(512, 33)
    ground.requests()
    ground.tell({"x": 1.0, "y": 2.0, "heading": 0.0}, stopped=False)
    assert (desk.seen["COMMAND_ACK"].result, desk.seen.keys()) == (0, {"COMMAND_ACK", "GLOBAL_POSITION_INT"})


def test_there_are_no_missions_and_none_is_taken(ground: GroundStation, desk: Desk) -> None:
    """A ground station that is not answered asks again, and then says that it has failed."""
    for kind in (0, 1, 2):  # missions, fences, rally points
        desk.waiting.append(desk.pack(desk.mav.mission_request_list_encode(ROBOT, 1, kind)))
        ground.requests()
        assert (desk.seen["MISSION_COUNT"].count, desk.seen["MISSION_COUNT"].mission_type) == (0, kind)
        for message, result in (
            (desk.mav.mission_count_encode(ROBOT, 1, 3, kind), 14),
            (desk.mav.mission_count_encode(ROBOT, 1, 0, kind), 0),
            (desk.mav.mission_clear_all_encode(ROBOT, 1, kind), 0),
        ):
            desk.waiting.append(desk.pack(message))
            assert ground.requests() == []
            assert (desk.seen["MISSION_ACK"].type, desk.seen["MISSION_ACK"].mission_type) == (result, kind)
    assert desk.seen["STATUSTEXT"].text == "it takes no missions"


@pytest.mark.counterpart("pymavlink")
def test_a_script_of_pymavlink_that_asks_where_it_is_gets_an_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """It waits for VFR_HUD, for as long as that takes."""
    monkeypatch.setenv("MAVLINK20", "1")  # which it would set itself
    port = free_port()
    script = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
    ground = open_ground_station(f"mavlink://127.0.0.1:{port}?unsigned=yes&origin=36.6,-121.9", ROBOT, (1.0, 1.0))
    places: list[Any] = []
    asking = Thread(target=lambda: places.append(script.location()), daemon=True)
    asking.start()
    end = time.monotonic() + PATIENCE
    while asking.is_alive() and time.monotonic() < end:
        ground.tell({"x": 30.0, "y": 40.0, "heading": 0.0, "height": 2.0}, stopped=False)
        time.sleep(0.02)
    ground.close()
    (place,) = places
    assert (place.lat, place.lng) == pytest.approx((36.60036, -121.899665), abs=2e-6)
    assert (place.alt, place.heading) == (2.0, 90)
    script.close()
