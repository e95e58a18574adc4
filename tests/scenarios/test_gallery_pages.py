"""What the gallery's pages say is true: their examples load, check, and are the scenarios' own commands."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sleepcast.language import check
from sleepcast.language.learned_names import LearnedNames
from sleepcast.loop import Swarm, vocabulary_of
from sleepcast.simulator import Scenario, SettingsError, Simulator, find_scenario, load, parse_mission, scenario_names
from sleepcast.simulator.scenario.mission import instruction
from sleepcast.simulator.scenario.scenario import GALLERY

WITHOUT_FIGURE = ("calibrate", "crowd", "flood", "maze", "rehearsal", "stop", "two-desks")
"""These show a command, or a crowd, rather than a law; that of stop is in docs/scenarios.md."""
DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.fixture(params=scenario_names())
def scenario(request: pytest.FixtureRequest) -> Scenario:
    return find_scenario(request.param)


def plain(text: str) -> str:
    return " ".join(text.split())


def expressions(scenario: Scenario) -> list[str]:
    """What the mission has robots evaluate."""
    found = [instruction(order) for order in scenario.mission]
    return [each.text for each in found if each.is_expression]


def page(scenario: Scenario) -> str:
    return (scenario.path.parent / "README.md").read_text(encoding="utf-8")


def test_ready_made_commands_and_orders_are_without_a_finding(scenario: Scenario) -> None:
    """Each may use what those before it declare."""
    vocabulary = vocabulary_of(Simulator(scenario).model)
    for texts in ([c.text for c in scenario.commands], expressions(scenario)):
        names = LearnedNames(vocabulary)
        for text in texts:
            checked = check(text, names)
            assert not checked.findings, text
            names.learn(checked.required().form)


def test_the_mission_says_what_the_ready_made_commands_say(scenario: Scenario) -> None:
    assert {plain(text) for text in expressions(scenario)} == {plain(command.text) for command in scenario.commands}


def test_the_page_tells_to_type_the_ready_made_commands(scenario: Scenario) -> None:
    for command in scenario.commands:
        assert plain(command.text) in plain(page(scenario))


def test_things_to_try_can_be_tried(scenario: Scenario) -> None:
    swarm = Swarm(Simulator(scenario))
    examples = re.findall(r"`(\([^`]+\))`", page(scenario))
    assert examples
    for text in (*(command.text for command in scenario.commands), *examples):
        assert not swarm.evaluate(swarm.simulator.names[0], text).faults, text


def test_the_gallery_shows_it(scenario: Scenario) -> None:
    gallery = (DOCS / "gallery.md").read_text(encoding="utf-8")
    assert f"[**{scenario.name}**](../src/sleepcast/scenarios/{scenario.name}/README.md)" in gallery
    assert f'<img src="pictures/gallery/{scenario.name}.svg" ' in gallery
    assert (DOCS / "pictures" / "gallery" / f"{scenario.name}.svg").is_file(), "docs/pictures/make.py gallery draws it"


def test_each_figure_is_made_by_a_command_on_the_page(scenario: Scenario) -> None:
    """docs/pictures/make.py follows these commands."""
    text = page(scenario)
    shown = set(re.findall(r"^!\[[^\]]*\]\((\w[\w-]*\.svg)\)", text, re.MULTILINE))
    made = set(re.findall(r"^    sleepcast plot .*--out (\S+\.svg)$", text, re.MULTILINE))
    assert shown == made
    assert all((scenario.path.parent / name).is_file() for name in shown)
    assert shown or scenario.name in WITHOUT_FIGURE


def test_the_complete_example_loads(tmp_path: Path) -> None:
    text = (GALLERY / "README.md").read_text(encoding="utf-8")
    example = re.search(r"```toml\n(.*?)```", text, re.DOTALL)
    mission = re.search(r"```\n(@.*?)```", text, re.DOTALL)
    assert example
    assert mission
    (tmp_path / "pond.sleep").write_text(mission[1], encoding="utf-8")
    (tmp_path / "scenario.toml").write_text(example[1].replace("# mission", "mission"), encoding="utf-8")
    pond = load(tmp_path)
    assert pond.mission == parse_mission(mission[1], str(tmp_path / "pond.sleep"))
    sim = Simulator(pond)
    sim.step()
    assert len(sim.readings()[0]) == len(sim.model.sensors)


def test_the_complete_example_has_every_key(tmp_path: Path) -> None:
    """Every key that the reader asks for is in the example: the reader lists them when one is unknown."""
    text = (GALLERY / "README.md").read_text(encoding="utf-8")
    example = re.search(r"```toml\n(.*?)```", text, re.DOTALL)
    assert example
    lines = example[1].split("\n")
    tables = [number for number, line in enumerate(lines) if line.startswith("[")]
    file = tmp_path / "scenario.toml"
    for number in (tables[0] - 1, *tables):
        if lines[number].startswith(("[places.", "[robots.stores.", "[noise]", "[constants]", "[nomad", "[[nomad")):
            continue  # those below have names that people choose, or are seen with their keys here, or `sites` reads
        file.write_text("\n".join((*lines[: number + 1], "nonsense_key = 1", *lines[number + 1 :])), encoding="utf-8")
        with pytest.raises(SettingsError, match="unknown key") as caught:
            load(file)
        known = re.search(r"known here: (.*)", str(caught.value))
        assert known
        for key in known[1].split(", "):
            assert re.search(
                rf"^(# |\[{{0,2}}((robots|world|fields\.\w+)\.(sonar\.)?)?)?{key}\b", example[1], re.MULTILINE
            ), key
