"""Public records: read from files as they were published, and diagnosed; without any network."""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.io import savemat

from examples.public_records.__main__ import main
from examples.public_records.records import (
    EMPS_S,
    LAP,
    RECORDS,
    SILVERBOX_PART,
    SILVERBOX_S,
    TANKS_S,
    Mjcf,
    Record,
    RecordError,
)
from smad.diagnosis import Verdict
from smad.diagnosis.plant import Array, ModelPoint
from smad.diagnosis.runs import GapRun
from smad.simulators import Simulator, diagnose
from smad.simulators.bind import bind
from smad.simulators.mjcf.asked import declare_mjcf
from tests.smad.diagnosis.cases import strong

TANKS, SILVERBOX, EMPS = RECORDS["tanks"], RECORDS["silverbox"], RECORDS["emps"]
PENDULUM = RECORDS["pendulum"]
FETCHED = Path(__file__).resolve().parents[2] / "public-records"
"""Where `python -m examples.public_records` puts them, from the root."""
GAIN = 1.1
"""Of the Silverbox that is made here."""


def multisine(n: int, lines: int, seed: int) -> Array:
    """A sum of `lines` cosines of random phases, its largest value 1."""
    rng = np.random.default_rng(seed)
    spectrum = np.zeros(n // 2 + 1, dtype=complex)
    spectrum[1 : lines + 1] = np.exp(2j * np.pi * rng.random(lines))
    u = np.fft.irfft(spectrum, n)
    return np.asarray(u / np.max(np.abs(u)))


SHOWN = {"pump_V": "level_V", "input_V": "output_V", "force_N": "position_rate"}
"""What is measured beside an input."""


def shown(of: Simulator, point: ModelPoint, given: GapRun) -> Array:
    """What a simulator shows at a point, begun at 0 where nothing was measured."""
    (played,) = given.inputs
    run = (
        given
        if given.outputs
        else replace(given, outputs={SHOWN[played]: np.zeros(len(given.t_s))})
    )
    return bind(of, run).plant.simulate(point, run)[SHOWN[played]]


def answered(of: Simulator, point: ModelPoint, given: GapRun, noise: float, seed: int) -> Array:
    clean = shown(of, point, given)
    return np.asarray(clean + noise * np.random.default_rng(seed).standard_normal(len(clean)))


def written(path: Path, columns: Mapping[str, Array]) -> None:
    """A file as they are published: names in quotes, a comma at each end, an empty last line."""
    head = ",".join(f'"{name}"' for name in columns)
    rows = np.column_stack(list(columns.values()))
    lines = (",".join(f"{v:.6g}" for v in row) for row in rows)
    path.write_text(f"{head},\n" + "".join(f"{line},\n" for line in lines) + "\n")


def as_published(record: Record, folder: Path) -> Record:
    """The record, as if what is in `folder` were what was published."""
    digests = {
        name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in record.files
    }
    return replace(record, files=digests)


def tanks_file(folder: Path, effects: Mapping[str, Mapping[str, float]]) -> Record:
    point = ModelPoint(
        {"upper_outlet": 0.045, "lower_outlet": 0.055, "upper_start_V": 8.0, "sensor_zero_V": -1.0},
        effects,
    )
    columns = {}
    for i, which in enumerate(("Est", "Val")):
        pump = 2.8 + 2.2 * multisine(1024, 24, seed=i)
        given = GapRun(which, np.arange(1024) * TANKS_S, {"pump_V": pump}, {})
        columns[f"u{which}"] = pump
        columns[f"y{which}"] = answered(TANKS.simulator, point, given, 0.015, seed=i)
    ordered = {name: columns[name] for name in ("uEst", "uVal", "yEst", "yVal")}
    (name,) = TANKS.files
    written(folder / name, {**ordered, "Ts": np.full(1024, TANKS_S)})
    return as_published(TANKS, folder)


def silverbox_file(folder: Path, effects: Mapping[str, Mapping[str, float]]) -> Record:
    point = ModelPoint({"resonance_Hz": 68.0, "gain": GAIN, "input_zero_V": 0.006}, effects)
    columns = {"V1": np.zeros(131072), "V2": np.zeros(131072)}
    (name,) = SILVERBOX.files
    for seed, start in enumerate((40577 - SILVERBOX_PART, 40577, 49271, 110110)):
        u = 0.1 * multisine(SILVERBOX_PART, 390, seed=seed)
        given = GapRun("", np.arange(SILVERBOX_PART) * SILVERBOX_S, {"input_V": u}, {})
        columns["V1"][start : start + SILVERBOX_PART] = u
        columns["V2"][start : start + SILVERBOX_PART] = answered(
            SILVERBOX.simulator, point, given, 3e-4, seed
        )
    written(folder / name, columns)
    return as_published(SILVERBOX, folder)


def there_and_back() -> Array:
    """The rate of a lap: three speeds forwards, then the same backwards, each held for a while."""
    speeds = np.array([0.04, 0.08, 0.12, 0.04])
    held = np.repeat(np.r_[speeds, -speeds], 2)
    edges = np.linspace(0, LAP, 9)
    knots = np.column_stack([edges[:-1] + 120, edges[1:] - 120]).ravel()
    return np.interp(np.arange(LAP), np.r_[0, knots, LAP], np.r_[0.0, held, 0.0])


def emps_files(folder: Path, effects: Mapping[str, Mapping[str, float]]) -> Record:
    """Two files of four laps; the position is what an encoder shows of the sum of the rates.

    Forces are those of the programme, and in the second file pulses beside.
    """
    mass, drag, gain = 95.0, 210.0, 35.0
    point = ModelPoint({"mass_kg": mass, "drag_N_s_m": drag, "offset_N": -3.0}, effects)
    told = np.tile(there_and_back(), 4)
    force = mass * np.gradient(told, EMPS_S) + drag * told - 3.0
    force += effects.get("friction_N", {}).get("size", 0.0) * np.sign(told)
    for i, name in enumerate(EMPS.files):
        pulses = np.where(np.arange(len(told)) % 500 < 20, 60.0 * i, 0.0)
        given = GapRun("", np.arange(len(told)) * EMPS_S, {"force_N": force + pulses}, {})
        rate = answered(EMPS.simulator, point, given, 1e-4, seed=i)
        middles = 0.5 * (rate[1:] + rate[:-1])
        steps = EMPS_S * np.r_[rate[0], middles, rate[-1]]
        position = 5e-8 * np.round(np.r_[0.0, np.cumsum(steps)] / 5e-8)
        volts = np.r_[0.0, given.inputs["force_N"], 0.0] / gain
        columns = {"vir": volts, "qm": position, "kp": np.array([160.0]), "gtau": np.array([gain])}
        savemat(folder / name, {n: c[:, None] for n, c in columns.items()})
    return as_published(EMPS, folder)


def test_an_overflow_put_into_the_tanks_comes_first(tmp_path: Path) -> None:
    spilling = {"upper_overflow": {"size": 0.9, "upper_rim_V": 10.0, "to_lower": 0.1}}
    asked = tanks_file(tmp_path, spilling).asked(tmp_path)
    found = diagnose([*asked.fit, *asked.hold_out], TANKS.simulator).verdict
    first, *_ = found.causes
    assert first.name == "upper_overflow"
    (share,) = (v for v in first.values if v.name == "to_lower")
    assert share.value == pytest.approx(0.1, abs=0.03)
    assert found.whole is not None
    assert found.whole.final < 0.3 * found.whole.parameters


def test_the_gap_with_the_first_causes_is_that_of_these_alone_where_one_was_exchanged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The right one is not fitted at first, and takes the place of another one later.
    for name, few in (("_TRIED", 3), ("_MOST", 3), ("_ROUNDS", 1)):
        monkeypatch.setattr(f"smad.diagnosis.rivals.screening.{name}", few)
    spilling = {"upper_overflow": {"size": 0.9, "upper_rim_V": 10.0, "to_lower": 0.1}}
    asked = tanks_file(tmp_path, spilling).asked(tmp_path)
    answer = diagnose([*asked.fit, *asked.hold_out], TANKS.simulator)
    first, *_ = causes = answer.verdict.causes
    assert first.name == "upper_overflow"
    assert len(causes) > 1
    fits = [stage.fit for stage in answer.stages[1:] if stage.fit is not None]
    parts = [[part.name for part in fitted.model.parts] for fitted in fits]
    assert parts == [parts[-1][:count] for count in range(len(causes) + 1)]
    assert answer.verdict.whole is not None
    assert answer.verdict.whole.causes == [cause.gap for cause in causes]
    # What is named after the part that entered last is no effect itself.
    assert {r.title for cause in causes for r in cause.rivals if r.kind == "nothing"} == {""}


def test_the_command_prints_the_name_of_what_was_put_in_and_writes_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stiff = silverbox_file(tmp_path, {"cubic_spring": {"size": 4.0}})
    monkeypatch.setitem(RECORDS, "silverbox", stiff)
    page = tmp_path / "silverbox.html"
    done = CliRunner().invoke(main, ["silverbox", "--folder", str(tmp_path), "--report", str(page)])
    assert done.exit_code == 0, done.output
    assert "cubic_spring, size = 4.0" in done.output
    assert "Silverbox" in page.read_text()


def silverbox_told(tmp_path: Path, effect: str, size: float) -> Verdict:
    asked = silverbox_file(tmp_path, {effect: {"size": size}}).asked(tmp_path)
    return diagnose(asked.fit, SILVERBOX.simulator, hold_out=asked.hold_out, candidates=()).verdict


def test_a_cubic_spring_comes_out_as_a_force_that_grows_with_the_cube_of_displacement(
    tmp_path: Path,
) -> None:
    """Without an entry for it: of its curve a line is other values of the parameters.

    At the input, −4·y³ of the spring is that over the circuit's gain.
    """
    told, *_ = silverbox_told(tmp_path, "cubic_spring", 4.0).causes
    assert told.place == "input_input_V"
    assert {t.state for t in told.read} == {"output_V"}
    y = np.linspace(-0.2, 0.2, 81)
    law = np.zeros(len(y))
    for term in told.read:
        _, _, knot = term.words.partition(" above ")
        bent = np.maximum(y - float(knot.split()[0]), 0.0) if knot else y
        law += term.slopes["both"] * bent
    shape = np.column_stack([np.ones(len(y)), y, y**3])
    fit = np.linalg.lstsq(shape, law, rcond=None)[0]
    line = shape[:, :2] @ np.linalg.lstsq(shape[:, :2], law, rcond=None)[0]
    assert fit[2] == pytest.approx(-4.0 / GAIN, rel=0.15)
    assert np.sum((law - shape @ fit) ** 2) < 0.5 * np.sum((law - line) ** 2)


def test_friction_comes_out_as_a_force_with_the_sign_of_the_rate(tmp_path: Path) -> None:
    (told,) = silverbox_told(tmp_path, "friction_V", 0.005).causes
    assert told.place == "input_input_V"
    (sign,) = (t for t in told.read if t.name.endswith("_sign"))
    assert sign.state == "output_V_rate"
    assert sign.slopes["both"] < -6.0 * sign.sd["both"]


def test_friction_of_a_drive_comes_out_as_a_force_with_the_sign_of_its_rate(
    tmp_path: Path,
) -> None:
    """Without an entry for it, and beside it that drag is smaller forwards."""
    rubbing = {"friction_N": {"size": 12.0}, "one_way_drag_N_s_m": {"size": -40.0}}
    asked = emps_files(tmp_path, rubbing).asked(tmp_path)
    found = diagnose(asked.fit, EMPS.simulator, hold_out=asked.hold_out, candidates=()).verdict
    (told,) = found.causes
    assert told.place == "input_force_N"
    sign, *further = told.read
    assert sign.name == "position_rate_sign"
    assert sign.slopes["both"] == pytest.approx(-12.0, rel=0.08)
    (bend,) = (t for t in further if " above " in t.words)
    assert bend.state == "position_rate"
    assert bend.slopes["both"] == pytest.approx(40.0, rel=0.3)
    assert found.whole is not None
    assert found.whole.final < 0.11 * found.whole.parameters


def test_the_laps_of_a_drive_are_runs_and_show_the_rate_that_the_force_up_to_then_gave(
    tmp_path: Path,
) -> None:
    asked = emps_files(tmp_path, {}).asked(tmp_path)
    assert [r.name for r in asked.fit] == ["lap 1", "lap 2", "lap 3", "lap 4"]
    assert [r.name for r in asked.hold_out] == [f"lap with pulses {i}" for i in (1, 2, 3, 4)]
    point = ModelPoint({"mass_kg": 95.0, "drag_N_s_m": 210.0, "offset_N": -3.0})
    for run in (*asked.fit, *asked.hold_out):
        assert len(run.t_s) == LAP
        clean = shown(EMPS.simulator, point, run)
        off = clean - run.outputs["position_rate"]
        assert np.std(off) < 2e-4
        # With the force of a sample later the drive would be ahead of the model in its ramps.
        ramps = np.gradient(there_and_back())
        assert abs(np.sum(off * ramps)) < 0.3 * np.sum(ramps**2)


def pendulum_files(folder: Path) -> Record:
    """Two files of a pendulum with dry friction of 0.15 N m; a torque is in force from its time."""
    inertia, damping, dt = 0.6 * 0.5**2, 0.05, 0.002
    for seed, name in enumerate(PENDULUM.files):
        torque = 1.5 * multisine(1000, 8, seed)
        angle = rate = 0.0
        rows = []
        for k in range(1000):
            rows.append((k * dt, angle, rate, torque[k]))
            rate += dt * (torque[k] - damping * rate - 0.3 * 9.81 * np.sin(angle)) / inertia
            rate -= np.clip(rate, -dt * 0.15 / inertia, dt * 0.15 / inertia)
            angle += dt * rate
        head = ",".join(PENDULUM.columns)
        np.savetxt(folder / name, rows, "%.9e", ",", header=head, comments="")
    return as_published(PENDULUM, folder)


def test_the_model_and_the_map_of_the_pendulum_replay_its_files(tmp_path: Path) -> None:
    asked = pendulum_files(tmp_path).asked(tmp_path)
    assert isinstance(PENDULUM.simulator, Mjcf)
    declared, (tables,) = declare_mjcf(PENDULUM.simulator.model, PENDULUM.simulator.map, asked.fit)
    bound = bind(declared, tables)
    theta = {"mass_kg": 0.6, "length_m": 0.5, "damping": 0.05}
    rubbing = {"hinge_dry_friction": {"size": 0.15}}
    for run in bound.groups[0]:
        angle = run.outputs["angle_rad"]
        errors = [
            np.std(bound.plant.simulate(ModelPoint(theta, effects), run)["angle_rad"] - angle)
            for effects in (rubbing, {})
        ]
        assert errors[0] < 0.02 * np.std(angle)
        assert errors[1] > 10.0 * errors[0]


@pytest.mark.campaign
@pytest.mark.skipif(
    not all((FETCHED / name).exists() for name in PENDULUM.files),
    reason="not fetched: python -m examples.public_records pendulum",
)
def test_friction_of_the_public_pendulum_comes_first_at_its_joint() -> None:
    asked = PENDULUM.asked(FETCHED)
    first, *_ = PENDULUM.diagnosed(asked.fit, asked.hold_out).verdict.causes
    assert first.place == "input_hinge_torque"
    assert first.name == "hinge_dry_friction"
    (size,) = (v for v in first.values if v.name == "size")
    assert 0.09 < size.value < 0.2


def test_a_file_at_an_address_of_its_own_is_fetched_from_there(tmp_path: Path) -> None:
    record = pendulum_files(tmp_path)
    there = replace(record, addresses={n: (tmp_path / n).as_uri() for n in record.files})
    assert len(there.asked(tmp_path / "fetched").fit) == 2
    gone = replace(record, addresses={n: (tmp_path / "gone").as_uri() for n in record.files})
    with pytest.raises(RecordError, match=r"put pendulum-ddp\.csv .*gone"):
        gone.asked(tmp_path / "again")


@pytest.mark.parametrize(
    ("record", "played", "step_s"),
    [
        (TANKS, "pump_V", TANKS_S),
        (SILVERBOX, "input_V", SILVERBOX_S),
        (EMPS, "force_N", EMPS_S),
    ],
    ids=["tanks", "silverbox", "emps"],
)
def test_an_effect_of_no_size_changes_nothing_and_each_of_usual_size_does(
    record: Record, played: str, step_s: float
) -> None:
    inputs = {
        "pump_V": 4.0 + 3.0 * multisine(400, 4, seed=1),
        "input_V": 0.1 * multisine(400, 60, seed=1),
        "force_N": 200.0 * multisine(400, 4, seed=1),
    }
    given = GapRun("", np.arange(400) * step_s, {played: inputs[played]}, {})
    bare = shown(record.simulator, ModelPoint({}), given)
    assert len(record.simulator.effects) >= 5
    for effect in record.simulator.effects:
        at = [
            shown(record.simulator, ModelPoint({}, {effect.name: strong(effect, level)}), given)
            for level in (0.0, 1.0)
        ]
        assert np.array_equal(at[0], bare)
        assert np.ptp(at[1] - bare) > 0.0, effect.name


def test_the_silverbox_runs_lie_where_they_were_played_and_leave_out_how_they_begin(
    tmp_path: Path,
) -> None:
    asked = silverbox_file(tmp_path, {}).asked(tmp_path)
    for run in (*asked.fit, *asked.hold_out):
        assert np.max(np.abs(run.inputs["input_V"])) == pytest.approx(0.1, rel=1e-5)
        assert np.sum(~run.good) == 100
        assert run.dt_s == pytest.approx(1 / 610.35, rel=1e-5)


def test_a_file_with_other_content_is_refused_and_one_with_other_line_ends_is_not(
    tmp_path: Path,
) -> None:
    record = tanks_file(tmp_path, {})
    (name,) = record.files
    path = tmp_path / name
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert len(record.asked(tmp_path).fit[0].t_s) == 1024
    path.write_text(path.read_text().replace("3", "4", 1))
    with pytest.raises(RecordError, match=r"not the record that was published.*SHA-256"):
        record.asked(tmp_path)


@pytest.mark.parametrize("made", [tanks_file, emps_files], ids=["one file", "two files"])
def test_a_record_is_fetched_once_out_of_its_archive(
    made: Callable[..., Record], tmp_path: Path
) -> None:
    record = made(tmp_path, {})
    with zipfile.ZipFile(tmp_path / "made.zip", "w") as archive:
        for name in record.files:
            archive.write(tmp_path / name, f"AnyFolder/{name}")
    there = replace(record, archive=(tmp_path / "made.zip").as_uri())
    folder = tmp_path / "fetched"
    there.asked(folder)
    for name in record.files:
        assert (folder / name).read_bytes() == (tmp_path / name).read_bytes()
    (tmp_path / "made.zip").unlink()
    assert len(there.asked(folder).hold_out) == len(record.asked(tmp_path).hold_out)


def test_a_record_that_cannot_be_fetched_says_where_to_put_it_by_hand(tmp_path: Path) -> None:
    record = replace(TANKS, archive=(tmp_path / "none.zip").as_uri())
    with pytest.raises(RecordError, match=r"put dataBenchmark\.csv .*cascaded-tanks into"):
        record.asked(tmp_path / "folder")
