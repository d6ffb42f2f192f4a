"""The README's picture comes from a run log, by the command that its caption names."""

import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.smad.runlog.helpers import write_small_run
from tools.picture import DARK

ROOT = Path(__file__).resolve().parents[2]


def test_the_newest_log_is_drawn_with_both_springs(tmp_path: Path) -> None:
    log = write_small_run(tmp_path / "20261121-000000-demo.mcap")
    (tmp_path / "20261120-000000-demo.mcap").write_bytes(b"an older one, not read")
    target = tmp_path / "picture.svg"
    done = subprocess.run(
        [
            sys.executable,
            "tools/picture.py",
            *map(str, tmp_path.glob("*.mcap")),
            "-o",
            str(target),
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert str(log) in done.stdout
    text = "".join(ElementTree.parse(target).getroot().itertext())
    for drawn in ("displacement", "reference", "spring X", "spring Y"):
        assert drawn in text
    assert DARK in target.read_text()


@pytest.mark.parametrize("drawing", sorted((ROOT / "docs/img").glob("*.svg")), ids=lambda p: p.name)
def test_a_drawing_does_not_glare_in_a_dark_page(drawing: Path) -> None:
    assert DARK in drawing.read_text()


def test_the_readme_has_each_photograph_light_and_dark() -> None:
    shown = re.findall(r'(?:src|srcset)="([^"]+)"', (ROOT / "README.md").read_text())
    assert [Path(path).stem for path in shown] == ["live-page-dark", "live-page"]
    assert all((ROOT / path).is_file() for path in shown)
