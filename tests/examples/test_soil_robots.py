"""The example package is built and installed, and what it adds is found by its entry points."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.channel.transports import open_transport
from sleepcast.channel.transports.address import AddressError
from sleepcast.experiments.measures import read_measure

pytest.importorskip("build")
pytest.importorskip("hatchling")

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "soil_robots"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("soil")
    shutil.copytree(EXAMPLE, folder / "source", ignore=shutil.ignore_patterns("__pycache__", "dist"))
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--skip-dependency-check"]
    subprocess.run([*build, "--outdir", folder, folder / "source"], check=True, capture_output=True, timeout=300)
    (found,) = folder.glob("*.whl")
    return found


@pytest.fixture
def installed(wheel: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of Python's path in which the package is installed; a wheel of pure Python is unpacked and no more."""
    with ZipFile(wheel) as archive:
        archive.extractall(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    sys.modules.pop("soil_robots", None)


@pytest.mark.parametrize("name", ["prober", "probers"])
def test_robots_of_the_package_are_opened_by_name(installed: Path, name: str) -> None:
    fleet = sc.open("bravo", robots=name, over={"robots.count": 30}, seed=7)
    assert np.isnan(fleet["moisture"]).all()
    assert len(fleet.send("(SETQ probe_speed 0.04m/s)", everybody=True).matched) == 30
    fleet.run(3, quiet=True)
    assert ((fleet["depth"] > 0.1) & (fleet["moisture"] > 0)).all()
    assert np.allclose(fleet["(TIME_TO_DEPTH 30cm)"], (0.3 - fleet["depth"]) / 0.04)
    assert len(fleet.send("(WHEN (> id 10) (SAMPLE))").matched) == 20
    fleet.run(1, quiet=True)
    assert read_measure("probed", own=True)(fleet) == 20 / 30
    assert read_measure("sum samples")(fleet) == 20


def test_objects_and_arrays_give_the_same_bits(installed: Path) -> None:
    fleets = [sc.open("bravo", robots=name, over={"robots.count": 30}, seed=7) for name in ("prober", "probers")]
    for fleet in fleets:
        fleet.send("(RULE low (SETQ probe_speed (RANDOM -0.05 0.05)))", everybody=True)
        fleet.run(10, quiet=True)
    assert fleets[0]["depth"].std() > 0
    assert fleets[0].hash == fleets[1].hash


def test_parties_hear_each_other_by_the_transport_of_the_package(installed: Path, tmp_path: Path) -> None:
    (tmp_path / "air").mkdir()
    first, second = (open_transport(f"folder:{tmp_path}/air") for _ in range(2))
    first.send(b"hello")
    assert second.receive() == [b"hello"]
    assert first.receive() == []
    first.close()
    second.close()
    assert not list((tmp_path / "air").iterdir())
    with pytest.raises(AddressError, match="did you mean folder"):
        open_transport("foldr:/tmp")


def test_what_is_not_there_is_told(installed: Path) -> None:
    with pytest.raises(sc.errors.MisuseError, match=r'no robots "probr" \(did you mean prober\?\)'):
        sc.open("bravo", robots="probr")
