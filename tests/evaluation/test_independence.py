"""The plant of the evaluation shares nothing with ours; what asks the product does not reach it."""

import ast
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parents[2]
OURS = frozenset(("smad", "sim_device", "firmware_protocol", "firmware"))
# Folder -> the folders that it may import beside itself, and the packages of ours.
FOLDERS: dict[str, tuple[set[str], set[str]]] = {
    "plant": (set(), set()),
    "pendulum": (set(), {"smad"}),
    "simulators": (set(), {"smad"}),
    "bank": ({"plant", "errors"}, set()),
    "quiz": ({"plant", "bank", "errors"}, {"firmware_protocol"}),
    "run": ({"score", "names", "checkout", "errors"}, {"smad", "sim_device"}),
    "score": ({"run", "results", "names", "checkout", "errors"}, {"smad", "sim_device"}),
    "calibrate": ({"recovery", "run", "score", "results", "names", "errors"}, {"smad"}),
    "recovery": ({"score", "results", "checkout", "errors"}, {"smad", "sim_device"}),
    "programme": ({"errors"}, {"smad", "sim_device"}),
    "results": ({"checkout", "errors"}, {"smad"}),
}
PRODUCT = ("evaluation/quiz/session.py", "evaluation/quiz/ends.py")
"""Of the quiz, what asks the product; it does not reach the plant."""
SOURCES = sorted((HERE / "evaluation").rglob("*.py"))


def _imported(path: Path) -> set[str]:
    """Full names of the modules that a file imports."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None, f"{path}: a relative import"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def _name(path: Path) -> str:
    return str(path.relative_to(HERE))


def test_every_room_has_a_rule() -> None:
    folders = {p.parent.name for p in SOURCES if p.parent.name != "evaluation"}
    assert folders == set(FOLDERS)


@pytest.mark.parametrize("path", SOURCES, ids=_name)
def test_a_room_imports_only_what_it_may(path: Path) -> None:
    folder = path.parent.name
    if folder not in FOLDERS:
        return
    folders, packages = FOLDERS[folder]
    if _name(path) in PRODUCT:
        folders, packages = {"quiz", "score", "names", "errors"}, {"smad"}
    names = {tuple(name.split(".")) for name in _imported(path)}
    assert {n[1] for n in names if n[0] == "evaluation"} <= {folder, *folders}
    assert {n[0] for n in names} & OURS <= packages
    assert not {n[0] for n in names} & {"tests", "bench", "tools"}


def test_only_the_board_on_the_wire_knows_the_protocol() -> None:
    knowing = [_name(p) for p in SOURCES if any("firmware_protocol" in n for n in _imported(p))]
    assert knowing == ["evaluation/quiz/wire_board.py"]


def test_what_makes_a_bank_does_not_reach_what_asks_the_product() -> None:
    reaching = [
        _name(p)
        for p in SOURCES
        if p.parent.name in ("bank", "quiz") and _name(p) not in PRODUCT
        for name in _imported(p)
        if name.startswith(("evaluation.quiz.session", "evaluation.quiz.ends"))
    ]
    assert reaching == []


def test_the_product_imports_nothing_of_the_evaluation() -> None:
    product = [p for folder in OURS for p in (HERE / folder).rglob("*.py")]
    assert len(product) > 50
    assert [_name(p) for p in product if any("evaluation." in n for n in _imported(p))] == []


@pytest.mark.parametrize("path", SOURCES, ids=_name)
def test_no_source_imports_by_a_computed_name(path: Path) -> None:
    calls = [n.func for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Call)]
    names = {f.id if isinstance(f, ast.Name) else getattr(f, "attr", "") for f in calls}
    assert not names & {"__import__", "import_module"}
