"""A robot to begin with: put your own sensors and motors in the place of this rover's numbers.

A board runs main.py when it starts. Beside it lie the folder sleepnode, robot.key, trust.json, and config.json.
"""

import gc
import time

from sleepnode.body import Body
from sleepnode.node import Node
from sleepnode.radio import Radio
from sleepnode.reader import unload


class Rover:
    """Something that drives: here only in numbers."""

    def __init__(self):
        self.speed = self.turn_rate = self.x = 0.0
        self.lamp = 0.0
        self._since = time.ticks_ms()

    def drive(self, speed, turn_rate):
        self.where()
        self.speed = max(-0.5, min(0.5, speed))  # the body's own limit: no expression can pass it
        self.turn_rate = max(-2.0, min(2.0, turn_rate))  # for your motors: these numbers know no heading

    def stop(self):
        self.drive(0.0, 0.0)

    def where(self):
        now = time.ticks_ms()
        self.x += self.speed * time.ticks_diff(now, self._since) / 1000
        self._since = now
        return self.x

    def light(self, value):
        self.lamp = value


def start(config):
    """The node of this robot. config: see config.json."""
    rover = Rover()
    body = Body(stop=rover.stop)
    body.sensor("x", rover.where, "m")
    body.sensor("speed", lambda: rover.speed, "m/s", -0.5, 0.5)
    body.sensor("fuel", lambda: config.get("fuel"), "", 0, 1)
    body.actuator("lamp", rover.light, "", 0, 1)
    body.function("DRIVE", rover.drive, 2)  # the speed and turn rate that DRIVE takes on all robots
    body.function("ST", rover.stop)
    radio = Radio(config["address"], config["port"], config.get("interface") or "")
    return Node(
        body,
        radio,
        fleet=config["fleet"],
        name=config.get("name"),
        lease=config.get("lease"),
        number=config.get("id", 0),
        tick=config.get("tick", 0.1),
    )


def live(node):
    """Until somebody interrupts it."""
    gc.collect()
    held = "; stopped until RELEASE" if node.stopped else ""
    print("%s is up: %d bytes of memory are free%s" % (node.name, gc.mem_free(), held))
    try:
        node.run()
    except KeyboardInterrupt:
        print("%s has ended; its body is at rest" % node.name)


if __name__ == "__main__":
    from sleepnode import configuring

    made = configuring.begun(start)
    del configuring
    unload("configuring")
    if made is not None:
        live(made)
