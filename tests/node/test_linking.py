"""Linking: an expression's variable is the host's own number, in an object, a structure, a record or a mapping."""

from __future__ import annotations

import ctypes
import math
import subprocess
import sys
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.core.model import HostFunction, Quantity
from sleepcast.core.units import LENGTH, RATE, SPEED
from sleepcast.language.vocabulary import Variable, VariableKind, Vocabulary, VocabularyError
from sleepcast.node.linking import LinkError, VariableTable, actuator, command, function, sensor
from sleepcast.node.node import Node

INCH = 0.0254


class Scout:
    """A robot as somebody else wrote it, with inches and degrees inside."""

    def __init__(self) -> None:
        self._velocity = 0.0
        self._range: float | None = 30.0
        self.range_time = 0.0
        self.said: list[tuple[object, ...]] = []

    @property
    @actuator(unit="in/s", low=-20, high=20)
    def velocity(self) -> float:
        """How fast it goes.

        More that nobody needs."""
        return self._velocity

    @velocity.setter
    def velocity(self, value: float) -> None:
        if value == 13:
            raise RuntimeError("the motor sticks")
        self._velocity = value

    @property
    @sensor(unit="in", low=0, high=255, freshness=0.5, measured_at="range_time", name="front_range")
    def range(self) -> float | None:
        return self._range

    @sensor(low=0, high=3)
    def bumps(self) -> int:
        return len(self.said)

    @command(units=("in/s", "deg/s"))
    def drive(self, speed: float, turn_rate: float = 90.0) -> None:
        """Drives."""
        self.said.append(("drive", speed, turn_rate))

    @function(units=("m", None), result="in")
    def halved(self, length: float, by: float) -> float:
        return length / by / INCH

    @command
    def beep(self) -> bool:
        self.said.append(("beep",))
        return True

    @command(labelled=True, name="TK")
    def talk(self, text: str, volume: float = 1.0) -> None:
        self.said.append((text, volume))


def slot_of(table: VariableTable, name: str) -> int:
    found = table.vocabulary.bindings[name]
    assert isinstance(found, Variable)
    return found.slot


def reader(table: VariableTable, name: str) -> Callable[[], float]:
    slot = slot_of(table, name)
    return lambda: table.read(slot)


def call(table: VariableTable, name: str, *arguments: object) -> float | None:
    found = table.vocabulary.bindings[name]
    assert isinstance(found, HostFunction)
    return found.call(table.body, *arguments)


# ---- a robot's class


def test_a_class_declares_its_variables_and_functions() -> None:
    table = VariableTable("scout").link(Scout())
    vocabulary = table.vocabulary
    assert [quantity.name for quantity in vocabulary.sensors] == ["front_range", "bumps"]
    assert vocabulary.actuators == (Quantity("velocity", "in/s", -20 * INCH, 20 * INCH, doc="How fast it goes."),)
    assert vocabulary.linked == {"velocity", "front_range", "bumps"}
    assert table.linked_slots == {slot_of(table, name) for name in vocabulary.linked}
    drive = vocabulary.bindings["drive"]
    assert isinstance(drive, HostFunction)
    assert (drive.dimensions, drive.least, drive.usage, drive.acts) == (
        (SPEED, RATE),
        1,
        "(drive speed turn_rate)",
        True,
    )
    assert drive.doc == "Drives."
    halved = vocabulary.bindings["halved"]
    assert isinstance(halved, HostFunction)
    assert (halved.dimensions, halved.least, halved.result, halved.acts) == ((LENGTH, None), 2, LENGTH, False)
    talk = vocabulary.bindings["tk"]
    assert isinstance(talk, HostFunction)
    assert (talk.labelled, talk.dimensions, talk.least) == (True, (None,), 0)


def test_a_linked_property_is_the_robots_own_number_in_si() -> None:
    scout = Scout()
    table = VariableTable().link(scout)
    velocity, bumps = reader(table, "velocity"), reader(table, "bumps")
    scout.velocity = 10
    assert velocity() == 10 * INCH
    table.write(slot_of(table, "velocity"), 5 * INCH)
    assert scout.velocity == pytest.approx(5, rel=1e-15)
    assert bumps() == 0.0
    scout.beep()
    assert bumps() == 1.0
    assert type(bumps()) is float


