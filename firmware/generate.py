"""`python -m firmware.generate [--check]`: the table of the RTD converter.

The platinum curve is that of the simulated converters; see sim_device/firmware/frontend.py.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from sim_device.firmware.frontend import RTD_TABLE_STEP, rtd_table

HERE = Path(__file__).resolve().parent
TABLE = HERE / "core" / "rtd_table.h"


def rtd_header() -> str:
    """Return the text of rtd_table.h."""
    entries = rtd_table()
    rows = [
        "    " + " ".join(f"{value}," for value in entries[start : start + 12])
        for start in range(0, len(entries), 12)
    ]
    return (
        "/* Made by `python -m firmware.generate`; do not edit. */\n\n"
        f"#define RTD_TABLE_STEP {RTD_TABLE_STEP}u\n#define RTD_TABLE_SIZE {len(entries)}u\n\n"
        "static const HAL_FLASH int16_t rtd_table_cC[RTD_TABLE_SIZE] = {\n"
        + "\n".join(rows)
        + "\n};\n"
    )


def generated() -> dict[Path, str]:
    """Return the text of each generated file by its path."""
    return {TABLE: rtd_header()}


def main() -> int:
    """Write the file, or with --check say whether it is stale."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; fail if it is stale")
    checking = parser.parse_args().check
    stale = 0
    for path, text in generated().items():
        if checking and path.read_text(encoding="utf-8") != text:
            print(f"stale: {path}; run python -m firmware.generate", file=sys.stderr)
            stale = 1
        elif not checking:
            path.write_text(text, encoding="utf-8")
    return stale


if __name__ == "__main__":
    raise SystemExit(main())
