"""The node: a radio, a mind and a body, ten times a second unless said otherwise, and the radio in between.

Datagrams are looked at as they come, and their signatures verified in slices, one at a time: a STOP goes before
everything else, whenever it comes. Whatever the node says is signed in slices as well.
"""

import gc
import random

from micropython import const

from sleepnode import ed25519
from sleepnode.cbor import Malformed, encode
from sleepnode.envelope import content, look, names, payload, sealed, signed
from sleepnode.mind import bid_of, command_of
from sleepnode.reader import Refused, unload
from sleepnode.trust import make_room, not_stored

_ASK = const(1)
_STOP = const(2)
_RELEASE = const(3)
_HEARTBEAT = const(4)
_ANSWER = const(5)
_REPORT = const(6)
_DIGEST = const(7)
_REQUEST = const(8)
_STANDING = const(9)
_OWNER = const(0)
_ROLE = const(1)

# Why a datagram is dropped; other reasons are those of `trust.py`.
_MALFORMED = const(1)
_NOT_ALLOWED = const(4)
_LATE = const(5)
_FROM_THE_FUTURE = const(6)
_REPEATED = const(7)
_TOO_MANY = const(8)
_FORGED = const(9)
_OTHER_FLEET = const(10)
_NO_ROOM = const(11)
_NO_MEMORY = const(12)
_NOT_SENT = const(13)
_TOO_LONG_TO_SEND = const(14)
_OURS = const(15)
_NOT_NEEDED = const(16)

_SKEW = const(2000000)
_OLDEST = const(3600000000)
_MAX_JOBS = const(6)
_MAX_WAITING = const(2400)
"""Bytes of datagrams that wait to be verified: two long ones."""
_KIND = const(22)
"""Where a datagram says its kind."""
_KEYS = const(b"\x64keys")
"""In the body of a change of keys."""
_CALM = const(100)
"""Ticks after a forgery until datagrams wait in the order of their numbers again."""
_MAX_PARTS = const(3)
_MAX_QUEUE = const(16)
_MAX_OUT = const(16)
_MAX_REASON = const(120)
"""Characters of why a body does not stop: a fault has 200, and may have to say as well that it is not stored."""
_MAX_ANSWERED = const(700)
"""Bytes of answers that can be repeated."""
_RANKS = const(b"\x01\x03\x00\x00\x02\x05\x05\x04\x05\x01")
"""In which order signatures are verified, by kind: orders before questions, and those before digests."""
_PATIENCE = const(200)
"""Ticks after which messages that have not come whole are forgotten."""
_RETRY = const(300)
"""Milliseconds until what found no memory is looked at again."""
_STOPPED = const(3)
_CANCELLED = const(4)
"""States of what waited (`timing.py`)."""
_PHASE = const(3)
_OUT = const(2)
_WHY = const(4)
_MADE = const(5)
"""Places in a bid (`bidding.py`)."""
_LEAVE = const(4)
_FORGET = const(9)
"""Acts of the mind."""
_LISTEN = const(16)
"""Datagrams read at once, before the node does something else."""