def test_an_actuator_is_set_within_its_declared_range() -> None:
    scout = Scout()
    table = VariableTable().link(scout)
    table.write(slot_of(table, "velocity"), 1e9)
    assert scout.velocity == 20
    table.write(slot_of(table, "velocity"), -1e9)
    assert scout.velocity == -20


def test_functions_are_called_in_the_hosts_units_on_the_linked_body() -> None:
    scout = Scout()
    table = VariableTable().link(scout)
    assert table.body is scout
    assert call(table, "drive", 5 * INCH, math.pi) is None
    assert call(table, "drive", 10 * INCH) is None
    assert scout.said == [
        ("drive", pytest.approx(5), pytest.approx(180)),
        ("drive", pytest.approx(10), 90.0),
    ]
    assert call(table, "halved", 3.0, 2.0) == pytest.approx(1.5)
    assert call(table, "beep") == 1.0
    assert call(table, "tk", "hello", 2.0) is None
    assert scout.said[-1] == ("hello", 2.0)


def test_a_subclass_keeps_declarations_and_its_own_code_runs() -> None:
    class Fast(Scout):
        @property
        def velocity(self) -> float:
            return 2 * self._velocity

        @velocity.setter
        def velocity(self, value: float) -> None:
            self._velocity = value

        def beep(self) -> bool:
            self.said.append(("BEEP",))
            return False

    fast = Fast()
    fast.velocity = 3
    table = VariableTable().link(fast)
    assert table.read(slot_of(table, "velocity")) == 6 * INCH
    assert call(table, "beep") == 0.0
    assert fast.said == [("BEEP",)]


def test_decorators_may_stand_over_the_property_too() -> None:
    def get(robot: object) -> float:
        return 4.0

    table = VariableTable().link(type("Odd", (), {"speed": sensor(unit="m/s")(property(get))})())
    assert table.read(slot_of(table, "speed")) == 4.0


def test_what_the_hosts_code_raises_is_a_link_error_that_names_the_place() -> None:
    class Broken(Scout):
        @property
        def range(self) -> float:
            raise OSError("no answer")

    table = VariableTable().link(Broken())
    table.refresh([], 0.0)
    with pytest.raises(LinkError, match=r"Broken\.range cannot be read: OSError: no answer"):
        table.read(slot_of(table, "front_range"))
    with pytest.raises(LinkError, match=r"Broken\.velocity cannot be set to 13: RuntimeError: the motor sticks"):
        table.write(slot_of(table, "velocity"), 13 * INCH)


# ---- ctypes structures


class Pose(ctypes.Structure):
    _fields_ = (("x", ctypes.c_double), ("y", ctypes.c_float))


class Base(ctypes.BigEndianStructure):
    _fields_: ClassVar[tuple[tuple[str, Any], ...]] = (("serial", ctypes.c_uint16),)


class Both(ctypes.Union):
    _fields_ = (("word", ctypes.c_uint32), ("half", ctypes.c_uint16 * 2))


class State(ctypes.Structure):
    _anonymous_ = ("both",)
    _fields_ = (
        ("velocity", ctypes.c_double),
        ("trim", ctypes.c_int8),
        ("lamp", ctypes.c_bool),
        ("gear", ctypes.c_uint8, 3),
        ("pose", Pose),
        ("sonar", ctypes.c_int16 * 4),
        ("path", Pose * 2),
        ("both", Both),
        ("name", ctypes.c_char * 8),
        ("stamp", ctypes.c_double),
    )


def test_a_structure_is_read_and_written_where_it_lies() -> None:
    v = State()
    table = VariableTable().link_struct(v, {"velocity": actuator(unit="m/s")})
    slot = slot_of(table, "velocity")
    v.velocity = 1.25
    assert table.read(slot) == 1.25
    table.write(slot, -0.5)
    assert v.velocity == -0.5
    seen_elsewhere = State.from_buffer(v)
    seen_elsewhere.velocity = 7.0
    assert table.read(slot) == 7.0


