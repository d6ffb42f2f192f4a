"""Faulty records as people published them: each is answered as it should be."""

from pathlib import Path

import pytest

from tests.smad.records.cases import CASES, Case, answer, prepare


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("cases")
    prepare(made)
    return made


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.number} {case.title}")
def test_a_case_ends_with_its_status_and_says_why(case: Case, folder: Path) -> None:
    status, said = answer(case, folder)
    assert status == case.status, said
    for word in case.words:
        assert word in said
