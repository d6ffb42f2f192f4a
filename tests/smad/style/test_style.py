"""One palette: every colour that is named is in it, and pages, figures and layouts use no other."""

import re
from pathlib import Path

import pytest

from smad.report.plots import draw, label, new_figure, svg_of
from smad.style import assets
from smad.style.palette import PALETTE, css, following, in_print
from smad.style.strips import STRIPS
from smad.view.layouts import layouts

ROOT = Path(__file__).resolve().parents[3]
SET = re.compile(r"""setProperty\("--([\w-]+)""")
HEX = re.compile(r"#[0-9a-f]{6}\b")
USED = re.compile(r"var\(--([\w-]+)[,)]|css\(\"--([\w-]+)\"\)")
PAGES = [
    path
    for path in (ROOT / "smad").rglob("static/*")
    if path.suffix in {".css", ".js", ".html"} and path.is_file()
]


def test_a_colour_stands_for_one_thing_in_light_and_dark() -> None:
    seen: dict[str, str] = {}
    for colour in PALETTE.values():
        if colour.light != in_print("back"):
            assert seen.setdefault(colour.light, colour.dark) == colour.dark


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_a_page_uses_variables_that_there_are_and_no_colours_of_its_own(path: Path) -> None:
    text = path.read_text("utf-8")
    used = {name for match in USED.findall(text) for name in match if name}
    by_script = {n for f in path.parent.glob("*.js") for n in SET.findall(f.read_text("utf-8"))}
    assert {name for name in used - by_script if f"--{name}:" not in css()} == set()
    # A map of values is white behind in the dark as well.
    assert set(HEX.findall(text)) <= {in_print("text"), in_print("back")}


def test_no_module_has_a_colour_of_its_own() -> None:
    modules = [path for path in (ROOT / "smad").rglob("*.py") if path.name != "palette.py"]
    found = {
        str(path.relative_to(ROOT)): set(HEX.findall(path.read_text("utf-8"))) for path in modules
    }
    assert {name: colours for name, colours in found.items() if colours} == {}


def test_spring_y_has_one_colour_everywhere() -> None:
    y = in_print("y")
    assert f"--y: {y};" in css()
    assert "y" in {curve.pen for strip in STRIPS for curve in strip.curves}
    figure, (axes,) = new_figure()
    draw(axes, [0.0, 1.0], [0.0, 1.0], "spring Y", "y")
    assert f"stroke: {y}" in svg_of(figure)
    for layout in layouts().values():
        assert y in layout.decode()


def test_a_figure_takes_the_colours_of_the_page_and_keeps_its_own_elsewhere() -> None:
    figure, (axes,) = new_figure()
    draw(axes, [0.0, 1.0], [0.0, 1.0], "#c2410c", "x")
    label(axes, "s", "mm")
    svg = following(svg_of(figure))
    assert f"stroke: var(--x, {in_print('x')})" in svg
    assert "fill: var(--back, #ffffff)" in svg
    assert not re.search(r"(fill|stroke): #", svg)
    assert ">#c2410c<" in svg


def test_the_script_of_a_page_of_one_file_imports_nothing_and_declares_each_name_once() -> None:
    ours = assets.script().partition("})();\n")[2]
    assert not re.search(r"^(import|export) ", ours, re.MULTILINE)
    names = re.findall(r"^(?:const|function|class) (\w+)", ours, re.MULTILINE)
    assert len(names) == len(set(names)) > 10


def test_the_files_of_the_look_have_their_types() -> None:
    files = assets.files()
    assert files["style.css"] == ("text/css; charset=utf-8", css().encode())
    assert {"plots.js", "plane.js", "panels.js", "vendor/uPlot.js", "vendor/uPlot.css"} <= set(
        files
    )
