"""The record of a bench, its trends, and what is forecast."""

import math
from pathlib import Path

import numpy as np
import pytest

from smad.cli import execute
from smad.health.collect import collect, row_of_verdict
from smad.health.cycles import rows_of_cycles
from smad.health.errors import HealthError
from smad.health.measure import row_of
from smad.health.record import FILE, Row, Value, append, read
from smad.health.report import headline, health_of, page, table
from smad.health.trends import REFERENCE, Trend, forecast, trend_of
from smad.progress import silent
from smad.report.page import render
from smad.runlog.header import RunHeader
from smad.runlog.schema import CUT, Event
from smad.runlog.schema import Row as Sample
from smad.runlog.writer import write_run

from . import ageing

X = np.arange(0.0, 20_001.0, 500.0)


def trend(y: np.ndarray) -> Trend:
    found = trend_of("stroke_mm", X, y, np.zeros_like(X))
    assert found is not None
    return found


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, 0.02, len(X))


def row(number: int, **values: float) -> Row:
    return Row(
        unix_s=float(number),
        kind="run",
        source=f"{number}.mcap",
        group="standard",
        cycles=500.0,
        values={name: Value(value) for name, value in values.items()},
    )


def test_noise_alone_is_told_as_a_change_in_one_of_a_hundred_series_at_most() -> None:
    assert sum(trend(10.0 + noise(seed)).noticed is not None for seed in range(500)) <= 5


def test_a_slow_loss_is_noticed_and_a_step_of_ten_scatters_within_a_few_rows() -> None:
    for seed in range(20):
        slow = trend(10.0 + noise(seed) - 1e-5 * X)
        assert slow.noticed is not None
        assert slow.x[slow.noticed] <= 16_000.0
        step = trend(10.0 + noise(seed) - 0.2 * (X > 8000.0))
        assert step.noticed is not None
        assert 8000.0 < step.x[step.noticed] <= 10_000.0


def test_three_odd_rows_are_no_change_and_a_longer_one_that_ends_has_come_back() -> None:
    for seed in range(20):
        odd = trend(10.0 + noise(seed) + 0.4 * ((X >= 8000.0) & (X < 9500.0)))
        assert (odd.noticed, odd.passed) == (None, ())
        longer = trend(10.0 + noise(seed) + 0.4 * ((X >= 8000.0) & (X < 11_000.0)))
        assert longer.noticed is None
        ((begin, back),) = longer.passed
        assert X[begin] <= 10_000.0
        assert 11_000.0 < X[back] <= 16_000.0
    rows = [row(n, stroke_mm=float(y)) for n, y in enumerate(longer.y)]
    assert "came back: standard: stroke_mm" in headline(health_of(rows, {}))


def in_sittings(seed: int, shifts: list[float], rows: int = 12) -> Trend | None:
    """Twelve rows a day, which scatter by 0.02, while days scatter by 0.1, and by `shifts`."""
    draw = np.random.default_rng(seed)
    days = 10.0 + draw.normal(0.0, 0.1, len(shifts)) + shifts
    y = (days[:, None] + draw.normal(0.0, 0.02, (len(shifts), rows))).ravel()
    unix_s = (86_400.0 * np.arange(len(shifts))[:, None] + 600.0 * np.arange(rows)).ravel()
    return trend_of("stroke_mm", np.arange(len(y), dtype=float), y, unix_s)


def test_days_that_differ_more_than_the_runs_of_one_are_no_change() -> None:
    for days in (2, 3, 20):
        trends = [in_sittings(seed, [0.0] * days) for seed in range(100)]
        assert sum(found is not None and found.noticed is not None for found in trends) <= 1


def test_a_loss_that_stays_is_noticed_over_the_scatter_of_days() -> None:
    for seed in range(20):
        found = in_sittings(seed, [0.0] * 12 + [-0.6] * 8)
        assert found is not None
        assert found.noticed is not None
        assert 12 <= found.noticed // 12 <= 17


def test_a_change_within_a_day_stands_while_the_days_after_it_do_not_come_back() -> None:
    draw = np.random.default_rng(1)
    day = 10.0 + draw.normal(0.0, 0.02, 24) - 0.5 * (np.arange(24) >= 14)
    unix_s = np.concatenate([600.0 * np.arange(24), 86_400.0 + 600.0 * np.arange(12)])
    for level, stands in ((9.5, True), (10.0, False)):
        y = np.concatenate([day, level + draw.normal(0.0, 0.02, 12)])
        found = trend_of("stroke_mm", np.arange(36.0), y, unix_s)
        assert found is not None
        assert (found.noticed is not None) is stands
        assert bool(found.passed) is not stands


def test_the_interval_of_a_forecast_holds_the_truth_in_about_95_of_100() -> None:
    held = []
    for seed in range(200):
        predicted = forecast(trend(10.0 + noise(seed) - 1e-5 * X), 9.7)
        assert predicted is not None
        held.append(predicted.low <= 30_000.0 <= predicted.high)
    assert 0.85 <= np.mean(held) <= 1.0


