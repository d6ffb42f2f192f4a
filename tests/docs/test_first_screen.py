"""Who reads no further than the first screen knows what was measured, and on what."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_first_screen_says_that_nothing_was_measured_on_hardware_and_has_the_parts() -> None:
    first = README.partition("\n## ")[0]
    assert "measured on simulated benches" in first
    assert "hardware has not been built" in first
    (page,) = re.findall(r"\[parts list\]\((\S+)\)", first)
    assert (ROOT / page).read_text(encoding="utf-8").startswith("# Parts")


def test_no_count_of_benches_in_the_readme_reads_as_one_of_physical_ones() -> None:
    counts = re.findall(r"\b(?:\d+|two|twelve) (\w+)? ?benches\b", README, re.IGNORECASE)
    assert counts
    assert set(counts) == {"simulated"}
