"""What stands in config.json, or why a robot cannot begin with it, or with its key. Loaded once and let go again."""

import json
import sys

from micropython import const

from sleepnode.node_start import load_key
from sleepnode.reader import Refused

_NUMBER = (int, float)
_MAX_NAME = const(64)
_SEED = const(32)
_SETTINGS = (
    ("address", True, str, 7, 15, "an address such as 239.255.83.76"),
    ("port", True, int, 1, 65535, "a whole number from 1 to 65535"),
    ("fleet", True, str, 0, 64, "the name of a fleet, such as sleepcast"),
    ("interface", False, str, 0, 15, "the address of a network card, such as 127.0.0.1"),
    ("name", False, str, 1, 64, "the name of a robot, at most 64 characters"),
    ("lease", False, _NUMBER, 0, 3600, "seconds, at most 3600"),
    ("id", False, int, 0, 1000000, "a whole number from 0 to 1000000"),
    ("tick", False, _NUMBER, 0.001, 0.5, "seconds, from 0.001 to 0.5"),
)
"""Name, whether it must be there, type, the least and the most of it or of its length, and what is wanted."""


def begun(start):
    """The node that `start` makes of config.json, None if it cannot begin, which is said."""
    try:
        config = settings("config.json")
        check_key("robot.key", config.get("name"))
        return start(config)
    except Refused as error:
        print(error.sentence())
    except OSError as error:
        print("the channel of config.json cannot be opened: %r" % error)
    if sys.platform in ("linux", "darwin"):  # a board would only begin again
        sys.exit(1)
    return None


def settings(file):
    """The settings in a file; more than ours may stand there, and null is none. Raises Refused."""
    try:
        with open(file) as opened:
            values = json.load(opened)
    except OSError as error:
        raise Refused("%s cannot be read (%r): it lies beside main.py, and says where the channel is" % (file, error))
    except (ValueError, MemoryError):
        values = None
    if not isinstance(values, dict):
        raise Refused("%s is damaged: wanted one JSON object, such as {%s}" % (file, '"address": "239.255.83.76", ...'))
    values = {name: value for name, value in values.items() if value is not None}
    for name, needed, kind, least, most, wanted in _SETTINGS:
        value = values.get(name)
        if value is None and not needed:
            continue
        size = value
        if kind is str and isinstance(value, str):
            size = len(value)
            if name in ("address", "interface") and value and not _is_address(value):
                size = -1
        if not isinstance(value, kind) or isinstance(value, bool) or not least <= size <= most:
            raise Refused('%s: "%s" is %s, but wanted is %s' % (file, name, json.dumps(value), wanted))
    return values


def check_key(file, name):
    """Look whether a robot can sign with a key file of `sleepcast keys`. name: the one it is to have, None for that of
    the key. Raises Refused."""
    owner, seed = load_key(file)
    if not isinstance(owner, str) or not 0 < len(owner) <= _MAX_NAME or len(seed) != _SEED:
        raise Refused("%s holds no key: copy it again from where `sleepcast keys` has put it" % file)
    if owner[-1] == "*":
        fits = name is not None and name.startswith(owner[:-1])
    else:
        fits = name is None or name == owner
    if not fits:
        wanted = '"name" in config.json is %s, but wanted is such a name' % json.dumps(name)
        raise Refused("the key of %s is for %s: %s" % (file, owner, wanted))


def _is_address(text):
    parts = text.split(".")
    return len(parts) == 4 and all([part.isdigit() and len(part) < 4 and int(part) < 256 for part in parts])
