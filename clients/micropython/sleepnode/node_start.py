"""How a node begins: its `__init__`, loaded once and let go again, because it would stay in memory for ever."""

import json
import os

from micropython import const

from sleepnode.keeping import kept
from sleepnode.keeping import stops as kept_stops
from sleepnode.latch import Latch
from sleepnode.mind import Mind
from sleepnode.points import expand, public_key
from sleepnode.radio import Clock
from sleepnode.reader import Refused, unload
from sleepnode.streams import Streams
from sleepnode.trust import Trust, key_id

_SLOWEST = const(500)
_UNUSABLE = (OSError, ValueError, KeyError, TypeError, AttributeError, MemoryError)
_WHY = "%s cannot be used (%r): copy it again from where `sleepcast keys` has put it"


def begin(
    robot,
    body,
    radio,
    key="robot.key",
    trust="trust.json",
    stops="stops.json",
    waits="waits.json",
    fleet="",
    lease=1.0,
    number=0,
    seed=0,
    name=None,
    tick=0.1,
):
    """See `Node`."""
    robot.body, robot.radio, robot.fleet = body, radio, fleet
    owner, secret = load_key(key)
    robot.name = name or owner
    robot._secret = expand(secret)
    robot._public = public_key(robot._secret)
    unload("points")
    robot.key = key_id(robot._public)
    robot.trust, robot.clock, robot.latch = _trusted(trust), Clock(), Latch()
    sensors = [each[0] for each in body.sensors]
    actuators = [each[0] for each in body.actuators]
    robot.mind = Mind(sensors, actuators, body.constants, body.functions, number, seed)
    robot.stopped = robot.driven = robot.catching_up = robot._still = False
    robot.dropped = [0] * 17
    """Datagrams that were dropped, by the numbers above."""
    now = robot.clock.now()
    robot._epoch = now if robot.clock.is_set else int.from_bytes(os.urandom(6), "big")
    robot.number, robot.zero = 0, now
    robot.streams = Streams(now)
    robot._lease, robot._heard = lease, None
    robot.stop = robot.job = robot._signing = None
    robot._stops, robot._turn = 0, False
    robot._jobs, robot._queue, robot.out = [], [], []
    robot._calm = 0
    robot.answered = []
    robot.pieces = {}
    robot.next, robot.tick, robot.every = now, 0, min(max(int(1000 * tick), 1), _SLOWEST)
    robot.nonce, robot.asked, robot._pause = None, now - 16000, 2000
    robot.whom, robot.came, robot._sender = "", 0, ""
    robot._stops_file, robot.waits_file = stops, waits
    robot.waiting, robot.clocks, robot.stopped_at = [], {}, 0
    """What waits for an instant, the clocks of those who have sent it (`timing.py`), and the time of the last STOP."""
    robot.bids, robot.bid_at = [], 0
    """Bids and memberships (`bidding.py`), and when to look at them."""
    robot.latch.holding = kept_stops(stops)
    robot._kept = robot.latch.holding[:]
    if robot.latch.holding:
        robot.halt()
    robot.waiting = robot.seldom("timing", "restored", now)
    robot.look_at = 0 if robot.waiting else None
    """When to look at what waits, None for never."""
    robot.mind.cancel = robot.cancel


def load_key(file):
    """Owner and seed of a key file of `sleepcast keys`. Raises Refused."""
    try:
        with open(file) as opened:
            key = json.load(opened)
        return key["owner"], bytes.fromhex(key["secret"])
    except _UNUSABLE as error:
        raise Refused(_WHY % (file, error))


def _trusted(file):
    """Whom a trust file of `sleepcast keys` names. Raises Refused."""
    trust = Trust(file)
    try:
        stored = kept(file)
        for key in stored["keys"]:
            trust.add(key["owner"], key["role"], bytes.fromhex(key["public"]), key.get("revoked", False))
        trust.gone = [bytes.fromhex(each) for each in stored.get("gone", ())]
    except _UNUSABLE as error:
        raise Refused(_WHY % (file, error))
    return trust
