"""Layouts of the strips for PlotJuggler and Foxglove (Lichtblick), made from the one table.

Both show a run log; PlotJuggler's shows the live stream as well.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as xml

import msgspec

from smad.api import topic_of
from smad.bridge.foxglove import LOG_TOPIC
from smad.errors import RunLogError, refused_by_system
from smad.files import write_whole
from smad.runlog.schema import EVENT_TOPIC, row_topic
from smad.style.palette import in_print
from smad.style.strips import STRIPS, Strip


def layouts(axes: Sequence[str] = ()) -> Mapping[str, bytes]:
    """Return the content of each layout file by its name; of several axes, a tab for each."""
    names = tuple(axes) or ("",)
    return {
        "smad-foxglove.json": foxglove(names),
        "smad-plotjuggler-log.xml": plotjuggler({axis: row_topic(axis) for axis in names}),
        "smad-plotjuggler-live.xml": plotjuggler({axis: topic_of(axis) for axis in names}),
    }


def write_layouts(folder: Path, axes: Sequence[str]) -> list[Path]:
    """Write the layouts into a folder; return their paths. Raises RunLogError."""
    cause, action = "cannot write the layouts", "name another FOLDER"
    with refused_by_system(RunLogError, cause, value=str(folder), action=action):
        folder.mkdir(parents=True, exist_ok=True)
        written = {folder / name: content for name, content in layouts(axes).items()}
        for path, content in written.items():
            write_whole(path, content)
    return list(written)


def foxglove(axes: Sequence[str]) -> bytes:
    """Return a layout of one plot a strip and the board's state, for each axis; and the events."""
    panels: dict[str, Any] = {}
    tabs = []
    for axis in axes:
        topic, end = row_topic(axis), f"-{axis}" if axis else ""
        strip_panels = {f"Plot!{strip.name}{end}": _plot(strip, topic) for strip in STRIPS}
        strip_panels[f"StateTransitions!mode{end}"] = {
            "paths": [_path(f"{topic}.mode", "mode", in_print("good"))]
        }
        panels |= strip_panels
        tabs.append((axis, list(strip_panels)))
    events = {
        "RawMessages!events": {"topicPath": EVENT_TOPIC, "expansion": "all"},
        # What the bridge sends in their place.
        "RosOut!log": {"topicToRender": LOG_TOPIC, "minLogLevel": 1, "searchTerms": []},
    }
    content = tabs[0][1]
    if len(axes) > 1:
        contents = [{"title": axis, "layout": _column(names)} for axis, names in tabs]
        panels["Tab!axes"] = {"activeTabIdx": 0, "tabs": contents}
        content = ["Tab!axes"]
    layout = {
        "configById": panels | events,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _column([*content, *events]),
    }
    return msgspec.json.format(msgspec.json.encode(layout), indent=1) + b"\n"


def _plot(strip: Strip, topic: str) -> dict[str, Any]:
    return {
        "title": f"{strip.title} [{_unit(strip)}]",
        "paths": [
            _path(f"{topic}.{curve.column}", curve.label, in_print(curve.pen))
            for curve in strip.curves
        ],
        "showLegend": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
    }


def _path(value: str, label: str, colour: str) -> dict[str, Any]:
    return {
        "value": value,
        "enabled": True,
        "timestampMethod": "receiveTime",
        "label": label,
        "color": colour,
    }


def _unit(strip: Strip) -> str:
    # A viewer shows what the log holds; only our own page scales.
    return strip.unit if strip.scale == 1.0 else "1"


def _column(panels: list[str]) -> Any:
    """Stack panels of one height: the first has its share of what is left."""
    first, *rest = panels
    if not rest:
        return first
    return {
        "direction": "column",
        "first": first,
        "second": _column(rest),
        "splitPercentage": round(100 / len(panels), 2),
    }


def plotjuggler(topics: Mapping[str, str]) -> bytes:
    """Return a layout of one plot a strip and a tab an axis; `topics` are those of the axes."""
    root = xml.Element("root")
    window = xml.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    share = ";".join([f"{1 / len(STRIPS):.6f}"] * len(STRIPS))
    for axis, topic in topics.items():
        splitter = xml.SubElement(
            xml.SubElement(
                xml.SubElement(window, "Tab", tab_name=axis or "smad", containers="1"), "Container"
            ),
            "DockSplitter",
            orientation="-",
            sizes=share,
            count=str(len(STRIPS)),
        )
        for strip in STRIPS:
            area = xml.SubElement(splitter, "DockArea", name=f"{strip.title} [{_unit(strip)}]")
            plot = xml.SubElement(area, "plot", mode="TimeSeries", style="Lines")
            for curve in strip.curves:
                name = f"{topic}/{curve.column}"
                xml.SubElement(plot, "curve", name=name, color=in_print(curve.pen))
    xml.SubElement(window, "currentTabIndex", index="0")
    xml.SubElement(root, "use_relative_time_offset", enabled="1")
    xml.indent(root, " ")
    return bytes(xml.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"
