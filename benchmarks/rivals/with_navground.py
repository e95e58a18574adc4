"""The job in navground: its lidar in C++, and the rule for all robots at once through a group of behaviours.

A group gets its commands in one call instead of one call of Python for each robot, which is the fastest way that it
documents for a rule in Python.
"""

from __future__ import annotations

from importlib.metadata import version
from math import pi

import numpy as np
from navground import core, sim

from benchmarks.rivals import job


class Wanderers(core.BehaviorGroup):  # type: ignore[misc]
    """All robots: their ranges in, their commands out."""

    def __init__(self) -> None:
        super().__init__()
        self.source = np.random.default_rng(job.SEED)
        self.ranges: job.Floats = np.empty((0, job.BEAMS))

    def compute_cmds(self, time_step: float) -> list[core.Twist2]:
        self.ranges = np.array([member.sensed.get_buffer("range").data for member in self.members])
        speeds, turns = job.decide(self.ranges, self.source)
        ahead, twist = core.Frame.relative, core.Twist2
        return [twist((speed, 0.0), turn, ahead) for speed, turn in zip(speeds.tolist(), turns.tolist(), strict=True)]


class Wanderer(core.BehaviorGroupMember, name="Wanderer"):  # type: ignore[misc,call-arg]
    """One robot of the group."""

    groups: dict[int, Wanderers] = {}  # noqa: RUF012 - navground asks for one that all members share

    def __init__(self, kinematics: core.Kinematics, radius: float) -> None:
        super().__init__(kinematics, radius)
        self.sensed = core.SensingState()

    def get_environment_state(self) -> core.SensingState:
        return self.sensed

    def make_group(self) -> Wanderers:
        return Wanderers()

    def get_groups(self) -> dict[int, Wanderers]:
        return self.groups

    def get_group_hash(self) -> int:
        return 1


def ready(robots: int) -> job.Job:
    world = sim.World()
    for begin, end in job.corners(robots):
        world.add_wall(core.LineSegment(begin, end))
    places, headings = job.start(robots)
    for place, heading in zip(places.tolist(), headings.tolist(), strict=True):
        kinematics = core.Kinematics.make_type("2WDiff")
        kinematics.max_speed, kinematics.wheel_axis = job.TOP_SPEED, job.TRACK
        agent = sim.Agent(
            radius=job.RADIUS,
            behavior=Wanderer(kinematics, job.RADIUS),
            kinematics=kinematics,
            control_period=job.TICK,
        )
        agent.state_estimation = sim.state_estimations.LidarStateEstimation(
            range=job.REACH,
            start_angle=0.0,
            field_of_view=2 * pi * (job.BEAMS - 1) / job.BEAMS,
            resolution=job.BEAMS,
        )
        agent.pose = core.Pose2(place, heading)
        world.add_agent(agent)
    return job.Job(
        step=lambda: world.update(job.TICK),
        places=lambda: np.array([agent.position for agent in world.agents], np.float64),
        ranges=lambda: np.asarray(Wanderer.groups[1].ranges, np.float64),
        setting=f"navground {version('navground')}: lidar of 16 rays, one group of behaviours with the rule in NumPy",
    )
