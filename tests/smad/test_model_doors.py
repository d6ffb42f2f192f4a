"""A model with parameters, effects and laws arrives whole at every door that takes one."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from sim_device.plant import Drive, Plant, load_parameters
from sim_device.plant.covariance import Covariance
from sim_device.plant.laws import Law, Term
from sim_device.plant.models import Model, read_model, save_model, write_model
from smad.cli import execute
from smad.config import Config
from smad.diagnosis.spring_pair import SmaPlant
from smad.envs.episodes import Source
from smad.experiments.campaign import CampaignBench
from smad.experiments.errors import ExperimentError
from smad.experiments.virtual import VirtualDriver
from smad.fmi.export import MODEL, export_unit
from smad.processes.boards import build

LAW = Law("film", "both", (Term(name="constant", coefficient=-0.2),))
STEPS = 200


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "better.toml"
    save_model(
        file,
        overrides={"film_scale": 1.1},
        effects={"driver_gain": {"gain": 0.05}},
        laws=(LAW,),
        covariance=Covariance(("parameters.film_scale",), np.array([[1e-4]])),
        note="from a diagnosis",
    )
    return file


def course(plant: Plant) -> np.ndarray:
    """State after two seconds of 3 A in X and a fast pump at Y."""
    for _ in range(STEPS):
        plant.advance(Drive((3.0, 0.0), (0.0, 0.7)), 0.01)
    return plant.numbers.copy()


def plant_of(model: Model) -> Plant:
    return Plant(**model.physics)


def by_sim(path: Path, monkeypatch: pytest.MonkeyPatch) -> Plant:
    return build(Config(), rate_hz=100, seed=0, model_path=path).plant


def by_run(path: Path, monkeypatch: pytest.MonkeyPatch) -> Plant:
    seen = drivers_of(monkeypatch)

    def only_begun(_: object, bench: CampaignBench, *__: object, **___: object) -> None:
        bench.driver()
        raise ExperimentError("begun")

    monkeypatch.setattr("smad.experiments.campaign.run_campaign", only_begun)
    words = ["--sim", "--model", str(path), "--report", str(path.with_suffix(".html"))]
    assert execute(["run", "resistance", *words]) != 0
    return plant_of(seen[0])


def by_gap_next(path: Path, monkeypatch: pytest.MonkeyPatch) -> Plant:
    seen = drivers_of(monkeypatch)
    monkeypatch.setattr(VirtualDriver, "run", lambda self, plan: None)
    words = ["--sim", "--model", str(path), "--run", "pulses", "--folder", str(path.parent)]
    assert execute(["gap", "next", *words]) == 0
    return plant_of(seen[0])


def by_unit(path: Path, monkeypatch: pytest.MonkeyPatch) -> Plant:
    """The model file that a unit of FMI carries; what its C computes is tested with the unit."""
    unit = path.with_name("pair.fmu")
    monkeypatch.setenv("CC", "no compiler")
    export_unit(read_model(path), unit)
    with zipfile.ZipFile(unit) as packed:
        packed.extract(f"resources/{MODEL}", path.parent)
    return plant_of(read_model(path.parent / "resources" / MODEL))


def by_environment(path: Path, monkeypatch: pytest.MonkeyPatch) -> Plant:
    return plant_of(Source(path).drawn(np.random.default_rng(0)))


def by_apply(path: Path, monkeypatch: pytest.MonkeyPatch) -> Plant:
    """As `smad gap verify` reads a model and `diagnose --apply` writes one."""
    plant = SmaPlant()
    point = plant.load_model(path)
    plant.save_model(point, path.with_name("applied.toml"), "applied")
    return plant_of(read_model(path.with_name("applied.toml")))


def drivers_of(monkeypatch: pytest.MonkeyPatch) -> list[Model]:
    """The models of all virtual drivers that are made from now on."""
    seen: list[Model] = []
    make = VirtualDriver.__init__

    def note(self: VirtualDriver, model: Model, **options: object) -> None:
        seen.append(model)
        make(self, model, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(VirtualDriver, "__init__", note)
    return seen


@pytest.mark.parametrize(
    "door",
    [by_sim, by_run, by_gap_next, by_unit, by_environment, by_apply],
    ids=lambda door: door.__name__.removeprefix("by_"),
)
def test_a_plant_of_every_door_is_the_plant_of_the_model(
    door: object, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = course(plant_of(read_model(path)))
    assert np.array_equal(course(door(path, monkeypatch)), whole)  # type: ignore[operator]


@pytest.mark.parametrize("part", ["parameters", "effects", "laws"])
def test_a_model_without_one_of_its_parts_is_another_plant(part: str, path: Path) -> None:
    """What the test above would not see, were the parts without effect."""
    physics = read_model(path).physics
    nothing = {"parameters": load_parameters("A"), "effects": {}, "laws": ()}
    physics[part] = nothing[part]  # type: ignore[literal-required]
    assert not np.array_equal(course(Plant(**physics)), course(plant_of(read_model(path))))


def test_a_model_is_written_whole(path: Path, tmp_path: Path) -> None:
    model = read_model(path)
    write_model(tmp_path / "again.toml", model)
    again = read_model(tmp_path / "again.toml")
    assert again.physics == model.physics
    assert again.note == model.note
    assert again.covariance is not None
    assert model.covariance is not None
    assert again.covariance.names == model.covariance.names
    assert np.array_equal(again.covariance.matrix, model.covariance.matrix)