@pytest.mark.parametrize(
    ("path", "set_it", "get_it"),
    [
        ("pose.x", lambda v: setattr(v.pose, "x", 3), lambda v: v.pose.x),
        ("sonar[2]", lambda v: v.sonar.__setitem__(2, 3), lambda v: v.sonar[2]),
        ("path[1].y", lambda v: setattr(v.path[1], "y", 3), lambda v: v.path[1].y),
        ("word", lambda v: setattr(v, "word", 3), lambda v: v.word),
        ("both.half[0]", lambda v: v.half.__setitem__(0, 3), lambda v: v.half[0]),
        ("gear", lambda v: setattr(v, "gear", 3), lambda v: v.gear),
    ],
)
def test_paths_lead_into_a_structure(
    path: str, set_it: Callable[[State], None], get_it: Callable[[State], float]
) -> None:
    v = State()
    table = VariableTable().link_struct(v, {"part": actuator(field=path)})
    set_it(v)
    assert table.read(slot_of(table, "part")) == 3.0
    table.write(slot_of(table, "part"), 2.0)
    assert get_it(v) == 2


def test_fields_of_base_classes_and_foreign_byte_order() -> None:
    class Derived(Base):
        _fields_: ClassVar = (("level", ctypes.c_int32),)

    v = Derived()
    table = VariableTable().link_struct(v, {"serial": actuator(), "level": actuator()})
    table.write(slot_of(table, "serial"), 258.0)
    table.write(slot_of(table, "level"), -5.0)
    assert bytes(v)[:2] == b"\x01\x02"
    assert table.read(slot_of(table, "level")) == -5.0


@pytest.mark.parametrize(
    ("field", "value", "held"),
    [
        ("trim", 2.5, 2),
        ("trim", 3.5, 4),
        ("trim", -128.4, -128),
        ("lamp", 0.25, True),
        ("lamp", 0.0, False),
        ("gear", 7.0, 7),
        ("pose.y", 0.1, ctypes.c_float(0.1).value),
    ],
)
def test_a_value_is_converted_to_its_fields_type(field: str, value: float, held: float) -> None:
    v = State()
    table = VariableTable().link_struct(v, {"it": actuator(field=field)})
    table.write(slot_of(table, "it"), value)
    assert table.read(slot_of(table, "it")) == held


@pytest.mark.parametrize(
    ("field", "value", "sentence"),
    [
        ("trim", 128.0, r"State\.trim cannot be set to 128: it is a c_byte, which holds -128 to 127"),
        ("trim", -129.0, "-128 to 127"),
        ("gear", 8.0, "c_ubyte of 3 bits, which holds 0 to 7"),
        ("word", -1.0, "0 to 4294967295"),
        ("pose.y", 1e39, r"State\.pose\.y .* c_float, which holds -3.4028"),
        ("velocity", math.nan, "only finite numbers"),
        ("velocity", math.inf, "only finite numbers"),
    ],
)
def test_a_value_that_does_not_fit_is_refused_and_changes_nothing(field: str, value: float, sentence: str) -> None:
    v = State()
    table = VariableTable().link_struct(v, {"it": actuator(field=field)})
    table.write(slot_of(table, "it"), 1.0)
    with pytest.raises(LinkError, match=sentence):
        table.write(slot_of(table, "it"), value)
    assert table.read(slot_of(table, "it")) == 1.0


@pytest.mark.parametrize(
    ("path", "sentence"),
    [
        ("velocty", r"State has no field velocty \(did you mean velocity\?\); its fields are velocity, trim"),
        ("pose.z", r"State\.pose has no field z; its fields are x, y"),
        ("pose", r"State\.pose is a Pose, which is not one number"),
        ("sonar", r"State\.sonar is a c_short_Array_4, which is not one number"),
        ("name", "which is not one number"),
        ("sonar[4]", r"State\.sonar has the elements \[0\] to \[3\], so there is no \[4\]"),
        ("velocity[0]", r"State\.velocity is no array, so it has no element \[0\]"),
        ("velocity.x", r"State\.velocity has no field x; it has no fields"),
        ("pose x", "'pose x' is no path to a field of State"),
        (".pose", "no path"),
        ("sonar[-1]", "no path"),
    ],
)
def test_a_path_that_leads_nowhere_is_refused_with_what_is_there(path: str, sentence: str) -> None:
    with pytest.raises(LinkError, match=sentence):
        VariableTable().link_struct(State(), {"it": sensor(field=path)})


# ---- numpy records

