"""The README's picture comes from a run log, by the command that its caption names."""

import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

from tests.smad.runlog.helpers import write_small_run

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
