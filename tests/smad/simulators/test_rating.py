"""Rating before measuring: what inputs could show, without a reading, and in time."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from smad.cli import execute
from smad.simulators import plan, simulator
from smad.simulators.rating import Rating, lines
from tests.smad.diagnosis.heater_plant import HeaterPlant, recorded
from tests.smad.simulators.arm import arm_run, files
from tests.smad.simulators.systems import declared_heater, heater, heater_run


def by_name(ratings: list[Rating]) -> dict[str, Rating]:
    return {f"{r.kind} {r.name}": r for r in ratings}


def rated(*, power=None, **more) -> dict[str, Rating]:
    run = heater_run(0)
    given = {"t_s": run["t_s"], "power_W": run["power_W"] if power is None else power(run)}
    planned = plan([given], declared_heater(noise={"temperature_degC": 0.03}, **more))
    return by_name(planned.ratings)


def test_steps_of_power_identify_what_a_constant_power_does_not() -> None:
    steps = rated()
    assert {steps[f"parameter {n}"].rating for n in ("capacity_J_K", "loss_W_K", "room_degC")} == {
        "identifiable"
    }
    assert steps["effect slow_sensor"].rating == "identifiable"
    slow = rated(power=lambda r: 1.0 + 1e-3 * r["t_s"])
    assert slow["parameter capacity_J_K"].rating != "identifiable"
    assert slow["effect slow_sensor"].size > 5.0 * steps["effect slow_sensor"].size


def test_what_parameters_imitate_is_not_identifiable_and_what_looks_alike_is_weak() -> None:
    found = rated(transducers=True)
    # A room that is 1.5 K off is no likelier than the zero of the thermometer.
    zero = found["effect temperature_degC_zero"]
    assert (zero.rating, zero.size) == ("weak", pytest.approx(1.5, abs=0.1))
    assert found["place reading_temperature_degC"].size == pytest.approx(1.5, abs=0.1)
    assert found["effect power_W_lag.tau_s"].rating == "weak"
    assert "temperature_degC_lag.tau_s" in found["effect power_W_lag.tau_s"].alike
    assert any("looks like" in line for line in lines(list(found.values())))


def test_the_size_that_is_noticed_leaves_one_floor_beside_the_parameters() -> None:
    run = heater_run(0)
    given = {"t_s": run["t_s"], "power_W": run["power_W"]}
    # So noisy that the resolution, a thousandth of the span, adds nothing to the floor.
    fine, coarse = (
        by_name(plan([given], declared_heater(noise={"temperature_degC": noise})).ratings)
        for noise in (0.3, 3.0)
    )
    ratio = coarse["effect slow_sensor"].size / fine["effect slow_sensor"].size
    assert ratio == pytest.approx(10.0, rel=0.3)


def test_parameters_imitate_no_more_than_their_ranges_allow_and_is_likely() -> None:
    """A gain of the power is less capacity and less loss, as far as these may go."""
    run = heater_run(0)
    given = {"t_s": run["t_s"], "power_W": run["power_W"]}

    def gain(low: float, prior: float) -> Rating:
        """Both may be `low` of their values at least; `prior` is their deviation, of a value."""
        parameters = {
            n: (v, low * v, 2.0 * v, prior * v)
            for n, v in (("capacity_J_K", 30.0), ("loss_W_K", 0.8), ("room_degC", 22.0))
        }
        declared = simulator(
            heater,
            parameters=parameters,
            effects={"slow_sensor": (2.0, 0.0, 8.0)},
            noise={"temperature_degC": 0.03},
            transducers=True,
        )
        return by_name(plan([given], declared).ratings)["effect power_W_gain"]

    wide, near, unlikely = gain(0.3, 0.5), gain(0.9, 0.5), gain(0.3, 0.1)
    assert wide.rating == "not"
    assert near.size == pytest.approx(0.10, abs=0.03)
    assert unlikely.size == pytest.approx(0.15, abs=0.05)


def test_readings_that_a_file_has_are_not_used() -> None:
    run = heater_run(0)
    other = {**run, "temperature_degC": run["temperature_degC"] * 1.1 + 3.0}
    declared = declared_heater(noise={"temperature_degC": 0.03})
    sizes = [
        [r.size for r in plan([given], declared).ratings if r.kind != "place"]
        for given in (run, other)
    ]
    np.testing.assert_allclose(sizes[0], sizes[1], rtol=0.05)


def test_what_is_not_reached_in_the_time_is_unknown() -> None:
    run = heater_run(0)
    planned = plan([run], declared_heater(), within_s=0.0)
    assert {r.rating for r in planned.ratings} == {"unknown"}
    assert "not reached in the time; give more" in str(planned)


def test_what_gives_no_numbers_is_unknown_and_why_is_said() -> None:
    def frail(t, inputs, values, start):
        if values["loss_W_K"] != 0.8:
            raise ZeroDivisionError("no loss")
        return heater(t, inputs, values, start)

    planned = plan([heater_run(0)], replace(declared_heater(), function=frail))
    assert {r.name for r in planned.ratings if r.rating == "unknown"} == {"loss_W_K"}
    assert "unknown      loss_W_K: the model gives no numbers with it" in str(planned)
    assert "ZeroDivisionError: no loss" in str(planned)


def test_another_plant_is_rated_by_its_own_class() -> None:
    from smad.simulators.rating import rate

    found = by_name(rate(HeaterPlant(), [recorded("sines", 0)]))
    assert {r.kind for r in found.values()} == {"parameter", "effect", "place"}


def test_the_command_rates_the_inputs_of_a_mujoco_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, mapped = files(tmp_path)
    run = arm_run(0)
    given = np.column_stack([run["t_s"], run["torque_N_m"]])
    np.savetxt(tmp_path / "in.csv", given, delimiter=",", header="t_s,torque_N_m", comments="")
    asked = ["gap", "plan", "--inputs", str(tmp_path / "in.csv"), "--mjcf", str(model),
             "--map", str(mapped)]  # fmt: skip
    assert execute(asked) == 0
    told = capsys.readouterr().out
    assert "hinge_dry_friction: noticed from" in told
    assert execute([*asked, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert {r["kind"] for r in rows} == {"parameter", "effect", "place"}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([], "nothing would be played"),
        (["--experiment", "pulses", "--mjcf", "a", "--map", "a"], "exclude each other"),
    ],
)
def test_a_plan_of_nothing_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys, options: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a").write_text("")
    assert execute(["gap", "plan", *options]) == 2
    assert words in capsys.readouterr().err
