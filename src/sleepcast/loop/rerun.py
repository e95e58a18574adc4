"""A run again: a swarm that gets, tick by tick, what another one got from outside, and so does the same bit for bit.

What comes from outside are the operator's messages, solid things that somebody adds, moves or removes, and robots that
somebody adds. `InputLog` keeps all that while a swarm runs; `Rerun` gives it to another swarm that begins in an earlier
state of it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from itertools import zip_longest
from typing import TypeVar

from sleepcast.channel import Message
from sleepcast.channel.message_batch import MessageBatch
from sleepcast.core.records import dataclass
from sleepcast.loop.population import add_again
from sleepcast.loop.swarm import Swarm
from sleepcast.simulator import World
from sleepcast.simulator.bodies.arrivals import Arrival
from sleepcast.simulator.packing import pack
from sleepcast.simulator.recording.recorder import WorldChange
from sleepcast.simulator.world.world import Shape

Input = TypeVar("Input")


@dataclass(slots=True)
class Inputs:
    """What came from outside, in order. posted: the operator's messages, each with the tick in which it was sent.
    changes: of the solid things and of who is there, those excepted that the scenario makes itself."""

    posted: list[tuple[int, Message]] = field(default_factory=list)
    changes: list[WorldChange] = field(default_factory=list)

    def between(self, after: int, until: int) -> Inputs:
        """What came after the tick `after`, up to that of `until`."""
        (first, earliest), (end, latest) = self.counts(after), self.counts(until)
        return Inputs(self.posted[first:end], self.changes[earliest:latest])

    @property
    def middle(self) -> int:
        """The tick by which half of it had come. There must be something."""
        ticks = sorted([tick for tick, _ in self.posted] + [change.tick for change in self.changes])
        return ticks[len(ticks) // 2]

    def forget(self, tick: int) -> None:
        """Leave out all up to this tick."""
        posted, changes = self.counts(tick)
        del self.posted[:posted], self.changes[:changes]

    def leaves(self, other: Inputs) -> int | None:
        """The first tick with something that only one of the two has, None if both are equal."""
        posted = _apart(self.posted, other.posted, lambda each: each[0])
        changed = _apart(self.changes, other.changes, lambda each: each.tick)
        return min((tick for tick in (posted, changed) if tick is not None), default=None)

    def counts(self, tick: int) -> tuple[int, int]:
        """How many messages and how many changes had come when this tick was over."""
        posted = bisect_right(self.posted, tick, key=lambda each: each[0])
        return posted, bisect_right(self.changes, tick, key=lambda each: each.tick)


def _apart(some: Sequence[Input], others: Sequence[Input], tick_of: Callable[[Input], int]) -> int | None:
    """The tick of the first that only one has."""
    for one, other in zip_longest(some, others):
        if one != other:
            return min(tick_of(each) for each in (one, other) if each is not None)
    return None


class WorldLog:
    """Tells how a world has changed since it was looked at last."""

    def __init__(self, world: World, known: Mapping[int, Shape]) -> None:
        self._world, self._known, self._version = world, dict(known), -1

    @property
    def changed(self) -> bool:
        """Whether it has changed since."""
        return self._version != self._world.version

    def look(self, tick: int, *, own: bool) -> WorldChange | None:
        """The change, if there was any, as one that came before anything moved in `tick`."""
        world = self._world
        if not self.changed:
            return None
        self._version = world.version
        before, self._known = self._known, dict(world.shapes)
        put = {str(number): shape for number, shape in self._known.items() if before.get(number) != shape}
        gone = tuple(number for number in before if number not in self._known)
        return WorldChange(tick, put, gone, own) if put or gone else None


MESSAGE = 1_000
"""Bytes of a message besides its text."""
CHANGE = 500
"""Bytes of a change of the world besides its shapes."""
SHAPES = 8
"""Times as many bytes as they have packed do shapes take in memory."""


def size_of_change(change: WorldChange) -> int:
    """Bytes that a change of the world takes, about."""
    return CHANGE + SHAPES * len(pack(change))


class InputLog:
    """Keeps what a swarm gets from outside, as one of its witnesses. size: bytes of it, about.

    patient: it need not see ticks in which nothing comes from outside.
    """

    patient = True

    def __init__(self, swarm: Swarm) -> None:
        self.inputs = Inputs()
        self.size = 0
        self._simulator = swarm.simulator
        self._world = WorldLog(swarm.simulator.world, swarm.simulator.world.shapes)

    def ticking(self) -> None:
        """A tick begins. Changes in the world since the last one came from outside."""
        self._note(self._world.look(self._simulator.tick + 1, own=False))

    def came(self, arrival: Arrival) -> None:
        """Somebody has added a robot between two ticks, after all changes in the world so far."""
        self.ticking()
        self._note(WorldChange(self._simulator.tick + 1, {}, (), came=(arrival,)))

    def _note(self, change: WorldChange | None) -> None:
        if change is not None:
            self.inputs.changes.append(change)
            self.size += size_of_change(change)

    def posted(self, message: Message) -> None:
        """The operator's message goes on the air in this tick."""
        self.inputs.posted.append((self._simulator.tick, message))
        self.size += MESSAGE + len(message.text)

    def begin_with(self, earlier: Inputs) -> None:
        """This came before, in the run that this one goes on from."""
        self.inputs.posted[:0], self.inputs.changes[:0] = earlier.posted, earlier.changes
        self._weigh()

    def forget(self, tick: int) -> None:
        """Keep nothing of what came up to this tick."""
        self.inputs.forget(tick)
        self._weigh()

    def _weigh(self) -> None:
        posted = sum(MESSAGE + len(message.text) for _, message in self.inputs.posted)
        self.size = posted + sum(map(size_of_change, self.inputs.changes))

    def said(self, batch: MessageBatch) -> None:
        """Nothing: it comes from inside."""

    def ticked(self) -> None:
        """A tick is over. Changes in the world during it are the scenario's own."""
        self._world.look(self._simulator.tick, own=True)


class Rerun:
    """Runs `swarm` again with these inputs, of which those of its past are left out. Nobody else may command it."""

    def __init__(self, swarm: Swarm, inputs: Inputs) -> None:
        self.swarm = swarm
        swarm.mission.clear()  # what it brought is among the inputs
        swarm.posted.clear()
        self.follow(inputs)

    @property
    def tick(self) -> int:
        """Ticks since the start of the run."""
        return self.swarm.simulator.tick

    def step(self) -> None:
        """One tick."""
        swarm, inputs, tick = self.swarm, self._inputs, self.tick + 1
        while self._changes < len(inputs.changes) and inputs.changes[self._changes].tick <= tick:
            _change(swarm, inputs.changes[self._changes])
            self._changes += 1
        while self._posted < len(inputs.posted) and inputs.posted[self._posted][0] <= tick:
            swarm.post(inputs.posted[self._posted][1])
            self._posted += 1
        swarm.step()
        if swarm.desk is None:
            swarm.radio.hear()  # where nobody sits at a desk, this would gather without end

    def follow(self, inputs: Inputs) -> None:
        """Go on with these inputs, in place of those that were known."""
        self._inputs = inputs
        self._posted, self._changes = inputs.counts(self.tick)


def _change(swarm: Swarm, change: WorldChange) -> None:
    world = swarm.simulator.world
    for number in change.gone:
        if number in world.shapes:  # a snapshot that the run went on from may be without it already
            world.remove(number)
    for name, shape in change.put.items():
        world.put(int(name), shape)
    for arrival in change.came:
        add_again(swarm, arrival)
