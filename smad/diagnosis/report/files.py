"""The files of an answer: verdict, page and model.

A file that cannot be written keeps no other from being written: an answer takes minutes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from smad.diagnosis.answer import Answer
from smad.files import write_named


@dataclass(frozen=True, kw_only=True)
class AnswerFiles:
    """Where the verdict (JSON), the page and the model go, None where nowhere."""

    verdict: Path | None
    page: Path | None
    model: Path | None

    def write(
        self, answer: Answer, arguments: str, facts: Sequence[tuple[str, str]]
    ) -> tuple[list[Path], list[Exception]]:
        """Write each file whole; the files that are written, and what the others raised.

        `arguments` and `facts` are those of `page_of`.
        """

        def write_page_of(path: Path) -> None:
            from smad.diagnosis.report.page import page_of
            from smad.report.page import write_page

            write_page(page_of(answer, arguments, facts, (self.verdict, self.model)), path)

        def write_verdict(path: Path) -> None:
            write_named(path, answer.verdict.to_json())

        def write_model(path: Path) -> None:
            write_named(path, answer.verdict.model_text(as_json=path.suffix == ".json"))

        pairs = (
            (write_verdict, self.verdict),
            (write_page_of, self.page),
            (write_model, self.model),
        )
        written: list[Path] = []
        failed: list[Exception] = []
        for write, path in pairs:
            try:
                if path is not None:
                    write(path)
                    written.append(path)
            # Whatever it is: the caller prints the answer, and then raises it.
            except Exception as error:
                failed.append(error)
        return written, failed
