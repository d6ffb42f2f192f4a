"""Layouts of the strips for PlotJuggler and Foxglove (Lichtblick), made from the one table.

Pure. Both show a run log; PlotJuggler's shows the live stream as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree as xml

import msgspec

from smad.api import TELEMETRY_TOPIC
from smad.bridge.foxglove import LOG_TOPIC
from smad.runlog.schema import EVENT_TOPIC, ROW_TOPIC
from smad.style.palette import in_print
from smad.view.strips import STRIPS, Strip


def layouts() -> Mapping[str, bytes]:
    """Return the content of each layout file by its name."""
    return {
        "smad-foxglove.json": foxglove(),
        "smad-plotjuggler-log.xml": plotjuggler(f"{ROW_TOPIC}/"),
        "smad-plotjuggler-live.xml": plotjuggler(f"{TELEMETRY_TOPIC}/"),
    }


def foxglove() -> bytes:
    """Return a layout of one plot a strip, the board's state and the events."""
    panels: dict[str, Any] = {f"Plot!{strip.name}": _plot(strip) for strip in STRIPS}
    panels["StateTransitions!mode"] = {
        "paths": [_path(f"{ROW_TOPIC}.mode", "mode", in_print("good"))]
    }
    panels["RawMessages!events"] = {"topicPath": EVENT_TOPIC, "expansion": "all"}
    # What the bridge sends in their place.
    panels["RosOut!log"] = {"topicToRender": LOG_TOPIC, "minLogLevel": 1, "searchTerms": []}
    layout = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _column(list(panels)),
    }
    return msgspec.json.format(msgspec.json.encode(layout), indent=1) + b"\n"


def _plot(strip: Strip) -> dict[str, Any]:
    return {
        "title": f"{strip.title} [{_unit(strip)}]",
        "paths": [
            _path(f"{ROW_TOPIC}.{curve.column}", curve.label, in_print(curve.pen))
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


def plotjuggler(prefix: str) -> bytes:
    """Return a layout of one plot a strip; `prefix` stands before the name of a column."""
    root = xml.Element("root")
    window = xml.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    tab = xml.SubElement(window, "Tab", tab_name="smad", containers="1")
    share = ";".join([f"{1 / len(STRIPS):.6f}"] * len(STRIPS))
    splitter = xml.SubElement(
        xml.SubElement(tab, "Container"),
        "DockSplitter",
        orientation="-",
        sizes=share,
        count=str(len(STRIPS)),
    )
    for strip in STRIPS:
        area = xml.SubElement(splitter, "DockArea", name=f"{strip.title} [{_unit(strip)}]")
        plot = xml.SubElement(area, "plot", mode="TimeSeries", style="Lines")
        for curve in strip.curves:
            xml.SubElement(plot, "curve", name=f"{prefix}{curve.column}", color=in_print(curve.pen))
    xml.SubElement(window, "currentTabIndex", index="0")
    xml.SubElement(root, "use_relative_time_offset", enabled="1")
    xml.indent(root, " ")
    return bytes(xml.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"
