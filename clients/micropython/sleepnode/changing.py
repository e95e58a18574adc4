"""A commander's change of the keys that a robot trusts. Loaded for one change and let go again."""

from micropython import const

from sleepnode.keeping import keep
from sleepnode.reader import unload
from sleepnode.trust import not_stored

_OWNER = const(0)
_ROLE = const(1)
_PUBLIC = const(2)
_REVOKED = const(4)
_MAX_KEYS = const(64)


def changed(trust, change):
    """Take a change, and write the file; gives why it cannot be taken, or that it will not outlast a restart."""
    try:
        for which in change["revoke"]:
            which = bytes.fromhex(which)
            if which in trust.keys:
                trust.keys[which][_REVOKED] = True
            elif which not in trust.gone and len(trust.gone) < _MAX_KEYS:
                trust.gone.append(which)
        for owner, role, public in change["trust"]:
            trust.add(owner, role, bytes.fromhex(public))
    except (KeyError, TypeError, ValueError):
        return "a change of keys has the lists trust, vouch and revoke"
    keys = []
    for key in trust.keys.values():
        written = {"owner": key[_OWNER], "role": key[_ROLE], "public": key[_PUBLIC].hex(), "revoked": key[_REVOKED]}
        keys.append(written)
    try:
        keep(trust.file, {"format": 1, "keys": keys, "gone": [each.hex() for each in trust.gone]})
    except (OSError, MemoryError) as error:
        return not_stored(trust.file, error)
    finally:
        unload("keeping")
    return ""
