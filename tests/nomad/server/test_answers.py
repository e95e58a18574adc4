"""Every request of the wire, and what comes of it."""

from __future__ import annotations

from math import pi

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nomad.programs import EVERYTHING, Bench, Program, bench
from sleepcast.nomad.server.answers import answer
from sleepcast.nomad.wire.encoding import HEADER, Layout, decode, encode_request
from sleepcast.nomad.wire.requests import SHAPES, RequestType
from sleepcast.nomad.wire.units import INCH, TENTH
from sleepcast.nomad.world.building import nomad_world

FULL_ORDER = tuple(range(16))
SQUARE = (4, 500, 500, 900, 500, 900, 900, 500, 900)
"""A polygon of the wire, a metre square."""


@pytest.fixture
def made() -> Bench:
    return bench(2)


@pytest.fixture
def program(made: Bench) -> Program:
    return made.program()


def pass_time(made: Bench, seconds: float) -> None:
    until = made.world.time + seconds
    while made.world.time < until - 1e-9:
        made.nserver.step()


# ---- moving


def test_vm_turns_the_right_wheel_and_the_left(made: Bench, program: Program) -> None:
    program.state(RequestType.VM, 40, -40, 0)
    pass_time(made, 2.0)
    state = program.state(RequestType.GS)
    assert tuple(state[38:42]) == (40, -40, 0, 0b011)
    assert tuple(state[34:36]) == (0, 0)
    assert state[36] == state[37] == pytest.approx(675, abs=12)  # 33.7 degrees a second, less the start


def test_pr_goes_a_way_and_ws_waits_for_it(made: Bench, program: Program) -> None:
    program.state(RequestType.SP, 100, 100, 0)
    state = program.state(RequestType.PR, 250, 250, 0)
    assert state[41] == 0b011
    assert (program.state(RequestType.WS, 1, 1, 0, 1)[34], made.world.time) == (
        pytest.approx(95, abs=5),
        pytest.approx(1.0),
    )
    state = program.state(RequestType.WS, 1, 1, 0, 0)
    assert (state[34], state[41]) == (pytest.approx(250, abs=1), 0)
    began = made.world.time
    program.state(RequestType.WS, 1, 1, 1, 20)
    assert made.world.time == began


def test_st_stops_and_lp_lets_go(made: Bench, program: Program) -> None:
    for kind in (RequestType.ST, RequestType.LP):
        program.state(RequestType.VM, 100, 100, 0)
        pass_time(made, 1.0)
        program.state(kind)
        pass_time(made, 5.0)
        assert tuple(program.state(RequestType.GS)[38:42]) == (0, 0, 0, 0)


def test_mv_moves_each_axis_in_its_own_way(made: Bench, program: Program) -> None:
    program.state(RequestType.MV, 5, 50, 5, 50, 0, 0)  # speed of ways
    program.state(RequestType.MV, 2, 100, 1, -30, 0, 0)
    pass_time(made, 1.0)
    assert tuple(program.state(RequestType.GS)[38:40]) == (50, -30)
    pass_time(made, 2.0)
    assert tuple(program.state(RequestType.GS)[38:40]) == (0, -30)
    program.state(RequestType.MV, 0, 0, 3, 0, 0, 0)
    pass_time(made, 5.0)
    assert program.state(RequestType.GS)[39] == 0
    program.state(RequestType.MV, 4, 10, 4, 10, 0, 0)  # a tenth of what vm wants, in a second
    program.state(RequestType.VM, 100, 100, 0)
    pass_time(made, 1.0)
    assert program.state(RequestType.GS)[38] == pytest.approx(10, abs=1)


def test_ac_is_told_by_get_ra_and_ignores_what_is_not_more_than_0(program: Program) -> None:
    program.state(RequestType.AC, 300, 0, -5)
    assert program.ask(RequestType.GET_RA) == (90, (300, 0, -5))


