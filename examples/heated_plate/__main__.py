"""Make heater.fmu, map.toml and four runs in the current folder: python -m examples.heated_plate

The unit (heater.py) is a plate that loses heat in proportion to its temperature. The runs are of
one that has other values of its parameters and also radiates 8 W. docs/guide/fmi.md diagnoses them.
"""

import shutil
from pathlib import Path

import numpy as np
from pythonfmu.builder import FmuBuilder

HERE = Path(__file__).parent


def main() -> None:
    """Write the files."""
    FmuBuilder.build_FMU(str(HERE / "heater.py"), dest="heater.fmu")
    shutil.copy(HERE / "map.toml", "map.toml")
    for seed in range(4):
        Path(f"run{seed}.csv").write_text("\n".join(recorded(seed)))


def recorded(seed: int) -> list[str]:
    """The lines of one run: a minute of random steps of power, read with noise."""
    rng = np.random.default_rng(seed)
    power = np.repeat(rng.choice([0.0, 15.0, 30.0, 45.0], 12), 50)
    power[:50] = 0.0
    plate, lines = 22.0, ["t_s,power_W,temperature_degC"]
    for k, given in enumerate(power):
        if k:
            lost = 0.74 * (plate - 22.0) + 8.0 * ((plate + 273.15) / 300.0) ** 4
            plate += 0.1 * (given - lost) / 32.0
        lines.append(f"{0.1 * k:.1f},{given},{plate + 0.03 * rng.standard_normal():.2f}")
    return lines


if __name__ == "__main__":
    main()
