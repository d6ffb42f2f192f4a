"""The folder form of a bank: run files, the manifest, and the key that lies apart.

The form is described in evaluation/README.md; `read_run` reads what anybody may bring.
"""

import gzip
import hashlib
import io
import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.errors import BankError

Array = NDArray[np.float64]
Log = dict[str, Array]

FORMAT = "smad-bank-1"
UNITS = {
    "t_s": "s (board time)",
    "host_time_s": "s (Unix)",
    "i_cmd_x_A": "A",
    "i_cmd_y_A": "A",
    "i_applied_x_A": "A",
    "i_applied_y_A": "A",
    "i_meas_x_A": "A",
    "i_meas_y_A": "A",
    "v_x_V": "V",
    "v_y_V": "V",
    "rtd_x_degC": "°C",
    "rtd_y_degC": "°C",
    "rtd_inlet_degC": "°C",
    "rtd_ambient_degC": "°C",
    "displacement_mm": "mm, positive when spring X shortens",
    "force_N": "N, tendon at the anchor of spring X",
    "supply_V": "V",
    "duty_x": "pump duty 0…1",
    "duty_y": "pump duty 0…1",
    "reference_mm": "mm, 0 in open-loop stretches",
    "setpoint_age_ms": "ms",
    "mode": "board state, 2 = armed",
    "limiter": "0 = none",
    "faults": "0 = none",
    "warnings": "0 = none",
    "valid": "1 where every channel was valid",
    "tick": "sample counter, wraps at 65536",
}


def write_run(path: Path, log: Log) -> None:
    """Write a run log; the suffix chooses Parquet (`.parquet`) or gzipped CSV (`.csv.gz`).

    Nobody ever sees half of one.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = {name: np.asarray(log[name], float) for name in UNITS}
    if path.suffix == ".parquet":
        table = pa.table({n: pa.array(v, from_pandas=True) for n, v in columns.items()})
        partial = _partial(path)
        pq.write_table(table, partial, compression="zstd", compression_level=6)
        partial.replace(path)
        return
    text = io.StringIO()
    text.write(",".join(columns) + "\n")
    np.savetxt(text, np.stack(list(columns.values()), axis=1), delimiter=",", fmt="%.6f")
    _write_whole(path, gzip.compress(text.getvalue().encode(), mtime=0))


def _partial(path: Path) -> Path:
    return path.with_name(path.name + ".part")


def _write_whole(path: Path, data: bytes) -> None:
    partial = _partial(path)
    partial.write_bytes(data)
    partial.replace(path)


def read_run(path: Path) -> Log:
    """Columns of a run file by name, missing samples as NaN.

    Raises BankError when the file is missing, of another kind, or damaged.
    """
    if not path.exists():
        raise BankError(f"run file {path} is missing: make the bank again or fix its manifest")
    if not path.name.endswith((".parquet", ".csv", ".csv.gz")):
        raise BankError(f"{path.name}: run files are .parquet, .csv or .csv.gz; convert it")
    try:
        return _columns(path)
    except (OSError, EOFError, ValueError, zlib.error) as error:
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BankError(
            f"run file {path} cannot be read ({why}): restore it, or record it again"
        ) from error


def _columns(path: Path) -> Log:
    if path.suffix == ".parquet":
        import pyarrow.parquet as pq

        table = pq.read_table(path)
        return {
            n: table[n].to_numpy(zero_copy_only=False).astype(float) for n in table.column_names
        }
    raw = path.read_bytes()
    text = (gzip.decompress(raw) if path.suffix == ".gz" else raw).decode()
    header, _, body = text.partition("\n")
    values = np.genfromtxt(io.StringIO(body), delimiter=",", ndmin=2)
    return dict(zip(header.strip().split(","), values.T, strict=True))


def digest(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal; BankError when it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise BankError(f"{path} cannot be read ({error.strerror}): check the path") from None


def digest_of_runs(bank: Path) -> str:
    """SHA-256 over the names and contents of all files of a bank but its manifest."""
    paths = sorted(p for p in bank.rglob("*") if p.is_file() and p != bank / "manifest.json")
    lines = (f"{digest(p)}  {p.relative_to(bank).as_posix()}\n" for p in paths)
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def write_json(path: Path, value: Any) -> None:
    """Write JSON so that the same value always gives the same bytes."""
    text = json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False, allow_nan=False)
    _write_whole(path, f"{text}\n".encode())


def read_json(path: Path) -> Any:
    """Read JSON; BankError names the file when it is missing or broken."""
    try:
        return json.loads(path.read_text())
    except FileNotFoundError:
        raise BankError(f"{path} does not exist: check the path") from None
    except json.JSONDecodeError as error:
        raise BankError(f"{path} is not JSON ({error}): restore or make it again") from None
