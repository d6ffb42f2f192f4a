"""What a command needs to begin: looked at when it is queued, and again before it runs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from smad.client import folder
from smad.experiments.moves import read_moves
from smad.experiments.ready import BYTES_A_ROW, ROOM_S, require_baseline, require_logs
from smad.experiments.registry import chosen_experiments
from smad.queue.budget import configuration
from smad.queue.errors import QueueError

INPUTS = ("run", "path", "config_file", "model", "programme_folder")
"""Parameters whose files must be there before."""
NOT_QUEUED = ("listing", "feedforward", "logs")
"""Parameters of `smad run` with which it runs nothing."""
USUAL_RATE_HZ = 100
"""What the disk must have room for; the command itself looks again."""


def require_startable(kind: str, params: Mapping[str, Any], start_folder: Path) -> None:
    """Raise SmadError unless a command of this kind, with these parameters, can begin there."""
    for name in NOT_QUEUED:
        if params.get(name):
            raise QueueError(f"a command with --{name} moves nothing, so it is not queued")
    if kind == "run" and "names" in params:
        chosen_experiments(params["names"], params["settings"])
    for name in INPUTS:
        path = params.get(name)
        if isinstance(path, Path) and not (start_folder / path).exists():
            raise QueueError(f"{name} {path} is not there", action="nothing was begun; restore it")
    if kind == "tune" and params["save"] and (start_folder / params["save"]).exists():
        raise QueueError(f"{params['save']} is there already", action="name a new file for --save")
    baseline = params.get("folder" if kind == "checkup" else "baseline")
    if baseline is not None:
        require_baseline(start_folder / baseline)
    if kind == "move":
        read_moves(start_folder / params["path"]).require_within(configuration(params["bench"]))
    if params.get("sim"):
        require_logs(start_folder, 0.0)
    else:
        where = folder.recording_folder(params["bench"]) or start_folder
        require_logs(where, BYTES_A_ROW * USUAL_RATE_HZ * ROOM_S)
