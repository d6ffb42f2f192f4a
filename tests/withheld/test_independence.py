"""The withheld plant and its banks share nothing with the product; the quiz speaks its protocol."""

import ast
from pathlib import Path

import pytest

HERE = Path(__file__).parent
WRAPPER = "wire_board.py"
SECOND_PASS = (
    "second_pass.py",
    "more_runs.py",
    "best_entry.py",
    "after_next.py",
    "why.py",
    "entry.py",
    "separations.py",
    "reasons.py",
    "reason_tables.py",
    "after_why.py",
    "check_up.py",
    "calibrating.py",
    "curves.py",
    "inquiries.py",
    "mysteries.py",
    "seals.py",
    "deciding.py",
    "baselines.py",
    "goals.py",
    "openings.py",
    "places.py",
    "quick.py",
    "score_figures.py",
    "score_page.py",
    "scores.py",
    "scoring.py",
    "where.py",
)
SOURCES = sorted(HERE.rglob("*.py"))
MAKERS = [
    p
    for p in SOURCES
    if not p.name.startswith("test_") and str(p.relative_to(HERE)) not in SECOND_PASS
]
MODULES = tuple(
    f"tests.withheld.{name.removesuffix('.py').replace('/', '.')}" for name in SECOND_PASS
)


def _imported(path: Path) -> set[str]:
    """Full names of the modules that a file imports."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add("." if node.level else (node.module or ""))
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def _roots(path: Path) -> set[str]:
    return {name.split(".")[0] for name in _imported(path)}


def test_there_are_sources_to_check() -> None:
    assert {p.name for p in MAKERS} >= {"kernel.py", "bank.py", "quantities.py", "quiz.py"}


@pytest.mark.parametrize("path", MAKERS, ids=lambda p: str(p.relative_to(HERE)))
def test_no_maker_of_a_bank_imports_the_product(path: Path) -> None:
    forbidden = {"smad", "sim_device"}
    if path.name != WRAPPER:
        forbidden.add("firmware_protocol")
    assert not _roots(path) & forbidden


@pytest.mark.parametrize("path", MAKERS, ids=lambda p: str(p.relative_to(HERE)))
def test_only_the_command_line_reaches_what_uses_the_product(path: Path) -> None:
    reached = any(name.startswith(MODULES) for name in _imported(path))
    assert reached == (path.name == "command.py")


@pytest.mark.parametrize("name", SECOND_PASS)
def test_what_uses_the_product_imports_nothing_of_the_plant(name: str) -> None:
    own = {n for n in _imported(HERE / name) if n.startswith("tests.")}
    assert all(n.startswith(("tests.withheld.errors", *MODULES)) for n in own)


def test_the_product_imports_nothing_of_the_withheld_check() -> None:
    product = sorted((HERE.parents[1] / "smad").rglob("*.py"))
    assert len(product) > 50
    assert [p for p in product if "tests" in _roots(p)] == []


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(HERE)))
def test_no_source_imports_by_a_computed_name(path: Path) -> None:
    calls = [n.func for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Call)]
    names = {f.id if isinstance(f, ast.Name) else getattr(f, "attr", "") for f in calls}
    assert not names & {"__import__", "import_module"}
