"""The paper: figures come from its command, numbers from their source, each citation is listed."""

import json
import re
import subprocess
import sys
from pathlib import Path

from sim_device.plant.effects.registry import EFFECTS
from sim_device.plant.published import inside_of, near_of

FOLDER = Path(__file__).resolve().parents[2] / "paper"
TEXT = (FOLDER / "paper.md").read_text()
NUMBERS = {
    9: "nine",
    13: "thirteen",
    25: "Twenty-five",
    42: "forty-two",
    44: "forty-four",
}


def test_the_command_draws_the_figures_that_the_paper_shows(tmp_path: Path) -> None:
    subprocess.run([sys.executable, str(FOLDER / "figures.py"), str(tmp_path)], check=True)
    shown = set(re.findall(r"\]\((\w+\.png)\)", TEXT))
    assert {path.name for path in tmp_path.glob("*.png")} == shown
    assert all((FOLDER / name).stat().st_size > 10_000 for name in shown)


def test_its_numbers_are_those_of_the_code() -> None:
    near, judged = near_of()
    assert f"{NUMBERS[near]} of {NUMBERS[judged]} lie within 20 %" in TEXT
    inside, stated = inside_of()
    assert f"{NUMBERS[inside]} of {NUMBERS[stated]} in the interval" in TEXT
    assert f"{NUMBERS[len(EFFECTS)]} candidate effects" in TEXT
    scores = json.loads((FOLDER.parent / "evaluation/results/sealed-check-ups.json").read_text())
    benches, _, _ = scores["notes"][0].partition(" of the independent plant")
    assert f"the scores of {benches}" in TEXT
    rows = {name: value for name, value, *_ in scores["tables"]["Scores, check-up"]["rows"]}
    share = float(rows["place right first, unlisted"].split()[0])
    assert f"right first in {share:.0%}".replace("%", " %") in TEXT
    pairs = {row[0]: row[1:3] for row in scores["tables"]["Scores, check-up"]["rows"]}
    named, count = pairs["pairs: both names reported"]
    assert f"({round(float(named.split()[0]) * int(count))} of {count} pairs)" in TEXT
    rules = scores["tables"]["By likelihood alone: right name first, of noticed listed"]["rows"]
    ours, least = (value.split()[0] for _, value in rules)
    assert f"({least} and {ours} of the noticed listed effects)" in TEXT


def test_each_reference_is_cited_and_each_citation_is_a_reference() -> None:
    cited = set(re.findall(r"@(\w+)", TEXT))
    listed = set(re.findall(r"^@\w+\{(\w+),", (FOLDER / "paper.bib").read_text(), re.MULTILINE))
    assert cited == listed


def test_each_reference_can_be_looked_up() -> None:
    for entry in (FOLDER / "paper.bib").read_text().split("\n@"):
        assert re.search(r"^  (doi|url) = \{\S+\}$", entry, re.MULTILINE), entry


def test_it_has_the_sections_and_the_length_that_the_journal_asks_for() -> None:
    for section in (
        "Summary", "Statement of need", "State of the field", "Software design",
        "Research impact statement", "AI usage disclosure", "References",
    ):  # fmt: skip
        assert f"\n# {section}\n" in TEXT
    assert 750 <= len(TEXT.split()) <= 1750
