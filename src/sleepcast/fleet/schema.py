"""The serialized state of a fleet: plain data from which it can be restored; `mind.state` holds what its robots have
learned.

Robots are identified by their indices. Values that only last within a tick are not included, nor are the inputs of
past commands, from which explanations are made.
"""

from __future__ import annotations

from typing import Generic, TypeVar

import msgspec

from sleepcast.channel.message import Message
from sleepcast.channel.message_batch import MessageBatchState
from sleepcast.columns.values import ValuesState
from sleepcast.core.serial import Array, Arrays
from sleepcast.mind.authority import Driving, Latch, Lease
from sleepcast.mind.bidding import BiddingState
from sleepcast.mind.calling import CallsState
from sleepcast.mind.instants import WaitingCommand
from sleepcast.mind.merging import MergingState
from sleepcast.mind.state import SharedMinds

Value = TypeVar("Value")


class ColumnsState(msgspec.Struct):
    """`FleetState`: its values, its arrays by name, which robots have assigned each actuator (by slot, where any has),
    the latches with each robot's index into them (`orders`), and which robots have reported that they are crowded, if
    any has."""

    values: ValuesState
    arrays: Arrays
    actuated: dict[int, Array]
    orders: Arrays = {}
    latches: list[Latch] = []
    telling: Arrays = {}
    crowded: Array | None = None


class TelemetryState(msgspec.Struct):
    """The latest telemetry of each robot, and which robots were stopped then. asked: for a large fleet, the slots in
    it, each with the robots that reported it; None in older snapshots. last: the robots that reported last."""

    values: ValuesState
    stopped: Array
    asked: dict[int, Array] | None = None
    last: Array | None = None


class RuleStatisticsState(msgspec.Struct, array_like=True):
    """How one expression has performed; see `RuleStatistics`."""

    arrays: Arrays
    most_steps: int
    faulted: bool
    last_fault: dict[int, str]


class StatisticsState(msgspec.Struct):
    """All statistics and leases by key."""

    tallies: dict[str, RuleStatisticsState]
    leases: Arrays
    proven_leases: Arrays


class InboxState(msgspec.Struct):
    """seen: ids of messages with the robots that have received them (None: all), oldest first. queue: waiting messages
    with their robots."""

    seen: list[tuple[str, Array | None]]
    queue: list[tuple[Message, Array]]


class OutboxState(msgspec.Struct):
    """Messages still to be sent: together, or by robot if its outbox has been read. pings: robots and castes."""

    epoch: int
    sayings: list[MessageBatchState]
    outboxes: dict[int, list[Message]]
    pings: list[tuple[Array, Array]]
    ping_lists: dict[int, list[float]]


class SharedState(msgspec.Struct, Generic[Value]):
    """A `Shared`: its values, and each robot's index into them; None if all have the only one."""

    values: list[Value]
    column: Array | None


class AuthorityState(msgspec.Struct):
    """`FleetAuthority`, and what else depends on who has commanded. arrived: of each STOP that holds, its sender, the
    sender's epoch, and when it has reached each robot, s. leases: by group."""

    driving: SharedState[Driving]
    leases: SharedState[dict[str, Lease]]
    doubts: SharedState[str]
    catching_up: SharedState[bool]
    merging: SharedState[MergingState]
    arrived: list[tuple[str, int, Array]]


class AuctionsState(msgspec.Struct):
    """The bids and the calls of robots that have any."""

    bids: dict[int, BiddingState]
    calls: dict[int, CallsState]


class TimingState(msgspec.Struct):
    """`FleetTiming`: commands that wait, each with its robots; those that were discarded since the last tick, and why;
    when each robot was last stopped, s, None if none was."""

    waiting: list[tuple[WaitingCommand, Array]]
    gone: list[tuple[WaitingCommand, str, Array]]
    stopped: Array | None


class FleetSnapshot(msgspec.Struct):
    """The whole state.

    left_over: by robot, the rules that the budget of the last tick did not reach
    measured: by slot, when each robot last measured it (s)
    authority: None in snapshots of format 1
    auctions: None in those of 0.2.0
    timing: None where nothing waits and nobody was ever stopped
    """

    minds: SharedMinds
    state: ColumnsState
    told: TelemetryState
    tallies: StatisticsState
    inbox: InboxState
    speech: OutboxState
    left_over: dict[int, tuple[str, ...]]
    measured: dict[int, Array]
    minds_used: int
    authority: AuthorityState | None = None
    auctions: AuctionsState | None = None
    timing: TimingState | None = None
