"""The layouts for other viewers show what the page shows, from channels that a log has."""

import json
from pathlib import Path
from xml.etree import ElementTree as xml

import pytest
from click.testing import CliRunner

from smad.cli.log import log
from smad.runlog.schema import CHANNELS
from smad.style.strips import STRIPS
from smad.view.layouts import layouts

COLUMNS = tuple(curve.column for strip in STRIPS for curve in strip.curves)


def names_in(layout: object) -> list[str]:
    if isinstance(layout, dict):
        return [*names_in(layout["first"]), *names_in(layout["second"])]
    return [str(layout)]


def test_the_foxglove_layout_places_each_panel_once_and_plots_channels_of_the_log() -> None:
    layout = json.loads(layouts()["smad-foxglove.json"])
    assert sorted(names_in(layout["layout"])) == sorted(layout["configById"])
    paths = [
        path["value"] for one in layout["configById"].values() for path in one.get("paths", ())
    ]
    assert {path.removeprefix("/smad/row.") for path in paths} == {*COLUMNS, "mode"}
    assert {*COLUMNS, "mode"} <= set(CHANNELS)


@pytest.mark.parametrize(("kind", "prefix"), [("log", "/smad/row/"), ("live", "smad/")])
def test_the_plotjuggler_layouts_have_a_share_of_the_height_for_each_strip(
    kind: str, prefix: str
) -> None:
    root = xml.fromstring(layouts()[f"smad-plotjuggler-{kind}.xml"])
    splitter = root.find(".//DockSplitter")
    assert splitter is not None
    assert len(splitter.attrib["sizes"].split(";")) == len(list(splitter))
    curves = [curve.attrib["name"] for curve in root.iter("curve")]
    assert curves == [prefix + column for column in COLUMNS]


def test_of_several_axes_each_has_a_tab_with_its_own_channels() -> None:
    made = layouts(["pitch-1", "yaw-1"])
    root = xml.fromstring(made["smad-plotjuggler-live.xml"])
    tabs = {tab.attrib["tab_name"]: tab for tab in root.iter("Tab")}
    assert list(tabs) == ["pitch-1", "yaw-1"]
    curves = [curve.attrib["name"] for curve in tabs["yaw-1"].iter("curve")]
    assert curves == [f"axis/yaw-1/{column}" for column in COLUMNS]
    layout = json.loads(made["smad-foxglove.json"])
    tabbed = layout["configById"]["Tab!axes"]["tabs"]
    assert [tab["title"] for tab in tabbed] == ["pitch-1", "yaw-1"]
    placed = [name for tab in (*tabbed, layout) for name in names_in(tab["layout"])]
    assert sorted(placed) == sorted(layout["configById"])
    paths = layout["configById"]["Plot!force-yaw-1"]["paths"]
    assert [path["value"] for path in paths] == ["/smad/axis/yaw-1/row.force_N"]


def test_the_command_writes_them_and_says_where_they_go(tmp_path: Path) -> None:
    done = CliRunner().invoke(log, ["layouts", str(tmp_path / "new")])
    assert done.exit_code == 0
    assert {path.name for path in (tmp_path / "new").iterdir()} == set(layouts())
    assert "Load Layout" in done.output


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = CliRunner().invoke(log, ["layouts", str(tmp_path / "file" / "in")])
    assert done.exit_code != 0
    assert "cannot write the layouts" in f"{done.output}{done.exception}"
