"""`sleepcast scenarios`: what there is to run, and what each one shows."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from sleepcast.cli.streams import complain, put
from sleepcast.core.errors import SleepcastError

if TYPE_CHECKING:
    from sleepcast.simulator import Scenario

WIDTH = 88
"""Characters of a line of prose on the page of a scenario, for reading."""


@click.command("scenarios")
@click.argument("name", required=False)
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead.")
def scenarios(name: str | None, as_json: bool) -> int:
    """List the gallery of scenarios, and those that installed packages add; with a NAME (or the path of a scenario of
    your own), show what that one is about.

    \b
    Examples:
      sleepcast scenarios
      sleepcast scenarios bravo
    """
    from sleepcast.simulator import added_scenarios, find_scenario, scenario_names

    if name is not None:
        scenario = find_scenario(name)
        put(json.dumps(_as_dict(scenario)) if as_json else _page(scenario, name))
        return 0
    gallery = [find_scenario(known) for known in scenario_names()]
    for added in added_scenarios():
        try:
            gallery.append(find_scenario(added))
        except SleepcastError as error:  # somebody else's mistake hides no other scenario
            complain(str(error))
    if as_json:
        put(json.dumps([_as_dict(scenario) for scenario in gallery]))
        return 0
    width = max((len(scenario.name) for scenario in gallery), default=0)
    for scenario in gallery:
        robots = f"{scenario.robots.count} {scenario.robots.type}s"
        put(f"{scenario.name:<{width}}  {scenario.title} ({robots})")
    return 0


def _page(scenario: Scenario, name: str) -> str:
    """The page of a scenario, as text. name: how it was asked for, which is how it can be run."""
    import textwrap

    from sleepcast.core.units import value_in_words

    robots = scenario.robots
    lines = [f"{scenario.name}: {scenario.title}", "", *textwrap.wrap(" ".join(scenario.about.split()), WIDTH), ""]
    lines.append(f"{robots.count} {robots.type}s; seed {scenario.seed}; a headless run lasts {scenario.seconds:g} s,")
    lines.append(f"a tick {scenario.tick:g} s; in the browser at {scenario.speed_up:g} times real time.")
    for place in scenario.places:
        lines.append(f"{place.title}: {place.name}_x, {place.name}_y{f' ({place.about})' if place.about else ''}")
    lines += [f"{light.title}: a light, seen as sFlag, sRange, sBearing" for light in scenario.lights]
    for group in robots.groups:
        values = ", ".join(f"{name} {value_in_words(*value)}" for name, value in group.values.items())
        lines.append(f"{group.name}: {group.count} of them{f', with {values}' if values else ''}")
    for store in robots.stores:
        lines.append(f"{store.name}{f': {store.about}' if store.about else ''}")
    if scenario.commands:
        lines += ["", "Try:"]
    for command in scenario.commands:
        lines += [
            "",
            *textwrap.wrap(command.about or command.title, WIDTH, initial_indent="  ", subsequent_indent="  "),
        ]
        lines += [f"    {line}" for line in command.text.strip().split("\n")]
    lines += ["", f"sleepcast demo {name}", f"sleepcast run {name} --json"]
    return "\n".join(lines)


def _as_dict(scenario: Scenario) -> dict[str, object]:
    return {
        "name": scenario.name,
        "title": scenario.title,
        "about": " ".join(scenario.about.split()),
        "robots": scenario.robots.count,
        "type": scenario.robots.type,
        "seed": scenario.seed,
        "seconds": scenario.seconds,
        "tick": scenario.tick,
        "speed_up": scenario.speed_up,
        "commands": [
            {"title": command.title, "text": command.text.strip(), "about": command.about}
            for command in scenario.commands
        ],
    }