def test_zr_brings_the_robot_home_and_takes_its_time(made: Bench, program: Program) -> None:
    program.ask(RequestType.PLACE_ROBOT, 1000, -1000, 900, 0)
    program.state(RequestType.VM, 200, 200, 0)
    pass_time(made, 1.0)
    began = made.world.time
    assert tuple(program.state(RequestType.ZR)[34:38]) == (0, 0, 0, 0)
    assert made.world.time > began
    assert made.world.observe(0).real[:2] == pytest.approx((0.0, 0.0))


def test_another_command_ends_zeroing(made: Bench, program: Program) -> None:
    program.ask(RequestType.PLACE_ROBOT, 1000, -1000, 900, 0)
    program.state(RequestType.VM, 300, 300, 0)
    pass_time(made, 1.0)
    assert program.send(encode_request(Layout.FOUR, RequestType.ZR)) is None
    made.program().state(RequestType.VM, 100, 100, 0)
    made.nserver.step()
    assert program.wait is not None
    assert program.wait.ready() is not None
    assert made.world.observe(0).speeds.first > 0.0


def test_dp_and_da_change_what_is_believed_and_place_robot_both(made: Bench, program: Program) -> None:
    program.state(RequestType.DP, 300, -400)
    assert tuple(program.state(RequestType.DA, 900, 100)[34:38]) == (300, -400, 900, 900)
    assert made.world.observe(0).real[:3] == pytest.approx((0.0, 0.0, 0.0))
    assert program.ask(RequestType.PLACE_ROBOT, -100, -200, 900, 450) == (82, ())
    seen = made.world.observe(0)
    assert seen.real == seen.believed == pytest.approx((-100 * TENTH, -200 * TENTH, pi / 2, pi / 2))


def test_conf_tm_stops_a_robot_that_nobody_asks(made: Bench, program: Program) -> None:
    program.state(RequestType.CONF_TM, 1)
    program.state(RequestType.VM, 50, -50, 0)
    for _ in range(5):
        pass_time(made, 0.9)
        assert program.ask(RequestType.GET_RV)[1][0] == 50  # any request keeps it going
    pass_time(made, 2.0)
    assert program.state(RequestType.GS)[38] == 0
    program.state(RequestType.PR, 1000, -1000, 0)
    program.state(RequestType.WS, 1, 1, 1, 20)  # a long way is broken off as well
    assert program.state(RequestType.GS)[41] == 0
    program.state(RequestType.CONF_TM, 0)
    program.state(RequestType.VM, 50, -50, 0)
    pass_time(made, 5.0)
    assert program.state(RequestType.GS)[38] == 50


def test_a_robot_goes_on_without_its_program_until_the_timeout(made: Bench, program: Program) -> None:
    program.state(RequestType.CONF_TM, 2)
    program.state(RequestType.VM, 50, 50, 0)
    program.send(encode_request(Layout.FOUR, RequestType.DISCONNECT_ROBOT, (1, 1)))
    pass_time(made, 1.5)
    assert made.world.observe(0).speeds.first > 0.1
    pass_time(made, 2.0)
    assert made.world.observe(0).speeds.first == 0.0


def test_a_nomad_200_steers_and_turns_its_turret() -> None:
    made = bench(1, "nomad200")
    program = made.program()
    program.state(RequestType.VM, 50, 0, 300)
    pass_time(made, 3.0)
    state = program.state(RequestType.GS)
    assert tuple(state[38:42]) == (50, 0, 300, 0b101)
    assert (state[36], state[37] > 300, state[34] > 50) == (0, True, True)
    assert all(0 <= reading <= 15 for reading in state[1:17])
    program.state(RequestType.CONF_CP, 1)
    assert program.state(RequestType.GS)[43] == program.state(RequestType.GS)[37]
    assert tuple(program.state(RequestType.DA, 1800, 450)[36:38]) == (1800, 450)


# ---- sensing


