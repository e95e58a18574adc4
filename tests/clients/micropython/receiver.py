"""Runs under MicroPython: a node without a radio takes in the datagrams that arrive as lines of JSON, and says what
became of each: `passed`, `kept` for a part that waits for others, or why it was dropped. Also decodes and signs."""

import gc
import json
import sys

from sleepnode import ed25519, points
from sleepnode.body import Body
from sleepnode.cbor import Malformed
from sleepnode.envelope import content, look, names, payload, sealed, signed
from sleepnode.keeping import keep, stops
from sleepnode.node import Node
from sleepnode.releasing import holding

REASONS = [
    "",
    "malformed",
    "unknown key",
    "revoked key",
    "not allowed",
    "late",
    "from the future",
    "repeated",
    "too many",
    "forged",
    "other fleet",
    "no room",
    "no memory",
    "not sent",
    "too long to send",
    "ours",
    "not needed",
]


class Radio:
    def receive(self):
        return None

    def send(self, datagram):
        pass


class Clock:
    def __init__(self, now):
        self._now, self.is_set, self.taken = now, True, 0

    def now(self):
        return self._now

    def set(self, now):
        self.taken = now


def take(node, datagram):
    """What becomes of a datagram that is verified, whether the node needs it or not."""
    taken, heard, needs = [], node._take, node._needs
    node._take = lambda message: taken.append(message[1])
    node._needs = lambda kind, part: True
    before = list(node.dropped)
    try:
        reason = node._look(datagram)
        if reason:
            return REASONS[reason]
        while node.stop or node.job or node._jobs:
            node._work()
    except Malformed:
        return "malformed"
    finally:
        node._take, node._needs = heard, needs
    for at in range(len(before)):
        if node.dropped[at] > before[at]:
            return REASONS[at]
    if taken and taken[0] == 9:
        part = look(datagram)
        node.streams.of((part[0], part[2]))[0] = part[3]  # as if it had been obeyed
    return "passed" if taken else "kept"


node = None
for line in sys.stdin:
    asked = json.loads(line)
    if "fleet" in asked:
        node = None
        gc.collect()
        node = Node(Body(stop=lambda: None), Radio(), fleet=asked["fleet"], name="r3")
        node.clock = Clock(asked["now"])
        node.nonce = bytes.fromhex(asked["nonce"]) or None
        print(json.dumps({"name": node.name}))
    elif "read" in asked:
        try:
            part = look(bytes.fromhex(asked["read"]))
            said = names(part[8])
            print(json.dumps({"kind": part[1], "numbers": part[2:8], "names": said[:2], "piece": bytes(said[2]).hex()}))
        except Malformed:
            print(json.dumps({}))
    elif "content" in asked:
        text, body = content(bytes.fromhex(asked["content"]))
        print(json.dumps({"text": text, "keys": sorted(body)}))
    elif "seed" in asked:
        secret = points.expand(bytes.fromhex(asked["seed"]))
        public = points.public_key(secret)
        found = payload(asked["kind"], asked["numbers"], asked["lab"], asked["sender"], asked["text"], b"\xa0")
        signature = ed25519.finished(ed25519.sign(secret, public, signed(found)))
        datagram = sealed(bytes.fromhex(asked["key"]), found, signature)
        print(json.dumps({"public": public.hex(), "datagram": datagram.hex()}))
    elif "looked" in asked:
        node.driven = asked["driven"]
        if asked["rules"]:
            node.streams.of((bytes.fromhex(asked["key"]), 1))[1] = asked["rules"]
        node.streams._speaks = 0 if asked["speaks"] else None
        reason, node._jobs = node._look(bytes.fromhex(asked["looked"])), []
        print(json.dumps({"reason": REASONS[reason]}))
    elif "busy" in asked:
        said = []
        node.radio.send = said.append
        for each in asked["busy"]:
            node._look(bytes.fromhex(each))
        while (node._jobs or node.job) and len(said) < asked["most"]:
            node.say(6, {"label": "busy", "values": []})
            node._work()
        print(json.dumps({"said": len(said), "left": len(node._jobs)}))
    elif "digests" in asked:
        streams, which, found = node.streams, bytes.fromhex(asked["key"]), []
        streams._speaks = None
        for each in asked["digests"]:
            have = [[which, epoch, number] for epoch, number in each]
            found.append(streams.matters(have, lambda key: True))
            streams.compare(have, lambda key: True, asked["now"], bytes.fromhex(asked.get("teller", "00")))
        print(json.dumps({"matter": found}))
    elif "stops" in asked:
        latch = node.latch
        if "before" in asked:
            keep("before.json", asked["before"])
            latch.holding = stops("before.json")
        for each in asked["stops"]:
            latch.stop(each, {})
        held, freed = latch.rows(), []
        for sender, ends in asked["releases"]:
            freed.append(latch.release([sender, 1, 2**40, "key of " + sender], {"ends": ends}))
        print(json.dumps({"held": held, "freed": freed, "left": latch.rows(), "names": holding(node)}))
    elif "begun" in asked:
        streams, found = node.streams, []
        for key, epoch, standing in asked["begun"]:
            streams.take((bytes.fromhex(key), epoch), 5, standing, {}, [0, 0, 0, 5, 0], asked["now"])
        for key, sender, epoch in asked["begun_by"]:
            node.trust.note((bytes.fromhex(key), sender, epoch), 5)
        known = [name[0].hex() for name in streams._streams]
        print(json.dumps({"streams": known, "heard": [name[0].hex() for name in node.trust._heard]}))
    elif "waits" in asked:
        node._jobs, node.streams._speaks = [bytes.fromhex(each) for each in asked["waits"]], 0
        node.streams.theirs = {b"r": {(bytes.fromhex(asked["key"]), 1): asked["told"]}}
        node.streams._told = node.clock.now()
        node._calm = node.tick + asked["calm"]
        node._speak(asked["now"])
        print(json.dumps({"said": [each[1] for each in node.out], "eager": node.streams.eager}))
    elif "follows" in asked:
        streams, which = node.streams, bytes.fromhex(asked["key"])
        streams.take((which, 1), 9, False, asked["follows"], None, asked["now"])
        streams.compare([[which, 1, asked["told"]]], lambda key: True, asked["now"], b"r")
        print(json.dumps({"wanted": [each[2] for each in streams.wanted(asked["now"] + 1000)]}))
    else:
        print(json.dumps({"became": take(node, bytes.fromhex(asked["datagram"]))}))
