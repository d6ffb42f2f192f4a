"""The notebooks of examples/ run as a reader would run them, and are committed without output.

One kernel runs the quick ones one after the other, each in a folder of its own. The slow ones are
run by `make notebooks`.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nbformat
import pytest
from jupyter_client.manager import KernelManager
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "examples/notebooks").glob("*.ipynb"))
SLOW = {"gap_diagnosed", "policy_trained"}
ALL = "SMAD_ALL_NOTEBOOKS"
CELL_S = 240


def read(path: Path) -> Any:
    return nbformat.read(path, as_version=4)


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[KernelManager]:
    home = tmp_path_factory.mktemp("jupyter")
    manager = KernelManager(kernel_name="python3")
    manager.kernel_spec.argv[0] = sys.executable
    manager.start_kernel(
        env={**os.environ, "IPYTHONDIR": str(home), "JUPYTER_RUNTIME_DIR": str(home)}
    )
    yield manager
    manager.shutdown_kernel(now=True)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, kernel: KernelManager) -> None:
    if path.stem in SLOW and not os.environ.get(ALL):
        pytest.skip(f"takes long: make notebooks, or {ALL}=1")
    notebook = read(path)
    # What a kernel of its own would give each notebook: a folder, and no names of the one before.
    fresh = f"%reset -f\nimport os\nos.chdir({str(tmp_path)!r})"
    notebook.cells.insert(0, nbformat.v4.new_code_cell(fresh))
    NotebookClient(notebook, km=kernel, timeout=CELL_S).execute()


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_committed_without_output(path: Path) -> None:
    cells = [cell for cell in read(path).cells if cell.cell_type == "code"]
    assert cells
    assert [cell for cell in cells if cell.outputs or cell.execution_count] == []


def test_the_simulator_of_the_notebook_is_the_one_of_the_page() -> None:
    page = (ROOT / "docs/your-simulator.md").read_text()
    script, *_ = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    cells = [
        c.source
        for c in read(ROOT / "examples/notebooks/own_simulator.ipynb").cells
        if c.cell_type == "code"
    ]
    assert "".join(cells).replace("\n", "").startswith(script.replace("\n", ""))


def test_a_diagnosed_gap_is_recorded_once_and_tells_what_smad_refuses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    asked = []

    def run(words: list[str], **_: Any) -> subprocess.CompletedProcess[str]:
        asked.append(words)
        Path("slow-sensor").mkdir(exist_ok=True)
        Path(f"slow-sensor/gap {words[words.index('--run') + 1]}.mcap").touch()
        return subprocess.CompletedProcess(words, len(asked) == 5, "", "the disk is full")

    monkeypatch.setattr(subprocess, "run", run)
    ready, record, *_ = [
        cell.source
        for cell in read(ROOT / "examples/notebooks/gap_diagnosed.ipynb").cells
        if cell.cell_type == "code"
    ]
    for _ in range(2):
        exec(f"{ready}\n{record}", {})
    assert len(asked) == 4
    Path("slow-sensor/gap sines.mcap").unlink()
    with pytest.raises(RuntimeError, match="the disk is full"):
        exec(f"{ready}\n{record}", {})
