"""What a page refers to exists (files, headings, decisions), and its tables are whole."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *sorted(ROOT.glob("*.md")),
    ROOT / "examples/README.md",
    ROOT / "evaluation/README.md",
    ROOT / "evaluation/results/README.md",
    *sorted((ROOT / "docs").rglob("*.md")),
]
DECISIONS = {page.name[:4]: page for page in (ROOT / "docs/decisions").glob("[0-9]*.md")}

FENCED = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ +(.+?)\s*$", re.MULTILINE)
BAR = re.compile(r"(?<!\\)\|")
MENTION = re.compile(r"\b[Dd]ecisions?[ /]\[?(\d{4})\b|\[(0\d{3})\]\(")


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def prose(page: Path) -> str:
    return FENCED.sub("", page.read_text())


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    found: dict[str, int] = {}
    for heading in HEADING.findall(prose(page)):
        text = re.sub(r"\]\([^)]*\)", "]", heading).lower()
        slug = re.sub(r"[^\w\- ]", "", text).replace(" ", "-")
        found[slug] = found.get(slug, -1) + 1
        if found[slug]:
            found[f"{slug}-{found[slug]}"] = 0
    return set(found)


def dead_links(page: Path) -> list[str]:
    dead = []
    for target in LINK.findall(prose(page)):
        if target.startswith(("http://", "https://", "mailto:")):
            continue
        path, _, anchor = target.partition("#")
        goal = (page.parent / path).resolve() if path else page
        if not goal.exists() or (anchor and anchor not in anchors(goal)):
            dead.append(target)
    return dead


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    assert dead_links(page) == []


def test_a_dead_link_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# A page\n[here](#a-page) [gone](gone.md) [nowhere](#nowhere)\n")
    assert dead_links(page) == ["gone.md", "#nowhere"]


def broken_rows(page: Path) -> list[str]:
    """The rows of tables with more or fewer cells than the row above them."""
    broken = []
    cells = 0
    for line in prose(page).splitlines():
        before, cells = cells, len(BAR.findall(line)) if line.startswith("|") else 0
        if before and cells and cells != before:
            broken.append(line)
    return broken


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_row_of_a_table_has_as_many_cells_as_the_one_above(page: Path) -> None:
    assert broken_rows(page) == []


def test_a_bar_inside_a_cell_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("| a | b |\n|---|---|\n| x | largest |y| |\n\n| a |\n|---|\n| \\|y\\| |\n")
    assert broken_rows(page) == ["| x | largest |y| |"]


def test_every_decision_that_is_mentioned_exists() -> None:
    files = [ROOT / "README.md", ROOT / "pyproject.toml", ROOT / "Makefile"]
    for folder in ("docs", "firmware_protocol", "sim_device", "smad", "tests", "tools"):
        files += [file for end in ("*.md", "*.py", "*.toml") for file in (ROOT / folder).rglob(end)]
    missing = {
        f"{name(file)}: {number}"
        for file in files
        for groups in MENTION.findall(file.read_text(errors="replace"))
        for number in groups
        if number and number not in DECISIONS
    }
    assert missing == set()


@pytest.mark.parametrize("page", DECISIONS.values(), ids=name)
def test_a_decision_has_its_number_a_status_and_three_parts(page: Path) -> None:
    lines = page.read_text().splitlines()
    assert lines[0].startswith(f"# {page.name[:4]} ")
    status = next(line for line in lines if line.startswith("Status: "))
    if by := re.match(r"Status: superseded by (\d{4})", status):
        assert by[1] in DECISIONS
    else:
        assert status.startswith(("Status: accepted", "Status: rejected"))
    for part in ("Context", "Decision", "Consequences"):
        assert any(line.startswith(f"**{part}.**") for line in lines), part
