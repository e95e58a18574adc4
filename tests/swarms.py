"""Swarms with their desks for tests, driven by orders that come at given ticks, and all that can be seen of them."""

from __future__ import annotations

from collections.abc import Callable

from sleepcast.fleet import RobotView
from sleepcast.loop import Swarm
from sleepcast.simulator import Scenario, Simulator
from sleepcast.station import Station

ORDERS = {
    5: "(RULE shy (COND ((PROB 10%) (DRIVE 0.5 0.3)) (1 (DRIVE 1 0))))",
    8: '(WHEN (PROB 50%) (REPORT "here" x y))',
    10: "(WHEN (PROB 40%) (JOIN chosen_ones))",
    12: "(RULE gossip (WHEN (PROB 2%) (TELL (MARK))))",
    13: "(LEASE gossip 3s)",
    15: "(DEFUN offset (a) (+ a x))",
    16: "(RULE onwards (offset 3))",
    18: "(DEFUN offset (a b) (+ a b))",
    19: "(WHEN (IN chosen_ones) (PING 3))",
    20: "(+ x nobody)",
    23: "(WHEN (IN chosen_ones) (RULE onwards (SETQ drive_speed (* 0.1 (MOD id 5)))))",
    26: "(DEFVAR seen (RANDOM 0 1))",
    27: "(ROLLBACK)",
    31: "(SETQ seen (* seen 2))",
}
"""By tick; there is something in them of all that a mind keeps."""
STOP, RELEASE = 28, 34


def settle(swarm: Swarm) -> None:
    """Wait until all rules that can be have become native code."""
    if swarm.fleet.kernels is not None:
        swarm.fleet.kernels.settle()


def station_of(swarm: Swarm) -> Station:
    """A desk for a swarm."""
    first, *others = swarm.operators or ["desk"]
    swarm.others = [_station(swarm, name) for name in others]
    return _station(swarm, first)


def _station(swarm: Swarm, operator: str) -> Station:
    return Station(swarm.vocabulary, swarm.minds, swarm.post, swarm, operator=operator)


def swarm_of(scenario: Scenario, seed: int | None = None, threads: int | None = None) -> Swarm:
    """A swarm in a scenario, with its mission and a desk."""
    swarm = Swarm(Simulator(scenario, seed, threads=threads), scenario.mission)
    swarm.desk = station_of(swarm)
    return swarm


def desk_of(swarm: Swarm) -> Station:
    """The desk of a swarm."""
    assert isinstance(swarm.desk, Station)
    return swarm.desk


def drive(swarm: Swarm, ticks: int, step: Callable[[Swarm], object] = Swarm.step) -> None:
    """Let a swarm run for so many ticks, each of which `step` makes; the desk sends `ORDERS`, stops everybody and
    releases them."""
    desk = desk_of(swarm)
    for _ in range(ticks):
        tick = swarm.simulator.tick
        if tick in ORDERS:
            desk.send(ORDERS[tick], everybody=True)
        if tick == STOP:
            desk.stop()
        if tick == RELEASE:
            desk.release()
        step(swarm)


def seen(swarm: Swarm) -> dict[str, object]:
    """All that can be seen of a swarm and its desk, as plain data in which unknown equals unknown."""
    desk, simulator = desk_of(swarm), swarm.simulator
    preview = desk.preview("(WHEN (AND (> x 5m) (NOT (IN chosen_ones))) (MARK))")
    return {
        "state": simulator.state_hash(),
        "measures": swarm.measures(),
        "said": [list(saying) for saying in simulator.sayings],
        "sensed": simulator.sensed.tobytes().hex() if len(simulator.names) < 20 else None,
        "accounting": [desk.accounting(command.id).sentence() for command in desk.commands()],
        "answers": [
            {name: repr(answer) for name, answer in command.answers.items()} | {"sent": repr(command.last_sent)}
            for command in desk.commands()
        ],
        "predicted": [sorted(command.predicted) for command in desk.commands()],
        "roster": desk.roster,
        "reports": [repr(report) for report in desk.reports],
        "journal": [
            [entry.number, entry.time, entry.who, entry.event, entry.subject, entry.text, plain(entry.details)]
            for entry in desk.journal.entries()
        ],
        "preview": [preview.codes.tolist(), preview.reasons, preview.oldest],
        "minds": [mind(view) for view in swarm.fleet.values()],
    }


def plain(details: object) -> str:
    if isinstance(details, dict):
        return repr({key: plain(value) for key, value in details.items()})
    return repr(list(details)) if isinstance(details, list | tuple) or hasattr(details, "places") else repr(details)


def mind(view: RobotView) -> list[object]:
    """What can be seen of one robot's mind."""
    return [
        [value.hex() for value in view.values],
        [repr(rule) for rule in view.rules()],
        sorted(view.groups),
        list(view.heard()),
        [view.dropped, view.lost, view.stopped, view.awake],
    ]
