"""The withheld plant shares nothing with the product; only the quiz speaks its protocol."""

import ast
from pathlib import Path

import pytest

HERE = Path(__file__).parent
WRAPPER = "wire_board.py"
SOURCES = sorted(HERE.rglob("*.py"))


def _imported(path: Path) -> set[str]:
    roots: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            roots |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            roots.add("." if node.level else (node.module or "").split(".")[0])
    return roots


def test_there_are_sources_to_check() -> None:
    assert {p.name for p in SOURCES} >= {"kernel.py", "bank.py", "score.py"}


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(HERE)))
def test_no_source_imports_the_product(path: Path) -> None:
    forbidden = {"smad", "sim_device"}
    if path.name != WRAPPER and not path.name.startswith("test_"):
        forbidden.add("firmware_protocol")
    assert not _imported(path) & forbidden


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(HERE)))
def test_no_source_imports_by_a_computed_name(path: Path) -> None:
    calls = [n.func for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Call)]
    names = {f.id if isinstance(f, ast.Name) else getattr(f, "attr", "") for f in calls}
    assert not names & {"__import__", "import_module"}
