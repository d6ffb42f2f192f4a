"""Positive and negative controls on the simulated spring pair: `python -m bench.controls`.

The simulator is its own bench here, through controller, sensors and noise, with other parameter
values. It shows what the tests' tiny plant cannot: which effects of the real library are named,
which are rejected when they are taken out of it, and which these runs cannot separate. A good score
here flatters; the withheld check is what counts.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click

from smad.gap import Settings, diagnose
from smad.diagnosis.plant import ModelPoint
from smad.gap.records import Diagnosis, Outcome
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair import SmaPlant
from smad.diagnosis.spring_pair.recorded import recorded

FAMILIES = ("pulses", "levels", "stairs", "mixed")
HELD = ("sines", "quick levels")
OTHER_BENCH = {
    "resistivity": 0.95, "modulus_martensite": 0.94, "flow_max": 0.93, "stress_start": 0.95,
    "heat_capacity_heating": 1.06, "latent_heating": 0.92,
}  # fmt: skip
SHIFTS_K = {"austenite_start": 0.8, "martensite_start": -0.5}
FAR_OFF = 0.15


@dataclass(frozen=True)
class Control:
    """A case: what the bench has, what the library lacks, and the answers that count as right."""

    name: str
    bench: ModelPoint
    right: frozenset[str]
    without: tuple[str, ...] = ()
    variant: str = "extended"


def other_bench(plant: SmaPlant) -> dict[str, float]:
    """Parameters of another bench, 5 to 8 % and up to 0.8 K off."""
    values = {n: plant.parameter_set[n] * f for n, f in OTHER_BENCH.items()}
    return values | {n: plant.parameter_set[n] + k for n, k in SHIFTS_K.items()}


def controls(plant: SmaPlant, level: float) -> Iterable[Control]:
    """All controls; `level` scales the typical strength of the effects."""
    theta = other_bench(plant)
    yield Control("itself", ModelPoint({}), frozenset({Outcome.NO_GAP}))
    far = {
        n: plant.parameter_set[n] * (1 + FAR_OFF * sign)
        for n, sign in (("resistivity", 1), ("flow_max", -1), ("modulus_martensite", -1))
    }
    for name, values in (("other parameters", theta), ("15 % off", far)):
        yield Control(name, ModelPoint(values), frozenset({Outcome.PARAMETERS}))
    for e in plant.effects:
        point = ModelPoint(theta, {e.name: e.at(level)})
        yield Control(e.name, point, frozenset({e.name}))
        yield Control(f"{e.name} left out", point, frozenset({Outcome.UNKNOWN}), (e.name,))
    yield Control(
        "water_warming in the printed model",
        ModelPoint(theta),
        frozenset({"water_warming"}),
        variant="printed",
    )
    named = {e.name: e for e in plant.effects}
    for a, b in (("rtd_lag", "driver_gain"), ("pump_lag", "force_offset")):
        effects = {a: named[a].at(level), b: named[b].at(level)}
        yield Control(f"{a} and {b}", ModelPoint(theta, effects), frozenset({a, b}))


def run_control(control: Control, settings: Settings) -> Diagnosis:
    """Makes the runs of a control and diagnoses them."""
    bench = SmaPlant()
    runs = [recorded(f, bench, control.bench, i) for i, f in enumerate(FAMILIES)]
    held = [recorded(f, bench, control.bench, 50 + i) for i, f in enumerate(HELD)]
    plant = SmaPlant(variant=control.variant)
    kept = tuple(e.name for e in plant.effects if e.name not in control.without)
    return diagnose(runs, plant=replace(plant, only=kept), hold_out=held, settings=settings)


def answered(control: Control, diagnosis: Diagnosis) -> str:
    """ "right", "in group" (named among what cannot be told apart) or "wrong"."""
    v = diagnosis.verdict
    said = frozenset(v.effects) if v.effects else frozenset({v.outcome.value})
    if said == control.right:
        return "right"
    return "in group" if control.right <= said | frozenset(v.group) else "wrong"


def negative(runs: Sequence[GapRun]) -> dict[str, list[GapRun]]:
    """Spoilt copies of good runs, by the kind of finding that each must give."""
    import numpy as np

    def swapped(r: GapRun) -> GapRun:
        pairs = {"rtd_x_degC": "rtd_y_degC", "rtd_y_degC": "rtd_x_degC"}
        return r.with_columns(outputs={a: r.outputs[b] for a, b in pairs.items()})

    def shuffled(r: GapRun) -> GapRun:
        order = np.random.default_rng(1).permutation(len(r.t_s))
        return r.with_columns(inputs={k: v[order] for k, v in r.inputs.items()})

    def constant(r: GapRun) -> GapRun:
        return r.with_columns(outputs={"rtd_x_degC": np.full_like(r.t_s, 26.85)})

    spoil: dict[str, Callable[[GapRun], GapRun]] = {
        "swapped channels": swapped,
        "inputs do not drive the outputs": shuffled,
        "constant channel": constant,
        "too short": lambda r: r.part(0, 300),
        "truncated": lambda r: replace(r.part(0, 4000), cut_short=True),
    }
    return {kind: [make(r) for r in runs] for kind, make in spoil.items()}


@click.command()
@click.option("--level", default=0.6, show_default=True, help="Strength, in typical ones.")
@click.option("--only", multiple=True, help="Controls whose name begins so.")
@click.option("--json", "path", type=click.Path(path_type=Path), help="Write the answers here.")
def main(level: float, only: tuple[str, ...], path: Path | None) -> None:
    """Run the controls one after the other and print each answer."""
    plant, settings = SmaPlant(), Settings()
    rows = []
    for control in controls(plant, level):
        if only and not any(control.name.startswith(o) for o in only):
            continue
        d = run_control(control, settings)
        v = d.verdict
        verdict = answered(control, d)
        rows.append({"control": control.name, "answer": verdict, "text": v.text})
        said = " + ".join(v.effects) or v.outcome.value
        group = f" (or {', '.join(v.group)})" if v.group else ""
        click.echo(
            f"{verdict:<9} {control.name:<40} {said}{group}  "
            f"S {v.shrink:.2f}  {v.gap_raw:.1f}→{v.gap_refit:.1f}→{v.gap_final:.1f}  "
            f"{d.seconds:.0f} s"
        )
        sys.stdout.flush()
    if not only or "negative" in only:
        good = [recorded(f, plant, ModelPoint(other_bench(plant)), 7) for f in FAMILIES[:2]]
        for kind, spoilt in negative(good).items():
            d = diagnose(spoilt, plant=plant, settings=settings)
            found = sorted({f.kind for f in d.findings})
            verdict = "right" if kind in found and not d.verdict.effects else "wrong"
            rows.append({"control": kind, "answer": verdict, "text": d.verdict.text})
            click.echo(f"{verdict:<9} {kind:<40} {', '.join(found)}; {d.verdict.outcome.value}")
    right = sum(r["answer"] != "wrong" for r in rows)
    click.echo(f"{right} of {len(rows)} right or in the group")
    if path is not None:
        path.write_text(json.dumps(rows, indent=1, ensure_ascii=False))


if __name__ == "__main__":
    main()
