"""A diagnosis for its reader: records, words, figures, page.

`page_of` makes the page of a diagnosis, `summary_lines` its text.
"""

from smad.gap.report.advice import Asked
from smad.gap.report.page import page_of, summary_lines

__all__ = ["Asked", "page_of", "summary_lines"]
