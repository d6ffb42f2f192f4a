"""Write the font of saved figures: `python -m tools.figure_font Arimo-Regular.ttf`.

The letters that figures use are taken from Arimo (Debian: fonts-croscore), which has the widths of
Helvetica, into `smad/style/static/vendor/font.js`. Needs fonttools, which comes with matplotlib.
"""

from __future__ import annotations

import base64
import io
import json
import sys
from pathlib import Path

from fontTools import subset
from fontTools.ttLib import TTFont

TARGET = Path(__file__).resolve().parents[1] / "smad/style/static/vendor/font.js"
NAME = "SmadSans"
"""Arimo's own name is reserved for the whole font (SIL Open Font License 1.1)."""
GREEK = "".join(chr(code) for code in range(0x391, 0x3CA) if code != 0x3A2)
LETTERS = "".join(map(chr, [*range(0x20, 0x7F), *range(0xA0, 0x100)])) + (
    GREEK + "–—‘’“”•…‰−≈≠≤≥√∞∂∑∆←→↔ₐ₀₁₂₃₄⁻ⁿ"
)


def written(source: Path) -> str:
    """Return the module: the font as base64, and of each letter its glyph and width."""
    options = subset.Options(hinting=False, layout_features=[], notdef_outline=True)
    font = TTFont(source, recalcTimestamp=False)
    chooser = subset.Subsetter(options)
    chooser.populate(text=LETTERS)
    chooser.subset(font)
    letters = {chr(c): name for c, name in font.getBestCmap().items()}
    # Text of the PDF is glyph numbers: it needs no table of letters.
    for table in ("GDEF", "GPOS", "GSUB", "DSIG", "cmap", "post", "OS/2"):
        if table in font:
            del font[table]
    for record in list(font["name"].names):
        if record.nameID in (1, 4, 6):
            font["name"].setName(NAME, record.nameID, record.platformID, record.platEncID, 0x409)
        elif record.nameID not in (0, 13, 14):
            font["name"].names.remove(record)
    order = {name: number for number, name in enumerate(font.getGlyphOrder())}
    thousandths = 1000 / font["head"].unitsPerEm
    glyphs = {
        letter: [order[name], round(font["hmtx"][name][0] * thousandths)]
        for letter, name in sorted(letters.items())
    }
    box = [
        round(getattr(font["head"], side) * thousandths)
        for side in ("xMin", "yMin", "xMax", "yMax")
    ]
    up, down = (round(getattr(font["hhea"], of) * thousandths) for of in ("ascent", "descent"))
    file = io.BytesIO()
    font.save(file)
    fields = {"name": NAME, "box": box, "ascent": up, "descent": down, "glyphs": glyphs}
    fields["file"] = base64.b64encode(file.getvalue()).decode()
    rows = [f"  {key}: {json.dumps(value, ensure_ascii=False)}," for key, value in fields.items()]
    return "\n".join(
        [
            "// A part of Arimo, (c) Google, SIL Open Font License 1.1: see font-license.txt.",
            "// Written by tools/figure_font.py. Of each letter [glyph, width in thousandths].",
            "export const PRINT_FONT = {",
            *rows,
            "};",
            "",
        ]
    )


if __name__ == "__main__":
    TARGET.write_text(written(Path(sys.argv[1])))
