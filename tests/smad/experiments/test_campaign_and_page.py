"""Campaigns, their page, and the settings of experiments."""

from __future__ import annotations

import html
import importlib
import inspect
import json
import pkgutil
import re
import signal
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import pytest

import smad.experiments
from sim_device.plant import Plant
from sim_device.plant.errors import SolverError
from sim_device.plant.models import Model
from smad.cli import execute as command
from smad.client.signals import ended_by_signals
from smad.experiments.base import Comparison, Experiment, Findings
from smad.experiments.campaign import CampaignBench, CampaignResult, run_campaign
from smad.experiments.contradictions import CONTRADICTIONS
from smad.experiments.dsc import Dsc, DscOptions
from smad.experiments.errors import ExperimentError
from smad.experiments.estimate import Estimate, Tolerance
from smad.experiments.inverse import feedforward_of
from smad.experiments.registry import EXPERIMENTS, make_experiment
from smad.experiments.report import campaign_page, comparison_table, recovery_table
from smad.report.page import render
from smad.units import unparted

from .helpers import NOMINAL, given

NAMES = ("resistance", "dsc")


def small_campaign(executor: ThreadPoolExecutor | None = None) -> CampaignResult:
    return run_campaign(
        [make_experiment(name) for name in NAMES],
        CampaignBench(Model(given()), seed=1),
        executor,
    )


def test_an_executor_changes_nothing_but_the_time() -> None:
    with ThreadPoolExecutor(2) as pool:
        there = small_campaign(pool)
    here = small_campaign()
    assert there.estimates == here.estimates
    page = campaign_page(here, given(), given=given(), facts=[])
    assert render(page) == render(campaign_page(there, given(), given=given(), facts=[]))


def test_estimates_that_make_no_parameter_set_are_refused_with_the_experiments_name() -> None:
    class Swapped(Dsc):
        def conclude(self, outcomes: object, model: object) -> Findings:
            wrong = Estimate("austenite_start", 320.0, 319.0, 321.0, "dsc", Tolerance(share=0.1))
            return Findings((), (), (wrong,))

    with pytest.raises(ExperimentError, match=r"dsc cannot be analysed.*A_S = .*below A_F"):
        run_campaign([Swapped(DscOptions())], CampaignBench(Model(NOMINAL)))


def test_a_solver_that_gives_up_names_the_run_the_time_and_the_state(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def advance(self: Plant, drive: object, dt_s: float) -> None:
        raise SolverError("not found", time_s=1.5, state={"T_x_K": 310.25})

    monkeypatch.setattr(Plant, "advance", advance)
    said = r"run resistance: .*not found at t = 1\.5 s with T_x_K = 310\.25"
    with pytest.raises(ExperimentError, match=said):
        run_campaign([make_experiment("resistance")], CampaignBench(Model(NOMINAL)))


def test_the_page_is_self_contained_and_says_what_contradicts() -> None:
    text = render(campaign_page(small_campaign(), given(), given=given(), facts=[("a", "<b>")]))
    assert "a: &lt;b&gt;" in text
    outside = re.findall(r"""(?:src|href)=["'](?!#|data:)[^"']*|url\((?!#)[^)]*|@import""", text)
    assert outside == []
    for contradiction in CONTRADICTIONS.values():
        assert unparted(contradiction) in html.unescape(text)
    body, *scripts = text.split("<script")
    assert body.count("<svg") == 2
    # The buttons that save the pictures.
    assert len(scripts) == 1


def test_a_number_that_contradicts_another_points_to_the_contradiction() -> None:
    with pytest.raises(KeyError):
        Comparison("fact", "paper", "here", contradiction="weather")
    rows = comparison_table(small_campaign()).rows
    latent = next(row for row in rows if "latent heats" in row[0])
    assert latent[-1] == "see contradiction 7"


def test_the_tables_are_there_for_programs_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.html"
    arguments = ["run", "resistance", "--sim", "--jobs", "1", "--report", str(page), "--json"]
    assert command(arguments) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["page"] == str(page)
    assert {row["experiment"] for row in found["comparisons"]} == {"resistance"}
    (estimate,) = found["estimates"]
    assert estimate["name"] == "resistivity"
    assert estimate["unit"] == "Ohm m"
    assert estimate["low"] <= estimate["value"] <= estimate["high"]
    assert estimate["given"] == pytest.approx(NOMINAL["resistivity"])
    assert estimate["within_tolerance"] is True
    assert command(["run", "--list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [one["name"] for one in listed] == list(EXPERIMENTS)
    assert "force_N" in next(one for one in listed if one["name"] == "fig9-cycle")["needs"]


def test_the_recovery_table_says_when_a_value_is_not_within_its_tolerance() -> None:
    result = small_campaign()
    good = recovery_table(result.estimates, given(), given())
    assert {row[-1].split()[0] for row in good.rows} == {"within"}
    wrong = recovery_table(result.estimates, NOMINAL, NOMINAL)
    assert any(row[-1].startswith("NOT within") for row in wrong.rows)


def test_every_experiment_is_registered() -> None:
    modules = [
        importlib.import_module(f"smad.experiments.{found.name}")
        for found in pkgutil.iter_modules(smad.experiments.__path__)
    ]
    written = {
        f"{kind.__module__}:{kind.__name__}"
        for module in modules
        for kind in vars(module).values()
        if inspect.isclass(kind) and issubclass(kind, Experiment) and not inspect.isabstract(kind)
    }
    assert written == set(EXPERIMENTS.values())


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_has_its_page_of_documentation(name: str) -> None:
    page = Path(__file__).resolve().parents[3] / "docs/experiments" / f"{name}.md"
    text = page.read_text(encoding="utf-8")
    for setting in make_experiment(name).options.__struct_fields__:
        assert f"`{setting}`" in text, f"{page.name} does not tell of {setting}"
    assert f"| [{name}]({name}.md) |" in (page.parent / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"stepmm": "3"}, "stepmm"),
        ({"step_mm": "99"}, "step_mm"),
        ({"step_mm": "much"}, "step_mm"),
        ({"step_mm": "nan"}, "step_mm"),
    ],
)
def test_a_setting_that_is_not_valid_is_refused_by_name(
    settings: dict[str, str], says: str
) -> None:
    with pytest.raises(ExperimentError, match=says):
        make_experiment("fig9-cycle", settings)


