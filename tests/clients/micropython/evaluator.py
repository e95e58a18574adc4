"""Runs under MicroPython: evaluates texts that arrive as lines of JSON on one robot after another, and says what came
of each. The robot is the one of tests/cases.

Numbers go both ways as the bits of a double in hexadecimal digits, since the firmware reads and writes decimals now and
then one unit of the last place off."""

import gc
import json
import struct
import sys
from binascii import hexlify, unhexlify

from sleepnode.checker import Function
from sleepnode.mind import Mind
from sleepnode.reader import Refused, format_number

SENSORS = ["fuel", "ordnance", "x", "y", "speed", "sonar1", "sonar2", "sonar3"]
ACTUATORS = ["throttle", "lamp"]


def shown(value):
    """As people see it, to whom a zero has no sign."""
    return format_number(value if value is None else value + 0.0)


class Body:
    def __init__(self):
        self.done = []

    def do(self, name, *arguments):
        written = ['"%s"' % x if isinstance(x, str) else shown(x) for x in arguments]
        self.done.append("(%s)" % " ".join([name] + written))


def fail():
    raise ValueError("a wire is loose")


def robot(asked, body):
    functions = (
        Function("VM", lambda right, left: body.do("VM", right, left), 2, 2, True, False),
        Function("ST", lambda: body.do("ST"), 0, 0, True, False),
        Function("TK", lambda text: body.do("TK", text), 1, 1, True, True),
        Function("SONAR", lambda i: i / 2, 1, 1, False, False),
        Function("GIVE", lambda x: x, 1, 1, False, False),
        Function("MUTE", lambda: float("nan"), 0, 0, False, False),
        Function("LOOSE", fail, 0, 0, False, False),
    )
    sensors = SENSORS + asked["sensors"]
    mind = Mind(sensors, ACTUATORS, {"FRONT": 1.0, "REAR": 2.0}, functions, number=asked["number"], seed=asked["seed"])
    for name, value in asked["values"].items():
        mind.values[mind.binding(name)] = number(value)
    return mind


def printed(label, values):
    words = ['"%s"' % label] if label else []
    return " ".join(words + [shown(value) for value in values])


def bits(value):
    return None if value is None else hexlify(struct.pack("<d", float(value))).decode()


def number(text):
    return None if text is None else struct.unpack("<d", unhexlify(text))[0]


body, mind = Body(), None
for line in sys.stdin:
    asked = json.loads(line)
    if "sensors" in asked:
        mind = None
        gc.collect()
        body = Body()
        mind = robot(asked, body)
        print(json.dumps({}))
        continue
    if "ticks" in asked:
        moved = []
        for _ in range(asked["ticks"]):
            for name, value in asked["values"].items():
                mind.values[mind.binding(name)] = number(value)
            mind.begin(mind.tick + 1, (mind.tick + 1) * number(asked["seconds"]))
            moved.append(mind.round())
        print(json.dumps({"moved": moved, "faults": mind.faults}))
        continue
    body.done = []
    mind.reports, mind.told, mind.pings = [], [], []
    try:
        value = mind.evaluate(asked["text"])
    except Refused as error:
        print(json.dumps({"refused": error.sentence()}))
        continue
    print(
        json.dumps(
            {
                "value": bits(value),
                "faults": mind.faults,
                "prints": [printed(label, values) for label, values, _ in mind.reports],
                "tells": [text for text, _ in mind.told],
                "pings": [bits(each) for each in mind.pings],
                "does": body.done,
                "matched": mind.matched,
            }
        )
    )
