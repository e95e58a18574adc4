"""What the Python client puts on the wire, byte for byte what the C library of 1998 did; what it reads from replies."""

from __future__ import annotations

import os
import random
import socket
import struct
from dataclasses import replace
from threading import Thread

import pytest

from nomad.serving import LONGEST
from sleepcast.core.errors import MisuseError
from sleepcast.nomad.bridge.model import BASES, model_of
from sleepcast.nomad.bridge.vocabulary import NAMES, nomad_vocabulary
from sleepcast.nomad.client.nclient import mask_words, order_words, packet_words, text_words
from sleepcast.nomad.client.nomad import Nomad
from sleepcast.nomad.wire.encoding import MAX_WORDS, text_of
from sleepcast.nomad.wire.state import EVERYTHING, ReplyReader, read_state

CAPTURED = (
    "0066 0002 00000001 PROCESS_",
    "0010 0007 000000ff 000000ff 000000ff 000000ff 000000ff 0000000e 00000000",
    "001a 0001 00000001",
    "0017 0011 00000001 00000000 00000001 00000002 00000003 00000004 00000005 00000006 00000007 00000008 00000009"
    " 0000000a 0000000b 0000000c 0000000d 0000000e 0000000f",
    "0014 0000",
    "0027 0004 00000001 00000001 00000001 00000014",
    "0029 0004 ffffff9c ffffff38 00000384 000001c2",
    "000c 0003 00000034 ffffffea 00000000",
    "000f 0000",
    "0013 0002 6863754f 0000002e",
    "0067 0002 00000001 PROCESS_",
)
"""What the original client sent in these calls; behind the text of `tk` it had stale bytes, where ours has zeros."""


def test_a_session_has_the_bytes_of_the_original_client() -> None:
    heard = bytearray()
    state = struct.pack(">hH49i", 80, 49, 10, *(0,) * 33, -100, -200, 816, 450, *(0,) * 8, 2254561, 200, 210)

    def serve(listener: socket.socket) -> None:
        with listener.accept()[0] as client:
            client.settimeout(LONGEST)
            while request := client.recv(1000):
                heard.extend(request)
                if request[1] == 103:  # which has no reply
                    return
                client.sendall(struct.pack(">hHi", 102, 1, 7019) if request[1] == 102 else state)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        thread = Thread(target=serve, args=(listener,))
        thread.start()
        nomad = Nomad.connect(*listener.getsockname())
        nomad.conf_tm(1)
        nomad.conf_sn(1)
        nomad.zr()
        nomad.ws(True, True, True, 20)
        nomad.place_robot(-100, -200, 900, 450)
        nomad.scout_vm(15, 320)
        found = nomad.gs()
        nomad.tk("Ouch.")
        nomad.disconnect_robot()
        thread.join(LONGEST)
    process = f"{os.getpid():08x}"
    assert heard.hex() == "".join(CAPTURED).replace(" ", "").replace("PROCESS_", process)
    assert (found.words[34:38], found.clock, found.batteries) == ((-100, -200, 816, 450), 2254561, (200, 210))
    assert found.computer_volts == pytest.approx(10.447, abs=1e-3)


def test_words_of_a_mask() -> None:
    assert mask_words([0, *(1,) * 43]) == EVERYTHING
    assert mask_words([0] * 44) == (0,) * 7
    assert mask_words([18, -1, 1, *(0,) * 40, 5]) == (2, 0, 0, 0, 0, 9, 18)
    assert mask_words([0] * 33 + [1] + [0] * 10) == (0, 0, 0, 0, 1, 0, 0)


@pytest.mark.parametrize("text", ["", "a", "abcd", "abcde", "ten inches", "x" * 999])
def test_a_text_comes_through_in_both_byte_orders(text: str) -> None:
    assert text_of(text_words(text, big_endian=False), "little") == text
    assert text_of(text_words(text, big_endian=True), "big") == text


def test_bounds() -> None:
    assert order_words("conf_sn", ()) == (255,) * 16
    for order in ((16,), (-1,), (0,) * 17):
        with pytest.raises(MisuseError, match="conf_sn takes at most 16 sensors, each 0 to 15"):
            order_words("conf_sn", order)
    assert packet_words(3, 40, b"\1\xff") == (6, 0, 3, 40, 1, 255)
    with pytest.raises(MisuseError, match="bytes of data"):
        packet_words(0, 0, bytes(MAX_WORDS))
    with pytest.raises(MisuseError, match="bytes of text"):
        text_words("x" * 4 * MAX_WORDS, big_endian=False)


class Refused(Exception):
    """What the client makes of a reply that cannot be right."""


def test_a_reply_of_any_words_is_a_state_or_refused() -> None:
    chance = random.Random(3)
    states = 0
    for _ in range(3_000):
        size = chance.choice((48, 49, 50, chance.randrange(600)))
        words = [chance.choice((0, 1, 255, chance.randrange(-(2**31), 2**31))) for _ in range(size)]
        if chance.random() < 0.7 and size > 45:
            words[45] = chance.randrange(4)
        try:
            state = read_state(ReplyReader(words, Refused), chance.choice((1, 2, 4)), chance.randrange(32))
        except Refused:
            continue
        states += 1
        for name in ("x", "heading", "sonars", "bumper", "moving", "compass", "motor_volts", "time", "right_speed"):
            getattr(state, name)
        assert len(state.words) == 45
        assert -3.15 < state.heading < 3.15
    assert states > 100


def test_the_vocabulary_converts_what_the_wire_has_units_for() -> None:
    model = model_of(BASES["scout"])
    names = {function.name: function for function in nomad_vocabulary(model).functions}
    standard = {function.name: function for function in model.functions}
    assert set(NAMES) <= set(names) == set(standard)
    for name, function in names.items():
        assert (function is standard[name]) == (name not in NAMES)
        assert len(function.dimensions) == len(standard[name].dimensions)
    turning = next(f for f in nomad_vocabulary(model_of(BASES["nomad200"])).functions if f.name == "VM")
    assert len(turning.dimensions) == 3
    calls: list[tuple[float, ...]] = []

    noting = [
        replace(standard[name], call=lambda _, *given: calls.append(given)) for name in ("PLACE_ROBOT", "CONF_SN", "VM")
    ]
    replaced = nomad_vocabulary(replace(model, functions=tuple(noting)))
    for function, given in zip(replaced.functions, ((100, -10, 1800), (6, 0, 15), (75, 75)), strict=True):
        function.call(None, *given)
    assert calls == [
        pytest.approx((0.254, -0.0254, 3.14159265)),
        pytest.approx((0.024, 0, 15)),
        pytest.approx((0.1905, 0.1905)),
    ]
