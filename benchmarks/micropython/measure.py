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


def fill(mind, found):
    """Store rules until memory is full; gives how long each took."""
    from sleepnode.reader import Refused

    before, count, took = used(), 0, []
    while count < 64:
        begin = time.ticks_us()
        try:
            mind.evaluate(RULE % count)
        except Refused:
            break
        took.append(time.ticks_diff(time.ticks_us(), begin))
        if mind.faults:
            break
        count += 1
        if count == 10:
            mind.values[70] = mind.values[71] = 0.9
            mind.begin(1, 0.1)
            found["tick_ms"] = milliseconds(mind.round, 101)
            found["rule_us"] = round(100 * found["tick_ms"])
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
    def receive(self):
        return None

    def send(self, datagram):
        pass


def mind(found, base):
    from sleepnode.mind import Mind

    found["code"] = used() - base
    robot = Mind(("fuel", "ordnance"), ("speed",))
    robot.values[72] = 0.0
    found["start"] = used()
    fill(robot, found)


def node(found, base):
    from sleepnode import ed25519
    from sleepnode.body import Body
    from sleepnode.node import Node

    found["code"] = used() - base
    with open("trust.json", "w") as file:
        json.dump({"keys": [{"owner": "desk", "role": "commander", "public": "%064x" % 1}]}, file)
    with open("robot.key", "w") as file:
        json.dump({"owner": "tiny", "secret": "%064x" % 7}, file)
    body = Body(stop=lambda: None)
    for name in ("fuel", "ordnance"):
        body.sensor(name, lambda: 0.9)
    body.actuator("speed", lambda value: None)
    robot = Node(body, Radio(), fleet="lab")
    robot.mind.values[72] = 0.0
    found["start"] = used()
    text, secret, public = b"x" * 200, robot._secret, robot._public
    signature = ed25519.finished(ed25519.sign(secret, public, text))
    point = ed25519.point(public)
    signing = [work(lambda: ed25519.sign(secret, public, text)) for _ in range(5)]
    checking = [work(lambda: ed25519.verify(public, point, text, signature)) for _ in range(5)]
    found["sign_ms"], found["verify_ms"] = sorted([each[1] for each in signing])[2], sorted([e[1] for e in checking])[2]
    found["slice_ms"] = sorted([each[0] for each in signing + checking])[5]
    signing = checking = point = signature = None
    fill(robot.mind, found)


found = {}
(mind if sys.argv[1] == "mind" else node)(found, used())
print(json.dumps(found))
