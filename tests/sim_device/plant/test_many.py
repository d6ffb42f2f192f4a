"""Many plants side by side are each the plant alone."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from sim_device.plant import Drive, Plant, load_parameters
from sim_device.plant.errors import InputError, ModelError
from sim_device.plant.laws import Factor, Law, Term
from sim_device.plant.many import READINGS, PlantArray
from sim_device.plant.setup import Setup

A = load_parameters("A")
EFFECTS = [
    {},
    {"rtd_lag": {"tau_s": 0.8}},
    {"channel_delay": {}},
    {"unified_kinetics": {}, "tube_friction": {}},
]


WARMER = Factor(state="wire", lag_s=1.0, low=290.0, high=340.0, centre=315.0, scale=25.0)
LAWS = (
    Law("heat_into_wire", "x", (Term(name="constant", coefficient=0.3),)),
    Law("reading_force", "both", (Term(name="wire_lag1", factors=(WARMER,), coefficient=0.05),)),
)
# Of every four plants some have no law, one and two.
LAWS_OF = [(), LAWS[:1], (), LAWS]


def setup_of(
    effects: dict[str, dict[str, float]], variant: str = "extended", laws: tuple[Law, ...] = ()
) -> Setup:
    return Setup.make(
        A,
        variant=variant,
        fixture="antagonistic",
        cooling="water",
        effects=effects,
        laws=laws,
    )


def drives(steps: int, plants: int) -> np.ndarray:
    rng = np.random.default_rng(5)
    held = rng.uniform(0.0, [3.0, 3.0, 1.0, 1.0], size=(steps // 50 + 1, plants, 4))
    return np.repeat(held, 50, axis=0)[:steps]


@pytest.mark.parametrize("workers", [1, 2])
def test_every_plant_of_an_array_gives_the_readings_of_the_plant_alone(workers: int) -> None:
    effects = EFFECTS * 4
    given = drives(200, len(effects))
    with ThreadPoolExecutor(2) as pool:
        array = PlantArray(len(effects), setup_of({}), executor=pool, workers=workers)
        for i, chosen in enumerate(effects):
            array.put(i, setup_of(chosen, laws=LAWS_OF[i % 4]), seed=i)
        seen = [array.read()]
        for row in given:
            array.drive[:, :4] = row
            assert array.advance(0.01)
            seen.append(array.read())
    shown = np.array(seen)
    for i, chosen in enumerate(effects):
        plant = Plant(A, effects=chosen, laws=LAWS_OF[i % 4], seed=i)
        alone = [plant.read()]
        for row in given[:, i]:
            plant.advance(Drive((row[0], row[1]), (row[2], row[3])), 0.01)
            alone.append(plant.read())
        assert [r.displacement_m for r in alone] == shown[
            :, i, READINGS.index("displacement_m")
        ].tolist()
        assert [r.force_N for r in alone] == shown[:, i, READINGS.index("force_N")].tolist()
        degrees = shown[:, i, READINGS.index("rtd_x_K")] - 273.15
        assert [r.rtd_degC[0] for r in alone] == degrees.tolist()
    assert np.ptp(shown[:, :, READINGS.index("rtd_x_K")]) > 1.0


def test_a_plant_without_a_solution_leaves_the_others_as_they_are() -> None:
    array = PlantArray(3, setup_of({}))
    array.drive[1, 0] = np.nan
    array.drive[2, 0] = 2.0
    assert not array.advance(0.01)
    assert (array.statuses != 0).tolist() == [False, True, False]
    assert "t = " in str(array.error(1))
    array.put(1, setup_of({}))
    assert array.advance(0.01)


def test_an_array_is_of_one_variant_and_of_one_plant_at_least() -> None:
    with pytest.raises(ModelError, match="one variant"):
        PlantArray(2, setup_of({})).put(0, setup_of({}, "printed"))
    with pytest.raises(InputError, match="at least one"):
        PlantArray(0, setup_of({}))
    with pytest.raises(InputError, match="dt_s"):
        PlantArray(1, setup_of({})).advance(0.0)
