"""Built into a wheel: the kernel as a library, where a C compiler is; else the wheel is for all.

A hook of hatchling. Of an editable installation `make setup` compiles it beside its source.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from packaging.tags import platform_tags


class KernelHook(BuildHookInterface[Any]):
    """Compiles the library and tags the wheel with this platform, for every Python."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable":
            return
        sys.path.insert(0, self.root)
        from sim_device.plant.kernel.library import FILE
        from smad.fmi.library import build_library

        self._folder = tempfile.TemporaryDirectory(prefix="smad-wheel-")
        target = Path(self._folder.name) / FILE
        if build_library(target):
            build_data["force_include"][str(target)] = f"sim_device/plant/kernel/{FILE}"
            build_data["pure_python"] = False
            build_data["tag"] = f"py3-none-{next(platform_tags())}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if version != "editable":
            self._folder.cleanup()
