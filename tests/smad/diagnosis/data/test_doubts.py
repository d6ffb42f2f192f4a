"""Columns that look misread: units, signs, exchanged inputs; and what leaves no doubt."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from smad.diagnosis.data.doubts import doubted_columns
from smad.diagnosis.plant import Array, Channel, ModelPoint, Signal, nominal_replay
from smad.diagnosis.runs import GapRun
from smad.simulators import diagnose, simulator

N = 600


class Plates:
    """Two heated plates and a pull on a spring, at 10 Hz."""

    name, version, parameters, effects = "plates", "1", (), ()
    inputs = tuple(Signal(n, "W", 0.0, 50.0) for n in ("a_W", "b_W"))
    channels = (
        *(
            Channel(name=f"{n}_degC", unit="degC", quantum=0.01, low=-20.0, high=150.0, noise=0.03)
            for n in "ab"
        ),
        Channel(name="force_N", unit="N", quantum=0.001, low=-5.0, high=60.0, noise=0.003),
    )

    def simulate(self, point: ModelPoint, run: GapRun, *, fast: bool = False) -> dict[str, Array]:
        out = {}
        for n in "ab":
            plate = [22.0]
            for power in run.inputs[f"{n}_W"][1:]:
                plate.append(plate[-1] + 0.1 * (power - 0.6 * (plate[-1] - 22.0)) / 20.0)
            out[f"{n}_degC"] = np.array(plate)
        return out | {"force_N": 1.0 + 0.2 * (out["a_degC"] - 22.0)}


def recorded(gain: float = 1.0) -> GapRun:
    """A healthy run of a bench whose plates warm by another gain, with noise."""
    rng = np.random.default_rng(1)
    early = np.repeat([0.0, 15.0, 50.0, 0.0, 0.0, 15.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], N // 12)
    inputs = {"a_W": early, "b_W": early[::-1].copy()}
    run = GapRun("a", 0.1 * np.arange(N), inputs, {})
    shown = Plates().simulate(ModelPoint({}), run)
    zero = {"a_degC": 22.0, "b_degC": 22.0, "force_N": 1.0}
    noisy = {n: zero[n] + gain * (y - zero[n]) for n, y in shown.items()}
    return replace(run, outputs={n: y + 0.01 * rng.standard_normal(N) for n, y in noisy.items()})


def doubts(
    run: GapRun,
    inputs: Mapping[str, Array] | None = None,
    outputs: Mapping[str, Array] | None = None,
) -> list[str]:
    read = run.with_columns(inputs, outputs)
    return doubted_columns(Plates(), read, nominal_replay(read, Plates()))


@pytest.mark.parametrize("gain", [0.6, 1.0, 1.6])
@pytest.mark.parametrize(
    ("column", "scale", "offset", "words"),
    [
        ("a_degC", 1.8, 32.0, "in degF"),
        ("force_N", 1 / 4.448, 0.0, "in lbf"),
        ("force_N", 1 / 9.807, 0.0, "in kgf"),
        ("force_N", -1.0, 0.0, "of the other sign"),
    ],
)
def test_a_reading_in_another_unit_is_named(
    gain: float, column: str, scale: float, offset: float, words: str
) -> None:
    run = recorded(gain)
    (said,) = doubts(run, outputs={column: scale * run.outputs[column] + offset})
    assert said.startswith(f"is {column} ")
    assert words in said.partition("?")[0]
    assert "if so, " in said


def test_exchanged_inputs_are_named() -> None:
    run = recorded()
    (said,) = doubts(run, inputs={"a_W": run.inputs["b_W"], "b_W": run.inputs["a_W"]})
    assert said.startswith("are a_W, b_W exchanged? Only then does the model as configured come")
    assert "correct the wiring or the names of the columns" in said


@pytest.mark.parametrize("gain", [0.5, 0.7, 1.0, 1.4, 2.0])
def test_a_bench_that_is_not_its_model_is_not_doubted(gain: float) -> None:
    assert doubts(recorded(gain)) == []


@pytest.mark.parametrize(("unit", "factor"), [("mN", 1e3), ("lbf", 1 / 4.448), ("gf", 1e3 / 9.807)])
def test_a_unit_is_named_where_quantum_and_range_are_those_of_the_record(
    unit: str, factor: float
) -> None:
    run = recorded(1.4)
    column = factor * np.round(run.outputs["force_N"], 2)
    read = run.with_columns(None, {"force_N": column})
    force = Channel(
        name="force_N",
        unit="N",
        quantum=0.01 * factor,
        low=-2.0 * column.max(),
        high=2.0 * column.max(),
        noise=0.01 * factor,
    )

    class OfTheRecord(Plates):
        channels = (*Plates.channels[:2], force)

    (said,) = doubted_columns(OfTheRecord(), read, nominal_replay(read, OfTheRecord()))
    assert said.startswith("is force_N in ")
    assert unit in said.partition("?")[0]


def pulled(
    t: Array, inputs: Mapping[str, Array], values: Mapping[str, float], start: object
) -> dict[str, Array]:
    """A lagging force."""
    force = np.zeros(len(t))
    for k in range(1, len(t)):
        asked = values["gain"] * inputs["a_W"][k]
        force[k] = force[k - 1] + 0.05 * (asked - force[k - 1])
    return {"force_N": force}


def test_a_headline_of_runs_that_look_misread_begins_with_that() -> None:
    plant = simulator(pulled, parameters={"gain": (1.0, 0.9, 1.1)})
    t_s, tables = 0.1 * np.arange(N), []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        power = np.repeat(rng.uniform(0.0, 50.0, N // 50), 50)
        force = pulled(t_s, {"a_W": power}, {"gain": 1.0}, None)["force_N"]
        in_kgf = force / 9.80665 + 0.003 * rng.standard_normal(N)
        tables.append({"t_s": t_s, "a_W": power, "force_N": in_kgf})
    verdict = diagnose(tables, plant).verdict
    assert verdict.causes
    assert verdict.headline.startswith("a column may be misread; as it was read, the simulator")