ROW = np.dtype(
    [
        ("velocity", "f8"),
        ("trim", "i1"),
        ("lamp", "?"),
        ("pose", [("x", "f4"), ("y", ">f8")]),
        ("sonar", "u2", (4,)),
        ("name", "U8"),
    ]
)


@pytest.mark.parametrize("as_row", [lambda a: a[1], lambda a: a.view(np.recarray)[1], lambda a: a[1:2].reshape(())])
def test_a_record_is_read_and_written_where_it_lies(as_row: Callable[[np.ndarray], object]) -> None:
    fleet = np.zeros(3, ROW)
    links = {
        "velocity": actuator(unit="m/s"),
        "trim": actuator(),
        "lamp": actuator(),
        "y": actuator(field="pose.y"),
        "front": actuator(field="sonar[2]"),
    }
    table = VariableTable().link_struct(as_row(fleet), links)
    for name, value in (("velocity", 1.5), ("trim", -7.0), ("lamp", 1.0), ("y", 0.1), ("front", 65535.0)):
        table.write(slot_of(table, name), value)
        assert table.read(slot_of(table, name)) == value
        assert type(table.read(slot_of(table, name))) is float
    row = fleet[1]
    assert (row["velocity"], row["trim"], row["lamp"], row["pose"]["y"]) == (1.5, -7, True, 0.1)
    assert list(row["sonar"]) == [0, 0, 65535, 0]
    fleet["velocity"][1] = 2.0
    assert table.read(slot_of(table, "velocity")) == 2.0
    assert fleet[0] == np.zeros((), ROW)
    with pytest.raises(LinkError, match="it is a int8, which holds -128 to 127"):
        table.write(slot_of(table, "trim"), 300.0)
    with pytest.raises(LinkError, match="uint16"):
        table.write(slot_of(table, "front"), -1.0)


@pytest.mark.parametrize(
    ("path", "sentence"),
    [
        ("speed", r"void has no field speed; its fields are velocity, trim, lamp, pose, sonar, name"),
        ("sonar", r"void\.sonar is a uint16 of shape \(4,\), which is not one number"),
        ("sonar[9]", r"elements \[0\] to \[3\]"),
        ("pose[0]", r"void\.pose is no array"),
        ("name", r"void\.name is a str_, which is not one number"),
        ("pose", "which is not one number"),
    ],
)
def test_a_record_path_that_leads_nowhere_is_refused(path: str, sentence: str) -> None:
    with pytest.raises(LinkError, match=sentence):
        VariableTable().link_struct(np.zeros(1, ROW)[0], {"it": sensor(field=path)})


def test_an_array_that_is_no_record_and_a_read_only_one_are_refused() -> None:
    with pytest.raises(LinkError, match=r"shape \(3,\) is no record: link one row"):
        VariableTable().link_struct(np.zeros(3, ROW), {"velocity": sensor()})
    with pytest.raises(LinkError, match="is no record"):
        VariableTable().link_struct(np.zeros(()), {"velocity": sensor()})
    fleet = np.zeros(1, ROW)
    fleet.flags.writeable = False
    VariableTable().link_struct(fleet[0], {"velocity": sensor()})
    with pytest.raises(LinkError, match=r"void\.velocity cannot be the actuator velocity.*read-only"):
        VariableTable().link_struct(fleet[0], {"velocity": actuator()})


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_number_passes_a_double_unchanged(value: float) -> None:
    v, row = State(), np.zeros((), ROW)
    for table in (
        VariableTable().link_struct(v, {"velocity": actuator()}),
        VariableTable().link_struct(row, {"velocity": actuator()}),
        VariableTable().link_mapping({"velocity": None}, {"velocity": actuator()}),
    ):
        table.write(slot_of(table, "velocity"), value)
        assert table.read(slot_of(table, "velocity")) == value


@given(st.integers(-300, 300))
def test_an_int8_takes_just_what_it_holds(value: int) -> None:
    v = State()
    table = VariableTable().link_struct(v, {"trim": actuator()})
    if -128 <= value <= 127:
        table.write(slot_of(table, "trim"), float(value))
        assert v.trim == value
    else:
        with pytest.raises(LinkError):
            table.write(slot_of(table, "trim"), float(value))
        assert v.trim == 0


# ---- mappings


