"""Runs under MicroPython: measures an evaluator (`mind`) or a whole node (`node`), and says so as JSON."""

import gc
import json
import sys
import time

RULE = "(RULE rule%d (WHEN (AND (> fuel 50%%) (NOT (< ordnance 70%%))) (SETQ speed (+ speed 0.1))))"


def used():
    gc.collect()
    return gc.mem_alloc()


def milliseconds(call, times):
    """The median of some calls."""
    found = []
    for _ in range(times):
        begin = time.ticks_us()
        call()
        found.append(time.ticks_diff(time.ticks_us(), begin))
    return sorted(found)[times // 2] / 1000


def fill(mind, found, tell):
    """Store rules until memory is full; gives how long each took. tell: has a text obeyed; gives whether it was."""
    before, count, took = used(), 0, []
    while count < 64:
        begin = time.ticks_us()
        if not tell(RULE % count) or "rule%d" % count not in mind.learned:
            break
        took.append(time.ticks_diff(time.ticks_us(), begin))
        count += 1
        if count == 10:
            mind.values[70] = mind.values[71] = 0.9
            mind.begin(1, 0.1)
            found["tick_ms"] = milliseconds(mind.round, 101)
            found["rule_us"] = round(100 * found["tick_ms"])
        if count == 60:
            gc.collect()
            found["free"] = gc.mem_free()
    found["rules"], found["rule"] = count, (used() - before) // max(count, 1)
    found["compile_ms"] = sorted(took)[len(took) // 2] / 1000


def work(make):
    """The longest slice, and all of them together, ms."""
    job, longest, begin = make(), 0, time.ticks_us()
    while True:
        at = time.ticks_us()
        try:
            next(job)
        except StopIteration:
            break
        finally:
            longest = max(longest, time.ticks_diff(time.ticks_us(), at))
    return longest / 1000, time.ticks_diff(time.ticks_us(), begin) / 1000


class Radio:
    """A radio that hears one datagram."""

    def __init__(self):
        self.datagram, self.sent = None, 0

    def receive(self):
        found, self.datagram = self.datagram, None
        return found

    def send(self, datagram):
        self.sent += 1


class Desk:
    """Signs commands, and lets a node run until it has obeyed and answered."""

    def __init__(self):
        from sleepnode import points

        self.secret = points.expand(bytes([1] * 32))
        self.public, self.number = points.public_key(self.secret), 0

    def command(self, robot, text):
        """Whether it was obeyed."""
        self.number += 1
        now = 1000 * robot.clock.now()
        said = payload(9, (1, self.number, now, now + 60000000), "lab", "desk", text, b"\xa0")
        signature = ed25519.finished(ed25519.sign(self.secret, self.public, signed(said)))
        robot.radio.datagram = sealed(key_id(self.public), said, signature)
        said = signature = None
        answers = len(robot.answered), robot.answered[-1:]
        for _ in range(5000):
            try:
                robot.step()
            except MemoryError:
                return False
            if not robot.out and not robot._signing and answers != (len(robot.answered), robot.answered[-1:]):
                return b"gmatched" in robot.answered[-1]
            robot.next = 0  # the next tick at once
        return False


def mind(found, base):
    from sleepnode.mind import Mind
    from sleepnode.reader import Refused

    found["code"] = used() - base
    robot = Mind(("fuel", "ordnance"), ("speed",))
    robot.values[72] = 0.0
    found["start"] = used()

    def tell(text):
        try:
            return robot.evaluate(text) is not None and not robot.faults
        except Refused:
            return False

    fill(robot, found, tell)


def node(found, base):
    global ed25519, payload, sealed, signed, key_id
    from sleepnode import ed25519
    from sleepnode.body import Body
    from sleepnode.envelope import payload, sealed, signed
    from sleepnode.node import Node
    from sleepnode.reader import unload
    from sleepnode.trust import key_id

    __import__("sleepnode.node_start")  # which loads what a node needs
    unload("node_start")
    found["code"] = used() - base
    desk = Desk()
    unload("points")
    with open("trust.json", "w") as file:
        json.dump({"keys": [{"owner": "desk", "role": "commander", "public": desk.public.hex()}]}, file)
    with open("robot.key", "w") as file:
        json.dump({"owner": "tiny", "secret": "%064x" % 7}, file)
    body = Body(stop=lambda: None)
    for name in ("fuel", "ordnance"):
        body.sensor(name, lambda: 0.9)
    body.actuator("speed", lambda value: None)
    robot = Node(body, Radio(), fleet="lab")
    robot.mind.values[72] = 0.0
    found["start"] = used()
    text, secret, public = (b"x" * 200,), robot._secret, robot._public
    from sleepnode import points

    signature = ed25519.finished(ed25519.sign(secret, public, text))
    point = points.point(public)
    del points
    unload("points")
    signing = [work(lambda: ed25519.sign(secret, public, text)) for _ in range(5)]
    checking = [work(lambda: ed25519.verify(public, point, text, signature)) for _ in range(5)]
    found["sign_ms"], found["verify_ms"] = sorted([each[1] for each in signing])[2], sorted([e[1] for e in checking])[2]
    found["slice_ms"] = sorted([each[0] for each in signing + checking])[5]
    signing = checking = point = signature = None
    fill(robot.mind, found, lambda text: desk.command(robot, text))
    found["obeys"] = desk.command(robot, "(SETQ speed 0)")


found = {}
(mind if sys.argv[1] == "mind" else node)(found, used())
print(json.dumps(found))