def test_sonars_tell_inches_in_the_order_that_was_asked_for(made: Bench, program: Program) -> None:
    program.state(RequestType.CONF_SN, 1, *FULL_ORDER)
    assert program.ask(RequestType.ADD_OBSTACLE, 4, 200, -300, 300, -300, 300, 300, 200, 300) == (82, ())
    pass_time(made, 3.0)
    radius = made.world.radius(0) / INCH
    front = program.ask(RequestType.GET_SN)[1][0]
    assert front == pytest.approx(20 - radius, abs=1)
    program.state(RequestType.CONF_SN, 1, 8, -1, *FULL_ORDER[2:])
    assert program.ask(RequestType.DELETE_OBSTACLE, 4, 200, -300, 300, -300, 300, 300, 200, 300) == (82, ())
    pass_time(made, 3.0)
    assert program.ask(RequestType.GET_SN)[1][0] == front  # does not fire, and keeps what it read
    program.state(RequestType.CONF_SN, 1, 255, *FULL_ORDER[1:])
    pass_time(made, 1.0)
    assert program.ask(RequestType.GET_SN)[1][0] == front
    program.state(RequestType.CONF_SN, 1, *FULL_ORDER)
    pass_time(made, 3.0)
    assert program.ask(RequestType.GET_SN)[1][0] > front


def test_the_bumper_tells_where_it_is_pressed(made: Bench, program: Program) -> None:
    program.ask(RequestType.ADD_OBSTACLE, 4, 200, -300, 300, -300, 300, 300, 200, 300)
    program.state(RequestType.VM, 100, 100, 0)
    pass_time(made, 3.0)
    assert program.ask(RequestType.GET_BP) == (87, (1, round(made.world.time * 1000)))
    assert program.state(RequestType.GS)[33] == 1


@pytest.mark.parametrize(
    ("kind", "answered", "words"),
    [
        (RequestType.GET_IR, 83, 17),
        (RequestType.GET_SN, 84, 17),
        (RequestType.GET_RC, 88, 4),
        (RequestType.GET_RV, 89, 3),
        (RequestType.GET_RA, 90, 3),
        (RequestType.GET_CP, 86, 2),
        (RequestType.GET_LS, 85, 2),
        (RequestType.GET_SG, 85, 2),
        (RequestType.GET_BP, 87, 2),
    ],
)
def test_parts_of_the_state(program: Program, kind: int, answered: int, words: int) -> None:
    found, numbers = program.ask(kind)
    assert (found, len(numbers)) == (answered, words)


def test_posdata_comes_for_the_sensors_that_were_asked_for(made: Bench, program: Program) -> None:
    state = program.state(RequestType.CT, *EVERYTHING[:6], 31)
    assert len(state) == 364
    for bit, count in ((1, 16), (2, 16), (4, 1), (8, 1), (16, 1)):
        assert len(program.state(RequestType.CT, *EVERYTHING[:6], bit)) == 49 + 9 * count
    assert [len(program.ask(kind)[1]) for kind in (RequestType.GET_SN, RequestType.GET_CP)] == [17, 11]
    program.state(RequestType.CT, *EVERYTHING[:6], 2)
    program.state(RequestType.VM, 100, 100, 0)
    pass_time(made, 2.0)
    state = program.state(RequestType.GS)
    records = [state[46 + 9 * sonar : 55 + 9 * sonar] for sonar in range(16)]
    moved = [record for record in records if record[0] > 50]
    assert moved
    assert all(record[0] <= state[34] and record[7] == record[8] <= state[-3] for record in records)
    assert any(record[4:6] == (100, 100) for record in moved)


def test_what_is_masked_out_keeps_its_last_value(made: Bench, program: Program) -> None:
    other = made.program()
    program.ask(RequestType.PLACE_ROBOT, 100, 100, 0, 0)
    assert other.state(RequestType.GS) == program.state(RequestType.GS)
    pass_time(made, 0.1)
    other.ask(RequestType.PLACE_ROBOT, 200, 200, 0, 0)
    pass_time(made, 0.1)
    state = program.state(RequestType.CT, 255, 255, 255, 255, 0b11111101, 14, 0)  # without x
    assert (state[34], state[35]) == (100, 200)
    pass_time(made, 0.1)
    program.ask(RequestType.PLACE_ROBOT, 300, 300, 0, 0)
    state = program.state(RequestType.GS)
    assert (state[34], state[35]) == (100, 300)
    assert other.state(RequestType.GS)[34] == 300  # another client's mask is its own
    assert program.state(RequestType.CT, *EVERYTHING)[34] == 300