@pytest.mark.parametrize(
    ("held", "read"),
    [
        (3, 3.0),
        (True, 1.0),
        (np.float32(0.5), 0.5),
        (np.int64(-4), -4.0),
        (np.bool_(True), 1.0),
        (np.array(2.5), 2.5),
        (Fraction(1, 4), 0.25),
        (Decimal("0.5"), 0.5),
        (None, math.nan),
        (math.inf, math.nan),
        (-math.inf, math.nan),
        (math.nan, math.nan),
        (10**400, math.nan),
    ],
)
def test_whatever_is_a_number_reads_as_a_float(held: object, read: float) -> None:
    table = VariableTable().link_mapping({"fuel": held}, {"fuel": sensor()})
    found = table.read(slot_of(table, "fuel"))
    assert type(found) is float
    assert found == read or (math.isnan(found) and math.isnan(read))


@pytest.mark.parametrize("held", ["3", b"3", [3], 3j, np.zeros(2)])
def test_what_is_no_number_is_refused_when_linked_and_a_fault_later(held: object) -> None:
    state: dict[str, object] = {"fuel": held}
    with pytest.raises(LinkError, match=r"dict\['fuel'\] holds .* not (a|one) number"):
        VariableTable().link_mapping(state, {"fuel": sensor()})
    state["fuel"] = 1
    table = VariableTable().link_mapping(state, {"fuel": sensor()})
    read = reader(table, "fuel")
    assert read() == 1.0
    state["fuel"] = held
    with pytest.raises(LinkError, match=r"not (a|one) number"):
        read()
    del state["fuel"]
    assert math.isnan(read())


def test_a_mapping_is_the_same_memory_in_both_directions() -> None:
    state: dict[str, object] = {"fuel": 55, "speed": 0}
    table = VariableTable().link_mapping(
        state, {"fuel": sensor(unit="%", low=0, high=100), "v": actuator(field="speed")}
    )
    assert table.vocabulary.sensors == (Quantity("fuel", "%", 0.0, 1.0),)
    assert table.read(slot_of(table, "fuel")) == 0.55
    table.write(slot_of(table, "v"), 0.5)
    assert state["speed"] == 0.5


def test_a_mapping_says_what_it_lacks() -> None:
    with pytest.raises(LinkError, match=r"dict has no key 'feul' \(did you mean fuel\?\)"):
        VariableTable().link_mapping({"fuel": 1}, {"feul": sensor()})
    frozen = MappingProxyType({"fuel": 1.0})
    with pytest.raises(LinkError, match=r"cannot be the actuator fuel.*cannot be changed"):
        VariableTable().link_mapping(frozen, {"fuel": actuator()})


def test_an_objects_plain_attributes_are_a_mapping() -> None:
    scout = Scout()
    table = VariableTable().link_mapping(vars(scout), {"v": actuator(field="_velocity")})
    table.write(slot_of(table, "v"), 2.0)
    assert scout.velocity == 2.0


# ---- freshness


def test_a_linked_measurement_ages_by_the_hosts_own_time() -> None:
    scout = Scout()
    table = VariableTable().link(scout)
    read = reader(table, "front_range")
    scout.range_time = 1.0
    for now, expected in ((1.0, 30 * INCH), (1.5, 30 * INCH), (1.75, math.nan)):
        table.refresh([], now)
        assert read() == pytest.approx(expected, nan_ok=True)
    scout.range_time = 1.7
    assert read() == 30 * INCH
    scout._range = None
    assert math.isnan(read())


def test_a_linked_measurement_ages_from_what_the_host_says() -> None:
    table = VariableTable().link_struct(
        State(), {"sonar": sensor(field="sonar[0]", freshness=1.0), "pose": sensor(field="pose.x")}
    )
    read = reader(table, "sonar")
    table.refresh([], 5.0)
    assert math.isnan(read())
    table.measured(4.5, "SONAR")
    assert read() == 0.0
    table.refresh([], 5.6)
    assert math.isnan(read())
    table.measured(5.6)
    assert read() == 0.0
    assert table.read(slot_of(table, "pose")) == 0.0
    with pytest.raises(LinkError, match=r"no variable sonr \(did you mean sonar\?\)"):
        table.measured(6.0, "sonr")


