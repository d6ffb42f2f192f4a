"""A MuJoCo model as a simulator: replays, its library, what is refused, the better model."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import mujoco
import numpy as np
import pytest

from sim_device.plant.laws import Law, Term
from smad.cli import execute
from smad.diagnosis.answer import Answer
from smad.diagnosis.plant import ModelPoint
from smad.simulators.bind import bind
from smad.simulators.errors import SimulatorError
from smad.simulators.mjcf import asked
from smad.simulators.mjcf.asked import declare_mjcf, diagnose_mjcf
from smad.simulators.mjcf.parts import add_point_mass
from tests.smad.diagnosis.cases import strong
from tests.smad.simulators.arm import DT, MAP, MODEL, arm_run, files, rubbing


def bound_arm(folder: Path, model: str = MODEL, mapped: str = MAP, runs=None):
    declared, (tables,) = declare_mjcf(*files(folder, model, mapped), runs or [arm_run(0)])
    return bind(declared, tables)


def shown(bound, point: ModelPoint | None = None):
    return bound.plant.simulate(point or ModelPoint({}), bound.groups[0][0])


def test_friction_that_a_model_lacks_is_placed_named_and_sized_by_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    model, mapped = files(tmp_path)
    runs = [tmp_path / f"r{seed}.csv" for seed in (1, 3)]
    for seed, path in zip((1, 3), runs, strict=True):
        run = arm_run(seed, rubbing)
        np.savetxt(
            path,
            np.column_stack(list(run.values())),
            delimiter=",",
            header=",".join(run),
            comments="",
        )
    answers: list[Answer] = []
    monkeypatch.setattr(
        asked,
        "diagnose_mjcf",
        lambda *given, **more: answers.append(diagnose_mjcf(*given, **more)) or answers[0],
    )
    better = tmp_path / "better.toml"
    status = execute(["gap", "diagnose", *map(str, runs), "--mjcf", str(model),
                      "--map", str(mapped), "--apply", str(better),
                      "--processes", "2"])  # fmt: skip
    assert status == 0
    assert "torque at joint hinge" in capsys.readouterr().out
    assert better.exists()
    verdict = answers[0].verdict
    first, *_ = verdict.causes
    assert first.place == "input_hinge_torque"
    assert first.words == "torque at joint hinge"
    assert first.name == "hinge_dry_friction"
    assert first.values[0].value == pytest.approx(0.06, rel=0.05)
    assert verdict.models


def test_a_table_is_read_as_its_map_says_that_it_is_written(tmp_path: Path) -> None:
    run = arm_run(0, seconds=2.0)
    head = "time_ms;torque_N_m;angle_rad"
    cells = np.column_stack([1e3 * run["t_s"], run["torque_N_m"], run["angle_rad"]]).tolist()
    rows = [";".join(f"{v:.6f}" for v in row).replace(".", ",") for row in cells]
    (tmp_path / "run.csv").write_text("\n".join([head, *rows]))
    mapped = f'time = "time_ms"\n{MAP}\n[csv]\ndelimiter = ";"\ndecimal = ","\n'
    _, ((table,),) = declare_mjcf(*files(tmp_path, mapped=mapped), [tmp_path / "run.csv"])
    np.testing.assert_allclose(table.t_s, run["t_s"], atol=1e-9)
    np.testing.assert_allclose(table.columns["angle_rad"], run["angle_rad"], atol=1e-6)


def test_a_column_in_another_unit_than_the_map_names_it_by_is_converted(tmp_path: Path) -> None:
    run = arm_run(0, seconds=2.0)
    given = {"t_s": run["t_s"], "Torque [mN m]": 1e3 * run["torque_N_m"], "battery_V": run["t_s"],
             "Angle [°]": np.degrees(run["angle_rad"])}  # fmt: skip
    mapped = MAP.replace('"motor"', '"motor"\ncolumn = "Torque [mN m]"')
    mapped = mapped.replace('joint = "hinge"', 'joint = "hinge"\ncolumn = "Angle [°]"')
    _, ((table,),) = declare_mjcf(*files(tmp_path, mapped=mapped), given)
    np.testing.assert_allclose(table.columns["torque_N_m"], run["torque_N_m"], atol=1e-12)
    np.testing.assert_allclose(table.columns["angle_rad"], run["angle_rad"], atol=1e-12)
    assert table.notes == ("columns left out, which the map does not name: battery_V",)
    unnamed = mapped.replace("channels.angle_rad", "channels.angle")
    declared, _ = declare_mjcf(*files(tmp_path, mapped=unnamed), given)
    assert declared.units["angle"] == "deg"
    with pytest.raises(SimulatorError, match=r"gives torque_N_m a column in another unit; got Ang"):
        declare_mjcf(*files(tmp_path, mapped=mapped.replace("Torque [mN m]", "Angle [°]")), given)


@pytest.mark.parametrize("lacking", ["torque_N_m", "angle_rad"])
def test_a_run_without_an_input_or_any_channel_is_refused_by_the_name_in_the_map(
    lacking: str, tmp_path: Path
) -> None:
    run = arm_run(0, seconds=2.0)
    named = {"other": run[lacking], **{n: c for n, c in run.items() if n != lacking}}
    with pytest.raises(SimulatorError, match=f"run 1 has no column '{lacking}', which the map"):
        diagnose_mjcf(*files(tmp_path), [named])
    with pytest.raises(SimulatorError, match="there are no runs; give at least one"):
        diagnose_mjcf(*files(tmp_path), [])


@pytest.mark.parametrize(
    ("column", "unit", "said"),
    [("q[deg]", "deg", ""), ("q (°)", "deg", ""), ("q", "rad", "q has no unit in its name or")],
)
def test_the_unit_of_a_channel_is_in_its_name_or_is_said_to_be_assumed(
    tmp_path: Path, column: str, unit: str, said: str
) -> None:
    run = arm_run(0, seconds=2.0)
    run[column] = np.degrees(run.pop("angle_rad")) if unit == "deg" else run.pop("angle_rad")
    mapped = MAP.replace("angle_rad", f'"{column}"')
    declared, ((table,),) = declare_mjcf(*files(tmp_path, mapped=mapped), [run])
    assert declared.unit(column) == unit
    assert "".join(table.notes).startswith(said)
    bound = bind(declared, [table])
    predicted = bound.plant.simulate(ModelPoint({}), bound.groups[0][0])[column]
    assert np.std(predicted - run[column]) < 0.2 * np.std(run[column])


@pytest.mark.parametrize(
    ("column", "scale", "channel"),
    [
        ("q_V", 0.1, '[channels.q_V]\njoint = "hinge"\nscale = 5.7295779513'),
        ("enc", 1, '[channels.q]\njoint = "hinge"\ncolumn = "enc"\ncolumn_unit = "deg"'),
        ("q_deg", 1, '[channels.q_deg]\njoint = "hinge"\nunit = "rad"'),
        ("q_deg", -1, '[channels.q_rad]\njoint = "hinge"\ncolumn = "q_deg"\nscale = -1'),
        ("q_deg", 1, '[channels.q_deg]\nsensor = "encoder"'),
        ("q_deg", 1, '[channels.q_deg]\nsensor = "encoder"\nscale = 57.295779513'),
        ("q_deg", 1, '[channels.q_rad]\nsensor = "encoder"\ncolumn = "q_deg"'),
    ],
)
def test_a_reading_in_degrees_is_one_wherever_the_map_says_so(
    tmp_path: Path, column: str, scale: float, channel: str
) -> None:
    sensed = MODEL.replace("<sensor>", '<sensor><jointpos name="encoder" joint="hinge"/>')
    mapped = MAP.replace('[channels.angle_rad]\njoint = "hinge"', channel)
    # From the middle of a run on: the model begins in the state that was read there.
    run = {n: c[200:] for n, c in arm_run(0, seconds=4.0).items()}
    run[column] = scale * np.degrees(run.pop("angle_rad"))
    bound = bound_arm(tmp_path, sensed, mapped, [run])
    ((name, read),) = bound.groups[0][0].outputs.items()
    assert np.std(shown(bound)[name] - read) < 0.1 * np.std(read)


def test_a_parameter_has_the_unit_of_its_field_and_is_refused_by_the_name_of_another(
    tmp_path: Path,
) -> None:
    declared, _ = declare_mjcf(*files(tmp_path), [arm_run(0, seconds=2.0)])
    assert {p.name: p.unit for p in declared.parameters} == {
        "mass_kg": "kg", "damping": "N m s/rad",
    }  # fmt: skip
    grams = MAP.replace("mass_kg", "mass [g]").replace(
        "[parameters.mass [g]]", '[parameters."mass [g]"]'
    )
    with pytest.raises(SimulatorError, match="another unit than the model's field; got g; allowed"):
        declare_mjcf(*files(tmp_path, mapped=grams), [arm_run(0, seconds=2.0)])
    metres = MAP.replace("mass_kg", "mass_m")
    with pytest.raises(SimulatorError, match="mass_m is a mass by its name"):
        declare_mjcf(*files(tmp_path, mapped=metres), [arm_run(0, seconds=2.0)])


def test_a_replay_is_that_of_mj_step(tmp_path: Path) -> None:
    run = arm_run(0, noise=0.0)
    declared, _ = declare_mjcf(*files(tmp_path), [run])
    inputs = {"torque_N_m": run["torque_N_m"], "hinge_torque": np.zeros(len(run["t_s"]))}
    at_rest = {"angle_rad": 0.0, "angle_rad_rate": 0.0}
    found = declared.function(run["t_s"], inputs, declared.values({}, {}), at_rest)
    np.testing.assert_allclose(found["angle_rad"], run["angle_rad"], atol=1e-10)


@pytest.mark.parametrize(("held", "late"), [("until", 0), ("from", 1)])
def test_a_row_is_in_force_until_its_time_or_from_it_on(
    tmp_path: Path, held: str, late: int
) -> None:
    run = arm_run(0, noise=0.0, seconds=2.0)
    run["angle_rad"] = np.zeros(len(run["t_s"]))
    run["torque_N_m"] = np.where(np.arange(len(run["t_s"])) == 50, 1.0, 0.0)
    for mapped in (f'held = "{held}"\n{MAP}', MAP.replace('"motor"', f'"motor"\nheld = "{held}"')):
        angle = shown(bound_arm(tmp_path, mapped=mapped, runs=[run]))["angle_rad"]
        assert int(np.flatnonzero(angle)[0]) == 50 + late
        # The same where a sample is lost and the others come a little early.
        uneven = {n: np.delete(c, 10) for n, c in run.items()}
        uneven["t_s"] = np.r_[0.0, uneven["t_s"][1:] - 3e-4]
        angle = shown(bound_arm(tmp_path, mapped=mapped, runs=[uneven]))["angle_rad"]
        assert int(np.flatnonzero(angle)[0]) == 49 + late


def test_an_effect_of_no_size_changes_nothing_and_each_of_usual_size_does(tmp_path: Path) -> None:
    bound = bound_arm(tmp_path)
    base = shown(bound)["angle_rad"]
    names = [e.name for e in bound.plant.effects]
    assert {
        "hinge_dry_friction",
        "hinge_viscous_friction",
        "hinge_armature",
        "hinge_spring",
        "arm_payload",
        "angle_rad_backlash",
        "angle_rad_delay",
        "angle_rad_zero",
        "angle_rad_gain",
        "torque_N_m_gain",
        "torque_N_m_lag",
        "torque_N_m_delay",
        "torque_N_m_saturation",
    } <= set(names)
    for effect in bound.plant.effects:
        none = ModelPoint({}, {effect.name: strong(effect, 0.0)})
        some = ModelPoint({}, {effect.name: strong(effect, 1.0)})
        assert np.array_equal(shown(bound, none)["angle_rad"], base), effect.name
        assert np.ptp(shown(bound, some)["angle_rad"] - base) > 0.0, effect.name


def test_a_parameter_sets_what_mujoco_compiles_from_the_same_number(tmp_path: Path) -> None:
    bound = bound_arm(tmp_path)
    heavier = MODEL.replace('mass="1"', 'mass="1.3"')
    (tmp_path / "other").mkdir()
    again = bound_arm(tmp_path / "other", model=heavier)
    np.testing.assert_allclose(
        shown(bound, ModelPoint({"mass_kg": 1.3}))["angle_rad"],
        shown(again)["angle_rad"],
        atol=1e-9,
    )


def test_a_payload_is_a_point_mass_as_mujoco_would_compile_it() -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    add_point_mass(model, 1, 0.3, np.array([0.1, 0.0, -0.8]))
    inertia = '<inertial pos="0 0 0" mass="0.3" diaginertia="1e-9 1e-9 1e-9"/>'
    ball = f'<body pos="0.1 0 -.8">{inertia}</body>'
    fused = mujoco.MjModel.from_xml_string(MODEL.replace("</body>", f"{ball}</body>", 1))
    mass = [np.zeros((1, 1)), np.zeros((1, 1))]
    for m, into in zip((model, fused), mass, strict=True):
        data = mujoco.MjData(m)
        mujoco.mj_setConst(m, data)
        data.qpos[:] = 0.4
        mujoco.mj_forward(m, data)
        mujoco.mj_fullM(m, data, into)
        np.add(into, data.qfrc_bias, out=into)
    assert mass[0] == pytest.approx(mass[1], rel=1e-6)


def test_degrees_and_sensors_are_converted_and_a_sensor_lags_nothing(tmp_path: Path) -> None:
    mapped = MAP.replace(
        '[channels.angle_rad]\njoint = "hinge"',
        '[channels.angle_deg]\njoint = "hinge"\n[channels.pull_N_m]\nsensor = "pull"\n'
        '[channels.rate_rad_s]\nvelocity_of = "hinge"',
    )
    run = arm_run(0, noise=0.0)
    rate = np.gradient(run["angle_rad"], DT)
    run |= {"angle_deg": np.degrees(run["angle_rad"]), "pull_N_m": run["torque_N_m"],
            "rate_rad_s": rate}  # fmt: skip
    found = shown(bound_arm(tmp_path, mapped=mapped, runs=[run]))
    np.testing.assert_allclose(found["angle_deg"], run["angle_deg"], atol=1.0)
    np.testing.assert_allclose(found["rate_rad_s"], rate, atol=0.3)
    # In force until its time: at a sample the motor pulls as the next row says.
    np.testing.assert_allclose(found["pull_N_m"][:-1], run["torque_N_m"][1:], atol=1e-9)


@pytest.mark.parametrize(
    ("model", "mapped", "words"),
    [
        (MODEL, MAP.replace('joint = "hinge"', 'joint = "elbow"'),
         r"no joint 'elbow', which the map has at channels\.angle_rad; allowed: hinge"),
        (MODEL, MAP.replace('"motor"', '"moto"'), r"no actuator 'moto'.*inputs\.torque_N_m"),
        (MODEL, MAP.replace('of = "arm"', 'of = "leg"'), r"no body 'leg'.*parameters\.mass_kg"),
        (MODEL, MAP.replace("angle_rad", "angle_mm"),
         r"channels\.angle_mm: the unit contradicts the model's, which is rad; got mm"),
        (MODEL, MAP.replace('actuator = "motor"', 'joint = "hinge"\nunit = "N"'),
         r"inputs\.torque_N_m: the unit contradicts the model's, which is N m; got N"),
        (MODEL, MAP.replace("low = 0.5", "low = 1.5"), r"mass_kg does not begin within its range"),
        (MODEL, MAP.replace('field = "mass"', 'field = "weight"'), r"parameters\.mass_kg.*weight"),
        (MODEL, MAP.replace('actuator = "motor"', ""), "neither of an actuator nor of a joint"),
        (MODEL, MAP.replace('joint = "hinge"', ""), "is not of one part of the model"),
        (MODEL, MAP.replace('joint = "hinge"', 'sensor = "pull"\nindex = 3'), "no such value"),
        (MODEL, MAP.replace('field = "mass"', 'feld = "mass"'), "feld"),
        (MODEL, "inputs = 3", "map file"),
        ("<mujoco><worldbody><body/>", MAP, "is not a MuJoCo model"),
        (MODEL.replace('"hinge" axis="0 1 0" damping="0.05"', '"hinge" type="ball"'), MAP,
         "neither turns nor slides"),
    ],
)  # fmt: skip
def test_a_model_and_a_map_that_do_not_fit_are_refused_by_name(
    tmp_path: Path, model: str, mapped: str, words: str
) -> None:
    run = {**arm_run(0, seconds=2.0), "angle_mm": np.zeros(200)}
    with pytest.raises(SimulatorError, match=words):
        bound_arm(tmp_path, model, mapped, [run])


def test_a_model_that_becomes_unstable_predicts_nothing_and_leaves_no_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    wild = MODEL.replace('integrator="implicitfast"', 'integrator="Euler"').replace("0.005", "0.01")
    mapped = MAP.replace('field = "damping"', 'field = "stiffness"').replace(
        "high = 0.3", "high = 1e9"
    )
    bound = bound_arm(tmp_path, wild, mapped.replace("low = 0.0", "low = 0.0\nnominal = 0.0"))
    angle = shown(bound, ModelPoint({"damping": 1e8}))["angle_rad"]
    assert np.isnan(angle).all()
    assert bound.plant.plain.failures.failed == 1
    assert np.isfinite(shown(bound)["angle_rad"]).all()
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


def test_the_better_model_is_mjcf_that_moves_as_the_point_does(tmp_path: Path) -> None:
    bound = bound_arm(tmp_path)
    point = ModelPoint(
        {"mass_kg": 1.2, "damping": 0.02},
        {"hinge_dry_friction": {"size": 0.05}, "arm_payload": {"size": 0.1},
         "hinge_spring": {"size": 0.4, "hinge_spring_rest": 0.1}, "torque_N_m_gain": {"g": 0.2}},
    )  # fmt: skip
    bound.plant.save_model(point, tmp_path / "better.xml", "a note -- with dashes")
    better = (tmp_path / "better.xml").read_text()
    assert 'frictionloss="0.05"' in better
    again = tmp_path / "other"
    again.mkdir()
    np.testing.assert_allclose(
        shown(bound_arm(again, model=better))["angle_rad"],
        shown(bound, point)["angle_rad"],
        atol=1e-4,
    )


def test_what_no_field_of_mjcf_has_goes_into_a_model_file_with_the_mjcf(tmp_path: Path) -> None:
    bound = bound_arm(tmp_path)
    law = Law("input_hinge_torque", "both", (Term(name="constant", coefficient=0.3),))
    point = ModelPoint({"mass_kg": 1.2}, {"angle_rad_delay": {"T_s": 0.02}}, (law,))
    bound.plant.save_model(point, tmp_path / "better.toml", "a note")
    with (tmp_path / "better.toml").open("rb") as file:
        found = tomllib.load(file)
    assert found["effects"] == {"angle_rad_delay": {"T_s": 0.02}}
    assert found["laws"][0]["coefficient"] == 0.3
    model = mujoco.MjModel.from_xml_string(found["mjcf"])
    assert model.body_mass[1] == pytest.approx(1.2)


def test_an_uneven_clock_is_replayed_on_an_even_one(tmp_path: Path) -> None:
    run = arm_run(0, noise=0.0)
    rng = np.random.default_rng(1)
    kept = np.sort(rng.choice(len(run["t_s"]), 1100, replace=False))
    kept[0] = 0
    uneven = {n: c[kept] for n, c in run.items()}
    angle = shown(bound_arm(tmp_path, runs=[uneven]))["angle_rad"]
    assert np.sqrt(np.mean((angle[:400] - uneven["angle_rad"][:400]) ** 2)) < 0.05


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--mjcf", "arm.xml"], "--mjcf needs --map"),
        (
            ["--mjcf", "arm.xml", "--fmu", "arm.xml", "--map", "map.toml"],
            "--fmu and --mjcf exclude each other",
        ),
        (["--map", "map.toml"], "If it is the map of a simulator, give --fmu or --mjcf, too"),
        (["--window", "3"], "--window needs --mjcf"),
    ],
)
def test_options_that_do_not_go_together_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys, options: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    files(tmp_path)
    (tmp_path / "r.csv").write_text("t_s\n0\n")
    assert execute(["gap", "diagnose", "r.csv", *options]) == 2
    assert words in capsys.readouterr().err


def test_a_joint_that_turns_by_a_servo_keeps_its_input_as_a_place(tmp_path: Path) -> None:
    servo = MODEL.replace(
        '<motor name="motor" joint="hinge"/>', '<position name="motor" joint="hinge" kp="20"/>'
    )
    places = [p.name for p in bound_arm(tmp_path, model=servo).plant.places]
    assert places == ["reading_angle_rad", "input_torque_N_m", "input_hinge_torque"]
    (tmp_path / "other").mkdir()
    places = [p.name for p in bound_arm(tmp_path / "other").plant.places]
    assert places == ["reading_angle_rad", "input_hinge_torque"]


@pytest.mark.parametrize(
    ("kind", "column", "unit", "factor"),
    [
        ("motor", "tau_mNm", "N m", 1e3),
        ("motor", "torque [mN m]", "N m", 1e3),
        ('position kp="20"', "target_deg", "rad", np.degrees(1.0)),
        ('velocity kv="2"', "speed_rpm", "rad/s", 30.0 / np.pi),
    ],
)
def test_an_actuator_is_given_its_input_in_si(
    tmp_path: Path, kind: str, column: str, unit: str, factor: float
) -> None:
    run = arm_run(0, seconds=2.0)
    model = MODEL.replace("motor name", f"{kind} name")
    plain = shown(bound_arm(tmp_path, model, runs=[run]))
    other = {column: factor * run.pop("torque_N_m"), **run}
    mapped = MAP.replace("inputs.torque_N_m", f'inputs."{column}"')
    bound = bound_arm(tmp_path, model, mapped, [other])
    np.testing.assert_allclose(shown(bound)["angle_rad"], plain["angle_rad"], atol=1e-9)
    assert f"{column} is given to actuator motor in {unit}" in bound.groups[0][0].notes


def test_a_control_that_the_model_clips_is_asked_about(tmp_path: Path) -> None:
    limited = MODEL.replace('joint="hinge"/></act', 'joint="hinge" ctrlrange="-0.5 0.5"/></act')
    (note,) = bound_arm(tmp_path, limited).groups[0][0].notes
    assert re.match(r"torque_N_m asks .* clips them to the ctrlrange, -0.5 to 0.5: is its", note)


@pytest.mark.parametrize(("unit", "radian"), [("rad", 1.0), ("deg", np.degrees(1.0))])
def test_backlash_is_as_large_in_any_unit(tmp_path: Path, unit: str, radian: float) -> None:
    run = arm_run(0, seconds=2.0)
    run |= {f"angle_{unit}": radian * run["angle_rad"]}
    bound = bound_arm(tmp_path, mapped=MAP.replace("angle_rad", f"angle_{unit}"), runs=[run])
    (play,) = (e.parameters[0] for e in bound.plant.effects if e.name.endswith("_backlash"))
    assert (play.typical, play.high) == pytest.approx((0.02 * radian, 0.3 * radian))