def test_the_positions_of_all_robots(made: Bench, program: Program) -> None:
    made.program(2).ask(RequestType.PLACE_ROBOT, 500, 600, 2700, 0)
    assert program.ask(RequestType.GET_RPX) == (76, (2, 0, 0, 0, 500, 600, 2700))


# ---- the world


def test_obstacles_come_and_go(made: Bench, program: Program) -> None:
    before = len(made.world.solids())
    assert program.ask(RequestType.ADD_OBSTACLE, *SQUARE) == (82, ())
    assert len(made.world.solids()) == before + 1
    shifted = (4, 510, 480, 910, 480, 910, 880, 510, 880)
    assert program.ask(RequestType.MOVE_OBSTACLE, *SQUARE, 10, -20) == (81, shifted)
    assert program.ask(RequestType.MOVE_OBSTACLE, *SQUARE, 10, -20) == (81, SQUARE)  # which is not there any more
    assert program.ask(RequestType.DELETE_OBSTACLE, *SQUARE)[0] == 91
    assert program.ask(RequestType.DELETE_OBSTACLE, *shifted) == (82, ())
    program.ask(RequestType.ADD_OBSTACLE, *SQUARE)
    assert program.ask(RequestType.NEW_WORLD) == (82, ())
    assert len(made.world.solids()) == before
    assert program.ask(RequestType.ADD_OBSTACLE, 4, *SQUARE[1:7])[0] == 91


def test_what_sensors_would_read_elsewhere(program: Program) -> None:
    program.ask(RequestType.ADD_OBSTACLE, *SQUARE)
    _, near = program.ask(RequestType.PREDICT_SENSORS, 200, 700, 0, 0)
    _, far = program.ask(RequestType.PREDICT_SENSORS, -3000, -3000, 0, 0)
    assert len(near) == len(far) == 45
    assert near[17] == pytest.approx(30 - 0.17 / INCH, abs=1)
    assert (far[17], near[44], near[1]) == (255, 0, 15)


def test_whether_a_way_is_free(program: Program) -> None:
    program.ask(RequestType.ADD_OBSTACLE, *SQUARE)
    junk = (7, 8, 9)
    assert program.ask(RequestType.MOTION_CHECK, 0, 0, 0, 30_000, 0, *junk) == (400, (0, 0, 0, 0))
    _, (hit, x, y, normal) = program.ask(RequestType.MOTION_CHECK, 0, 0, 70_000, 70_000, 70_000, *junk)
    assert (hit, y, normal) == (1, 70_000, pytest.approx(pi * 1e6, abs=1))
    assert x / 100 * TENTH == pytest.approx(500 * TENTH - 0.17, abs=1e-3)
    arc = (1, 0, 0, 0, round(pi / 2 * 1e6), 70_000, 0, 0)  # round the origin, through the square
    assert program.ask(RequestType.MOTION_CHECK, *arc)[1][0] == 1
    assert program.ask(RequestType.MOTION_CHECK, 2, *arc[1:])[0] == 91


# ---- the windows