def test_readings_in_the_list_stand_until_they_are_too_old() -> None:
    table = VariableTable(sensors=(Quantity("x", "m"), Quantity("range", "m", freshness=0.5)))
    first = table.vocabulary.first_sensor
    values = [math.nan] * table.vocabulary.size

    def after(now: float, *readings: float) -> list[float]:
        table.sense(values, readings, now)
        table.refresh(values, now)
        return values[first : first + 2]

    assert after(0.0, math.nan, math.nan) == pytest.approx([math.nan, math.nan], nan_ok=True)
    assert after(0.1, 1.0, 2.0) == [1.0, 2.0]
    assert after(0.6, math.nan, math.inf) == [1.0, 2.0]
    assert after(0.7, math.nan, math.nan) == pytest.approx([1.0, math.nan], nan_ok=True)
    assert after(0.8, 3.0, 4.0) == [3.0, 4.0]
    assert after(9.0) == pytest.approx([3.0, math.nan], nan_ok=True)


def test_readings_without_limits_are_copied_but_for_what_was_not_measured() -> None:
    table = VariableTable(sensors=(Quantity("x"), Quantity("y")))
    first = table.vocabulary.first_sensor
    values = [math.nan] * table.vocabulary.size
    table.sense(values, (1.0, 2.0), 0.0)
    assert values[first:] == [1.0, 2.0]
    table.sense(values, (1e308, 1e308), 0.1)  # their sum overflows, they do not
    assert values[first:] == [1e308, 1e308]
    table.sense(values, (math.nan, 5.0), 0.2)
    assert values[first:] == [1e308, 5.0]
    with pytest.raises(LinkError, match="1 readings for the 2 sensors of robot"):
        table.sense(values, (1.0,), 0.3)


def test_linked_sensors_are_left_alone_by_readings() -> None:
    table = VariableTable(sensors=(Quantity("x"),)).link_mapping({"fuel": 7}, {"fuel": sensor()})
    values = [math.nan] * table.vocabulary.size
    table.sense(values, (1.0, 99.0), 0.0)
    assert values[slot_of(table, "x")] == 1.0
    assert table.read(slot_of(table, "fuel")) == 7.0


# ---- stopping


class Driven(ctypes.Structure):
    _fields_ = (("speed", ctypes.c_double), ("turn", ctypes.c_double), ("arm", ctypes.c_int8), ("lamp", ctypes.c_bool))


def test_stop_sets_what_moves_to_rest_and_holds_it_until_release() -> None:
    v = Driven()
    links = {
        "speed": actuator(unit="ft/s", low=-3, high=3),
        "turn": actuator(unit="deg/s"),
        "arm": actuator(low=10, high=90, rest=45),
        "lamp": actuator(),
    }
    table = VariableTable().link_struct(v, links)
    for name, value in (("speed", 0.5), ("turn", 1.0), ("arm", 80.0), ("lamp", 1.0)):
        table.write(slot_of(table, name), value)
    table.stop()
    assert (v.speed, v.turn, v.arm, v.lamp) == (0.0, 0.0, 45, True)
    with pytest.raises(LinkError, match="while the robot is stopped"):
        table.write(slot_of(table, "speed"), 0.5)
    assert v.speed == 0.0
    table.release()
    assert v.speed == 0.0
    table.write(slot_of(table, "speed"), 0.3048)
    assert v.speed == 1.0


def test_stop_tries_everything_before_it_says_what_was_refused() -> None:
    class Stuck:
        def __init__(self) -> None:
            self.turning = 5.0

        @property
        @actuator(unit="m/s")
        def speed(self) -> float:
            return 1.0

        @speed.setter
        def speed(self, value: float) -> None:
            raise OSError("no answer")

        @property
        @actuator(unit="rad/s")
        def turn(self) -> float:
            return self.turning

        @turn.setter
        def turn(self, value: float) -> None:
            self.turning = value

    stuck = Stuck()
    table = VariableTable().link(stuck)
    _ = table.vocabulary
    with pytest.raises(LinkError, match=r"not everything came to rest: Stuck\.speed cannot be set to 0: OSError"):
        table.stop()
    assert stuck.turning == 0.0
    assert table.stopped


# ---- in a robot's mind