def test_an_unknown_experiment_is_refused_with_those_there_are() -> None:
    with pytest.raises(ExperimentError, match=r"fig99.*fig9-cycle"):
        make_experiment("fig99")


def test_the_inverse_of_the_nominal_set_is_the_default_configuration() -> None:
    from msgspec.structs import asdict

    from smad.config import FeedforwardConfig

    made, default = asdict(feedforward_of(NOMINAL)), asdict(FeedforwardConfig())
    for name, value in default.items():
        assert made[name] == pytest.approx(value, rel=0.05), name


def test_the_command_runs_one_experiment_and_writes_page_and_parameters(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page, parameters = tmp_path / "page.html", tmp_path / "found.toml"
    status = command(
        ["run", "resistance", "--sim", "--jobs", "1", "--set", "dwell_s=0.5",
         "--report", str(page), "--save-parameters", str(parameters)]
    )  # fmt: skip
    assert status == 0
    printed = capsys.readouterr().out
    assert "Eq. (27)" in printed
    assert "within 3%" in printed
    assert page.read_text(encoding="utf-8").startswith("<!doctype html>")
    assert "resistivity" in parameters.read_text(encoding="utf-8")


@pytest.mark.usefixtures("not_ignored")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_ends_the_command_still_disarms(number: int) -> None:
    before = signal.getsignal(number)
    did: list[str] = []

    def run_and_disarm() -> None:
        with ended_by_signals(), ExitStack() as ending:
            ending.callback(did.append, "disarm")
            signal.raise_signal(number)

    with pytest.raises(SystemExit) as end:
        run_and_disarm()
    assert did == ["disarm"]
    assert end.value.code == 128 + number
    assert signal.getsignal(number) == before


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["run"], "name an experiment"),
        (["run", "fig99", "--sim"], "no such experiment"),
        (["run", "fig9-cycle", "--sim", "--lacking", "force_N"], "the force sensor"),
        (["run", "fig9-cycle", "--sim", "--lacking", "froce_N"], "froce_N; did you mean force_N?"),
        (["run", "fig9-cycle", "--sim", "--set", "step_mm=99"], "step_mm"),
        (["run", "fig9-cycle", "--sim", "--set", "nonsense"], "KEY=VALUE"),
        (["run", "fig9-cycle", "--sim", "--parameters", "nowhere.toml"], "nowhere.toml"),
        (["run", "fig9-cycle", "--from", "nowhere.mcap"], "nowhere.mcap"),
        (["run", "dsc", "--sim", "--set", "file=nowhere.csv"], "nowhere.csv"),
        (["run", "resistance", "--sim", "--jobs", "1", "--report", "/proc/no/page.html"], "/proc"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_a_status(
    arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(arguments) != 0
    message = capsys.readouterr().err
    assert says in message
    assert len(message.strip().splitlines()) == 1
    assert "internal error" not in message
