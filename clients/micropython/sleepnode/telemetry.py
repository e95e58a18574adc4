"""What a robot tells about itself when it is asked (docs/wire.md, telemetry requests). Loaded for one answer."""

import hashlib
import json
import struct

from micropython import const

from sleepnode.cbor import encode

_ANSWER = const(5)


def told(node, body):
    """The fields of the answer."""
    what = body.get("look")
    if what == "vocabulary":
        return {"told": vocabulary(node.body)}
    if what == "mind":
        return {"told": learned(node.mind)}
    if what != "telemetry":
        return {"fault": "this robot tells its telemetry, vocabulary and mind, not its %s" % what}
    mind = node.mind
    values = mind.values[:4] + mind.values[67 : mind.first_user]
    said = (
        _digest(vocabulary(node.body)),
        _digest(learned(mind)),
        b"".join([struct.pack("<d", float("nan") if each is None else each) for each in values]),
        sum([1 << at - 1 for at in range(1, 64) if mind.values[3 + at]]),
        b"",
        {},
        mind.groups(),
        node.stopped,
        node.driven,
    )
    names = "type mind values active running user groups stopped driven".split()  # so they need not stay in memory
    record = {names[at]: said[at] for at in range(9)}
    for key, slot in mind.learned.items():
        if isinstance(slot, int):
            value = mind.values[slot]
            said[5][key] = float("nan") if value is None else value
    if node.catching_up:
        record["catching_up"] = True
    more = {"told": record}
    if node.latch.holding:
        more["stops"] = [each + [0.0] for each in node.latch.rows()]
    return more


def vocabulary(body):
    """The names of this type of robot as a text."""
    names = {"name": "small computer", "sensors": [], "actuators": [], "constants": [], "functions": [], "forms": []}
    names["forms"] += "after-issue", "best"
    for kind in ("sensors", "actuators"):
        for name, _, unit, low, high in getattr(body, kind):
            names[kind].append([name, unit, low, high, None, "", ""])
    for name in sorted(body.constants):
        names["constants"].append([name, body.constants[name], None, ""])
    for each in body.functions:
        more = 1 if each.labelled else 0
        most, least = each.most - more, each.least - more
        names["functions"].append([each.name, [None] * most, least, "", None, each.acts, each.labelled, False, ""])
    return json.dumps(names)


def learned(mind):
    """The names of its groups as a text. The texts of its rules and operators are not kept."""
    groups = sorted([key for key, meaning in mind.learned.items() if meaning == "group"])
    return json.dumps({"groups": groups, "operators": [], "rules": []})


def _digest(text):
    return hashlib.sha256(text.encode()).digest()[:8]


def say_again(node, body):
    """An operator has missed answers."""
    if ("for" in body or "not" in body) and isinstance(body["again"], str) and node.is_addressed(body):
        command = encode(body["again"])
        for answer in node.answered:
            if command in answer and not any([each[4] is answer for each in node.out]):
                node.say(_ANSWER, answer, within=node.within(body))
