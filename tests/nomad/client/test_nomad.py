"""The Python client against the real server; against servers that are none, what it says."""

from __future__ import annotations

import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import isclose, pi
from threading import Thread

import pytest

from nomad.serving import LONGEST, Served, serving
from sleepcast.core.errors import MisuseError
from sleepcast.nomad.client.nclient import State
from sleepcast.nomad.client.nomad import LAYERS, Kind, LostError, Nomad, Pose, RefusedError, RequestError
from sleepcast.nomad.world.building import nomad_world
from sleepcast.nomad.world.nomad_world import NomadWorld

INCH = 0.0254
SQUARE = [(1.016, 0.0), (2.032, 0.0), (2.032, 1.016)]


@pytest.fixture
def world() -> NomadWorld:
    return nomad_world(None, "ideal", 2, 1)


@pytest.fixture
def served(world: NomadWorld) -> Iterator[Served]:
    with serving(world, lockstep=True, headless=True) as found:
        yield found


@pytest.fixture
def nomad(served: Served) -> Iterator[Nomad]:
    with Nomad.connect("127.0.0.1", served.port) as found:
        yield found


def later(nomad: Nomad, ticks: int = 25) -> State:
    """The state when so many ticks have passed."""
    return [nomad.gs() for _ in range(ticks)][-1]


def test_short_names_speak_tenths_of_inches_and_readable_ones_si(nomad: Nomad) -> None:
    nomad.vm(75, 50)
    assert later(nomad).velocities == (75, 50, 0)
    nomad.drive(0.254, -0.127)
    state = later(nomad)
    assert state.velocities == (100, -50, 0)
    assert (state.right_speed, state.left_speed) == pytest.approx((0.254, -0.127))
    assert state.moving == (True, True, False)
    nomad.st()
    assert later(nomad).velocities == (0, 0, 0)


def test_a_state_has_words_and_si(nomad: Nomad, world: NomadWorld) -> None:
    nomad.place_robot(-100, -200, 2700, 0)
    state = nomad.gs()
    assert state is nomad.state
    assert len(state.words) == 45
    assert state.words[34:38] == (-100, -200, 2700, 2700)
    assert (state.x, state.y, state.heading) == pytest.approx((-0.254, -0.508, -pi / 2))
    state = later(nomad, 50)
    assert set(state.sonar_inches[:4]) == {255}
    assert state.sonars == pytest.approx([inches * INCH for inches in state.sonar_inches])
    assert state.infrared == (15,) * 16
    assert state.bumper == 0
    assert state.time == pytest.approx(world.time)
    assert state.batteries == (255, 255)
    assert (state.computer_volts, state.motor_volts) == pytest.approx((12.0, 12.85))


def test_a_way_has_an_end(nomad: Nomad) -> None:
    nomad.cruise(1.0, 1.0)
    nomad.travel(0.508, 0.508)
    state = nomad.wait_until_still(20)
    assert state.x == pytest.approx(0.508, abs=0.003)
    assert nomad.pr(-200, -200).moving == (True, True, False)
    assert nomad.ws(True, True).words[34] == pytest.approx(0, abs=1)
    nomad.mv((1, 30), (0, 999))
    assert later(nomad).velocities == (30, 0, 0)
    assert nomad.zero().words[34:38] == (0, 0, 0, 0)


def test_what_is_believed_is_not_what_is(nomad: Nomad) -> None:
    nomad.dp(70, -7)
    assert nomad.da(900, 900).words[34:37] == (70, -7, 900)
    nomad.believe_place(1.0, 2.0)
    assert nomad.believe_heading(-pi / 2, 0.0).words[34:37] == (394, 787, 2700)


def test_sensors_can_be_asked_for_alone(nomad: Nomad) -> None:
    before = nomad.state.clock
    assert nomad.get_sn().sonar_inches[4] == 255
    assert nomad.state.clock > before
    assert nomad.get_ir().infrared == (15,) * 16
    assert nomad.get_bp().bumper == 0
    nomad.vm(10, 20)
    later(nomad)
    assert nomad.get_rv().velocities == (10, 20, 0)
    assert nomad.get_rc().words[34] == nomad.state.words[34]
    assert len(nomad.get_ra()) == 3
    assert nomad.get_ls().laser == nomad.get_sg().laser == ()
    assert nomad.get_cp().compass == 0.0


def test_records_of_where_sensors_measured_come_when_they_are_wanted(nomad: Nomad) -> None:
    nomad.place_robot(10, 20, 300, 0)
    nomad.mask[0] = 2
    stamps = nomad.ct().stamps
    assert list(stamps) == ["sonar"]
    assert len(stamps["sonar"]) == 16
    assert nomad.get_sn().stamps["sonar"][0].clock <= nomad.state.clock
    nomad.mask[0] = 31
    assert [len(records) for records in nomad.ct().stamps.values()] == [16, 16, 1, 1, 1]
    nomad.init_mask()
    assert nomad.ct().stamps == {}


