"""What each act does, for whoever must know it before it is done: a part of op "act" has one of these names.

How a memory does it is the memory's own (`node/memory.py`, `fleet/memory.py`).
"""

from __future__ import annotations

from collections.abc import Mapping

from sleepcast.core.records import NamedTuple
from sleepcast.language.vocabulary import FROZEN, MARKED, SLEEPING


class Act(NamedTuple):
    """flag: the slot of the support flag that it sets, and the value.
    rules: whether it changes which rules and operators a robot has, or which of them run.
    teaches: whether a robot may evaluate afterwards what it would not have before.
    irreversible: whether it loses what nobody may have any more.
    """

    flag: tuple[int, float] | None = None
    rules: bool = False
    teaches: bool = False
    irreversible: bool = False


ACTS: Mapping[str, Act] = {
    "sleep": Act(flag=(SLEEPING, 1.0)),
    "wake": Act(flag=(SLEEPING, 0.0)),
    "freeze": Act(flag=(FROZEN, 1.0)),
    "thaw": Act(flag=(FROZEN, 0.0)),
    "mark": Act(flag=(MARKED, 1.0)),
    "unmark": Act(flag=(MARKED, 0.0)),
    "join": Act(),
    "leave": Act(),
    "report": Act(),
    "tell": Act(),
    "ping": Act(),
    "cancel": Act(),
    "activate": Act(rules=True, teaches=True),
    "deactivate": Act(rules=True),
    "lease": Act(rules=True),
    "defun": Act(rules=True, teaches=True),
    "forget": Act(rules=True, teaches=True, irreversible=True),
    "rollback": Act(rules=True, teaches=True, irreversible=True),
}

FLAGS: Mapping[str, tuple[int, float]] = {name: act.flag for name, act in ACTS.items() if act.flag is not None}
"""The acts that set a support flag: its slot and what it becomes."""
