"""Puts kernel and supervisor into a wheel as libraries, where a C compiler is.

A hook of hatchling. Of an editable installation `make setup` compiles them beside their source.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from packaging.tags import platform_tags


class LibrariesHook(BuildHookInterface[Any]):
    """Compiles the libraries and tags the wheel with this platform, for every Python."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable":
            return
        sys.path.insert(0, self.root)
        from firmware_protocol.supervisor import compiled as supervisor
        from sim_device.plant.kernel import library as kernel
        from smad.fmi.library import build_library as build_kernel

        self._folder = tempfile.TemporaryDirectory(prefix="smad-wheel-")
        made = {
            f"sim_device/plant/kernel/{kernel.FILE}": build_kernel,
            f"firmware_protocol/c/{supervisor.LIBRARY.name}": supervisor.build_library,
        }
        for place, build in made.items():
            target = Path(self._folder.name) / Path(place).name
            if build(target):
                build_data["force_include"][str(target)] = place
                build_data["pure_python"] = False
                build_data["tag"] = f"py3-none-{next(platform_tags())}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if version != "editable":
            self._folder.cleanup()