def test_what_is_masked_out_stays_as_it_was(nomad: Nomad) -> None:
    nomad.mask[34] = 0
    before = nomad.ct().words[34]
    nomad.place_robot(500, 0, 0, 0)
    assert nomad.gs().words[34] == before


def test_sonars_are_set_up(nomad: Nomad, world: NomadWorld) -> None:
    ring = world.simulator.bodies.rings_of(0)
    assert ring is not None
    nomad.conf_sn(6, (0, 2, 15))
    assert ring.firing.order[0, : ring.firing.length[0]].tolist() == [0, 2, 15]
    assert ring.firing.pause[0] == pytest.approx(0.024)
    nomad.fire_sonars(0.06, ())
    assert (ring.firing.length[0], ring.firing.pause[0]) == (0, pytest.approx(0.06))
    for call in (nomad.conf_ir, nomad.conf_sn):
        with pytest.raises(MisuseError, match="at most 16 sensors"):
            call(1, range(17))
    assert nomad.conf_cp(0).words[43] == nomad.conf_ls(51, 20, 20, 20, 1).laser_numbers - 2 == 0
    assert nomad.conf_sg(1, 2, 3).clock > 0
    assert nomad.stop_after(1).clock > 0


def test_the_world_is_changed_and_asked_about(nomad: Nomad, world: NomadWorld) -> None:
    empty = len(world.solids())
    nomad.put_up(SQUARE)
    assert len(world.solids()) == empty + 1
    infrared, sonars = nomad.predict(Pose(0.0, 0.0))
    assert (sonars[0], len(infrared)) == (pytest.approx(1.016 - 0.17, abs=INCH), 16)
    assert nomad.touches_along((0.0, 0.0), (0.5, 0.0)) is None
    met = nomad.touches_along((0.0, 0.0), (2.0, 0.0))
    assert met is not None
    assert met[:3] == pytest.approx((1.016 - 0.17, 0.0, pi), abs=1e-3)
    assert nomad.touches_round((0.0, 0.0), 0.5, 0.0, 1.0) is None
    assert nomad.shift(SQUARE, 1.016, 0.0)[0] == pytest.approx((2.032, 0.0))
    nomad.take_away([(x + 1.016, y) for x, y in SQUARE])
    assert len(world.solids()) == empty
    nomad.add_obstacle([(1000, 1000), (1100, 1000), (1100, 1100)])
    nomad.clear_world()
    assert len(world.solids()) == empty
    for wrong in ([(0, 0), (1, 1)], [(0, 0)] * 11):
        with pytest.raises(MisuseError, match="3 to 10 corners"):
            nomad.add_obstacle(wrong)
    with pytest.raises(MisuseError, match="the 7 of an arc"):
        nomad.motion_check(2, 1.0)


def test_windows_are_drawn_into_and_erased(nomad: Nomad, served: Served) -> None:
    nomad.sketch_line((0.0, 0.0), (1.0, 1.0), 4)
    nomad.sketch_robot(Pose(1.0, 2.0))
    nomad.sketch_arc((0.0, 1.0), (1.0, 1.0), 0.0, pi)
    assert [sketch.kind for sketch in served.nserver.windows.sketches] == ["line", "robot", "arc"]
    for layer in LAYERS:
        nomad.erase(layer)
    assert all(served.nserver.windows.robots[0].erased.values())
    with pytest.raises(MisuseError, match="did you mean sonar_sensor"):
        nomad.erase("sonar_sensors")


@pytest.mark.parametrize("text", ["", "Ouch.", "ten inches", "x" * 900, "caf\u00e9"])
def test_a_text_is_said(nomad: Nomad, served: Served, text: str) -> None:
    nomad.say(text)
    assert served.nserver.windows.robots[0].said[-1][1] == text


def test_other_requests(nomad: Nomad) -> None:
    assert nomad.get_robot_conf(5.0) == nomad.state.words[34:38]
    assert nomad.ask_for_pose().heading == nomad.state.heading
    assert len(nomad.get_rpx()) == 2
    nomad.simulated_robot()
    with pytest.raises(RequestError, match="quit_server"):
        nomad.quit_server()  # which is not permitted here
    nomad.lp()
    nomad.accelerate(1.0, 1.0)
    assert nomad.gs().clock > 0


