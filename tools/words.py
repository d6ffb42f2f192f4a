"""Words of the handbook by kind, counted as `wc -w` does: python tools/words.py"""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
GENERATED = re.compile(
    r"<!-- (?:generated|table): \w+ -->\n(.*?)<!-- end(?: of table)? -->", re.DOTALL
)
KINDS = {
    "decisions": "docs/decisions/*.md",
    "experiments": "docs/experiments/*.md",
    "guides": "docs/guide/*.md",
    "other pages": "docs/**/*.md",
    "README": "README.md",
}
"""Kind of page → where they are; a page belongs to the first that has it."""


def counted(root: Path = ROOT) -> dict[str, int]:
    """Words by kind; what stands between markers of a generator is *generated reference*."""
    totals = dict.fromkeys((*KINDS, "generated reference"), 0)
    seen: set[Path] = set()
    for kind, pattern in KINDS.items():
        for page in sorted(set(root.glob(pattern)) - seen):
            seen.add(page)
            text = page.read_text()
            generated = sum(len(part.split()) for part in GENERATED.findall(text))
            totals["generated reference"] += generated
            totals[kind] += len(text.split()) - generated
    return totals


def main() -> None:
    """Print the table."""
    totals = counted()
    for kind, words in totals.items():
        print(f"{kind:<20} {words:>6}")
    print(f"{'in all':<20} {sum(totals.values()):>6}")


if __name__ == "__main__":
    main()
