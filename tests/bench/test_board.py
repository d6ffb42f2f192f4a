"""The benchmark runs and gives a cost for each part; how large it is depends on the machine."""

import pytest

from bench import board


def test_every_row_is_a_positive_cost_and_the_whole_costs_more_than_a_part(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(board, "SAMPLES", 200)
    monkeypatch.setattr(board, "ROUNDS", 3)
    assert board.main() == 0
    lines = capsys.readouterr().out.splitlines()
    values = {line[:48].strip(): float(line[48:].split()[0]) for line in lines}
    assert all(value > 0 for value in values.values())
    assert (
        values["whole bench, typed: one sample"]
        > values["plant: advance one 100 Hz sample and read it"]
    )
