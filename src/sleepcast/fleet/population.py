"""What becomes of a fleet's minds when robots come and go: a child has all that its parent has learned and knows, and a
random stream, a name and messages of its own; one without a parent is as robots are at the start; nothing is left of
one that is gone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from sleepcast.channel.message_batch import NameIndex
from sleepcast.columns.values import Index, Rows
from sleepcast.fleet.state import FleetState, streams
from sleepcast.language.vocabulary import ID
from sleepcast.mind.authority import Latch
from sleepcast.mind.merging import Merging

if TYPE_CHECKING:
    from sleepcast.fleet.fleet import Fleet


def turn_over(fleet: Fleet, names: NameIndex, parents: Index, children: Index, numbers: Index, dead: Index) -> None:
    """Robots have come to the rows `children`, each from the parent in its place, or from nobody if that is itself,
    with these `numbers`, from 0; and those of the rows `dead` have gone. names: of all from now on."""
    changed = np.concatenate((children, dead))
    _teach(fleet.state, parents, children, numbers)
    _forget(fleet.state, dead)
    for measured in fleet.measured.values():
        measured[children], measured[dead] = measured[parents], -np.inf
    fleet.names = names
    fleet.numbers = _ids(fleet.numbers, children, numbers, dead)
    fleet.memory.statistics.turn_over(parents, children, dead)
    fleet.authority.turn_over(parents, children, dead)
    for when in fleet.arrived.values():
        when[children] = when[parents]
    fleet.inbox.turn_over(parents, children, dead)
    fleet.outbox.turn_over(names, changed)
    fleet.bids.turn_over(parents, children, dead)
    fleet.timing.turn_over(parents, children, dead)
    fleet.evaluation_log.turn_over(changed)
    fleet.telemetry.turn_over(changed)
    for row in changed.tolist() if fleet.scheduler.left_over else ():
        fleet.scheduler.left_over.pop(row, None)


def renumber(fleet: Fleet, names: NameIndex, numbers: Index) -> None:
    """Other robots are there than at the start: these, with these numbers by row, below 0 for none."""
    fleet.names = fleet.outbox.names = names
    fleet.numbers = (numbers + 1).tolist()
    fleet.state.keys[:] = streams(fleet.state.seed, numbers + 1)


def _ids(ids: Sequence[int], children: Index, numbers: Index, dead: Index) -> list[int]:
    """The robots' ids from now on, 0 where there is none."""
    later = list(ids)
    for row in dead.tolist():
        later[row] = 0
    for row, number in zip(children.tolist(), numbers.tolist(), strict=True):
        later[row] = number + 1
    return later


def _teach(state: FleetState, parents: Index, children: Index, numbers: Index) -> None:
    """Let children have what their parents have."""
    state.copy_robots(parents, children)
    if (alone := children[children == parents]).size:
        state.begin_robots(alone, state.at_first)
    state.own(ID)[children] = numbers + 1.0
    state.keys[children] = streams(state.seed, numbers + 1)
    for column in (state.mind, state.proven, state.unproven_since, state.stopped, state.held, state.still):
        column[children] = column[parents]
    state.latch.copy(parents, children)
    state.merging.copy(parents, children)
    _count_anew(state, children)


def _forget(state: FleetState, dead: Index) -> None:
    """Let nothing be left of the dead."""
    gone = Rows.of(dead)
    state.forget_robots(dead)
    state.turn(gone, 0)
    for column in (state.proven, state.unproven_since, state.stopped, state.held, state.still):
        column[dead] = 0
    state.latch.set(gone, Latch())
    state.merging.set(gone, Merging())
    _count_anew(state, dead)


def _count_anew(state: FleetState, robots: Index) -> None:
    """Nothing was counted yet of these robots."""
    for column in (state.draws, state.dropped, state.lost, state.reported_in, state.reported):
        column[robots] = 0
    state.telling_until[robots] = 0.0
    state.rate_limited[robots] = state.crowded[robots] = False
    for assigned in state.actuated.values():
        assigned[robots] = False
    state.castes()[robots] = np.nan