def test_without_a_slope_nothing_is_forecast_nor_for_a_limit_that_lies_behind() -> None:
    assert forecast(trend(10.0 + noise(1)), 9.0) is None
    assert forecast(trend(10.0 + noise(1) - 1e-5 * X), 11.0) is None


def test_too_few_rows_make_no_trend() -> None:
    few_rows = X[: REFERENCE + 1]
    assert trend_of("a", few_rows, few_rows, np.zeros_like(few_rows)) is None
    few = health_of([row(1, stroke_mm=1.0)], {})
    assert headline(few) == (
        "no trend yet, 1 row in health.jsonl: a trend needs 12 runs of one name in one session, "
        "or 4 sessions"
    )
    assert "<table" not in render(page(few, "bench"))


def test_runs_of_different_names_are_not_compared() -> None:
    import msgspec

    mixed = [
        msgspec.structs.replace(row(n, stroke_mm=10.0 if n % 2 else 5.0), group=f"g{n % 2}")
        for n in range(40)
    ]
    health = health_of(mixed, {})
    assert set(health.trends) == {"g0: stroke_mm", "g1: stroke_mm"}
    assert headline(health) == "nothing has changed in 40 rows"


def test_the_page_and_the_table_name_what_changed_and_when_the_limit_is_reached() -> None:
    rows = [row(n, stroke_mm=10.0 - 5e-6 * 500 * n, force_max_N=2.0) for n in range(40)]
    health = health_of(rows, {"stroke_mm": 9.0})
    assert headline(health).startswith("changed: standard: stroke_mm; first noticed at cycle")
    first = table(health).rows[0]
    assert first[0] == "standard: stroke_mm"
    assert first[-1].startswith("200500 [")
    html = render(page(health, "bench"))
    assert "Health of bench" in html
    assert html.count("<svg") == 2


def test_a_record_is_appended_to_and_a_torn_last_line_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / FILE
    append(path, [row(1, a=1.0), row(2, a=2.0)])
    path.write_bytes(path.read_bytes()[:-10])
    assert [r.unix_s for r in read(path)] == [1.0]
    append(path, [row(3, a=3.0)])
    assert [r.unix_s for r in read(path)] == [1.0, 3.0]


def test_a_record_that_is_damaged_or_newer_is_told(tmp_path: Path) -> None:
    path = tmp_path / FILE
    path.write_text("nonsense\n")
    with pytest.raises(HealthError, match="line 1 is damaged"):
        read(path)
    import msgspec

    append(tmp_path / "newer", [msgspec.structs.replace(row(1), format=2)])
    with pytest.raises(HealthError, match="newer smad; got 2; allowed: 1"):
        read(tmp_path / "newer")


def test_a_verdict_of_a_check_up_gives_parameters_floors_and_causes(tmp_path: Path) -> None:
    path = tmp_path / "verdict.json"
    path.write_text(
        '{"outcome": "causes", "headline": "the film has changed", "extra": 1,'
        '"parameters": [{"name": "h", "before": 1.0, "after": 1.2, "sd": 0.1}],'
        '"causes": [{"words": "film of X", "probability": 0.8}],'
        '"budget": [{"signal": "rtd_x", "unit": "K", "floor": 0.1, "raw": 0.9}]}'
    )
    found = row_of_verdict(path)
    assert found.values["parameter_h"] == Value(1.2, 0.1)
    assert found.values["floor_rtd_x_K"] == Value(0.1)
    assert found.words == ("the film has changed", "film of X (0.80)")
    path.write_text("[]")
    with pytest.raises(HealthError, match="not a verdict"):
        row_of_verdict(path)


def test_each_block_of_an_endurance_run_is_a_row_once_and_a_short_one_adds_its_cycles(
    tmp_path: Path,
) -> None:
    text = "number,t_s,duration_s,stroke_mm,force_max_N\n" + "".join(
        f"{n},{12.0 * n + 300.0 * (n > 40) + 300.0 * (n > 46)},12.0,{10.0 - 0.01 * n},nan\n"
        for n in range(1, 121)
    )
    (tmp_path / "cycles.csv").write_text(text)
    rows = list(rows_of_cycles(tmp_path, set()))
    assert [r.source for r in rows] == ["cycles.csv from 1", "cycles.csv from 47"]
    assert [r.cycles for r in rows] == [40.0, 80.0]
    assert rows[0].values == {"stroke_mm": Value(pytest.approx(9.77))}
    assert rows[0].unix_s < rows[1].unix_s
    assert list(rows_of_cycles(tmp_path, {r.source for r in rows})) == []
    (tmp_path / "cycles.csv").write_text(text + "121,to")
    assert len(list(rows_of_cycles(tmp_path, set()))) == 2
    (tmp_path / "cycles.csv").write_text(text + "121,torn\n")
    with pytest.raises(HealthError, match="cannot be read"):
        list(rows_of_cycles(tmp_path, set()))


