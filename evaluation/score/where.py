"""Where: how often the place of an effect comes first, on a development bank of check-ups.

    python -m evaluation where BANK KEY [--jobs N] [--out FILE]

Each bench is commissioned once, with the responses of all places. Nothing of a sealed bank is read.
"""

import argparse
import json
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.run.check_ups import benches_of, manifest_of
from evaluation.score.seals import refuse_sealed
from sim_device.plant.laws import Support, Term, law_space
from smad.diagnosis.numerics.folds import FoldRows
from smad.diagnosis.places.responses import Responses, responses
from smad.diagnosis.search.where import Where, where
from smad.gap.paired.difference import Paired, paired
from smad.gap.paired.spring_pair import TRAITS
from smad.gap.sma import SmaPlant

PLACES_OF: dict[str, tuple[str, ...]] = {
    "driver_gain": ("driven_current",),
    "driver_lag": ("driven_current",),
    "saturation": ("driven_current",),
    "resistivity": ("resistance",),
    "contact_resistance": ("reading_voltage", "resistance"),
    "rtd_lag": ("reading_rtd",),
    "rtd_stem_error": ("reading_rtd",),
    "rtd_offset": ("reading_rtd",),
    "channel_delay": ("reading_displacement", "reading_force"),
    "encoder_backlash": ("reading_displacement",),
    "encoder_slip": ("reading_displacement",),
    "force_offset": ("reading_force",),
    "force_gain": ("reading_force",),
    "force_creep": ("reading_force",),
    "water_drain": ("film", "heat_into_water"),
    "air_bubbles": ("film", "flow_behind_pump", "flow_before_pump"),
    "pump_dead_time": ("flow_before_pump", "flow_behind_pump"),
    "flow_shortfall": ("flow_before_pump", "flow_behind_pump"),
    "reservoir_warming": ("inlet_water", "heat_into_water"),
    "ambient_drift": ("ambient_air", "heat_into_water"),
    "valve_leak": ("flow_before_pump", "flow_behind_pump"),
    "cold_ends": ("heat_into_wire", "recoverable_strain"),
    "convection_exponent": ("film", "heat_into_water"),
    "minor_loop": ("transformation_shift", "recoverable_strain"),
    "transformation_drift": ("transformation_shift", "recoverable_strain"),
    "r_phase": ("recoverable_strain", "transformation_shift"),
    "stress_latent_heat": ("heat_into_wire",),
    "tube_friction": ("force_cell_on_x", "force_cell_on_y"),
    "viscous_drag": ("force_cell_on_x", "force_cell_on_y"),
    "tendon_compliance": ("recoverable_strain",),
    "tube_stiffness": ("force_cell_on_x", "force_cell_on_y"),
    "tendon_log_creep": ("recoverable_strain",),
    "rtd_current_pickup": ("reading_rtd",),
    "encoder_eccentricity": ("reading_displacement",),
    "force_frame_warming": ("reading_force",),
    "coil_contact": ("force_cell_on_x", "force_cell_on_y", "recoverable_strain"),
    "shunt_self_heating": ("reading_current",),
    "tube_swelling": ("film", "heat_into_water"),
    "pump_cavitation": ("flow_behind_pump", "flow_before_pump", "film"),
    "supply_beat": ("driven_current",),
    "rate_overshoot": ("transformation_shift",),
    "pump_bourdon": ("force_cell_on_x", "force_cell_on_y"),
    "martensite_stabilisation": ("transformation_shift",),
}
"""Where each effect of the plant acts, in the places of the simulator; several where its equation
has a term in each or where the simulator lumps them."""


def lines_and_lags(place: str, side: str, support: Support) -> tuple[Term, ...]:
    """Lines and lags of each state; bends and products would cost five times the replays."""
    return law_space(place, side, support, bends=False, products=False)


def asked(pairs: Paired, found: Responses) -> tuple[Where, FoldRows]:
    """The places of one check-up, and the rows they rest on."""
    by_name = {r.name: k for k, r in enumerate(pairs.reference.runs)}
    per_run = [found.runs[by_name[p.reference.name]] for p in pairs.pairs]
    A = pairs.tie(pairs.white([r.astype(np.float64) for r in per_run]))
    fold = np.where(pairs.white.valid, pairs.white.run_of_row(), -1)
    rows = FoldRows(pairs.z, A, fold)
    return where(rows, found.candidates()), rows


def _bench(bank: Path, key: Path, bench: str) -> list[dict[str, Any]]:
    plant = SmaPlant()
    entries = json.loads((key / "KEY.json").read_text())["cases"]
    ((_, reference, cases),) = benches_of(bank, manifest_of(bank), plant, only=[bench])
    began = time.process_time()
    found = responses(
        plant, reference.point, [r.played for r in reference.runs], space=lines_and_lags
    )
    cost = time.process_time() - began
    out = []
    for case, runs in cases:
        began = time.process_time()
        told, rows = asked(paired(plant, TRAITS, reference, runs), found)
        entry = entries[case]
        out.append(
            {
                "case": case,
                "bench": bench,
                "kind": entry["kind"],
                "effects": [[e["name"], e["known"], e["y_share"]] for e in entry["effects"]],
                "floors": entry["target_floors"],
                "ratio": rows.square / rows.count,
                "count": rows.count,
                "ranked": [
                    [s.candidate.place, s.candidate.side, round(s.share, 4)]
                    for s in told.ranked[:12]
                ],
                "steps": [
                    [s.chosen.place, s.chosen.side, round(s.share, 4),
                     sorted({c.place for c in s.near})]
                    for s in told.steps
                ],
                "seconds": round(time.process_time() - began, 2),
                "responses_s": round(cost, 1),
                "columns": len(found.runs[0]),
            }
        )  # fmt: skip
    return out


def summary(cases: list[dict[str, Any]]) -> list[str]:
    """Shares of cases by kind."""
    lines = []
    for title, chosen in (
        ("listed", [c for c in cases if c["kind"] == "single"]),
        ("unlisted", [c for c in cases if c["kind"] == "unknown"]),
    ):
        seen = [c for c in chosen if c["steps"]]
        right = [c["steps"][0][0] in PLACES_OF[c["effects"][0][0]] for c in seen]
        held = [bool(set(c["steps"][0][3]) & set(PLACES_OF[c["effects"][0][0]])) for c in seen]
        size = [len(c["steps"][0][3]) for c in seen]
        lines.append(
            f"{title}: {len(seen)} of {len(chosen)} have a place; of these first right"
            f" {sum(right)}, set holds it {sum(held)}, set size {sum(size) / max(len(size), 1):.1f}"
        )
    quiet = [c for c in cases if c["kind"] == "none"]
    lines.append(f"quiet: {sum(bool(c['steps']) for c in quiet)} of {len(quiet)} have a place")
    return lines


def main(arguments: Sequence[str]) -> None:
    """Ask every bench of a bank, and print the shares as they come in."""
    parser = argparse.ArgumentParser(prog="python -m evaluation where", description=__doc__)
    parser.add_argument("bank", type=Path)
    parser.add_argument("key", type=Path)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--benches", nargs="*")
    args = parser.parse_args(arguments)
    refuse_sealed(args.key)
    wanted = args.benches or sorted({c["bench"] for c in manifest_of(args.bank)["cases"]})
    cases: list[dict[str, Any]] = []
    with ProcessPoolExecutor(args.jobs) as pool:
        for task in as_completed([pool.submit(_bench, args.bank, args.key, b) for b in wanted]):
            cases += task.result()
            for line in summary(cases):
                print(line, flush=True)
            if args.out:
                args.out.write_text(json.dumps(cases, indent=1))
