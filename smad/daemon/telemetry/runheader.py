"""What the daemon writes at the head of a run log."""

from __future__ import annotations

import msgspec

from firmware_protocol.messages import Ident
from firmware_protocol.schema import canonical_json, describe
from smad.config import Config, config_to_toml
from smad.runlog.header import RunHeader, installed_versions
from smad.version import VERSION

_VERSIONS = installed_versions()
_SCHEMA = canonical_json(describe()).decode()


def run_header(
    config: Config, name: str, ident: Ident | None, *, parameter_text: str | None, now_s: float
) -> RunHeader:
    """Return the header: configuration, parameter file, gains, versions, message schema, seed.

    `parameter_text` is the parameter file of a simulated bench; None on a real one.
    """
    simulated = parameter_text is not None
    control = config.control
    return RunHeader(
        source="sim" if simulated else "bench",
        name=name,
        started_unix_s=now_s,
        rate_hz=float(config.link.rate_hz),
        axis=config.link.axis,
        axis_count=1 if ident is None else ident.axes,
        seed=config.plant.seed if simulated else None,
        configuration=config_to_toml(config),
        parameter_file=parameter_text or "",
        gains={
            "kp_A_per_mm": control.kp_A_per_mm,
            "ki_A_per_mm_s": control.ki_A_per_mm_s,
            "temperature_kp_A_per_K": control.temperature.kp_A_per_K,
            "temperature_ki_A_per_K_s": control.temperature.ki_A_per_K_s,
        },
        versions={**_VERSIONS, "smad": VERSION},
        board={} if ident is None else _board(ident),
        message_schema=_SCHEMA,
    )


def _board(ident: Ident) -> dict[str, str]:
    return {
        field: value.hex() if isinstance(value, bytes) else str(value)
        for field, value in msgspec.structs.asdict(ident).items()
    }