def test_a_name_in_an_expression_is_the_hosts_number() -> None:
    scout, v, row, state = Scout(), State(), np.zeros((), ROW), {"fuel": 40}
    table = (
        VariableTable("scout")
        .link(scout)
        .link_struct(v, {"trim": actuator()})
        .link_struct(row, {"pose_x": actuator(unit="m", field="pose.x")})
        .link_mapping(state, {"fuel": sensor(unit="%", low=0, high=100)})
    )
    node = Node("scout-1", table.vocabulary, body=table.body, variables=table)
    assert node.evaluate("(SETQ velocity 10in/s)").value == 10 * INCH
    assert scout.velocity == pytest.approx(10, rel=1e-15)
    node.evaluate("(WHEN (< fuel 50%) (SETQ trim -3) (SETQ pose_x 2.5m) (DRIVE 5in/s 90deg/s))")
    assert (v.trim, float(row["pose"]["x"])) == (-3, 2.5)
    assert scout.said == [("drive", 5.0, 90.0)]
    state["fuel"] = 60
    assert node.evaluate("fuel").value == 0.6
    (fault,) = node.evaluate("(SETQ trim 200)").faults
    assert fault.reason == "State.trim cannot be set to 200: it is a c_byte, which holds -128 to 127"
    assert v.trim == -3


# ---- the table as a whole


def test_the_three_ways_mix_in_one_vocabulary() -> None:
    table = (
        VariableTable("rover", sensors=(Quantity("x", "m"),))
        .link(Scout())
        .link_struct(State(), {"trim": actuator()})
        .link_mapping({"fuel": 1}, {"fuel": sensor()})
    )
    vocabulary = table.vocabulary
    assert [q.name for q in vocabulary.sensors] == ["x", "front_range", "bumps", "fuel"]
    assert [q.name for q in vocabulary.actuators] == ["velocity", "trim"]
    assert "x" not in vocabulary.linked
    assert slot_of(table, "trim") in table.linked_slots
    with pytest.raises(KeyError):
        table.read(slot_of(table, "x"))


def test_robots_of_one_type_share_a_vocabulary() -> None:
    first, second = Scout(), Scout()
    one = VariableTable("scout").link(first)
    other = VariableTable(like=one.vocabulary).link(second)
    assert other.vocabulary is one.vocabulary
    second.velocity = 4
    assert one.read(slot_of(one, "velocity")) == 0.0
    assert other.read(slot_of(one, "velocity")) == 4 * INCH
    call(other, "beep")
    assert (first.said, second.said) == ([], [("beep",)])


@pytest.mark.parametrize(
    ("links", "sentence"),
    [
        ({"fuel": sensor()}, "speed must be linked too"),
        ({"fuel": sensor(), "speed": actuator(), "x": sensor()}, "links x, which the vocabulary it shares does not"),
        ({"fuel": sensor(), "speed": sensor()}, "links speed otherwise"),
        ({"fuel": sensor(unit="%"), "speed": actuator()}, "links fuel otherwise"),
    ],
)
def test_a_table_that_differs_from_what_it_shares_is_refused(links: dict[str, object], sentence: str) -> None:
    state = {"fuel": 1, "speed": 0, "x": 0}
    shared = VariableTable().link_mapping(state, {"fuel": sensor(), "speed": actuator()}).vocabulary
    table = VariableTable(like=shared).link_mapping(state, links)  # type: ignore[arg-type]
    with pytest.raises(LinkError, match=sentence):
        _ = table.vocabulary


def test_a_plain_vocabulary_needs_nothing_linked() -> None:
    vocabulary = Vocabulary("scout", sensors=(Quantity("x"),))
    table = VariableTable(like=vocabulary)
    values = [math.nan] * vocabulary.size
    table.sense(values, (2.0,), 0.0)
    assert values[vocabulary.first_sensor] == 2.0
    assert table.linked_slots == frozenset()


