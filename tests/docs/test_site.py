"""The site of the pages: whole, with equations, and without a network."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tools.docs_site import OUTSIDE, mathml, subscripted

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^\$\$\n(.+?)^\$\$$", re.DOTALL | re.MULTILINE)
FROM_ELSEWHERE = re.compile(r"(?:src|href)=[\"']?(https?:[^\"' >]+)|@import|url\(['\"]?https?:")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("site")
    # Strict: a page that is not in the navigation, and a link to a page that is not there, fail.
    subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "-d", str(made)],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        check=True,
        capture_output=True,
    )
    return made


def test_every_page_is_there_the_examples_and_the_changes_too(site: Path) -> None:
    docs = ROOT / "docs"
    wanted = {page.relative_to(docs).with_suffix(".html") for page in docs.rglob("*.md")}
    wanted |= {Path(place).with_suffix(".html") for place in OUTSIDE.values()}
    wanted = {
        page.with_name("index.html") if page.name == "README.html" else page for page in wanted
    }
    assert {page for page in wanted if not (site / page).is_file()} == set()


def test_the_equations_of_the_physics_are_set(site: Path) -> None:
    equations = BLOCK.findall((ROOT / "docs/physics.md").read_text())
    page = (site / "physics.html").read_text()
    assert page.count('<math xmlns="http://www.w3.org/1998/Math/MathML" display="block">') == len(
        equations
    )
    assert len(equations) > 5
    assert "arithmatex" not in page
    assert "$$" not in page


def test_every_arrow_of_a_drawing_of_states_is_a_row_of_a_table(site: Path) -> None:
    page, source = (site / "safety.html").read_text(), (ROOT / "docs/safety.md").read_text()
    assert "--&gt;" not in page
    tables = [t for t in page.split("<table>") if "<th>from</th>" in t]
    rows = sum(table.split("</table>")[0].count("<tr>") - 1 for table in tables)
    assert rows == source.count("-->") - source.count("<!--")
    assert "<td>SAFE</td>\n<td>ARMED</td>\n<td>ARM_CONFIRM with a valid token" in page


def test_what_is_no_equation_is_left_alone(site: Path) -> None:
    pages = {page: page.read_text() for page in site.rglob("*.html")}
    with_equations = {page.name for page, text in pages.items() if "<math" in text}
    sources = {
        page.with_suffix(".html").name
        for page in (ROOT / "docs").rglob("*.md")
        if BLOCK.search(page.read_text())
    }
    assert with_equations == sources


def test_no_page_takes_anything_from_a_network(site: Path) -> None:
    for page in [*site.rglob("*.html"), *site.rglob("*.css")]:
        text = page.read_text()
        for tag in re.findall(r"<(?:script|link|img|iframe)\b[^>]*>", text):
            assert not FROM_ELSEWHERE.search(tag), (page.name, tag)
        if page.suffix == ".css":
            assert not FROM_ELSEWHERE.search(text), page.name


def test_the_search_knows_the_pages_without_a_server(site: Path) -> None:
    index = (site / "search" / "search_index.js").read_text()
    assert "setpoint age" in index
    assert (site / "iframe-worker.js").is_file()


def test_a_symbol_has_its_subscript_and_code_stays_as_it_is() -> None:
    page = '<p title="a_b">ξ_S and T_w,i, M_S, <code>t_s</code> rtd_x_degC</p>'
    assert subscripted(page) == (
        '<p title="a_b">ξ<sub>S</sub> and T<sub>w,i</sub>, M<sub>S</sub>, '
        "<code>t_s</code> rtd_x_degC</p>"
    )


def test_an_equation_becomes_mathml() -> None:
    assert "<mfrac>" in mathml(r"\frac{a}{b}", block=True)
