"""The job in sleepcast: two rules broadcast to the Scouts of the scenario `crowd`; and what those do by themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.report import installed
from benchmarks.rivals import job
from sleepcast.api.assembly import assemble
from sleepcast.core.version import VERSION
from sleepcast.simulator import Changes, Order, Scenario, find_scenario

RULES = """
(PROGN
  (RULE roam (PROGN (SETQ drive_speed 0.5m/s) (SETQ drive_turn (RANDOM -30deg/s 30deg/s))))
  (RULE avoid
    (WHEN (< front_range 30in)
      (SETQ drive_speed 0.25m/s)
      (SETQ drive_turn
        (IF (< (MIN sonar1 sonar2 sonar3 sonar4) (MIN sonar12 sonar13 sonar14 sonar15)) -60deg/s 60deg/s)))))
"""


def ready(robots: int) -> job.Job:
    """The rule of the job."""
    scenario = replace(_field(robots), mission=(Order(0.0, RULES, "the benchmark"),))
    return _ready(scenario, "the job's rule in SLEEP")


def ready_with_ten(robots: int) -> job.Job:
    """The ten rules of `crowd`."""
    return _ready(_field(robots), "more than the job: the ten rules of `crowd`")


def _field(robots: int) -> Scenario:
    return find_scenario("crowd", Changes(robots, job.AREA, walls=False))


def _ready(scenario: Scenario, words: str) -> job.Job:
    swarm, _ = assemble(scenario, job.SEED, mission=True)
    simulator = swarm.simulator
    sonars = [i for i, sensor in enumerate(simulator.model.sensors) if sensor.name.startswith("sonar")]
    machine = "numba" if installed("numba") else "NumPy alone"
    return job.Job(
        step=swarm.step,
        places=lambda: np.stack([simulator.x, simulator.y], axis=1),
        ranges=lambda: np.asarray(simulator.readings(None))[:, sonars],
        setting=f"sleepcast {VERSION}, {machine}: {words}; 16 exact cones with noise, wheels that slip, contact",
    )
