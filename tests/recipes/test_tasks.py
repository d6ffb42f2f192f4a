"""The main tasks are timed by the commands of their pages."""

import pytest

from tests.docs.pages import read_page
from tests.docs.test_commands import ROOT
from tests.recipes.__main__ import TASKS, main


@pytest.mark.parametrize("task", TASKS)
def test_a_task_has_a_page_with_commands_that_are_run(task: str) -> None:
    assert any(block.not_run is None for block in read_page(ROOT / TASKS[task][1]).blocks)


def test_a_task_that_does_not_exist_is_refused_with_those_that_do(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["leek"]) == 1
    assert "there is no task 'leek'; there are session, drive" in capsys.readouterr().out