@pytest.mark.parametrize(
    ("members", "sentence"),
    [
        ({}, "Odd declares nothing to link"),
        (
            {"v": property(actuator()(lambda robot: 1.0))},
            r"Odd\.v cannot be the actuator v.*give it one with @v\.setter",
        ),
        ({"v": actuator()(lambda robot: 1.0)}, r"Odd\.v cannot be.*it is a method; make it a property with a setter"),
        ({"go": command(lambda robot, *lengths: None)}, r"Odd\.go cannot be called from expressions: \*lengths"),
        ({"go": command(lambda robot, *, speed: None)}, r"Odd\.go cannot be called from expressions: speed"),
        ({"go": function(units=("m", "m"))(lambda robot: 1.0)}, r"Odd\.go takes 0 numbers, but units= names 2"),
        ({"go": command(labelled=True)(lambda robot: None)}, r"Odd\.go is labelled, so its first argument is the text"),
        ({"v": sensor(name="a b")(lambda robot: 1.0)}, "'a b' cannot be written as a name"),
        ({"v": function(name="(x")(lambda robot: 1.0)}, "cannot be written as a name"),
        ({"v": sensor(freshness=1.0, measured_at="tiem")(lambda robot: 1.0)}, "Odd has no attribute tiem"),
    ],
)
def test_a_class_that_cannot_be_linked_is_refused_with_what_to_do(members: dict[str, object], sentence: str) -> None:
    with pytest.raises(LinkError, match=sentence):
        VariableTable().link(type("Odd", (), members)())


def test_links_that_make_no_sense_are_refused() -> None:
    with pytest.raises(LinkError, match=r"Scout is a class; link a robot made from it: Scout\(\.\.\.\)"):
        VariableTable().link(Scout)
    with pytest.raises(LinkError, match="a Scout is linked already"):
        VariableTable().link(Scout()).link(Scout())
    with pytest.raises(LinkError, match=r"a dict is neither a ctypes structure nor a numpy record.*link_mapping"):
        VariableTable().link_struct({"v": 1.0}, {"v": sensor()})
    table = VariableTable("scout").link(Scout())
    _ = table.vocabulary
    with pytest.raises(LinkError, match="vocabulary of scout is in use already"):
        table.link_mapping({"v": 1.0}, {"v": sensor()})
    clash = VariableTable().link_mapping({"v": 1.0, "V": 2.0}, {"v": sensor(), "V": sensor()})
    with pytest.raises(VocabularyError, match="the sensor variable V has the same name as the sensor variable v"):
        _ = clash.vocabulary


@pytest.mark.parametrize(
    ("declare", "sentence"),
    [
        (lambda: sensor(unit="mps"), r"unknown unit 'mps' \(did you mean m/s\?|unknown unit 'mps'"),
        (lambda: command(units=("m", "furlong")), "unknown unit 'furlong'"),
        (lambda: function(result="furlong"), "unknown unit 'furlong'"),
        (lambda: actuator(low=1, high=1), "low=1 is not below high=1"),
        (lambda: actuator(low=math.nan), "low=nan is not below"),
        (lambda: actuator(unit="m/s", low=1, high=2), "rest=0, to which STOP sets it, is outside low=1 to high=2"),
        (lambda: sensor(freshness=0), "freshness=0 is not a number of seconds above 0"),
        (lambda: sensor(measured_at="stamp"), "no use without a freshness limit"),
        (lambda: sensor()(staticmethod(abs)), "stand over a property or a method"),
        (lambda: command(abs), "stand over a method, not over <built-in"),
    ],
)
def test_a_declaration_that_makes_no_sense_is_refused(declare: Callable[[], object], sentence: str) -> None:
    with pytest.raises(LinkError, match=sentence):
        declare()


def test_kinds_are_as_declared() -> None:
    table = VariableTable().link_mapping({"fuel": 1, "v": 0}, {"fuel": sensor(), "v": actuator()})
    kinds = {b.name: b.kind for b in table.vocabulary.bindings.values() if isinstance(b, Variable) and b.linked}
    assert kinds == {"fuel": VariableKind.SENSOR, "v": VariableKind.ACTUATOR}


def test_linking_loads_numpy_only_for_a_program_that_has_it() -> None:
    program = """
import sys
from sleepcast.node.linking import VariableTable, sensor
assert "numpy" not in sys.modules and "ctypes" not in sys.modules
VariableTable().link_mapping({"x": 1}, {"x": sensor()}).vocabulary
import ctypes
class V(ctypes.Structure):
    _fields_ = [("x", ctypes.c_int)]
VariableTable().link_struct(V(), {"x": sensor()}).vocabulary
assert "numpy" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", program], check=True)