class Node:
    """A robot on the air. body: see `body.py`; radio: see `radio.py`; key, trust: files of `sleepcast keys`; stops: the
    file in which it keeps which STOPs hold; waits: the one in which it keeps which commands wait for an instant.

    lease: the seconds for which a driven body goes on while no operator is heard, None for ever. number: its `id`.
    name: by default the owner of the key. tick: seconds from one tick to the next, 0.5 at most.
    """

    def __init__(self, body, radio, **given):
        self.seldom("node_start", "begin", body, radio, **given)
        gc.threshold(-1)

    def run(self):
        """Go on until interrupted, which brings the body to rest."""
        try:
            while True:
                try:
                    if not self.step():
                        self.radio.wait(self._leisure())
                except MemoryError:  # what was being done is lost, as on the air; the sender repeats it
                    self.job = self._signing = None
                    if self.stop:  # goes before everything else
                        self.stop[1], self._jobs, self.pieces = None, [], {}
                    gc.collect()
                    self._drop(_NO_MEMORY)
                except Exception:  # whatever a message says, the node goes on
                    self.job = self.stop = None
                    self._drop(_MALFORMED)
        finally:
            self.body.stop()

    def step(self):
        """One slice of what there is to do; whether there was anything."""
        self.listen()
        busy = self._work()
        now = self.clock.now()
        if now >= self.next:
            self.next = max(self.next + self.every, now)
            self._think(now)
            return True
        return busy

    def _leisure(self):
        """Milliseconds in which nothing is due."""
        return max(min([self.next] + [each[0] for each in self.out]) - self.clock.now(), 0)

    # ---- receiving

    def listen(self):
        """Look at the datagrams that have come."""
        for _ in range(_LISTEN):
            try:
                datagram = self.radio.receive()
                if datagram is None:
                    return
                reason = self._look(datagram)
            except Malformed:
                reason = _MALFORMED
            except MemoryError:
                reason = _NO_MEMORY
            if reason:
                self._drop(reason)

    def _drop(self, reason):
        self.dropped[reason] += 1

    def _look(self, datagram):
        """Why a datagram is dropped, 0 if its signature is to be verified. Raises Malformed."""
        part = look(datagram)
        which, kind, epoch, number = part[:4]
        if which == self.key and epoch == self._epoch and names(part[8])[1] == self.name:  # others may share the key
            return _OURS
        grants = kind == _REQUEST and any([each[0][0] == which for each in self.bids])  # the only ones that matter here
        reason = self.trust.objection(which, 0 if grants else kind)
        if reason:
            return reason
        if kind == _HEARTBEAT and self.nonce and self.nonce in part[8]:
            self.came = self.clock.now()
        elif kind != _STOP:
            now = 1000 * self.clock.now()
            if now > part[5] + _SKEW or (kind != _STANDING and now > part[4] + _OLDEST + _SKEW):
                return _LATE
            if part[4] > now + _SKEW:
                return _FROM_THE_FUTURE
        owner = self.trust.keys[which][_OWNER]
        if kind != _STANDING and self.trust.knows((which, owner, epoch), number):
            return _REPEATED
        if kind in (0, _STANDING) and self.trust.keys[which][_ROLE] != "robot":
            if self.streams.has(which, epoch, number):
                return _REPEATED
            if self.streams.is_too_early(which, epoch, number) and _KEYS not in part[8]:  # those do not wait
                return _NO_ROOM
        if part[6] in self.pieces.get((which, epoch, number), ()):
            return _REPEATED
        if datagram in self._jobs or (self.job and part == self.job[0]):
            return _REPEATED
        if not self._needs(kind, part):
            return _NOT_NEEDED
        if kind == _DIGEST:  # the same here, since most say the same
            for at, each in enumerate(self._jobs):
                if each[_KIND] == _DIGEST:
                    if random.getrandbits(1):
                        self._jobs[at] = datagram
                    return _TOO_MANY
        if kind == _STOP:  # of many at once a random one: forgeries have only their own share
            self._stops += 1
            if self.stop is None or (not self.stop[1] and random.random() * self._stops < 1):
                self.stop = [part, None]
        else:
            size = sum([len(each) for each in self._jobs]) + len(datagram)
            if len(self._jobs) < _MAX_JOBS and size <= _MAX_WAITING:
                self._jobs.append(datagram)
            else:
                at = self._giving_way(datagram, size)
                if at is not None:
                    self._jobs[at] = datagram
                return _TOO_MANY
        return 0

    def _needs(self, kind, part):
        """Whether it is worth verifying a message, which takes far longer than reading it. Raises Malformed."""
        leased = self.driven and self._lease is not None  # whatever an operator says keeps the body going
        if kind == _HEARTBEAT:
            return leased or (self.nonce and self.nonce in part[8])
        if kind not in (_ASK, _DIGEST, _RELEASE) or part[7] > 1:
            return True
        body = content(names(part[8])[2])[1]
        if kind == _DIGEST:
            return self.streams.matters(body.get("have"), self._commands)
        return leased or self.is_addressed(body)

    def _giving_way(self, datagram, size):
        """Which of the waiting datagrams gives way to this one, None if this one does. size: bytes of all."""
        jobs, rank = self._jobs, _RANKS[datagram[_KIND]]
        same = [at for at, each in enumerate(jobs) if _RANKS[each[_KIND]] >= rank and size - len(each) <= _MAX_WAITING]
        if not same:
            return None
        place = self._place(datagram)
        if len(place) == 1:  # of many at once a random one, but orders before questions
            return same[random.getrandbits(8) % len(same)]
        last = max(same, key=lambda at: self._place(jobs[at]))
        return last if place < self._place(jobs[last]) else None

    def _place(self, datagram):
        """When it is verified, among those that wait: commands in the order of their numbers, standing ones after
        others, because they come again. While there are forgeries, which could have any number, only kinds count."""
        kind = datagram[_KIND]
        place = bytes((_RANKS[kind],))
        if kind in (0, _STANDING) and self.tick >= self._calm:
            place += bytes((kind,)) + datagram[9:17] + datagram[24:41]
        return place

    def _work(self):
        """A slice of verifying or signing; whether there was anything to do."""
        if self.stop is not None:
            self._turn = not self._turn
            # A flood of forged STOPs must not keep a robot that has stopped from saying so.
            return (self.stopped and self._turn and self._sign()) or self._go_on(self.stop, True)
        if self.job is None:  # one after the other, because each takes memory, as obeying a message does
            if self._signing:
                return self._sign()
            if self._queue:
                if self._queue[0][1] != _STANDING:
                    return False
                self._obey_first()  # it waits for no tick: there may be thousands after it
                return True
            if self.streams.eager and not self._jobs:
                self.streams.eager = False
                self._ask_for_more()
            self._turn = not self._turn  # in turns: whatever there is to say, others are listened to
            if self._turn and self._sign():
                return True
        if self.job is None and self._jobs:
            first = min(range(len(self._jobs)), key=lambda at: self._place(self._jobs[at]))
            self.job = [look(self._jobs.pop(first)), None]
        return self._go_on(self.job, False) if self.job is not None else self._sign()

    def _go_on(self, job, on):
        part = job[0]
        if job[1] is None:
            job[1] = self.trust.verification(part[0], signed(part[8]), part[9])
        try:
            next(job[1])
            return True
        except StopIteration as end:
            good = end.value
        if on:
            self.stop, self._stops = None, 0
        else:
            self.job = None
        try:
            if not good:
                self._calm = self.tick + _CALM
                self._drop(_FORGED)
            else:
                self._verified(part, names(part[8]))
        except Malformed:
            self._drop(_MALFORMED)
        return True

    def _verified(self, part, name):
        which, kind, epoch, number, issued, deadline, at, parts = part[:8]
        fleet, sender, piece = name
        if fleet != self.fleet or not self.trust.is_of(which, sender):
            self._drop(_OTHER_FLEET if fleet != self.fleet else _NOT_ALLOWED)
            return
        if kind != _STANDING and self.trust.knows((which, sender, epoch), number):
            self._drop(_REPEATED)
            return
        message = [which, kind, epoch, number, issued, deadline, sender, "", {}]
        said = ""
        if parts > _MAX_PARTS:
            said = "a message of %d parts is too long for this computer" % parts
        elif parts > 1:
            waiting = self.pieces.setdefault((which, epoch, number), {})
            waiting[at] = piece
            if len(waiting) < parts:
                if len(self.pieces) > 2:
                    make_room("pieces", self.pieces, (which, epoch, number))
                return
            del self.pieces[which, epoch, number]
        try:
            if parts > 1 and not said:
                piece = b"".join([bytes(waiting.pop(each)) for each in range(parts)])
            message[7:] = ("", {}) if said else content(piece)
        except MemoryError:
            gc.collect()
            said = "too long for the memory of this computer"
        self.trust.note((which, sender, epoch), number)
        if said:
            self.streams.of((which, epoch))[0] = max(number, self.streams.of((which, epoch))[0])
            self.answer(message, "fault", None, said)
        else:
            self._take(message)

    # ---- messages: [key, kind, epoch, number, issued, deadline, sender, text, body]

    def _take(self, message):
        which, kind, epoch, number = message[:4]
        body, role, now = message[8], self.trust.keys[which][_ROLE], self.clock.now()
        if kind == _DIGEST:
            self.streams.compare(body.get("have"), self._commands, now, which)
            return
        if kind == _HEARTBEAT and "time" in body:
            if body["time"] == self.nonce:
                self.seldom("timing", "take_time", message, now)
            return
        if kind == _REQUEST:
            if "grants" in body:
                self.seldom("bidding", "hear", message)
            return
        if role in ("operator", "commander") and kind != _STANDING:
            self._heard = now
        if kind == _STOP:
            self._obey_stop(message)
        elif kind == _RELEASE and self.is_addressed(body):
            self._obey_release(message)
        elif kind == _ASK and "again" in body:
            self.seldom("telemetry", "say_again", body)
        elif kind in (0, _STANDING) and role != "robot":
            if "keys" in body:
                if kind == _STANDING and role == "commander":
                    reason = self.trust.change(body["keys"])
                    self.streams.theirs = {}  # perhaps under a key that nobody trusts any more
                    done = not reason or reason.endswith("not stored")
                    self.answer(message, "matched" if done else "fault", None, reason)
                message[7] = ""
            ready, gone = self.streams.take((which, epoch), number, kind == _STANDING, body, message, now)
            if gone is not None:
                self.trust.forget((which, gone[6], epoch), gone[3])
            for each in ready:
                self._enqueue(each)
        elif kind in (0, _ASK):
            self._enqueue(message)

    def _enqueue(self, message):
        old = message[1] != _STANDING and message[4] < 1000 * (self.streams.since - 2000)
        if old or "keys" in message[8] or not self.is_addressed(message[8]):
            return
        if len(self._queue) < _MAX_QUEUE:
            self._queue.append(message)
        else:
            self._drop(_NO_ROOM)

    def _commands(self, which):
        return not self.trust.objection(which, _STANDING)  # digests tell of nothing else

    def is_addressed(self, body):
        only, others = body.get("for"), body.get("not", [])
        if not isinstance(others, list) or self.name in others:
            return False
        return "for" not in body or (isinstance(only, list) and self.name in only)

    def _obey_stop(self, message):
        body = message[8]
        if not self.latch.stop([message[6], message[2], message[3], message[0].hex()], body):
            self.answer(message, "fault", None, "a RELEASE that was sent later has ended this STOP")
            return
        fault = self._keep_stops(self.halt())
        if self.is_addressed(body):
            self.answer(message, "stopped", None, fault)

    def _keep_stops(self, fault=""):
        """Write which STOPs hold, unless the file says so already; gives what failed, after this fault."""
        if self._kept == self.latch.holding:
            return fault
        try:
            from sleepnode.keeping import keep

            self._kept = None
            keep(self._stops_file, self.latch.holding)
            self._kept = self.latch.holding[:]
        except (OSError, MemoryError) as error:
            return not_stored(self._stops_file, error, fault)
        finally:
            unload("keeping")
        return fault

    def halt(self):
        """Stop the body, and keep it stopped."""
        self.stopped = self.mind.held = True
        self.mind.dirty = []
        fault = self._rest()
        self._discard(_STOPPED)
        self.stopped_at = self.clock.now()
        return fault

    def _discard(self, why, sender=None):
        """Let what waits of this sender, or of all, wait no more, and end bids; gives how many commands that were."""
        count = 0  # no float, which takes memory: a STOP needs none
        for row in self.waiting:
            if row[3] < _STOPPED and (sender is None or row[0][6] == sender):
                row[3] = why
                self.look_at = 0
                count += 1
        for bid in self.bids:
            if bid[_PHASE] != _OUT and (sender is None or bid[0][6] == sender):
                bid[_PHASE], bid[_WHY] = _OUT, why
                self.bid_at = 0
                count += 1
        return count

    def cancel(self):
        """CANCEL, as the mind calls it."""
        return 1.0 if self.mind.asked else float(self._discard(_CANCELLED, self._sender))

    def is_still(self):
        """Whether nobody is to count on it."""
        return self.stopped or self.catching_up or self.mind.values[2] or self.mind.values[3]

    def _rest(self):
        try:
            self.body.stop()
        except Exception as error:
            return ("the body does not stop: %r" % error)[:_MAX_REASON]
        return ""

    def _obey_release(self, message):
        free = self.latch.release([message[6], message[2], message[3], message[0].hex()], message[8])
        if free:
            self.stopped = self.mind.held = False
            self.body.release()
        fault = self._keep_stops()
        if not free:
            fault = "the STOP %s holds: the RELEASE does not name it" % self.seldom("releasing", "holding")
        self.answer(message, "released" if free else "fault", None, fault)

    # ---- ticks

    def _think(self, now):
        mind, seconds = self.mind, (now - self.zero) / 1000
        self.tick += 1
        if self.tick % _PATIENCE == 0:
            self.pieces = {}
        mind.begin(self.tick, seconds)
        self.body.sense(mind, 70)
        quiet = self._heard is None or now - self._heard > 1000 * (self._lease or 0)
        if self.driven and self._lease is not None and quiet:
            self.driven = False
            mind.dirty = []
            fault = self._rest()
            if not self.stopped:
                self.body.release()
            mind.report(fault or "at rest: nobody drives it any more", ())
        for message in self.streams.expire(now):
            self._enqueue(message)
        while self._queue:
            self._obey_first()
        if self.bids and now >= self.bid_at:
            self._obey_granted(now)
        if self.look_at is not None and now >= self.look_at:
            self._obey_waiting(now)
        self.catching_up = self.streams.is_catching_up(now)
        if mind.round(self.catching_up):
            self.driven = False
        still = bool(self.catching_up or mind.values[2] or mind.values[3])
        if still != self._still:
            self._still = still
            if still:
                self._rest()
            elif not self.stopped:
                self.body.release()
        if not self.is_still():
            fault = self.body.act(mind)
            if fault:
                mind.report(fault, ())
        self._speak(now)

    def _obey_first(self):
        message = self._queue.pop(0)
        try:
            self._obey(message)
        except MemoryError:
            self._drop(_NO_MEMORY)
            gc.collect()
            self.answer(message, "fault", None, "out of memory")

    def _obey(self, message):
        kind, body = message[1], message[8]
        if 1000 * self.clock.now() > message[5]:
            self.answer(message, "late", None, "")
            return
        if kind == _ASK and "look" in body:
            more = self.seldom("telemetry", "told", body)
            self.answer(message, "answer", None, more.pop("fault", ""), more)
            return
        if "lease" in body:
            self.answer(message, "fault", None, "this robot knows no leases of groups")
            return
        found = self._outcome(message)
        if found:
            self.answer(message, *found)

    def _outcome(self, message, inside=None):
        """What comes of a text, as for an answer; None if nobody wants to know now. inside: see `Mind.compile`."""
        kind, sender, body, mind = message[1], message[6], message[8], self.mind
        if self.trust.objection(message[0], kind):
            return "fault", None, "the key of %s is not trusted any more" % sender, {}
        role = self.trust.keys[message[0]][_ROLE]
        try:
            program = mind.compile(message[7], inside)
            if kind == _ASK and isinstance(mind.whole, float):
                program = mind.compile(message[7], command_of)
        except Refused as error:
            return "fault", None, error.sentence(), {}
        if kind == _ASK:
            value = mind.ask(program)
            more = {"matched": mind.matched} if "matched" in body else {}
            if more and mind.undecided and not mind.matched:
                more["unknown"] = True
            return "answer", value, "; ".join(mind.faults), more
        if role != "commander" and mind.ruling:
            said = "only a commander's key may change rules, and that of %s is of role %s" % (sender, role)
            return "fault", None, said, {}
        if mind.whole is not None:
            program = None  # it takes memory
            timed = isinstance(mind.whole, float)
            return self.seldom("timing", "let_wait", message) if timed else self._bid_for(message, mind.whole)
        hops = body.get("hops")
        mind.hops = min(max(hops, 1), 8) - 1 if isinstance(hops, int) else 0 if role == "robot" else 8
        self._sender = sender
        gc.collect()
        value = mind.run(program)
        mind.hops, self._sender = 8, ""
        if mind.moved:
            self.driven = role != "robot" and kind != _STANDING
        if role == "robot" and inside is None:
            return None
        if mind.faults:
            return "fault", value, mind.faults[0], {}
        if mind.matched:
            return "matched", value, "", {"held": True} if mind.moved and self.stopped else {}
        return "not matched", value, "", {"unknown": True} if mind.undecided else {}

    # ---- what waits for an instant, or is bid for

    def _obey_waiting(self, now):
        """Do what has waited for this tick."""
        done = []
        try:
            for row in self.seldom("timing", "step", now):
                if row[3] < _STOPPED:  # one before it may have been a CANCEL
                    found = self._outcome(row[0], command_of)
                    self.waiting.remove(row)
                    done.append((row, found, self.clock.now()))
            if done:
                self.seldom("timing", "settle", done, now)
        except MemoryError:  # the rules go on
            self.look_at = now + _RETRY
            self._drop(_NO_MEMORY)

    def _bid_for(self, message, auction):
        """Bid for a command, or give what to answer instead."""
        said = self.seldom("polls", "objection", message)
        if said is None:
            said = self.seldom("polls", "begin", message, auction, self._outcome(message, bid_of))
        return said or None

    def _obey_granted(self, now):
        """Do what is due about bids, and obey by those that were granted."""
        try:
            done = []
            for bid in self.seldom("bidding", "tick", now):
                done.append((bid, self._outcome(bid[0], command_of)))
            if done:
                self.seldom("bidding", "settle", done, now)
        except MemoryError:  # who cannot look at its lease gives its place up
            for bid in self.bids:
                self.end(bid)
            self.bids = []
            self._drop(_NO_MEMORY)

    def end(self, bid):
        """End what a command has made that the robot has got by a bid, as far as nothing has replaced it."""
        mind = self.mind
        for is_group, key, made in bid[_MADE]:
            if is_group or mind.learned.get(key) is made:
                mind.act(_LEAVE if is_group else _FORGET, key, [])
        bid[_MADE] = ()

    def seldom(self, module, what, *of, **more):
        """Call a function of a module that is loaded when there is something to do."""
        gc.collect()  # here, where nothing that was deeper on the stack is taken for used
        try:
            return getattr(getattr(__import__("sleepnode." + module), module), what)(self, *of, **more)
        finally:
            unload("keeping", module)

    # ---- speaking: [when, kind, deadline, text, body]

    def say(self, kind, body, text="", life=5000, within=0):
        """body: perhaps encoded already."""
        now = self.clock.now()
        asks = kind in (_DIGEST, _REQUEST)  # goes before answers, and one of each at most waits
        if asks:
            self.out = [each for each in self.out if each[1] != kind]
        if len(self.out) < _MAX_OUT + 2 * asks:
            body = body if isinstance(body, bytes) else encode(body)
            what = [now + int(1000 * within * random.random()), kind, now + life, text, body]
            self.out.insert(0 if asks else len(self.out), what)
        else:
            self._drop(_NOT_SENT)

    def _ask_for_more(self):
        """Say which standing commands we have, and how many of the next ones can wait here to be verified."""
        self.say(_DIGEST, {"have": self.streams.have(), "most": _MAX_JOBS})

    def answer(self, message, outcome, value, fault, more=None):
        gc.collect()
        body = {"command": "%s-%d.%d" % (message[6], message[2], message[3]), "outcome": outcome, "value": value}
        body["fault"] = fault[:200] or None
        body.update(more or {})
        body = encode(body)
        self.answered.append(body)
        while len(self.answered) > 1 and sum([len(each) for each in self.answered]) > _MAX_ANSWERED:
            del self.answered[0]
        self.say(_ANSWER, body, within=self.within(message[8]))

    def within(self, body):
        within = body.get("within")
        return within if isinstance(within, (int, float)) and 0 < within <= 60 else 0

    def _speak(self, now):
        """Hand what the mind has said, and what the channel wants, to the radio."""
        mind, streams = self.mind, self.streams
        for label, values, rule in mind.reports:
            body = {"label": label, "values": list(values)}
            if rule:
                body["rule"] = rule
            self.say(_REPORT, body)
        for text, hops in mind.told:
            self.say(0, {"hops": hops}, text)
        mind.reports, mind.told, mind.pings = [], [], []
        if streams.missed:
            self.say(_REPORT, {"label": "missed", "values": [float(streams.missed)]})
            streams.missed = 0
        wanted = not any([each[1] == _REQUEST for each in self.out]) and streams.wanted(now)
        if wanted:
            self.say(_REQUEST, {"want": wanted})
        if streams.is_due(now):
            waits = any([each[_KIND] == _STANDING for each in self._jobs])
            if waits and streams.is_behind() and self.tick >= self._calm:
                streams.eager = True  # others would send again what waits here
            else:
                self._ask_for_more()
        if not self.clock.is_set and now - self.asked >= self._pause:
            self._pause = min(2 * self._pause, 16000)
            self.seldom("timing", "ask_time", {})

    def _sign(self):
        """A slice of signing; whether there was anything to sign."""
        now = self.clock.now()
        if self._signing is None:
            due = [each for each in self.out if each[0] <= now]
            if not due:
                return False
            self.out.remove(due[0])
            _, kind, deadline, text, body = due[0]
            self.number += 1
            numbers = self._epoch, self.number, 1000 * now, 1000 * deadline
            data = payload(kind, numbers, self.fleet, self.name, text, body)
            if data is None:
                self._drop(_TOO_LONG_TO_SEND)
                return True
            self._signing = [data, ed25519.sign(self._secret, self._public, signed(data))]
        try:
            next(self._signing[1])
        except StopIteration as end:
            data = self._signing[0]
            self.radio.send(sealed(self.key, data, end.value))
            if self.nonce and self.nonce in data:
                self.asked = self.clock.now()  # signing takes time
            self._signing = None
        return True
