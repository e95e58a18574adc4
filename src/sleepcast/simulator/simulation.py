"""The simulator: one tick of all bodies, their readings and pings, and a hash of the state."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import overload

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message_batch import NameIndex
from sleepcast.core.counter_rng import GOLDEN, key
from sleepcast.core.errors import MisuseError
from sleepcast.core.given_numbers import read_seed
from sleepcast.core.threads import ThreadPool
from sleepcast.core.ticks import tick_at
from sleepcast.robot import RobotModel
from sleepcast.simulator.bodies.arrivals import Arrival, find_room, newcomers, refuse_full, sort_called, start_at
from sleepcast.simulator.bodies.bodies import TURN, Bodies, Flags, Floats, Mode, Saying, Whole
from sleepcast.simulator.bodies.body import TUMBLE, Body, BodySenses, FlyingBody, model_of
from sleepcast.simulator.bodies.closeness import Closeness
from sleepcast.simulator.bodies.crashes import crash
from sleepcast.simulator.bodies.fences import Fences
from sleepcast.simulator.bodies.links import Links
from sleepcast.simulator.bodies.looking_down import DownCameras
from sleepcast.simulator.bodies.particles import Particles
from sleepcast.simulator.bodies.payload import Payload
from sleepcast.simulator.bodies.pilot import Results, pilot_of
from sleepcast.simulator.bodies.population import Population, Turnover, joined
from sleepcast.simulator.bodies.proximity import Sonars
from sleepcast.simulator.bodies.senses import Senses, functions_of
from sleepcast.simulator.bodies.supplies import Supplies
from sleepcast.simulator.engine import Machine, choose, cores, keeps_kernels
from sleepcast.simulator.motion import encoders, omni, steps
from sleepcast.simulator.motion.driving import bounded
from sleepcast.simulator.motion.steps import Displacement, Draws, Settled, clear
from sleepcast.simulator.scenario.events import apply_events
from sleepcast.simulator.scenario.measures import Measuring
from sleepcast.simulator.scenario.population import NamesByRow, at_first, comes_and_goes, with_room
from sleepcast.simulator.scenario.robot_settings import TENTH
from sleepcast.simulator.scenario.robot_types import names_of
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.scenario.starts import Starts

MAX_CASTE = 254
"""`pinged` gives one byte per robot; castes above this are reported as this one."""
OTHER_COLOUR = 255
"""`colours` gives one byte per robot; this one stands for colours that have no byte of their own."""


class Simulator:
    """A running scenario; `seed` replaces the scenario's own. Equal seeds give equal runs, bit for bit, on any number
    of threads.

    payload: what a program adds to the bodies
    machine: the array backend (see `engine`). None chooses the fastest one installed, on `threads` threads (None: one
        per core); but NumPy for robots without bumpers and sonars that do not sense their neighbours, for which it is
        fast enough, as long as this computer has not compiled the kernels for others.
    names, robots: one for each robot, by its index; a robot's own number is its index + 1
    model: the robots' common model; it may be given if there is one already of a scenario that has only another seed
        and other walls
    """

    def __init__(
        self,
        scenario: Scenario,
        seed: int | None = None,
        machine: Machine | None = None,
        threads: int | None = None,
        payload: Payload | None = None,
        model: RobotModel | None = None,
    ) -> None:
        self.scenario = scenario
        self.seed = scenario.seed if seed is None else read_seed(seed)
        if machine is None:
            blind = scenario.robots.ring is None and not scenario.robots.bumpers
            light = blind and scenario.neighbours is None
            machine = choose("numpy" if light and not keeps_kernels() else None, threads)
        self.pool = machine.pool or ThreadPool(threads or cores())
        """The threads available to the simulator."""
        self.payload = payload
        rings = scenario.robots.ring.count + 1 if scenario.robots.ring else 0
        known = None if model is None else model.sensors[: len(model.sensors) - rings]
        added = payload.sensors if payload else ()
        first = at_first(scenario)
        begun = Bodies(first, self.seed, machine, added, known) if first.robots.count else None
        self.population: Population | None = None
        """Which robots are there, where they come and go."""
        self.turnover: Turnover | None = None
        """Who has come and gone at the end of the last tick, or was added last since; None if nobody has."""
        if comes_and_goes(scenario):
            if payload:
                raise MisuseError(
                    f"{scenario.name}: robots of classes of one's own do not come and go (hatch, most or at)"
                )
            roomy = with_room(scenario)
            self.population = Population(scenario, roomy)
            begun = Bodies(roomy, self.seed, machine, added, known, self.population, begun)
            for sort in self.population.awaited:  # here whoever starts this learns what is wrong with their starts
                newcomers(begun, scenario, sort, np.arange(self.population.sizes[sort]))
        assert begun is not None
        self.bodies = begun
        self.world = self.bodies.world
        """The solid things; they may be changed between ticks."""
        self.senses = Senses(self.bodies)
        if model is None:
            functions = (*functions_of(scenario), *(payload.functions if payload else ()))
            model = model_of(scenario, self.bodies.sensors, functions, payload.actuators if payload else ())
        self.model = model
        self.links = Links(self.bodies, scenario.cuts) if scenario.cuts else None
        """Between minds and bodies; None where none is ever cut."""
        self.names: NameIndex = (
            NamesByRow(scenario) if self.population else names_of(scenario.each_type, self.bodies.count)
        )
        self.robots = Robots(self.bodies, self.senses, self.model)
        flight = self.bodies.flight
        self.closeness = Closeness(self.bodies, flight) if flight and flight.collides else None
        """Of flying bodies; None without any that could touch."""
        uses_up = self.closeness and self.bodies.exhausted() is not None
        self.supplies = (
            Supplies(self.bodies, flight, refilled=bool(scenario.stocks or payload)) if flight and uses_up else None
        )
        """Of flying bodies; None without any that could be used up."""
        self.fences = Fences(self.bodies, flight) if flight and self.closeness and not scenario.torus else None
        """Of flying bodies; None without any that could come to one."""
        self._pinged = np.zeros(self.bodies.count, np.uint8)
        self.measuring = Measuring(scenario.measures, scenario.tick, self.bodies.x, self.bodies.y, self._there)
        self._halted = np.zeros(self.bodies.count, bool)
        """Which bodies were stopped when the payload saw them last."""
        if payload:
            payload.mount(self.bodies)
            payload.read(self._payload_rows)

    @property
    def tick(self) -> int:
        """Ticks since the start."""
        return self.bodies.tick

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self.bodies.time

    @property
    def x(self) -> Floats:
        """Positions of the robots, m, shape (robots,); the simulator's own array."""
        return self.bodies.x

    @property
    def y(self) -> Floats:
        return self.bodies.y

    @property
    def poses(self) -> tuple[Floats, Floats, Floats]:
        """x and y (m) and heading (rad) of the robots, for whoever draws them: NaN in rows without one."""
        columns = self.x, self.y, self.bodies.heading
        if self.population is None:
            return columns
        x, y, heading = (np.where(self.population.present, column, np.nan) for column in columns)
        return x, y, heading

    @property
    def heights(self) -> Floats | None:
        """z of the robots, m, for whoever draws them: 0 of those on the ground, NaN in rows without one; None where
        none flies."""
        if self.bodies.flight is None:
            return None
        z = np.nan_to_num(self.bodies.flight.z)
        return z if self.population is None else np.where(self.population.present, z, np.nan)

    @property
    def footprints(self) -> Floats | None:
        """How far from the point below it each robot's camera sees the ground, m, for whoever draws it: 0 of those that
        have none; None where nobody has one."""
        return self.senses.of(DownCameras).footprints if self.scenario.robots.camera else None

    @property
    def sayings(self) -> list[Saying]:
        """The latest messages that robots have spoken with `TK`."""
        return self.bodies.sayings

    @property
    def news(self) -> list[Saying]:
        """What has befallen bodies, such as crashes, and was not taken yet, as a swarm does in each tick to let it be
        reported; the latest."""
        return self.bodies.news

    def take_news(self) -> list[Saying]:
        """Take the news."""
        return self.bodies.take_news()

    def crashed(self) -> Flags | None:
        """Which bodies have crashed, and lie where they fell; None where no body can."""
        flight = self.bodies.flight
        return flight.crashed > 0.0 if flight and flight.collides else None

    def step(self) -> None:
        """One tick: apply the scenario's events, move all bodies, and what `follow` says."""
        scenario = self.scenario
        if scenario.events:
            things = (*scenario.shapes, *scenario.absent)
            apply_events(self.world, scenario.events, things, self.tick + 1, scenario.tick)
        if self.links:
            self.links.step()
        step(self.bodies)
        self.follow()

    def follow(self) -> None:
        """The rest of a tick in which bodies have moved: let those crash that have touched in the air, update lights,
        deliver the pings of the last tick, settle stocks."""
        if self.bodies.flight and self.closeness:
            crash(self.bodies, self.bodies.flight, self.closeness, self.names)
        self.senses.step()
        if self.payload:
            self.payload.halt(np.flatnonzero(self.bodies.stopped & ~self._halted))
            self._halted[:] = self.bodies.stopped
            self.payload.step()
            self.payload.read(self._payload_rows)
        if self.supplies:
            self.supplies.look()
        if self.fences:
            self.fences.look()
        if self.scenario.measures:
            self.measuring.observe(self.tick, self.time)

    @property
    def _there(self) -> Flags | None:
        return self.population.present if self.population else None

    @property
    def there(self) -> Flags:
        """Which rows have a robot."""
        return np.ones(self.bodies.count, bool) if self.population is None else self.population.present

    def turn_over(self) -> Turnover | None:
        """The end of a tick: robots come whose time it is, and come and go as they have asked; None if none does."""
        self.turnover = None
        if self.population is None:
            return None
        if self.senses.predation:
            self.population.die(self.senses.predation.settle(self.population.staying))
        tick = self.scenario.tick
        due = [sort for sort in self.population.awaited if tick_at(self.population.time_of(sort), tick) <= self.tick]
        came = [arrived for sort in due if (arrived := self._come(sort, self.population.sizes[sort], awaited=True))]
        settled = self.population.settle()
        if settled is not None:
            self._take_over(settled)
        if came or settled:
            self.turnover = joined([*came, *([settled] if settled else ())])
            if self.supplies:
                self.supplies.look()
        return self.turnover

    def add_robot(
        self, kind: str = "", x: float | None = None, y: float | None = None, heading: float | None = None
    ) -> Arrival:
        """Add a robot between two ticks; `turnover` says where it is. kind: its type, "" where only one can be added;
        x, y: its place, m, None for one by chance; heading: rad, None for one by chance. Raises MisuseError if there is
        no room for it."""
        if self.population is None:
            raise MisuseError(f"{self.scenario.name}: no robots can be added: say most = ... in its table of robots")
        sort = sort_called(self.population, kind)
        refuse_full(self.population, sort)
        spec = self.population.specs[sort]
        starts = start_at(spec, x, y, heading, (self.scenario.width, self.scenario.height))
        turnover = self._come(sort, 1, starts)
        if turnover is None:
            place = "where it might start" if starts is None else f"at {x:g}, {y:g} m"
            raise MisuseError(f"a {spec.type} has no room {place}: something solid or another robot is there")
        row = int(turnover.children[0])
        put_x, put_y, facing = (float(column[row]) for column in (self.x, self.y, self.bodies.heading))
        height = 0.0 if self.heights is None else float(self.heights[row])
        return Arrival(sort, self.population.added - 1, put_x, put_y, facing, height)

    def add_again(self, arrival: Arrival) -> Turnover | None:
        """Add a robot that was added between these ticks when the run went on before; None if it is there already, or
        has no room in this run."""
        population = self.population
        if population is None or population.added > arrival.order or not population.room(arrival.sort):
            return None
        return self._come(arrival.sort, 1, arrival.starts)

    def _come(self, sort: int, count: int, starts: Starts | None = None, *, awaited: bool = False) -> Turnover | None:
        """Let so many robots of a sort come where there is a place for them; None if there is not."""
        assert self.population is not None
        numbers = np.arange(self.population.following, self.population.following + count)
        new = newcomers(self.bodies, self.scenario, sort, numbers, starts)
        given = bool(self.population.specs[sort].starts if starts is None else starts)
        if not find_room(self.bodies, new, given=given):
            return None
        self.turnover = turnover = self.population.come(sort, count, awaited=awaited)
        self._take_over(turnover)
        self.bodies.take_in(new, turnover.children)
        self.bodies.forget()
        return turnover

    def _take_over(self, turnover: Turnover) -> None:
        """Let bodies, senses and names be those of who is there now."""
        self.bodies.turn_over(turnover)
        self.senses.turn_over(turnover)
        if self.supplies:
            self.supplies.turn_over(turnover.changed)
        if self.fences:
            self.fences.turn_over(turnover.changed)
        self._pinged[turnover.dead] = 0
        if isinstance(self.names, NamesByRow):
            self.names = self.names.after(turnover.dead, turnover.children, turnover.numbers)

    def renumber(self) -> None:
        """Other robots are there than at the start, as their numbers say."""
        if self.population and isinstance(self.names, NamesByRow):
            self.bodies.renumber()
            self.names = self.names.numbered(self.population.numbers)

    @property
    def _payload_rows(self) -> Floats:
        """What the payload's sensors read, without the noise of the scenario."""
        known = self.bodies.known
        return known[len(known) - len(self.payload.sensors if self.payload else ()) :]

    @property
    def sensed(self) -> Floats:
        """Sensor values in the order of `model.sensors`: SI, shape (sensors, robots); NaN for values never measured.
        This is the simulator's own table, up to date for the robots passed to `sense` in this tick."""
        return self.bodies.sensed

    @property
    def sonar_rows(self) -> range:
        """The rows of `sensed` that the sonars fill."""
        return range(len(self.bodies.sensors), len(self.model.sensors))

    def sense(self, robots: NDArray[np.intp] | None = None, sonars: bool | Collection[int] = True) -> None:
        """Bring `sensed` up to date for the robots with these indices (None: all), noise included; a second call in the
        same tick gives the same values. sonars: whether to compute sonars too, which is most of the work, or the sonar
        rows that are needed. Changes no state."""
        self.bodies.sense(robots, sonars)

    def act(self, actuator: str, robots: NDArray[np.intp] | slice, values: Floats) -> None:
        """Set the actuator of this name to `values` (SI), one per robot, as `Body.act` does. Stopped bodies do nothing;
        NaN leaves the value unchanged. Raises MisuseError for an unknown actuator."""
        if self.payload and any(each.name == actuator for each in self.payload.actuators):
            which = np.arange(self.bodies.count)[robots]
            free = ~self.bodies.stopped[which] & np.isfinite(values)
            self.payload.act(actuator, which[free], values[free])
            return
        self.bodies.act(actuator, robots, values)

    def readings(self, numbers: Sequence[int] | None = None) -> list[list[float]]:
        """Sensor values of the robots with these indices (None: all); see `Bodies.readings`."""
        return self.bodies.readings(numbers)

    def scans(self, robots: NDArray[np.intp] | None = None) -> NDArray[np.float32]:
        """What the laser scanners of the robots with these indices (None: all) measure in this tick: m from the robot's
        centre, shape (robots, beams), float32, beams counter-clockwise as `scenario.laser` says; infinite where nothing
        is within the scanner's range, minus infinite where something is nearer than it can measure. A second call in
        the same tick gives the same values. Raises MisuseError where robots have no scanners, and for other indices."""
        if self.bodies.scanner is None:
            raise MisuseError("these robots have no laser scanner: a table [laser] in the scenario gives them one")
        count = self.bodies.count
        some = np.arange(count) if robots is None else np.asarray(robots)
        numbers = some.ndim == 1 and (some.dtype.kind in "iu" or not some.size)
        if not numbers or some.min(initial=0) < 0 or some.max(initial=0) >= count:
            raise MisuseError(f"robots are numbered from 0 to {count - 1}: wanted such numbers, not {robots!r:.80}")
        return self.bodies.scans(some.astype(np.intp)).copy()

    def place(self, number: int, x: float, y: float, heading: float) -> None:
        """Put robot `number` at this pose (m, rad), at rest; its odometry is set to the same pose."""
        self.bodies.place(number, x, y, heading)

    def ping(self, number: int, caste: float) -> None:
        """Robot `number` sends a ping that carries `caste`; robots within reach receive it in the next tick."""
        self.pings(np.array([number]), np.array([caste]))

    def pings(self, robots: NDArray[np.intp], castes: Floats) -> None:
        """Send pings from many robots. If a robot pings twice in a tick, only its first ping is received."""
        self._pinged[robots] = 1.0 + np.rint(np.clip(np.nan_to_num(castes, nan=MAX_CASTE), 0.0, MAX_CASTE))
        self.senses.ping(robots, castes)

    def pinged(self) -> bytes:
        """Pings since the last call, for display: one byte per robot, 0 or its latest caste + 1; empty if no robot has
        pinged. Does not affect the run."""
        pinged = self._pinged.tobytes() if self._pinged.any() else b""
        self._pinged.fill(0)
        return pinged

    def exhausted(self) -> NDArray[np.bool_] | None:
        """Which bodies have used up what they drive with, so that they stand still; None where no body can."""
        return self.bodies.exhausted()

    def colours(self) -> bytes:
        """The colours that robots show with `COLOUR`, for display: one byte per robot, 0 for none, `OTHER_COLOUR` for
        what is no whole number from 1 to 254; empty if no robot shows one."""
        shown = np.nan_to_num(self.senses.colours())
        if not shown.any():
            return b""
        plain = (shown >= 0.0) & (shown < OTHER_COLOUR) & (shown == np.trunc(shown))
        return np.where(plain, shown, OTHER_COLOUR).astype(np.uint8).tobytes()

    def measured(self) -> dict[str, list[list[float]]]:
        """The scenario's own measures so far, each a list of [seconds, metres]."""
        return self.measuring.series()

    def stocks(self) -> dict[str, float]:
        """What is left of each stock, by name, in SI."""
        stocks = self.senses.stocks
        return (
            dict(zip((each.name for each in self.scenario.stocks), stocks.level.tolist(), strict=True))
            if stocks
            else {}
        )

    def state_hash(self) -> str:
        """SHA-256 of the state of all bodies, as hexadecimal digits."""
        return self.bodies.state_hash(self.senses.state())


