"""The TOML configuration: typed sections with units in the names, checked on load.

`load_config(path)` reads a file, `Config()` is a complete default, `default_toml()` writes it out.
"""

from smad.config.axes import AxisConfig, SegmentConfig
from smad.config.control import (
    ControlConfig,
    CoolingConfig,
    FeedforwardConfig,
    HoldConfig,
    LimitsConfig,
    RepeatConfig,
    TemperatureConfig,
)
from smad.config.hooks import HooksConfig
from smad.config.load import (
    bench_in,
    load_config,
    parse_config,
    replaced,
    with_changes,
    without_realtime,
)
from smad.config.model import (
    Config,
    DaemonConfig,
    LinkConfig,
    PlantConfig,
    RealtimeConfig,
    RecorderConfig,
    TcpConfig,
    TelemetryConfig,
)
from smad.config.template import config_to_toml, default_toml

__all__ = [
    "AxisConfig",
    "Config",
    "ControlConfig",
    "CoolingConfig",
    "DaemonConfig",
    "FeedforwardConfig",
    "HoldConfig",
    "HooksConfig",
    "LimitsConfig",
    "LinkConfig",
    "PlantConfig",
    "RealtimeConfig",
    "RecorderConfig",
    "RepeatConfig",
    "SegmentConfig",
    "TcpConfig",
    "TelemetryConfig",
    "TemperatureConfig",
    "bench_in",
    "config_to_toml",
    "default_toml",
    "load_config",
    "parse_config",
    "replaced",
    "with_changes",
    "without_realtime",
]