def test_drawing_and_erasing(made: Bench, program: Program) -> None:
    assert program.ask(RequestType.DRAW_ROBOT, 100, 200, 900, 450, 1) == (82, ())
    program.ask(RequestType.DRAW_LINE, 0, 0, 100, 100, 2)
    program.ask(RequestType.DRAW_ARC, 0, 100, 200, 100, 0, 1800, 7)
    robot, line, arc = made.windows.sketches
    assert (robot.kind, robot.mode) == ("robot", 1)
    assert robot.numbers == pytest.approx((0.254, 0.508, pi / 2, pi / 4))
    assert (line.kind, line.numbers, line.mode) == ("line", pytest.approx((0, 0, 0.254, 0.254)), 2)
    assert (arc.kind, arc.numbers) == ("arc", pytest.approx((0, 0.254, 0.508, 0.254, 0, pi)))
    pass_time(made, 1.0)
    window = made.windows.robots[0]
    assert window.actual
    for kind in range(RequestType.REFRESH_ALL, RequestType.REFRESH_CLIENT_GRAPHICS + 1):
        assert program.ask(kind) == (82, ())
    assert not made.windows.sketches
    assert window.erased == dict.fromkeys(window.erased, 3) | {"graphics": 2}


@pytest.mark.parametrize("order", ["little", "big"])
def test_texts_in_both_byte_orders(order: str) -> None:
    made = bench(tk_order=order)
    sent = [b"Ouch", b".\0\x07\xff"]
    words = [int.from_bytes(four, order, signed=True) for four in sent]  # type: ignore[arg-type]
    assert made.program().ask(RequestType.TK, *words) == (82, ())
    assert list(made.windows.robots[0].said) == [(0.0, "Ouch.")]
    assert "robot 1 says: Ouch." in made.said


def test_a_text_cannot_command_the_terminal(made: Bench, program: Program) -> None:
    program.ask(RequestType.TK, int.from_bytes(b"\x1b[2J", "little"))
    assert "\x1b" not in made.said[-1]


def test_get_robot_conf_waits_for_a_click(made: Bench, program: Program) -> None:
    program.ask(RequestType.PLACE_ROBOT, 0, 0, 900, 0)
    assert program.send(encode_request(Layout.FOUR, RequestType.GET_ROBOT_CONF)) is None
    assert program.wait is not None
    assert made.windows.robots[0].waiting == 1
    pass_time(made, 1.0)
    assert program.wait.ready() is None
    program.session.click(1.0, -0.508)
    assert program.wait.ready() == encode_request(Layout.FOUR, 200, (394, -200, 900, 900))
    assert made.windows.robots[0].waiting == 0


def test_who_waits_for_a_click_and_goes_waits_no_more(made: Bench, program: Program) -> None:
    program.send(encode_request(Layout.FOUR, RequestType.GET_ROBOT_CONF))
    program.session.leave()
    assert made.windows.robots[0].waiting == 0


def test_get_robot_conf_without_windows_is_where_the_robot_believes_to_be() -> None:
    program = bench(headless=True).program()
    program.state(RequestType.DP, 77, 88)
    assert program.ask(RequestType.GET_ROBOT_CONF) == (200, (77, 88, 0, 0))


def test_windows_say_who_drives_and_what_was_asked(made: Bench, program: Program) -> None:
    window = made.windows.robots[0]
    assert window.client == "test (process 4711)"
    for _ in range(100):
        program.state(RequestType.ST)
        made.nserver.step()
    program.state(RequestType.VM, 10, 20, 0)
    assert [text for _, text in window.commands] == ["st()", "vm(10, 20, 0)"]
    program.session.leave()
    assert window.client == ""


# ---- user packets


@pytest.mark.parametrize(
    ("packet", "answered"),
    [
        ((6, 0, 9, 40, 1, 0), (8, 0, 9, 40, 0, 0, 0, 0)),
        ((12, 0, 3, 41, 1, 0, 1, 0, 5, 4, 0, 0), (12, 0, 3, 41, 0, 0, 0, 0, 5, 4, 0, 0)),
        ((20, 0, 0, 42, *range(16)), (8, 0, 0, 42, 0, 0, 0, 0)),
    ],
)
def test_packets_of_the_arm(program: Program, packet: tuple[int, ...], answered: tuple[int, ...]) -> None:
    assert program.ask(RequestType.SPECIAL_REQUEST, *packet) == (300, answered)


