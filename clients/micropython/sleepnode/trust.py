"""Whom a robot obeys: the keys it knows, what their roles may send, and which messages it has heard already."""

import hashlib

from micropython import const

from sleepnode import ed25519
from sleepnode.reader import unload

_OWNER = const(0)
_ROLE = const(1)
_PUBLIC = const(2)
_POINT = const(3)
_REVOKED = const(4)
"""Places in a key. _POINT is computed when it is first needed."""
_UNKNOWN_KEY = const(2)
_REVOKED_KEY = const(3)
_NOT_ALLOWED = const(4)
_WINDOW = const(256)
"""Numbers back from the latest that are told apart; older ones count as received."""
_MAX_KEYS = const(64)
_MAX_REASON = const(60)
"""Characters of which file could not be written, and why: a fault has 200, and its end counts."""
_MAX_SENDERS = const(32)
_MAY = {"observer": (1, 2, 7), "operator": (0, 1, 2, 3, 4, 7), "commander": (0, 1, 2, 3, 4, 7, 9), "robot": (0, 2, 7)}
"""Numbers of the kinds that a robot takes from each role; it has nothing to send again, so no requests."""


def make_room(what, *of):
    """Let one entry of a full table give way: `what` is a function of `crowding.py`."""
    try:
        from sleepnode import crowding

        getattr(crowding, what)(*of)
    finally:
        unload("crowding")


def _point(public):
    try:
        from sleepnode.points import point

        return point(public)
    finally:
        unload("points")


def key_id(public):
    return hashlib.sha256(public).digest()[:8]


def not_stored(file, error, fault=""):
    """What an answer says, after its other fault, if a file could not be written: its end is the same on all robots."""
    said = ("%s: %r" % (file, error))[:_MAX_REASON] + "; not stored"
    return fault + "; " + said if fault else said


class Trust:
    """See the module. file: a trust file of `sleepcast keys`; changes are written to it."""

    def __init__(self, file):
        self.file = file
        self.keys = {}
        self.gone = []
        self._heard = {}

    def add(self, owner, role, public, revoked=False):
        which = key_id(public)
        if which not in self.keys and len(self.keys) < _MAX_KEYS and role in _MAY and len(public) == 32:
            self.keys[which] = [owner, role, public, None, revoked or which in self.gone]

    def objection(self, which, kind):
        """Why a message of this kind under this key is dropped (a number of `node.py`), 0 if it is not."""
        key = self.keys.get(which)
        if key is None:
            return _UNKNOWN_KEY
        if key[_REVOKED]:
            return _REVOKED_KEY
        return 0 if kind in _MAY[key[_ROLE]] else _NOT_ALLOWED

    def verification(self, which, message, signature):
        """The work of checking a signature, in slices."""
        key = self.keys[which]
        if key[_POINT] is None:
            key[_POINT] = _point(key[_PUBLIC])
        return ed25519.verify(key[_PUBLIC], key[_POINT], message, signature)

    def is_of(self, which, name):
        owner = self.keys[which][_OWNER]
        return name.startswith(owner[:-1]) if owner.endswith("*") else name == owner

    def change(self, change):
        """Take a commander's change of keys; gives why it cannot be taken."""
        try:
            from sleepnode.changing import changed

            return changed(self, change)
        finally:
            unload("changing")

    # ---- what was heard

    def knows(self, name, number):
        """Whether this number was heard. name: key, sender and epoch."""
        heard = self._heard.get(name)
        if heard is None or number > heard[0]:
            return False
        return heard[0] - number >= _WINDOW or bool(heard[1] >> (heard[0] - number) & 1)

    def forget(self, name, number):
        """This number is to come again."""
        heard = self._heard.get(name)
        if heard is not None and 0 <= heard[0] - number < _WINDOW:
            heard[1] &= ~(1 << (heard[0] - number))

    def note(self, name, number):
        """This number was heard."""
        heard = self._heard.get(name)
        if heard is None:
            if len(self._heard) >= _MAX_SENDERS:
                make_room("heard", self._heard, name[0])
            heard = self._heard[name] = [number, 1, 0]
        elif number > heard[0]:
            heard[1] = (heard[1] << min(number - heard[0], _WINDOW) | 1) & (1 << _WINDOW) - 1
            heard[0] = number
        elif heard[0] - number < _WINDOW:
            heard[1] |= 1 << (heard[0] - number)
        heard[2] = max([each[2] for each in self._heard.values()]) + 1
