"""A programme as the files that `smad.checkup.programme` reads."""

from __future__ import annotations

from pathlib import Path

import msgspec

from smad.checkup.programme import COLUMNS, Programme


def write_programme(programme: Programme, folder: Path) -> None:
    """Writes `programme.toml` and a CSV for each run."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.csv"):
        old.unlink()
    for run in programme.runs:
        lines = [",".join(COLUMNS)]
        for t, row in zip(run.t_s, run.inputs, strict=True):
            lines.append(",".join(f"{v:.6g}" for v in (t, *row)))
        (folder / f"{run.name}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    head = ("smad-programme-1", programme.name, programme.title)
    text = [f"{k} = {_quoted(v)}" for k, v in zip(("format", "name", "title"), head, strict=True)]
    for run in programme.runs:
        text += [
            "",
            "[[runs]]",
            f"name = {_quoted(run.name)}",
            f"title = {_quoted(run.title)}",
            f"duration_s = {run.duration_s:.6g}",
            f"quick = {'true' if run.quick else 'false'}",
        ]
    (folder / "programme.toml").write_text("\n".join(text) + "\n", encoding="utf-8")


def _quoted(text: str) -> str:
    """A TOML basic string, whose escapes are those of JSON."""
    return msgspec.json.encode(text).decode()