def test_a_refused_request_says_which_and_the_connection_goes_on(nomad: Nomad) -> None:
    with pytest.raises(RequestError, match="refused special_request with error") as refused:
        nomad.special_request(1, 99, b"\1\2")  # a packet that nobody understands
    assert nomad.state.words[44] == refused.value.code != 0
    assert nomad.gs().words[44] == 0
    with pytest.raises(MisuseError, match="whole numbers"):
        nomad.vm(7.5, 0)  # type: ignore[arg-type]
    with pytest.raises(MisuseError, match="modes 0 to 5"):
        nomad.mv((6, 1), (0, 0))
    nomad.mask.append(1)
    with pytest.raises(MisuseError, match="44 entries"):
        nomad.ct()


def test_a_robot_that_there_is_not(served: Served) -> None:
    with pytest.raises(RefusedError, match="has no robot 9; they are numbered from 1"):
        Nomad.connect("127.0.0.1", served.port, robot=9)


def test_a_connection_can_go_over_to_another_robot(nomad: Nomad, world: NomadWorld) -> None:
    nomad.connect_robot(2)
    nomad.vm(10, -10)
    later(nomad)
    assert [world.observe(robot).speeds.first for robot in (0, 1)] == pytest.approx([0.0, 0.0254])


def test_leaving_brings_the_robot_to_rest(served: Served, world: NomadWorld) -> None:
    nomad = Nomad.connect("127.0.0.1", served.port)
    with pytest.raises(ZeroDivisionError), nomad:
        raise ZeroDivisionError(nomad.drive(0.3, 0.3))
    with Nomad.connect("127.0.0.1", served.port, robot=2) as other:
        later(other, 50)  # in which time passes for the first one, too
    assert world.observe(0).speeds[:2] == (0.0, 0.0)
    with pytest.raises(LostError, match="has been closed; connect anew"):
        nomad.gs()


def test_after_a_wait_that_was_broken_off_the_replies_still_belong_to_their_requests(
    nomad: Nomad, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(type(nomad.connection), "_read_on", interrupted)
        with pytest.raises(KeyboardInterrupt):
            nomad.get_rv()
    assert len(nomad.gs().words) == 45


# ---- servers that are none


@contextmanager
def impostor(play: Callable[[socket.socket], object]) -> Iterator[int]:
    """A server that does with its first client what it likes."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            with listener.accept()[0] as client:
                client.settimeout(LONGEST)
                play(client)

        thread = Thread(target=serve)
        thread.start()
        try:
            yield listener.getsockname()[1]
        finally:
            thread.join(LONGEST)


def reply(kind: int, *words: int) -> bytes:
    return struct.pack(f">hH{len(words)}i", kind, len(words), *words)


ACCEPTED = reply(102, 7019)
STRANGE = {
    "too few words": (reply(80, *(0,) * 48), "has 48 words where at least 49 belong"),
    "no words": (reply(80), "has 0 words where at least 45 belong"),
    "a scan without end": (reply(80, *(0,) * 45, 2_000_000_000, 0, 0, 0), "a scan has 2000000000 points"),
    "more than anybody needs": (struct.pack(">hH", 80, 65535) + bytes(4 * 65535), "answered with 65535 words"),
    "more than was asked for": (reply(80, *(0,) * 49) * 2, "said more than it was asked for"),
    "half a reply": (reply(80, *(0,) * 49)[:-1], "has closed the connection"),
    "nothing": (b"", "has closed the connection"),
}


@pytest.mark.parametrize("said", STRANGE)
def test_a_server_that_says_what_cannot_be(said: str) -> None:
    answer, error = STRANGE[said]

    def play(client: socket.socket) -> None:
        client.recv(12)
        client.sendall(ACCEPTED)
        client.recv(32)
        client.sendall(answer)

    with impostor(play) as port, pytest.raises(LostError, match=error):
        Nomad.connect("127.0.0.1", port)


def test_a_server_that_says_nothing(served: Served) -> None:
    silent = impostor(lambda client: client.recv(64) and client.recv(64))
    with silent as port, pytest.raises(LostError, match=r"did not answer within 0\.2 s"):
        Nomad.connect("127.0.0.1", port, timeout=0.2)


def test_nobody_there() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with pytest.raises(LostError, match=f"no server listens at 127.0.0.1:{port}; start one with: sleepcast nserver"):
        Nomad.connect("127.0.0.1", port)
    with pytest.raises(LostError, match="there is no host of the name"):
        Nomad.connect("a" * 70)


def test_every_request_of_the_table_can_be_sent() -> None:
    done = {name for name in dir(Nomad) if not name.startswith("_")}
    names = {kind.name.lower() for kind in Kind if not kind.name.startswith("REFRESH")}
    assert names <= done
    assert isclose(len(LAYERS), 10)