@pytest.mark.parametrize("packet", [(4, 0, 0, 99), (5, 0, 0, 40), (4, 0, 0, 40), (4, 0, 0, 300), (7, 0, -1, 40, 1, 1)])
def test_packets_that_nobody_understands(program: Program, packet: tuple[int, ...]) -> None:
    assert program.ask(RequestType.SPECIAL_REQUEST, *packet) == (91, (4,))


# ---- connecting, and what is wrong


def test_a_client_may_go_over_to_another_robot(made: Bench, program: Program) -> None:
    assert program.ask(102, 2, 4711)[1][0]
    assert [window.client != "" for window in made.windows.robots] == [False, True]
    program.ask(RequestType.PLACE_ROBOT, 100, 0, 0, 0)
    assert made.world.observe(1).believed.x == pytest.approx(0.254)
    assert program.ask(101, 1, 4711)[0] == 101
    assert program.ask(102, 3, 4711) == (102, (0,))
    assert program.state(RequestType.GS)  # the robot of before is still there


@pytest.mark.parametrize("number", [0, -1, 3, 2**31 - 1])
def test_a_robot_that_there_is_not_is_refused_and_the_rest_is_an_error(made: Bench, number: int) -> None:
    program = made.program(None)
    program.parser.layout = Layout.FOUR
    assert program.ask(102, number, 5) == (102, (0,))
    assert program.ask(RequestType.GS) == (91, (111,))
    assert program.ask(RequestType.VM, 1, 1, 0) == (91, (111,))
    assert program.ask(102, 1, 5)[1][0]


def test_a_request_of_the_wrong_size_is_refused_in_words(made: Bench, program: Program) -> None:
    assert program.ask(RequestType.VM, 1, 2) == (91, (4,))
    assert made.said[-1] == "test (process 4711): vm takes 3 words, not 2: refused"
    assert program.ask(77, 1) == (91, (4,))
    assert made.said[-1].startswith("test (process 4711): there is no request of type 77")
    assert program.ask(102, 1) == (102, (0,))
    assert program.ask(RequestType.PLACE_ROBOT) == (91, (4,))


def test_only_who_may_ends_the_server() -> None:
    for may_quit in (False, True):
        made = bench(may_quit=may_quit)
        assert made.program().ask(RequestType.QUIT_SERVER)[0] == (82 if may_quit else 91)
        assert made.nserver.service.quitting is may_quit


numbers = st.integers(-(2**31), 2**31 - 1) | st.integers(-4, 300)


@settings(max_examples=60)
@given(st.lists(st.tuples(st.sampled_from([*SHAPES, 0, 14, 99]), st.lists(numbers, max_size=23)), max_size=12))
def test_nothing_that_a_client_sends_does_harm(asked: list[tuple[int, list[int]]]) -> None:
    made = shared()
    program = made.program()
    for kind, words in asked:
        shape = SHAPES.get(kind)
        fitting = words if shape is None or len(words) < shape.least else words[: shape.most]
        reply = program.send(encode_request(Layout.FOUR, kind, fitting))
        if reply is not None:
            _, size = HEADER.unpack_from(reply)
            assert len(decode(reply[4:])) == size
        made.nserver.step()
        if program.wait is not None:
            program.wait.ready()
    program.session.leave()
    seen = made.world.observe(0)
    assert all(abs(value) < 1e12 for value in (*seen.real, *seen.believed, *seen.speeds))
    made.nserver.service.quitting = False


_shared: list[Bench] = []


def shared() -> Bench:
    """One server for many examples: setting up a world takes longer than they do."""
    if not _shared:
        _shared.append(Bench(nomad_world(None, "noisy", 2, 1), may_quit=True))
    return _shared[0]


@given(st.binary(max_size=400), st.sampled_from(list(Layout)))
def test_no_bytes_do_harm(data: bytes, layout: Layout) -> None:
    program = shared().program(1, layout)
    program.send(data)
    while (request := program.parser.next()) is not None:
        answer(program.session, request)
    program.session.leave()
    shared().nserver.service.quitting = False
