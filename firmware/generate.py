"""`python -m firmware.generate [--check]`: the RTD converter's table, and that of the baud rates.

The platinum curve is that of the simulated converters; see sim_device/firmware/frontend.py.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from firmware_protocol.rates import MOST_SHARE, USUAL_BAUDS, load
from sim_device.firmware.frontend import RTD_TABLE_STEP, rtd_table

HERE = Path(__file__).resolve().parent
TABLE = HERE / "core" / "rtd_table.h"
WIRING = HERE.parent / "docs" / "firmware-wiring.md"
MEGA_HZ = 16_000_000
CLOCKS_PER_BIT = 8
"""With the doubled speed that the firmware sets."""
MEGA_RATE_HZ = 100
BAUDS = tuple(sorted({*USUAL_BAUDS, 250_000}))


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


def baud_table() -> str:
    """Return the baud rates that the Mega makes exactly, and what its samples take of the line."""
    rows = [f"| Bd | share of the line at {MEGA_RATE_HZ} Hz |", "| --- | --- |"]
    for baud in BAUDS:
        divisor = max(round(MEGA_HZ / CLOCKS_PER_BIT / baud), 1)
        share = load(MEGA_RATE_HZ, baud).share
        if MEGA_HZ / CLOCKS_PER_BIT / divisor == baud and share <= MOST_SHARE:
            rows.append(f"| {baud} | {share:.0%} |")
    return "\n".join(rows)


def filled(text: str) -> str:
    """Return the wiring page with its table made anew."""
    return re.sub(
        r"(<!-- generated: bauds -->\n).*?(<!-- end -->)",
        lambda found: f"{found[1]}{baud_table()}\n{found[2]}",
        text,
        flags=re.DOTALL,
    )


def generated() -> dict[Path, str]:
    """Return the text of each generated file by its path."""
    return {TABLE: rtd_header(), WIRING: filled(WIRING.read_text(encoding="utf-8"))}


def main() -> int:
    """Write the files, or with --check say which are stale."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; fail if one is stale")
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
