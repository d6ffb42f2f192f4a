"""What every reader says of every kind of faulty record: refused by name, or left out and said."""

from pathlib import Path

import pytest

from smad.diagnosis.spring_pair import SmaPlant, read_gap_run
from smad.fmi.map_file import read_map
from smad.records.importer import import_table
from tests.smad.fmi.heater import MAP, read_mapped
from tests.smad.records.kinds import (
    KINDS,
    READERS,
    Columns,
    Heater,
    admitted,
    as_csv,
    heated,
    outcome,
    pair,
    put,
)

DIAGNOSED = ("run log", "CSV", "Parquet", "FMU map", "Python plant")
VALUES = (*DIAGNOSED, "check-up")
"""Readers that compare values with what their plant declares."""
EVERY = (*VALUES, "log import")
TAKEN = ("used", "read", "imported")
ANY = (*TAKEN, "refused")

# Kind -> the readers it concerns, how what they say begins, and words in it. The other readers
# pass the record on to a diagnosis, which looks at it.
RIGHT: dict[str, tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = {
    "nothing": (EVERY, TAKEN, ()),
    "a hole of 1 s": (VALUES, ("used", "read"), ("is not recorded: the run is used up to",)),
    "counts of 8 bits": (EVERY, ("refused",), ("declared 0 to", "counts of 8 bits? give `scale")),
    "thousandths": (EVERY, ("refused",), ("declared", "in m")),
    "a reversed sign": (EVERY, ANY, ("holds -", "is its sign reversed?", "`scale = -1`")),
    "degrees Fahrenheit": (EVERY, ANY, ("declared -20 to", "in degF?")),
    "-127 in three samples": (EVERY, TAKEN, ("holds -127 in 3 samples",)),
    "85 °C in one sample": (EVERY, TAKEN, ("holds 85 in one sample",)),
    "9999 in one sample": (EVERY, TAKEN, ("holds 9999 in one sample",)),
    "a jump of one sample": (EVERY, TAKEN, ("jumps and comes back at once in one",)),
    "NaN in ten samples": (EVERY, TAKEN, ("without a number in 10 of",)),
    "an open sensor": (EVERY, ANY, ("-127", "is its sensor open?")),
    "a stuck channel": (EVERY, TAKEN, ("stays at",)),
    "an input on change": (EVERY, ANY, ("holds a reading in", "`hold = true`")),
    "a slower channel": (EVERY, ANY, ("samples only", "`hold = true`")),
    "a reading in five rows each": (EVERY, TAKEN, ("each value in 5 rows", "slower than the rest")),
    "a time in ms": (EVERY, ANY, ("sense",)),
    "1.1 s long": (DIAGNOSED, ("refused",), ("s long; at least 8 s are needed",)),
    "no input changes": (DIAGNOSED, ("refused",), ("inputs were recorded, and that", "--trust")),
    "another run's reading": (("FMU map", "Python plant"), ("used",), ("shifted in time",)),
}  # fmt: skip


def test_every_kind_has_a_right_answer() -> None:
    assert RIGHT.keys() == KINDS.keys()


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_is_told_by_each_reader_that_it_concerns(
    kind: str, reader: str, tmp_path: Path
) -> None:
    readers, begins, words = RIGHT[kind]
    said = outcome(kind, reader, tmp_path)
    assert len(said.splitlines()) == 1
    if reader not in readers:
        assert said.startswith(TAKEN)
        return
    assert said.startswith(begins)
    for word in words:
        assert word in said


@pytest.mark.parametrize("reader", READERS)
def test_a_record_without_a_fault_is_used_without_a_word(reader: str, tmp_path: Path) -> None:
    assert ":" not in outcome("nothing", reader, tmp_path)


def in_other_units(columns: Columns, scales: dict[str, tuple[str, float]]) -> Columns:
    """Columns renamed, as value · factor; a code in three samples of each."""
    out = dict(columns)
    for name, (other, factor) in scales.items():
        out[other] = put(factor * out.pop(name), [90, 140, 141], -999.0)
    return out


@pytest.mark.parametrize("read", ["run", "import", "map"])
def test_a_code_in_a_converted_column_is_known_by_its_number_in_the_file(
    read: str, tmp_path: Path
) -> None:
    bench, unit = (heated(), "cC") if read == "map" else (pair(), "mA")
    name = "temperature_degC" if read == "map" else "i_meas_x_A"
    other = name.rpartition("_")[0] + f"_{unit}"
    factor = 100.0 if read == "map" else 1e3
    path = as_csv(in_other_units(dict(bench.columns), {name: (other, factor)}), tmp_path / "a.csv")
    if read == "import":
        said = "; ".join(import_table(path, tmp_path / "a.mcap").notes)
    elif read == "map":
        row = "[channels.temperature_degC]\n"
        assert row in MAP
        (tmp_path / "m.toml").write_text(MAP.replace(row, f'{row}column = "{other}"\n'))
        said = admitted(read_mapped(path, read_map(tmp_path / "m.toml")), Heater())
    else:
        said = admitted(read_gap_run(path), SmaPlant())
    assert f"{name} holds -999 {unit} in 3 samples" in said
