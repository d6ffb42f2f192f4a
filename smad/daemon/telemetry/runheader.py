"""What the daemon writes at the head of a run log."""

from collections.abc import Mapping
from typing import TypeVar

import msgspec

from firmware_protocol.messages import Ident
from firmware_protocol.schema import canonical_json, describe
from smad.api import named
from smad.config import Config, config_to_toml
from smad.runlog.header import RunHeader, installed_versions
from smad.version import VERSION

T = TypeVar("T")
_VERSIONS = installed_versions()
_SCHEMA = canonical_json(describe()).decode()


def run_header(
    config: Config,
    name: str,
    idents: Mapping[str, Ident | None],
    *,
    parameter_text: str | None,
    now_s: float,
) -> RunHeader:
    """Return the header: configuration, parameter file, gains, versions, message schema, seed.

    `idents` are what the boards said, by axis; gains and boards of several have its name before
    theirs. `parameter_text` is the parameter file of a simulated bench; None on a real one.
    """
    simulated = parameter_text is not None
    configs = config.by_axis()
    return RunHeader(
        source="sim" if simulated else "bench",
        name=name,
        started_unix_s=now_s,
        rate_hz=float(config.link.rate_hz),
        axis=config.link.axis,
        axis_count=max((ident.axes for ident in idents.values() if ident), default=1),
        axes=tuple(axis for axis in idents if axis),
        seed=config.plant.seed if simulated else None,
        configuration=config_to_toml(config),
        parameter_file=parameter_text or "",
        gains=_by_axis({axis: _gains(axis_config) for axis, axis_config in configs.items()}),
        versions={**_VERSIONS, "smad": VERSION},
        board=_by_axis({axis: _board(ident) for axis, ident in idents.items() if ident}),
        message_schema=_SCHEMA,
    )


def _by_axis(parts: Mapping[str, Mapping[str, T]]) -> dict[str, T]:
    return {
        named(axis, name): value for axis, part in parts.items() for name, value in part.items()
    }


def _gains(config: Config) -> dict[str, float]:
    control = config.control
    return {
        "kp_A_per_mm": control.kp_A_per_mm,
        "ki_A_per_mm_s": control.ki_A_per_mm_s,
        "temperature_kp_A_per_K": control.temperature.kp_A_per_K,
        "temperature_ki_A_per_K_s": control.temperature.ki_A_per_K_s,
    }


def _board(ident: Ident) -> dict[str, str]:
    return {
        field: value.hex() if isinstance(value, bytes) else str(value)
        for field, value in msgspec.structs.asdict(ident).items()
    }