# All bodies of a simulator: a `Robot` for each one on demand, and functions that command many of them at once.


class Robots(Sequence[Body]):
    """The bodies by index, and the functions of `Body` for many robots at once, with the same results."""

    def __init__(self, bodies: Bodies, senses: BodySenses, model: RobotModel) -> None:
        self.bodies, self.senses, self._model = bodies, senses, model

    def __len__(self) -> int:
        return self.bodies.count

    @overload
    def __getitem__(self, number: int) -> Body: ...

    @overload
    def __getitem__(self, number: slice) -> list[Body]: ...

    def __getitem__(self, number: int | slice) -> Body | list[Body]:
        if isinstance(number, slice):
            return [self[i] for i in range(*number.indices(len(self)))]
        kind = Body if self.bodies.flight is None else FlyingBody
        return kind(self.bodies, self.senses, self._model, range(len(self))[number])

    def stop(self, robots: Whole) -> None:
        """See `Robot.stop`."""
        self.halt(self._reached(robots))
        self.bodies.stopped[robots] = True

    def release(self, robots: Whole) -> None:
        """See `Robot.release`."""
        self.bodies.stopped[robots] = False

    def let_go(self, robots: Whole) -> None:
        """See `Failsafe.let_go`."""
        self.stop(robots)
        self.release(robots)
        if self.bodies.flight is not None:
            pilot_of(self.bodies).let_go(self._reached(robots))

    def _reached(self, robots: Whole) -> Whole:
        """Those of these bodies that their minds reach."""
        cut_off = self.bodies.cut_off
        return robots[~cut_off[robots]] if cut_off.size else robots

    def hold(self, robots: Whole, still: Flags) -> None:
        """See `Robot.hold`; still: one flag per robot."""
        self.bodies.held[robots] = still

    def rest_states(self, robots: Whole) -> tuple[Floats, Floats]:
        """See `RestState`: speeds and distances."""
        return self.bodies.rest_states(robots)

    # ---- the functions of `Body`, with one array for each argument

    def drive(self, robots: Whole, speed: Floats, turn_rate: Floats) -> None:
        bodies, free = self.bodies, ~self.bodies.stopped[robots]
        if bodies.flight is not None:
            free &= bodies.takes_speeds[robots]
        moving = robots[free]
        bodies.mode[moving] = Mode.DRIVE
        bodies.wanted_speed[moving], bodies.wanted_turn[moving] = speed[free], turn_rate[free]
        if bodies.scenario.robots.omni:
            bodies.wanted_side[moving[bodies.omni[moving]]] = 0.0

    def go_to(self, robots: Whole, x: Floats, y: Floats, z: Floats | None = None) -> Results:
        if self.bodies.flight is not None:
            return pilot_of(self.bodies).go_to(robots, x, y, z)
        free = ~self.bodies.stopped[robots]
        self.bodies.go_to(robots[free], x[free], y[free])
        return None

    def arm(self, robots: Whole) -> Results:
        return pilot_of(self.bodies).arm(robots)

    def disarm(self, robots: Whole) -> Results:
        return pilot_of(self.bodies).disarm(robots)

    def take_off(self, robots: Whole, height: Floats | None = None) -> Results:
        return pilot_of(self.bodies).take_off(robots, height)

    def touch_down(self, robots: Whole) -> Results:
        return pilot_of(self.bodies).touch_down(robots)

    def cut_motors(self, robots: Whole) -> Results:
        return pilot_of(self.bodies).cut_motors(robots)

    def cut_all_motors(self, robots: Whole) -> Results:
        return pilot_of(self.bodies).cut_all_motors(robots)

    def climb(self, robots: Whole, speed: Floats) -> Results:
        return pilot_of(self.bodies).climb(robots, speed)

    def steer(self, robots: Whole, x: Floats, y: Floats, z: Floats) -> None:
        assert isinstance(self.bodies.flight, Particles)
        free = ~self.bodies.stopped[robots]
        self.bodies.flight.steer(robots[free], (x[free], y[free], z[free]))

    def wander(self, robots: Whole) -> None:
        self.bodies.mode[robots[~self.bodies.stopped[robots]]] = Mode.WANDER

    def halt(self, robots: Whole) -> None:
        at_rest = np.zeros(len(robots))
        self.drive(robots, at_rest, at_rest)
        self.bodies.swing[robots] = 0.0
        if self.bodies.flight is not None:
            self.bodies.flight.rest(robots[~self.bodies.stopped[robots]])

    def tumble(self, robots: Whole) -> Floats:
        bodies = self.bodies
        drawn = bodies.drawn(f"tumble {bodies.tick}", bodies.numbers[robots])
        sides = np.where(drawn < 0.5, 1.0, -1.0)
        free = ~bodies.stopped[robots]
        bodies.swing[robots[free]] = sides[free] * TUMBLE
        return sides

    def turn_wheels(self, robots: Whole, right: Floats, left: Floats) -> None:
        wheels = self.bodies.scenario.robots.wheels
        assert wheels
        self.drive(robots, (right + left) / 2.0, (right - left) / wheels.track)

    def turn_wheels_nomad(self, robots: Whole, right: Floats, left: Floats) -> None:
        self.turn_wheels(robots, right * TENTH, left * TENTH)

    def sonar(self, robots: Whole, which: Floats) -> Floats:
        if not isinstance(self.bodies.sonars, Sonars):
            return np.array([self[i].sonar(one) for i, one in zip(robots.tolist(), which.tolist(), strict=True)])
        asked = np.mod(np.trunc(which), self.bodies.sonars.ring.count).astype(np.int64)
        ranges = self.bodies.sonar_ranges(robots.tolist(), {*asked.tolist()})
        readings: Floats = ranges[np.arange(len(robots)), asked]
        return readings

    def nearest(self, robots: Whole, first: Floats, last: Floats) -> Floats:
        sonars = self.bodies.sonars
        if not isinstance(sonars, Sonars):
            ends = zip(robots.tolist(), first.tolist(), last.tolist(), strict=True)
            return np.array([self[i].nearest(*angles) for i, *angles in ends])
        wide = np.where(last - first >= TURN, last - first, np.mod(last - first, TURN))
        within = np.mod(sonars.cones.axes - first[:, None], TURN) <= wide[:, None]
        nearest: Floats = np.where(within, self.bodies.sonar_ranges(robots.tolist()), sonars.ring.most).min(axis=1)
        return nearest


