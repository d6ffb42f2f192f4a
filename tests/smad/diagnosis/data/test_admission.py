"""What is said of a run that lacks something: which channel, how much, and what to do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from smad.diagnosis.data.admission import admit
from smad.diagnosis.data.opinions import compare
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair.signals import read_gap_runs
from smad.diagnosis.verdict import Finding
from tests.smad.diagnosis.heater_plant import HeaterPlant, recorded
from tests.smad.runlog.helpers import write_small_run

PLANT = HeaterPlant()
RUN = recorded("random", 1, duration_s=50.0)


def findings(run: GapRun) -> list[Finding]:
    return list(admit([run], PLANT, 1.0).findings)


def refusals(run: GapRun) -> list[str]:
    return [f.text for f in findings(run) if f.refuses]


def test_progress_names_each_file_that_is_read_and_each_run_that_is_checked(tmp_path: Path) -> None:
    told: list[str] = []
    paths = [write_small_run(tmp_path / name, 50) for name in ("käse ü.mcap", "b.mcap")]
    read_gap_runs(paths, paths, progress=told.append)
    admit([RUN, replace(RUN, name="second")], PLANT, 1.0, progress=told.append)
    assert told[:2] == ["reading käse ü.mcap", "reading b.mcap"]
    assert told[2:] == [f"admission: {RUN.name}", "admission: second"]


def test_a_run_without_its_channels_names_them_and_what_it_has() -> None:
    (text,) = refusals(replace(RUN, outputs={}))
    assert text.startswith("power_l_W, power_r_W, temp_l_degC, temp_r_degC and 1 more not recorded")
    assert text.endswith("record one, give its column the channel's name, or leave the run out")
    (text,) = refusals(replace(RUN, outputs={"temperature": RUN.outputs["temp_l_degC"]}))
    assert "not recorded (the run has temperature), so no channel is left" in text


def test_channels_that_lack_a_third_at_once_are_named_and_no_map_is_asked_for() -> None:
    out = (RUN.t_s > 20.0) & (RUN.t_s < 37.0)
    outputs = {name: np.where(out, np.nan, y) for name, y in RUN.outputs.items()}
    said = findings(RUN.with_columns(outputs=outputs))
    assert said[-1].refuses
    assert "and 1 more with too few readings, so no channel is left to compare" in said[-1].text
    sparse = next(f.text for f in said if f.kind == "channel sparse")
    assert f"holds a reading in {np.sum(~out)} of {len(out)} samples only (" in sparse
    assert "is its sensor open?" in sparse
    assert "map" not in sparse


def test_stamps_that_jitter_are_said_to_and_lose_nothing() -> None:
    jitter = np.random.default_rng(0).uniform(-0.04, 0.04, len(RUN.t_s))
    said = findings(replace(RUN, t_s=RUN.t_s + jitter))
    assert "samples lost" not in {f.kind for f in said}
    text = next(f.text for f in said if f.kind == "time uneven")
    assert "(median), more than 10%" in text


def test_an_input_that_steps_while_samples_are_lost_is_named() -> None:
    step = int(np.argmax(np.abs(np.diff(RUN.inputs["cmd_l_W"])) > 10.0)) + 1
    kept = np.arange(len(RUN.t_s)) != step
    inputs = {n: c[kept] for n, c in RUN.inputs.items()}
    outputs = {n: c[kept] for n, c in RUN.outputs.items()}
    run = replace(RUN, t_s=RUN.t_s[kept], inputs=inputs, outputs=outputs)
    (text,) = [f.text for f in findings(run) if f.kind == "samples lost"]
    assert text.startswith("0.2% of the samples are lost, and not used; cmd_l_W steps meanwhile")
    assert f"first after {RUN.t_s[step - 1]:.6g} s" in text


@pytest.mark.parametrize(("name", "quoted"), [("gap levels", "'gap levels'"), ("levels", "levels")])
def test_advice_names_runs_as_a_shell_takes_them(name: str, quoted: str) -> None:
    texts: list[str] = []

    def say(kind: str, text: str, *, refuses: bool = False) -> None:
        texts.append(text)

    run = replace(RUN, name=name)
    compare(run, recorded("sines", 7, duration_s=50.0).outputs, PLANT, 1.0, say=say)
    assert any(f"(--leave-out {quoted})" in text for text in texts)
    swapped = {"temp_l_degC": "temp_r_degC", "temp_r_degC": "temp_l_degC"}
    crossed = {swapped.get(n, n): y for n, y in RUN.outputs.items()}
    compare(run, crossed, PLANT, 1.0, say=say)
    assert any(f"give --trust {quoted} if" in text for text in texts)
