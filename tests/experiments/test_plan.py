"""Plans: what a file or a line of options says, the runs that follow, and what is refused."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from sleepcast.core.errors import MisuseError
from sleepcast.experiments.plan import (
    Experiment,
    ParameterRange,
    PlanError,
    TimedCommand,
    experiment_of,
    experiment_of_scenario,
    read_experiment,
)

WHOLE = """
scenario = "crowd"
seconds = "1min"
seeds = [4, 9]
every = "500ms"
until = "share (> x 1000km) >= 0.5"
mission = false

[over]
radio.loss = [0, 0.3]
"robots.limits.speed" = ["0.5m/s", "1m/s"]

[measures]
charge = "mean battery"
far = 'quantile 0.9 (DIST x y 0 0)'

[[commands]]
at = "5s"
text = '(WHEN (> battery 50%) (REPORT "é\\x7f"))'
"""


def plan(text: str) -> Experiment:
    return read_experiment(Path("experiment.toml"), text).checked()


def test_a_file_says_all_of_it() -> None:
    found = plan(WHOLE)
    assert found.seconds == 60.0
    assert found.every == 0.5
    assert not found.mission
    assert found.commands == (TimedCommand(5.0, '(WHEN (> battery 50%) (REPORT "é\\x7f"))'),)
    assert [(run.number, run.seed, *run.point.values()) for run in found.runs()] == [
        (0, 4, 0, "0.5m/s"),
        (1, 4, 0, "1m/s"),
        (2, 4, 0.3, "0.5m/s"),
        (3, 4, 0.3, "1m/s"),
        (4, 9, 0, "0.5m/s"),
        (5, 9, 0, "1m/s"),
        (6, 9, 0.3, "0.5m/s"),
        (7, 9, 0.3, "1m/s"),
    ]


@pytest.mark.parametrize(
    "text",
    [
        WHOLE,
        'scenario = "crowd"\nseeds = 3\n[measures]\ncharge = "mean battery"\n',
        'scenario = "crowd"\nseeds = 9\nmeasures.a = "mean x"\n'
        'precision = { measure = "a", within = 0.5, least = 3 }\n',
        'scenario = "crowd"\nsampling = "latin"\npoints = 5\n[measures]\na = "mean x"\n'
        '[over.radio]\nloss = { low = 0, high = 0.5 }\n[over.robots]\nlimits.speed = { low = "1m/s", high = "2m/s" }\n',
    ],
)
def test_what_is_written_is_read_as_the_same(text: str) -> None:
    once = plan(text)
    assert plan(once.to_toml()) == once
    assert plan(once.to_toml()).to_toml() == once.to_toml()


def test_options_say_the_same_as_a_file() -> None:
    found = experiment_of(
        "crowd",
        over=["radio.loss=0,0.3", "world.edge=wall,fence"],
        measures=["mean battery", "n=count (> x 5)"],
        seeds=2,
    )
    text = """
        scenario = "crowd"
        seeds = 2
        over.radio.loss = [0, 0.3]
        over.world.edge = ["wall", "fence"]
        measures.mean_battery = "mean battery"
        measures.n = "count (> x 5)"
    """
    assert found == plan(text)
    assert len(found) == 8


@pytest.mark.parametrize("sampling", ["latin", "sobol"])
def test_drawn_points_fill_their_ranges(sampling: str) -> None:
    pytest.importorskip("scipy")
    found = plan(
        f'scenario = "crowd"\nsampling = "{sampling}"\npoints = 16\n[measures]\na = "mean x"\n'
        '[over]\nradio.loss = { low = 0.1, high = 0.5 }\n"robots.limits.speed" = { low = "1m/s", high = "2m/s" }\n'
    )
    assert found.over["radio.loss"] == ParameterRange(0.1, 0.5)
    points = [run.point for run in found.runs()]
    assert points == [run.point for run in found.runs()]
    losses = sorted(float(point["radio.loss"]) for point in points)
    assert [int((loss - 0.1) / 0.4 * 16 + 1e-9) for loss in losses] == list(range(16)), "one in each sixteenth"
    assert all(str(point["robots.limits.speed"]).endswith("m/s") for point in points)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ("seeds = 0", r"experiment.toml:\d+: seeds: wanted a whole number from 1"),
        ("seeds = []", r"seeds: wanted a list of 1 to"),
        ("seconds = '5m'", r"seconds: wanted a time"),
        ("every = 0", r"every: wanted a time"),
        ("until = 'share'", "wanted a measure and a bound"),
        ("until = 'meen x > 1'", 'there is no "meen" .did you mean mean'),
        ("sampling = 'sobel'", "did you mean sobol"),
        ("sampling = 'sobol'", "points: is missing"),
        ("sampling = 'sobol'\npoints = 4", "over: wanted a range to draw from"),
        ("sampling = 'sobol'\npoints = 4\nover.radio.loss = { low = 1, high = 0 }", "from the lower to the higher end"),
        ("over.radio.loss = 3", r"radio.loss: wanted a list of values"),
        ("over.radio.loss = []", r"radio.loss: wanted a list of values"),
        ("over.radio.los = [0]", r"over radio.los: unknown key .did you mean loss"),
        ("over.radio.loss = [0, 2]", r"radio.loss: wanted a plain number from 0 to 1, not 2"),
        ("sceds = 3", "sceds: unknown key .did you mean seeds"),
        ("measures.time = 'mean x'", "has a column of this name already"),
        ("measures.a = 'nosuch.module'", "cannot be loaded: ModuleNotFoundError"),
        ("measures.a = 'sleepcast.core.version.VERSION'", "is no function"),
        ("measures.a = 'quantile 2 x'", "wanted a share and an expression"),
        ("measures.a = 'mean'", 'no measure "mean"'),
        ("precision = { measure = 'chargd', within = 1 }", "precision: nothing is measured as .* .did you mean charge"),
        ("precision = { measure = 'charge', within = -1 }", r"precision.within: wanted"),
        ("commands = [{ at = '5s' }]", "text: is missing"),
        ("seeds = 1000000\nover.radio.loss = [0, 0.1]", "at most 1,000,000 fit"),
    ],
)
def test_what_is_wrong_is_said(wrong: str, sentence: str) -> None:
    with pytest.raises(MisuseError, match=sentence):
        plan(f'{wrong}\nscenario = "crowd"\nmeasures.charge = "mean battery"\n')


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"over": ["radio.loss"]}, "wanted a key and its values"),
        ({"measures": []}, "nothing is measured"),
        ({"seeds": 0}, "seeds 0: wanted"),
    ],
)
def test_wrong_options_are_refused(options: dict[str, object], sentence: str) -> None:
    with pytest.raises(MisuseError, match=sentence):
        experiment_of("crowd", **{"measures": ["mean x"], **options}).checked()  # type: ignore[arg-type]


GRID = 'scenario = "crowd"\n[measures]\na = "mean x"\n[over]\n'
DRAWN = (
    'scenario = "crowd"\nseeds = [1, 2, 1]\nsampling = "sobol"\npoints = 16\n[measures]\na = "mean x"\n[over]\n'
    "robots.count = { low = 5, high = 7, whole = true }\n"
)


class TestEqualOnes:
    """Points and seeds that coincide are one run each."""

    @pytest.mark.parametrize(
        ("values", "kept", "said"),
        [
            ("radio.loss=0.1,0.1,0", (0.1, 0), "over radio.loss: 0.1 was given more than once, and is done once"),
            ("radio.loss=1,1.0,1e0", (1,), "over radio.loss: 1.0 was given"),
            ("radio.reach=1m,100cm,2m", ("1m", "2m"), "over radio.reach: 100cm was given"),
            ("world.edge=wall,wall", ("wall",), "over world.edge: wall was given"),
        ],
    )
    def test_values_that_mean_the_same_are_one(self, values: str, kept: tuple[object, ...], said: str) -> None:
        found = experiment_of("crowd", measures=["mean x"], over=[values], seeds=2).checked()
        assert found.over[values.partition("=")[0]] == kept
        assert len(found) == len(list(found.runs())) == len({run.key for run in found.runs()}) == 2 * len(kept)
        assert said in found.repeats()[0]

    def test_truth_and_numbers_differ(self) -> None:
        found = Experiment("crowd", (1,), {"a": "mean x"}, {"radio.loss": (1, True, "1m", 1.0)})
        assert found.over["radio.loss"] == ("1m", True)  # a text stays, so that its unit is checked

    @pytest.mark.parametrize(
        ("key", "values", "kept"),
        [
            ("robots.limits.speed", (1, "1m/s", 2, "2000mm/s"), ("1m/s", 2, "2000mm/s")),
            ("robots.limits.speed", ("1m/s", 1.0), ("1m/s",)),
            ("radio.loss", (0.5, "50%"), ("50%",)),
            ("constants.A", (1, "1m", "1s"), (1, "1m", "1s")),
            ("constants.A", (2**53, 2**53 + 1, float(2**53)), (2**53, 2**53 + 1)),
        ],
    )
    def test_a_number_without_a_unit_is_in_si(self, key: str, values: tuple[int | str, ...], kept: object) -> None:
        assert Experiment("crowd", (1,), {"a": "mean x"}, {key: values}).over[key] == kept

    def test_a_wrong_unit_is_not_taken_for_a_repeated_number(self) -> None:
        with pytest.raises(MisuseError, match=r'radio\.loss: wanted a plain number, not "1m"'):
            experiment_of("crowd", measures=["mean x"], over=["radio.loss=1,1m"]).checked()

    def test_equal_seeds_are_one(self) -> None:
        found = read_experiment(Path("experiment.toml"), "seeds = [3, 5, 3, 3]\n" + GRID)
        assert found.seeds == (3, 5)
        assert found.repeats() == ("seeds: 3 was given more than once, and is done once",)
        assert len(list(found.runs())) == len(found) == 2
        assert Experiment("crowd", (np.uint64(7), 7), {"a": "mean x"}).seeds == (7,)  # type: ignore[arg-type]

    def test_points_that_are_drawn_again_are_one(self) -> None:
        pytest.importorskip("scipy")
        found = plan(DRAWN)
        runs = list(found.runs())
        assert len(runs) == len(found) == len({run.key for run in runs}) == 2 * 3
        assert "points: only 3 of 16 that were drawn are different; each is done once" in found.repeats()
        assert len({run.number for run in runs}) == 6
        assert sum(map(len, found.rounds())) == 6

    def test_what_differs_is_not_mentioned(self) -> None:
        assert plan(WHOLE).repeats() == ()


class TestKeys:
    """A key is given once, exists, and is not decided elsewhere."""

    @pytest.mark.parametrize(
        ("over", "said"),
        [
            (["radio.loss=0", "radio.loss=1"], "over radio.loss: it is given twice"),
            (["commands[0].title=a", "commands[00].title=b"], r"over commands\[0\].title: it is given twice"),
            (
                ["constants.FARR=1m,2m"],
                r"over constants.FARR: the file has no such name .did you mean FAR..: wanted one",
            ),
            (["seed=42,43"], r"over seed: each run has a seed of its own: --seeds 20 .* seeds = .42, 43."),
            (["speed_up=1,2"], "over speed_up: a run of a sweep goes as fast as it can"),
            (["title=a,b"], "over title: no run depends on it"),
            (["robots.cont=5"], "did you mean count"),
        ],
    )
    def test_wrong_ones_are_refused(self, over: list[str], said: str) -> None:
        with pytest.raises(MisuseError, match=said):
            experiment_of("gauci", measures=["mean x"], over=over).checked()

    def test_one_that_matters_at_some_points_only_is_taken(self) -> None:
        over = ["robots.count=3,200", "world.rooms.door=1.5m,2m"]  # three robots have one room
        assert len(experiment_of("crowd", measures=["mean x"], over=over).checked()) == 4

    @pytest.mark.parametrize(
        "text", ["radio.loss = [0]\n'radio.loss' = [1]\n", "'radio.loss' = [1]\nradio.loss = [0]\n"]
    )
    def test_a_file_gives_a_key_once(self, text: str) -> None:
        with pytest.raises(MisuseError, match=r"experiment.toml:\d+: over.radio.loss: it is given twice"):
            plan(GRID + text)

    def test_an_option_does_not_override_a_key(self) -> None:
        with pytest.raises(MisuseError, match="over seconds: the experiment says how long a run is"):
            experiment_of("crowd", measures=["mean x"], over=["seconds=5s,9s"], seconds=3.0).checked()
        experiment_of("crowd", measures=["mean x"], over=["seconds=5s,9s"]).checked()


class TestNamesOfMeasures:
    @pytest.mark.parametrize(
        "measures",
        [
            ["count (< x 5)", "count (> x 5)"],
            ["sum -1m", "sum 1m"],
            ["a=mean x", "a=mean y"],
            ["mean x", "mean_x=mean y"],
        ],
    )
    def test_two_of_one_name_are_refused(self, measures: list[str]) -> None:
        with pytest.raises(
            PlanError, match=r'measures ".+" and ".+" would both be called \w+: give them different names'
        ):
            experiment_of("crowd", measures=measures)

    def test_with_names_of_their_own_both_are_taken(self) -> None:
        found = experiment_of("crowd", measures=["count (< x 5)", "more=count (> x 5)"])
        assert found.measures == {"count_x_5": "count (< x 5)", "more": "count (> x 5)"}


class TestAnotherWay:
    """An experiment of the gallery, with other settings."""

    def test_it_measures_the_same(self) -> None:
        own = experiment_of_scenario("gauci")
        assert own is not None
        other = own.varied(over=["constants.FAR=1m,2m"], seeds=3)
        assert other.measures == own.measures
        assert other.over == {"constants.FAR": ("1m", "2m")}
        assert other.seeds == (1, 2, 3)
        assert own.varied(seconds=5.0) == msgspec.structs.replace(own, seconds=5.0)

    def test_what_is_replaced_is_not_said_to_be_repeated(self) -> None:
        twice = Experiment("crowd", (1, 1), {"a": "mean x"}, {"radio.loss": (0, 0)})
        assert len(twice.repeats()) == 2
        assert twice.varied(over=["radio.loss=0.1"]).repeats() == twice.repeats()[:1]
        assert twice.varied(over=["radio.loss=0.1"], seeds=2).repeats() == ()

    def test_drawn_points_are_not_replaced(self) -> None:
        drawn = Experiment(
            "bravo", (1,), {"a": "mean fuel"}, {"radio.loss": ParameterRange(0.0, 1.0)}, sampling="latin", points=2
        )
        assert drawn.varied(seeds=2).seeds == (1, 2)
        with pytest.raises(PlanError, match="drawn"):
            drawn.varied(over=["radio.loss=0"])
