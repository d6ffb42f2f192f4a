"""Where, which law, what name: scores on a development bank of check-ups.

    python -m evaluation where BANK KEY [--jobs N] [--out FILE]

Each bench is commissioned once, with the responses of all places. Nothing of a sealed bank is read.
With --from FILE nothing is judged: what --out wrote is scored again, with other values of the
constants `near` and `name_share` beside.
"""

import argparse
import json
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.run.check_ups import benches_of, manifest_of
from evaluation.score.seals import refuse_sealed
from smad.checkup.commission import asked
from smad.checkup.constants import shipped_constants
from smad.checkup.paired.difference import paired
from smad.checkup.verdict import decide
from smad.diagnosis.bank.intervals import wilson
from smad.diagnosis.bank.names import canonical
from smad.diagnosis.constants import shipped
from smad.diagnosis.search.locate import Located
from smad.diagnosis.spring_pair import SmaPlant

Case = dict[str, Any]

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
    "tube_stiffness": ("recoverable_strain", "force_cell_on_x", "force_cell_on_y"),
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
    "pump_bourdon": ("recoverable_strain", "force_cell_on_x", "force_cell_on_y"),
    "martensite_stabilisation": ("transformation_shift",),
}
"""Where each effect of the plant acts, in the places of the simulator; several where its equation
has a term in each or where the simulator lumps them: a force of the tube is a deflection
of its spring there."""


def _bench(bank: Path, key: Path, bench: str) -> list[Case]:
    plant, constants = SmaPlant(), shipped_constants()
    entries = json.loads((key / "KEY.json").read_text())["cases"]
    ((_, reference, cases),) = benches_of(bank, manifest_of(bank), plant, only=[bench])
    out = []
    for case, runs in cases:
        began = time.process_time()
        pairs = paired(plant, reference, runs)
        findings, located = asked(pairs, constants)
        told = decide(pairs, findings, constants, located)
        entry = entries[case]
        out.append(
            {
                "case": case,
                "bench": bench,
                "kind": entry["kind"],
                "effects": [[e["name"], e["known"], e["y_share"]] for e in entry["effects"]],
                "floors": entry["target_floors"],
                "outcome": told.outcome,
                "old": {"+".join(x.names): round(x.probability, 4) for x in told.likely},
                "told": [
                    {
                        "place": p.place,
                        "side": p.side,
                        "share": round(p.share, 4),
                        "near": p.near,
                        "terms": [t.name for t in p.terms],
                        "in_simulator": p.in_simulator,
                        "nearest": p.nearest,
                        "takes": round(p.takes, 4),
                    }
                    for p in told.places
                ],
                "whole": [told.whole.raw, told.whole.parameters, told.whole.laws],
                "seconds": round(time.process_time() - began, 2),
                **({} if located is None else _search(located)),
            }
        )
    return out


def _search(located: Located) -> Case:
    return {
        "square": located.square,
        "count": located.count,
        "ranked": [
            [s.candidate.place, s.candidate.side, round(s.share, 5), list(s.terms)]
            for s in located.where.ranked[:12]
        ],
        "steps": [
            [s.chosen.candidate.place, s.chosen.candidate.side, round(s.share, 5)]
            for s in located.where.steps
        ],
    }


def near_places(case: Case, near: float) -> list[str]:
    """The places told together with the first, by what each takes alone."""
    least = near * case["ranked"][0][2]
    return list(dict.fromkeys(r[0] for r in case["ranked"] if r[2] >= least))


