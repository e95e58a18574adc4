"""The desks of a simulated fleet and of a fleet on the air, as notebooks need them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager

from sleepcast.console.adapters.channel import EMPTY, FleetAdapter
from sleepcast.console.adapters.mission import SwarmMission
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.backend import Backend
from sleepcast.console.driver import Driver
from sleepcast.console.features.why import Explained, Why, show_why
from sleepcast.console.network import NetworkBackend
from sleepcast.console.view import Scene
from sleepcast.core.clock import WallClock
from sleepcast.loop import Pace, Swarm
from sleepcast.loop.mission import MissionLog
from sleepcast.notebook.desk import NotebookDesk
from sleepcast.station import Station
from sleepcast.station.asking import ask_why
from sleepcast.station.network import NetworkStation
from sleepcast.station.remote import TelemetryClient

Turn = Callable[[], AbstractContextManager[None]]
EVERY = 1.0
"""Seconds between two questions to robots on the air how they are."""
LOOK = 0.1
"""Seconds between two looks at the air: telemetry comes no faster."""


class SteppedSwarm(SwarmAdapter):
    """A swarm whose ticks are made by the fleet that it belongs to, which samples and records them."""

    def __init__(self, swarm: Swarm, step: Callable[[], None]) -> None:
        super().__init__(swarm)
        self._step = step

    def step(self) -> None:
        self._step()


def simulated_desk(
    swarm: Swarm, station: Station, step: Callable[[], None], turn: Turn, log: MissionLog
) -> NotebookDesk:
    """For a simulated fleet, whose time stands still until somebody lets it run, or sends its first command.

    step: makes a tick.
    turn: see `NotebookDesk`.
    log: what was sent of the mission.
    """
    clock = WallClock()
    pace = Pace(clock, swarm, swarm.simulator.scenario.speed_up, step)
    pace.paused = True
    seen = SteppedSwarm(swarm, step)
    seen.send_initial_telemetry()
    driver = Driver(seen, pace, clock, waits=seen.tick == 0)
    mission = SwarmMission(swarm, station, log) if swarm.simulator.scenario.mission else None
    return NotebookDesk(Backend(seen, station, driver, clock, mission=mission), clock, turn)


class PatientBackend(NetworkBackend):
    """The desk of robots on the air, which waits until a robot has said why."""

    def __init__(self, fleet: FleetAdapter, station: NetworkStation, telemetry: TelemetryClient, began: float) -> None:
        clock = WallClock()
        super().__init__(fleet, station, clock, began)
        self._asked, self._telemetry = station, telemetry

    def explain(self, asked: Why) -> Explained:
        explanation = ask_why(self._asked, self._telemetry, self.name_of(asked.robot), asked.command)
        return Explained(asked.serial, show_why(explanation))


def connected_desk(
    station: NetworkStation, telemetry: TelemetryClient, title: str, began: float, turn: Turn
) -> NotebookDesk:
    """For a fleet on the air.

    title: of the map.
    began: when the page's time begins, s of the station's clock.
    turn: see `NotebookDesk`.
    """
    ground = Scene(title, "", "robots", (), EMPTY, "m", ())
    fleet = FleetAdapter(station, telemetry, ground, EVERY, began)
    return NotebookDesk(PatientBackend(fleet, station, telemetry, began), WallClock(), turn, LOOK)
