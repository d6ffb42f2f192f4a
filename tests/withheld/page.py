"""Scores to read: a text table, a table for the README, and one self-contained HTML page."""

import html
import math
from pathlib import Path
from typing import Any

from tests.withheld.errors import BankError

BEGIN = "<!-- withheld scores: made by `python -m tests.withheld readme` -->"
END = "<!-- end of withheld scores -->"
WIDTH, HEIGHT = 260, 200
STYLE = """
body{font:15px/1.45 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem}
table{border-collapse:collapse;margin:.6rem 0 1.4rem}
td,th{padding:.2rem .6rem;border:1px solid #ccc;text-align:left}
td.n{text-align:right;font-variant-numeric:tabular-nums}.yes{background:#e3f4e3}
.no{background:#fbe4e1}svg{margin-right:1rem}.note{color:#555}
"""


def _number(row: dict[str, Any]) -> str:
    if row["count"] == 0 or math.isnan(row["value"]):
        return "–"
    return f"{row['value']:.3f} [{row['low']:.3f}, {row['high']:.3f}]"


def _verdict(row: dict[str, Any]) -> str:
    return {True: "yes", False: "no", None: ""}[row["met"]]


def text(report: dict[str, Any]) -> str:
    """The table of scores for a terminal."""
    lines = [f"{report['answered']} of {report['cases']} cases answered", ""]
    lines += [
        f"{row['name']:48s} {_number(row):24s} n={row['count']:<4d} "
        f"{row['goal']:34s} {_verdict(row)}".rstrip()
        for row in report["table"]
    ]
    for name, rows in report["baselines"].items():
        lines += ["", f"baseline {name}"]
        lines += [f"  {r['name']:46s} {_number(r)}" for r in rows]
    return "\n".join(lines)


def markdown(report: dict[str, Any]) -> str:
    """The short table for the README."""
    lines = ["| score | value [95 %] | cases | goal | met |", "|---|---|---|---|---|"]
    lines += [
        f"| {r['name']} | {_number(r)} | {r['count']} | {r['goal']} | {_verdict(r)} |"
        for r in report["table"]
    ]
    return "\n".join(lines) + "\n"


def into_readme(path: Path, report: dict[str, Any]) -> None:
    """Replace the table between the two markers; BankError when the file has no markers."""
    before = path.read_text()
    if BEGIN not in before or END not in before:
        raise BankError(f"{path} has no markers: put the lines {BEGIN!r} and {END!r} into it")
    head, _, rest = before.partition(BEGIN)
    _, _, tail = rest.partition(END)
    path.write_text(f"{head}{BEGIN}\n{markdown(report)}{END}{tail}")


def _rows(rows: list[dict[str, Any]]) -> str:
    out = []
    for row in rows:
        kind = _verdict(row)
        out.append(
            f"<tr class='{kind}'><td>{html.escape(row['name'])}</td>"
            f"<td class=n>{_number(row)}</td><td class=n>{row['count']}</td>"
            f"<td>{html.escape(row['goal'])}</td><td>{kind}</td></tr>"
        )
    head = "<tr><th>score</th><th>value [95 %]</th><th>cases</th><th>goal</th><th>met</th></tr>"
    return f"<table>{head}{''.join(out)}</table>"


def _calibration_plot(bins: list[dict[str, float]]) -> str:
    dots = "".join(
        f"<circle cx='{30 + b['said'] * 200:.1f}' cy='{180 - b['was'] * 160:.1f}' "
        f"r='{2 + b['count'] ** 0.5:.1f}' fill='#3568a8' fill-opacity='.7'/>"
        for b in bins
    )
    return (
        f"<svg width={WIDTH} height={HEIGHT} role='img' aria-label='calibration'>"
        "<line x1=30 y1=180 x2=230 y2=20 stroke='#bbb'/><path d='M30 20V180H230' fill='none' "
        f"stroke='#333'/>{dots}<text x=80 y=197 font-size=11>probability said</text>"
        "<text x=34 y=16 font-size=11>share right</text></svg>"
    )


def _strength_plot(name: str, rows: list[dict[str, Any]]) -> str:
    marks = []
    for i, row in enumerate(rows):
        if not row["count"]:
            continue
        x = 60 + 70 * i
        top, low = 180 - 160 * row["high"], 180 - 160 * row["low"]
        marks.append(
            f"<line x1={x} x2={x} y1='{top:.1f}' y2='{low:.1f}' stroke='#3568a8'/>"
            f"<circle cx={x} cy='{180 - 160 * row['value']:.1f}' r=4 fill='#3568a8'/>"
        )
    labels = "".join(
        f"<text x={52 + 70 * i} y=195 font-size=11>{r['name']}</text>" for i, r in enumerate(rows)
    )
    return (
        f"<svg width={WIDTH} height={HEIGHT} role='img' aria-label='{html.escape(name)}'>"
        f"<path d='M30 20V180H230' fill='none' stroke='#333'/>{''.join(marks)}{labels}"
        f"<text x=34 y=16 font-size=11>{html.escape(name)}</text></svg>"
    )


def _confusion(matrix: dict[str, dict[str, int]]) -> str:
    rows = "".join(
        f"<tr><td>{html.escape(truth)}</td><td>"
        + ", ".join(f"{html.escape(s)} {n}" for s, n in said.items())
        + "</td></tr>"
        for truth, said in matrix.items()
    )
    return f"<table><tr><th>truth</th><th>said (cases)</th></tr>{rows}</table>"


def page(report: dict[str, Any], title: str) -> str:
    """One HTML page with everything in it, no scripts and no links outward."""
    curves = "".join(_strength_plot(n, rows) for n, rows in report["by_strength"].items())
    others = "".join(
        f"<h3>{html.escape(n)}</h3>{_rows(rows)}" for n, rows in report["baselines"].items()
    )
    worst = "".join(
        f"<tr><td>{w['case']}</td><td>{html.escape(' + '.join(w['truth']))}</td>"
        f"<td class=n>{w['floors']}</td><td>{html.escape(' + '.join(w['said']))}</td>"
        f"<td class=n>{w['probability']:.2f}</td></tr>"
        for w in report["worst"]
    )
    return f"""<!doctype html><html lang=en><meta charset=utf-8><title>{html.escape(title)}</title>
<style>{STYLE}</style><h1>{html.escape(title)}</h1>
<p class=note>{report["answered"]} of {report["cases"]} cases answered. Every figure is about the
withheld plant's family of benches until a real bench says otherwise.</p>
{_rows(report["table"])}
<h2>By strength</h2>{curves}
<h2>Calibration</h2>{_calibration_plot(report["calibration"]["bins"])}
<h2>Baselines on the same data</h2>{others or "<p>none handed in</p>"}
<h2>Confusion</h2>{_confusion(report["confusion"])}
<h2>Most confident mistakes</h2><table><tr><th>case</th><th>truth</th><th>floors</th><th>said</th>
<th>probability</th></tr>{worst}</table></html>
"""