# Motion: one tick of all bodies at once.

_BITS = 0xFFFF_FFFF_FFFF_FFFF


def slide(bodies: Bodies, proposal: Displacement, settled: Settled) -> None:
    """Let bodies that slide go on along what has stopped them, as far as nothing else is in the way."""
    which = np.flatnonzero(bodies.slides & (settled.free < 1.0))
    if not which.size or bodies.contact is None:
        return
    dx, dy = np.zeros((2, bodies.count))
    dx[which], dy[which] = steps.slide(proposal, settled, which)
    if not bodies.scenario.torus:
        left, bottom, right, top = bodies.fence
        dx, dy = bounded(bodies.x + dx, left, right) - bodies.x, bounded(bodies.y + dy, bottom, top) - bodies.y
    again = Settled(*np.empty((3, bodies.count)))
    bodies.contact.settle(bodies.x, bodies.y, dx, dy, again)
    bodies.displace(which, again.free[which] * dx[which], again.free[which] * dy[which])
    bodies.moved()


def step(bodies: Bodies) -> None:
    """Move all bodies through the tick `bodies.tick`, and count it. Reuses the spatial index of the last tick unless a
    body was placed."""
    draws = Draws(
        bodies.tick * GOLDEN & _BITS,
        key(bodies.seed, "slip", "left", bodies.tick),
        key(bodies.seed, "slip", "right", bodies.tick),
    )
    machine, types = bodies.machine, list(zip(bodies.parts, bodies.of_each_type, strict=True))
    proposal, free = machine.room(bodies.count)
    if bodies.flight:
        bodies.flight.step()
        bodies.low.forget()
        types = [(part, which) for part, which in types if part.scenario.robots.flight is None]
    for part, which in types:
        if part.scenario.robots.omni:
            omni.propose(part.columns, part.sides, part.laws, draws, proposal.of(which))
        else:
            machine.propose(part.columns, part.laws, draws, proposal.of(which))
    settled = Settled(free, bodies.hit_x, bodies.hit_y)
    if bodies.contact:
        bodies.contact.settle(bodies.x, bodies.y, proposal.dx, proposal.dy, settled)
    else:
        clear(settled)
    for part, which in types:
        before = encoders.before_tick(part.columns, part.laws) if part.counts else None
        ways, ends = proposal.of(which), Settled(*(each[which] for each in settled))
        if part.scenario.robots.omni:
            omni.commit(part.columns, part.sides, part.laws, ways, ends)
        else:
            machine.commit(part.columns, part.laws, ways, ends)
        if before is not None:
            encoders.count(part.columns, part.laws, before, free[which], part.uncounted, part.counts)
    for part in bodies.parts:
        if not part.laws.track and part is not bodies:  # odometry is separate where other types have wheels
            part.encoder_x[:], part.encoder_y[:], part.encoder_heading[:] = part.x, part.y, part.heading
    bodies.moved()
    if bodies.contact:
        slide(bodies, proposal, settled)
    bodies.drain()
    bodies.tick += 1
    if bodies.sonars:
        bodies.sonars.fire(bodies.tick, bodies.time, (bodies.x, bodies.y, bodies.heading))
