"""Swarms at rest: what another swarm of the same scenario and seed needs in order to go on, in this process alone.

A small swarm is some hundreds of objects, which take several times as much memory as its numbers. At rest it is one
parcel of bytes, as in a snapshot, but without its scenario. Nothing else stays: objects would be spread over the memory
that swarms which are awake need, and each search for garbage would go through all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import msgspec

from sleepcast.channel import Message
from sleepcast.channel.simulated_radio import RadioState
from sleepcast.core.serial import pack, room_for, unpack
from sleepcast.fleet import snapshot as fleets
from sleepcast.fleet.inspection import EvaluationLog
from sleepcast.fleet.schema import FleetSnapshot
from sleepcast.loop.rerun import Inputs
from sleepcast.loop.snapshots import LoopState, go_on, loop_state
from sleepcast.loop.swarm import Swarm
from sleepcast.simulator import snapshot as simulators
from sleepcast.simulator.snapshot import SimulatorState


class RestingState(msgspec.Struct, array_like=True):
    """A swarm between two ticks. desks: the states of all of them. sent: see `Inputs.posted`."""

    simulator: SimulatorState
    fleet: FleetSnapshot
    radio: RadioState
    loop: LoopState
    desks: list[bytes]
    sent: list[tuple[int, Message]]


class RestingSwarm:
    """A swarm between two ticks, and what came from outside since its start. tick: ticks since then.

    Raises SerialError for a swarm that is too large.
    """

    __slots__ = ("_changes", "_parcel", "tick")

    def __init__(self, swarm: Swarm, inputs: Inputs) -> None:
        state = RestingState(
            simulators.state_of(swarm.simulator, whole=False),
            fleets.state_of(swarm.fleet),
            swarm.radio.state(),
            loop_state(swarm),
            [desk.state() for desk in swarm.desks],
            inputs.posted,
        )
        self.tick, self._changes = swarm.simulator.tick, tuple(inputs.changes)
        self._parcel = pack(state, room_for(len(swarm.fleet)))

    def wake(self, swarm: Swarm, again: Callable[[], Swarm]) -> Inputs:
        """Let a new swarm with its desks go on from here; gives what came from outside until now.

        again: makes another such swarm at its start; it is run until now if somebody wants to know why a robot did
            something before, since that is not kept. Nothing may have been sent but the mission.
        """
        state = unpack(RestingState, self._parcel, room_for(len(swarm.fleet)), "a swarm at rest")
        simulators.restore(swarm.simulator, state.simulator)
        go_on(swarm, state.fleet, state.radio, state.loop)
        for desk, known in zip(swarm.desks, state.desks, strict=True):
            desk.restore(known)
        swarm.fleet.evaluation_log.begin_after(partial(_evaluated_until, self.tick, again))
        return Inputs(state.sent, list(self._changes))


def _evaluated_until(tick: int, again: Callable[[], Swarm]) -> EvaluationLog:
    """What robots have evaluated up to this tick."""
    swarm = again()
    while swarm.simulator.tick < tick:
        swarm.advance(tick - swarm.simulator.tick)
    return swarm.fleet.evaluation_log
