"""`python -m firmware.make_rtd_table [--check]`: temperature of a Pt100 by converter code, as C.

The curve is that of the simulated converters; see sim_device/firmware/frontend.py.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from sim_device.firmware.frontend import RTD_TABLE_STEP, rtd_table

FILE = Path(__file__).resolve().parent / "core" / "rtd_table.h"


def text() -> str:
    """Return the text of rtd_table.h."""
    entries = rtd_table()
    rows = [
        "    " + " ".join(f"{value}," for value in entries[start : start + 12])
        for start in range(0, len(entries), 12)
    ]
    return (
        "/* Made by `python -m firmware.make_rtd_table`; do not edit. */\n\n"
        f"#define RTD_TABLE_STEP {RTD_TABLE_STEP}u\n#define RTD_TABLE_SIZE {len(entries)}u\n\n"
        "static const HAL_FLASH int16_t rtd_table_cC[RTD_TABLE_SIZE] = {\n"
        + "\n".join(rows)
        + "\n};\n"
    )


def main() -> int:
    """Write the table, or with --check say whether it is stale."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; fail if it is stale")
    if parser.parse_args().check:
        if FILE.exists() and FILE.read_text(encoding="utf-8") == text():
            return 0
        print(f"stale: {FILE}; run python -m firmware.make_rtd_table", file=sys.stderr)
        return 1
    FILE.write_text(text(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
