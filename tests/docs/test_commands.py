"""Every command and script that the documentation shows is run here, as its reader would."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from .bench import running_bench
from .pages import Block, Page, read_page

LONGEST_S = 800
"""Of one command on a busy machine."""
ROOT = Path(__file__).resolve().parents[2]
OUTSIDE = ("README.md", "evaluation/README.md", "examples/README.md")
SHOWN = [*(ROOT / page for page in OUTSIDE), *(ROOT / "docs").rglob("*.md")]
PAGES = sorted(path for path in SHOWN if read_page(path).blocks)
LONG = {"fig4-stretch", "fig5-block"}
"""Each page is one `smad run NAME --sim` of many minutes of bench time. The same command is run for
other experiments, and these two with shorter settings in tests/smad/experiments."""

# Why a command may go unrun, and what stands in for it. A reason outside this list fails.
REASONS = {
    "needs hardware": "the same command runs with --sim in tests/hil",
    "sets up this very environment": "it is what made the environment the tests run in",
    "needs root": "changes the machine: systemd, udev, priorities of the kernel",
    "takes long": "a campaign with a command of its own; a small one runs in its own tests",
    "two programs side by side": "tests/hil/test_real_port.py starts both",
    "another program": "PlotJuggler, MATLAB and the like are not here",
    "runs until ctrl-C": "it is started, used and ended in tests/smad/view",
    "needs the internet": "the same script reads files of the same form in tests/examples",
    "needs runs of a bench": "the same questions are asked of made runs in tests/smad/diagnosis",
}


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.fixture
def reader(tmp_path: Path) -> dict[str, str]:
    return reader_in(tmp_path)


def reader_in(folder: Path) -> dict[str, str]:
    """What surrounds a reader: a home and a run-time directory of their own, smad on the PATH."""
    runtime = folder / "run"
    runtime.mkdir(mode=0o700)
    home = folder / "home"
    home.mkdir()
    return {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "XDG_RUNTIME_DIR": str(runtime),
        # Alone: a daemon that somebody runs on this machine is not for a page to arm.
        "SMAD_RUNTIME_DIR": str(runtime / "smad"),
        "HOME": str(home),
        "MPLBACKEND": "Agg",
    }


def run_page(page: Page, folder: Path, env: dict[str, str]) -> None:
    """Run what a page shows, in its order, on a simulated bench where it wants one."""
    with running_bench(folder, env, page.bench):
        for block in page.blocks:
            if block.not_run is None:
                run_block(block, folder, env)


def run_block(block: Block, folder: Path, env: dict[str, str]) -> None:
    if block.language == "python":
        runs = [[sys.executable, "-c", block.text]]
    else:
        runs = [["bash", "-c", command] for command in block.commands()]
    for command in runs:
        done = subprocess.run(
            command,
            cwd=folder,
            env=env,
            capture_output=True,
            text=True,
            timeout=LONGEST_S,
            check=False,
        )
        assert done.returncode == block.exits, (
            f"line {block.line}: {command[-1]}\n{done.stdout}\n{done.stderr}"
        )


def long_or_not(path: Path) -> Any:
    marks = pytest.mark.campaign if path.stem in LONG else ()
    return pytest.param(path, marks=marks, id=name(path))


@pytest.mark.parametrize("path", [long_or_not(path) for path in PAGES])
def test_every_command_shown_runs(path: Path, tmp_path: Path, reader: dict[str, str]) -> None:
    folder = tmp_path / "work"
    folder.mkdir()
    run_page(read_page(path), folder, reader)


def skipped(page: Page) -> list[str]:
    return [block.not_run for block in page.blocks if block.not_run is not None]


@pytest.mark.parametrize("path", PAGES, ids=name)
def test_a_command_that_is_not_run_gives_a_known_reason(path: Path) -> None:
    assert [reason for reason in skipped(read_page(path)) if reason not in REASONS] == []
