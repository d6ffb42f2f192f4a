"""A bounded run of atheris itself, and what its command makes of it.

On every target it is left to `make long-tests`: each takes a Python of its own, whose imports are
instrumented. `make campaign CAMPAIGN="fuzz --seconds 600"` is the long one.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from campaign.command import execute
from campaign.fuzz import command, targets
from campaign.fuzz.blind import fuzz_blindly
from campaign.fuzz.corpus import write_corpus
from campaign.fuzz.engine import available, fuzz
from campaign.fuzz.limits import kind_of
from campaign.fuzz.outcome import Finding
from campaign.fuzz.program import Defect, Program, require
from campaign.fuzz.targets import TARGETS, Target

needs_atheris = pytest.mark.skipif(
    not available(), reason="atheris has wheels for Linux on x86-64 only; the corpus was replayed"
)

STRIDE = 24
MORE_RUNS = 20
"""Beyond those that load the corpus."""


@pytest.mark.campaign
@needs_atheris
@pytest.mark.parametrize("target", TARGETS.values(), ids=list(TARGETS))
def test_atheris_finds_nothing_new_in_a_bounded_run(target: Target) -> None:
    # The whole corpus is tried elsewhere, and faster; to begin from, a part is enough.
    kept = target.corpus()
    some = {*list(kept)[::STRIDE], *(name for name in kept if name.startswith("seed-"))}
    begun_from = {name: kept[name] for name in some}
    runs = len(begun_from) + MORE_RUNS
    outcome = fuzz(target, seconds=None, runs=runs, seed=1, corpus=begun_from)
    assert [finding.kind for finding in outcome.findings] == []
    assert outcome.executions >= runs
    assert 0 < outcome.edges_before <= outcome.edges < outcome.counters
    assert 0 < outcome.features_before <= outcome.features


@needs_atheris
def test_the_command_prints_a_row_for_each_target_and_writes_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "out.json"
    status = execute(["fuzz", "frames", "--runs", "200", "--seed", "3", "--json", str(path)])
    assert status == 0
    head, row = capsys.readouterr().out.splitlines()
    assert head.split()[:2] == ["target", "executions"]
    [result] = json.loads(path.read_text())
    assert row.split()[:2] == ["frames", str(result["executions"])]
    assert result["findings"] == []


def test_a_finding_is_told_with_a_file_that_holds_the_input(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command._write_finding(
        Finding("ValueError at codec.py:3", "a traceback", b"\1\2"), "frames", tmp_path
    )
    (path,) = (path for path in tmp_path.iterdir() if path.suffix != ".txt")
    assert path.read_bytes() == b"\1\2"
    assert path.with_suffix(".txt").read_text() == "a traceback"
    assert str(path) in capsys.readouterr().out


def test_without_atheris_the_command_tries_the_corpus_and_mutations(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "out.json"
    runs = ["--runs", "300", "--json", str(path)]
    assert execute(["fuzz", "config", "parameters", "--blind", *runs]) == 0
    said = capsys.readouterr()
    assert "not guided" in said.err
    assert [line.split()[:2] for line in said.out.splitlines()[1:]] == [
        ["config", "300"],
        ["parameters", "300"],
    ]
    assert [result["executions"] for result in json.loads(path.read_text())] == [300, 300]


def test_a_finding_without_atheris_is_kept_once_and_ends_the_command_with_status_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(data: bytes) -> None:
        raise KeyError(data)

    monkeypatch.setattr(Target, "harness", lambda target: broken)
    outcome = fuzz_blindly(TARGETS["frames"], seconds=None, runs=20, seed=1)
    assert [finding.kind.partition(" ")[0] for finding in outcome.findings] == ["KeyError"]
    findings = ["--findings", str(tmp_path / "found")]
    assert execute(["fuzz", "frames", "--blind", "--runs", "20", *findings]) == 1
    assert len(list((tmp_path / "found").iterdir())) == 2


def test_a_target_that_does_not_exist_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert execute(["fuzz", "nothing"]) == 2
    assert "frames" in capsys.readouterr().err


def test_two_defects_of_different_places_are_told_apart() -> None:
    kinds = set()
    for act in (lambda: require(False, "one"), lambda: require(0, "other"), lambda: 1 / 0):
        try:
            act()
        except (Defect, ZeroDivisionError) as error:
            kinds.add(kind_of(error).partition(" ")[0])
    assert kinds == {"Defect", "ZeroDivisionError"}


def test_a_program_that_has_ended_gives_zeros() -> None:
    program = Program(b"\1\2\3")
    assert (program.u8(), program.u16()) == (1, 0x0302)
    assert not program
    assert (program.u8(), program.take(2), program.rest()) == (0, b"\0\0", b"")


@needs_atheris
def test_keeping_adds_what_is_new_within_bounds_and_loses_no_seed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = TARGETS["frames"]
    seeds = {name: data for name, data in frames.corpus().items() if name.startswith("seed-")}
    monkeypatch.setattr(targets, "CORPUS", tmp_path)
    write_corpus(frames.archive, seeds)
    assert execute(["fuzz", "frames", "--runs", "600", "--keep"]) == 0
    kept = frames.corpus()
    assert seeds.items() < kept.items()
    before = fuzz(frames, seconds=None, runs=len(kept) + 1, seed=1)
    assert before.edges_before > 0
    monkeypatch.setattr(command, "_MOST_KEPT_BYTES", 1)
    assert execute(["fuzz", "frames", "--runs", "100", "--keep"]) == 0
    assert frames.corpus() == seeds
