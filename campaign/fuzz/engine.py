"""Runs atheris on one target and reads what it says."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from campaign.fuzz.limits import FINDINGS
from campaign.fuzz.outcome import Finding, Outcome
from campaign.fuzz.targets import Target
from campaign.fuzz.words import dictionary

ROOT = Path(__file__).resolve().parents[2]
HANG_S = 30
MOST_MEMORY_MIB = 2048
_STATUS = re.compile(
    r"^#(?P<runs>\d+)\s+(?P<what>\w+)\s+cov: (?P<edges>\d+) ft: (?P<features>\d+) "
    r"corp: (?P<inputs>\d+)",
    re.MULTILINE,
)
_STATISTIC = re.compile(r"^stat::(\w+):\s+(\d+)$", re.MULTILINE)
_DONE = re.compile(r"^Done \d+ runs in (\d+) second", re.MULTILINE)
_COUNTERS = re.compile(r"^counters: (\d+)$", re.MULTILINE)


class EngineError(Exception):
    """atheris did not run to its end, and not because of a finding."""


def fuzz(
    target: Target,
    *,
    seconds: int | None,
    runs: int | None,
    seed: int,
    corpus: Mapping[str, bytes] | None = None,
) -> Outcome:
    """Fuzz one target for so long, or so many inputs, from its corpus or other inputs.

    Raises EngineError.
    """
    with tempfile.TemporaryDirectory(prefix="smad-fuzz-") as name:
        folder = Path(name)
        work, begun_from = folder / "corpus", folder / "begun-from"
        work.mkdir()
        begun_from.mkdir()
        for label, data in (target.corpus() if corpus is None else corpus).items():
            (begun_from / label).write_bytes(data)
        flags = [
            f"-seed={seed}",
            f"-max_len={target.longest}",
            f"-timeout={HANG_S}",
            f"-rss_limit_mb={MOST_MEMORY_MIB}",
            f"-artifact_prefix={folder}/",
            "-print_final_stats=1",
        ]
        if words := dictionary(target):
            (folder / "words").write_text(words)
            flags.append(f"-dict={folder / 'words'}")
        flags += [] if seconds is None else [f"-max_total_time={seconds}"]
        flags += [] if runs is None else [f"-runs={runs}"]
        said = _run(target, folder, [*flags, str(work), str(begun_from)])
        findings = _findings(folder)
        return _outcome(target, said, findings, tuple(f.read_bytes() for f in work.iterdir()))


def least(target: Target, inputs: tuple[bytes, ...]) -> tuple[bytes, ...]:
    """Return the smallest of the inputs that together reach what all of them reach."""
    with tempfile.TemporaryDirectory(prefix="smad-fuzz-") as name:
        folder = Path(name)
        every, chosen = folder / "all", folder / "chosen"
        for path in (every, chosen):
            path.mkdir()
        for number, data in enumerate(inputs):
            (every / f"{number:06}").write_bytes(data)
        flags = [f"-artifact_prefix={folder}/", f"-timeout={HANG_S}", "-merge=1"]
        _run(target, folder, [*flags, str(chosen), str(every)])
        return tuple(path.read_bytes() for path in sorted(chosen.iterdir()))


def _run(target: Target, folder: Path, flags: list[str]) -> str:
    command = [sys.executable, "-m", "campaign.fuzz.child", target.name, str(folder), *flags]
    done = subprocess.run(
        command,
        cwd=ROOT,
        capture_output=True,
        check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    said = done.stderr.decode(errors="replace")
    if done.returncode and not _artifacts(folder):
        raise EngineError(f"{target.name}: atheris ended with {done.returncode}\n{said[-3000:]}")
    return said


def _artifacts(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if re.match(r"(crash|timeout|oom|leak)-", path.name)]


def _findings(folder: Path) -> tuple[Finding, ...]:
    findings = []
    for path in sorted((folder / FINDINGS).glob("*.input")):
        kind, _, text = path.with_suffix(".txt").read_text().partition("\n")
        findings.append(Finding(kind, text, path.read_bytes()))
    for path in _artifacts(folder):
        kind = path.name.partition("-")[0]
        findings.append(Finding(kind, f"libFuzzer ended the run: {kind}", path.read_bytes()))
    return tuple(findings)


def _outcome(
    target: Target, said: str, findings: tuple[Finding, ...], grown: tuple[bytes, ...]
) -> Outcome:
    lines = list(_STATUS.finditer(said))
    statistics = {name: int(value) for name, value in _STATISTIC.findall(said)}
    counters = _COUNTERS.search(said)
    if not lines or counters is None:
        raise EngineError(f"{target.name}: atheris said nothing of use\n{said[-3000:]}")
    begun = next((line for line in lines if line["what"] == "INITED"), lines[0])
    ended = lines[-1]
    took = _DONE.search(said)
    return Outcome(
        target=target.name,
        executions=statistics.get("number_of_executed_units", int(ended["runs"])),
        seconds=int(took[1]) if took else 0,
        edges_before=int(begun["edges"]),
        edges=int(ended["edges"]),
        counters=int(counters[1]),
        features_before=int(begun["features"]),
        features=int(ended["features"]),
        inputs_before=int(begun["inputs"]),
        inputs=int(ended["inputs"]),
        slowest_s=statistics.get("slowest_unit_time_sec", 0),
        peak_MiB=statistics.get("peak_rss_mb", 0),
        findings=findings,
        grown=grown,
    )


def available() -> bool:
    """Whether atheris is installed."""
    return importlib.util.find_spec("atheris") is not None
