"""The maps that docs/ shows are those of the examples."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SHOWN = {"heated_plate": "docs/guide/fmi.md", "pendulum": "docs/your-simulator.md"}


@pytest.mark.parametrize("example", SHOWN)
def test_a_page_shows_the_map_of_its_example(example: str) -> None:
    map_file = (ROOT / "examples" / example / "map.toml").read_text()
    assert f"```toml\n{map_file}```\n" in (ROOT / SHOWN[example]).read_text()