def write_log(path: Path, samples: int, *, name: str = "run", cut: bool = False) -> None:
    records = [
        Sample(t_s=0.01 * n, displacement_mm=5.0 * math.sin(0.02 * math.pi * n))
        for n in range(samples)
    ]
    note = Event(t_s=1.0, kind="note", text=f"{CUT}stopped by disarm of a client")
    write_run(path, RunHeader(name=name), [*records, note] if cut else records)


def test_a_run_that_is_too_short_or_was_stopped_gives_no_row(tmp_path: Path) -> None:
    for name, samples, cut, gives in (("a", 10, False, False), ("b", 200, True, False),
                                      ("c", 200, False, True)):  # fmt: skip
        write_log(tmp_path / f"{name}.mcap", samples, cut=cut)
        assert (row_of(tmp_path / f"{name}.mcap") is not None) is gives


def test_a_run_without_a_name_is_compared_with_none_and_its_cycles_count(tmp_path: Path) -> None:
    for name, compared in (("run", False), ("steps-2", True)):
        write_log(tmp_path / f"{name}.mcap", 2000, name=name)
        found = row_of(tmp_path / f"{name}.mcap")
        assert found is not None
        assert found.cycles == pytest.approx(20.0, abs=1.0)
        assert ("stroke_mm" in found.values) is compared


def test_the_cycles_of_an_endurance_run_count_once(tmp_path: Path) -> None:
    write_log(tmp_path / "block.mcap", 2000, name="endurance-0000001")
    (tmp_path / "alone").mkdir()
    write_log(tmp_path / "alone/block.mcap", 2000, name="endurance-0000001")
    (tmp_path / "cycles.csv").write_text(
        "number,t_s,duration_s,stroke_mm\n" + "".join(f"{n},{n},1.0,10.0\n" for n in range(1, 21))
    )
    for folder, cycles in ((tmp_path, [20.0, 0.0]), (tmp_path / "alone", [20.0])):
        collect(folder, [], say=silent, progress=silent)
        rows = sorted(read(folder / FILE), key=lambda row: row.kind)
        assert [row.cycles for row in rows] == [pytest.approx(n, abs=1.0) for n in cycles]


def test_a_standard_run_gives_stroke_cooling_and_resistance(tmp_path: Path) -> None:
    found = ageing.grown(ageing.AGEINGS[0], 0, 1, seed=1, folder=tmp_path)
    assert found.group == "standard"
    assert found.values["stroke_mm"].value == pytest.approx(8.0, abs=1.0)
    assert found.values["force_max_N"].value == pytest.approx(1.9, abs=0.1)
    for spring in "xy":
        assert found.values[f"cooling_{spring}_per_s"].value > 0.05
        assert 0.5 < found.values[f"resistance_{spring}_ohm"].value < 1.2


def test_the_command_takes_new_runs_in_once_and_says_what_is_wrong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert execute(["health", "--folder", str(tmp_path / "none")]) == 1
    assert "there is no folder" in capsys.readouterr().err
    assert execute(["health", "--folder", str(tmp_path), "--limit", "stroke"]) == 2
    assert "give NAME=VALUE" in capsys.readouterr().err
    assert execute(["health", "--folder", str(tmp_path), "--limit", "strok=8"]) == 0
    assert "no row has the quantity of --limit strok" in capsys.readouterr().err
    (tmp_path / "bad.mcap").write_text("no run log")
    ageing.grown(ageing.AGEINGS[0], 0, 1, seed=1, folder=tmp_path)
    append(tmp_path / FILE, [row(n, stroke_mm=10.0) for n in range(12)])
    assert execute(["health", "--folder", str(tmp_path)]) == 0
    told = capsys.readouterr()
    assert "left out: " in told.err
    assert told.out.startswith("nothing has changed in 12 rows")


def test_only_the_first_part_of_a_run_that_begins_cold_says_where_the_springs_rest(
    tmp_path: Path,
) -> None:
    for number, (part, first_A) in enumerate([(1, 0.0), (2, 0.0), (1, 1.0)]):
        records = [
            Sample(t_s=0.01 * n, displacement_mm=0.01 * n, i_applied_x_A=first_A)
            for n in range(200)
        ]
        path = tmp_path / f"{number}.mcap"
        write_run(path, RunHeader(name="steps", part=part), records)
        found = row_of(path)
        assert found is not None
        assert ("rest_mm" in found.values) is (number == 0)


def test_a_verdict_is_taken_in_once_by_whatever_path_and_anew_when_it_is_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs/queue").mkdir(parents=True)
    verdict = '{"outcome": "none", "headline": "nothing has changed"}'
    for path in ("runs/queue/item-1.json", "v.json"):
        Path(path).write_text(verdict)
    for folder in (Path("runs"), tmp_path / "runs"):
        collect(folder, [Path("v.json")], say=silent, progress=silent)
        assert len(read(folder / FILE)) == 1
    Path("v.json").write_text(verdict.replace("nothing", "something"))
    collect(Path("runs"), [Path("v.json")], say=silent, progress=silent)
    assert [row.words[0][:4] for row in read(Path("runs") / FILE)] == ["noth", "some"]