def summary(cases: Sequence[Case], near: float, name_share: float) -> list[str]:
    """The score table: shares of cases with Wilson intervals."""
    noticed = [c for c in cases if c["outcome"] != "quiet"]
    placed = [c for c in noticed if c["told"]]
    listed = [c for c in placed if c["kind"] == "single"]
    unlisted = [c for c in placed if c["kind"] == "unknown"]

    def truth(case: Case) -> set[str]:
        return {p for e in case["effects"] for p in PLACES_OF[e[0]]}

    def named(case: Case) -> str:
        first = case["told"][0]
        return str(first["nearest"]) if first["takes"] >= name_share else ""

    def right(case: Case) -> bool:
        return canonical(named(case)) == canonical(case["effects"][0][0])

    quiet = [c for c in cases if c["kind"] == "none"]
    parameters = [c for c in cases if c["kind"] == "parameters"]
    pairs = [c for c in placed if c["kind"] == "pair"]
    given = [c for c in listed + unlisted if named(c)]
    rows: list[tuple[str, Sequence[Case], Callable[[Case], bool]]] = [
        ("quiet benches called changed", quiet, lambda c: c["outcome"] != "quiet"),
        ("parameters given a cause or place", parameters, lambda c: bool(c["told"])),
        ("noticed listed with a place",
         [c for c in noticed if c["kind"] == "single"], lambda c: bool(c["told"])),
        ("place right first, listed", listed, lambda c: c["told"][0]["place"] in truth(c)),
        ("place right first, unlisted", unlisted, lambda c: c["told"][0]["place"] in truth(c)),
        ("told set holds the truth, listed", listed,
         lambda c: bool(set(near_places(c, near)) & truth(c))),
        ("told set holds the truth, unlisted", unlisted,
         lambda c: bool(set(near_places(c, near)) & truth(c))),
        ("right name, of placed listed", listed, right),
        ("right name, of names given", given, right),
        ("unlisted given a name", unlisted, lambda c: bool(named(c))),
        ("pairs: both places among those told", pairs,
         lambda c: all(set(PLACES_OF[e[0]]) & {p["place"] for p in c["told"]}
                       for e in c["effects"])),
    ]  # fmt: skip
    lines = [f"near {near:g}, name_share {name_share:g}"]
    for title, asked_of, holds in rows:
        k, n = sum(map(holds, asked_of)), len(asked_of)
        low, high = wilson(k, n) if n else (0.0, 1.0)
        share = f"{k / n:.2f}" if n else "–"
        lines.append(f"{title:<42} {k:>3} of {n:<3} {share} [{low:.2f}, {high:.2f}]")
    for title, chosen in (("listed", listed), ("unlisted", unlisted)):
        if chosen:
            size = np.mean([len(near_places(c, near)) for c in chosen])
            gone = [_gone(c) for c in chosen]
            lines.append(
                f"{title}: {size:.1f} places told on average; of the change above the floor the "
                f"simulator with the laws takes {np.median(gone):.2f} (median, held out)"
            )
    if cases:
        seconds = [c["seconds"] for c in cases]
        lines.append(f"processor time {np.median(seconds):.1f} s, at most {max(seconds):.1f} s")
    return lines


def _gone(case: Case) -> float:
    """Share of the squares above the floor (1) that the laws take."""
    _, before, after = case["whole"]
    above = max(before**2 - 1.0, 1e-9)
    return float(np.clip((before**2 - after**2) / above, -1.0, 1.0))


def main(given: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m evaluation where", description=__doc__)
    parser.add_argument("bank", type=Path, nargs="?")
    parser.add_argument("key", type=Path, nargs="?")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--from", dest="known", type=Path, action="append", default=[])
    parser.add_argument("--benches", nargs="*")
    args = parser.parse_args(given)
    cases: list[Case] = [c for path in args.known for c in json.loads(path.read_text())]
    constants = shipped()
    if args.bank is not None:
        refuse_sealed(args.key)
        wanted = args.benches or sorted({c["bench"] for c in manifest_of(args.bank)["cases"]})
        with ProcessPoolExecutor(args.jobs) as pool:
            tasks = [pool.submit(_bench, args.bank, args.key, b) for b in wanted]
            for task in as_completed(tasks):
                cases += task.result()
                print(f"{len(cases)} check-ups judged", flush=True)
                if args.out:
                    args.out.write_text(json.dumps(cases, indent=1))
    print("\n".join(summary(cases, constants.near, constants.name_share)))
    if args.known:
        for near in (0.75, 0.8, 0.85, 0.9):
            for share in (0.3, 0.5, 0.7):
                print("\n" + "\n".join(summary(cases, near, share)))


if __name__ == "__main__":
    main()
