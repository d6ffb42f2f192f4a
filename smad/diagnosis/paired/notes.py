"""Notes on a comparison with good runs: what was compared, with which model, what weakens it."""

from smad.diagnosis.paired.difference import PairedRuns
from smad.diagnosis.paired.good import GoodRun


def compared(paired: PairedRuns) -> str:
    """Which runs were compared with which good ones."""
    then = {p.name: _recordings(p.then) for p in paired.pairs}
    named = ", ".join(f"{now} with {good}" for now, good in then.items())
    return f"runs of the same inputs were compared: {named}"


def notes_of(paired: PairedRuns) -> list[str]:
    """What the model of the good runs has, and facts that weaken the comparison."""
    out = []
    if effects := paired.good.point.effects:
        out.append(f"the model has what the good runs show: {', '.join(effects)}")
    if not paired.good.floor.degrees:
        out.append(
            "each run was recorded good only once: the repeat floor is a guess; record one again "
            "on another day"
        )
    for p in paired.pairs:
        if p.share < 0.98:
            out.append(
                f"{p.name} counts as far as it goes: {100 * p.share:.0f} % of it was recorded"
            )
        if p.carried:
            out.append(
                f"{p.name}: inputs differed from the good run's; the model carried that over"
            )
    if lost := _lost(paired):
        out.append(f"recorded then and not now, and left out: {lost}")
    warm = [
        f"{c} {p.around[c] - p.then.around[c]:+.1f} K in {p.name}"
        for p in paired.pairs
        for c in p.around
        if c in p.then.around and abs(p.around[c] - p.then.around[c]) > 1.0
    ]
    if warm:
        out.append("carried over by the model: " + ", ".join(warm))
    unit = {channel.name: channel.unit for channel in paired.plant.channels}
    out += [
        f"{p.name} began elsewhere than its good run ({channel} {distance:+.2g} {unit[channel]}), "
        "as runs before may have left it: that counts as a difference between days"
        for p in paired.pairs
        for channel, distance in p.away.items()
    ]
    return out


def _recordings(then: GoodRun) -> str:
    more = int(then.count.max(initial=1)) - 1
    return f"{then.name} and {more} more" if more > 0 else then.name


def _lost(paired: PairedRuns) -> str:
    """Channels that lack most of the readings that the good runs have, with the runs."""
    runs: dict[str, list[str]] = {}
    for p in paired.pairs:
        had, has = p.then.valid.sum(axis=0), p.trial.rows.valid.sum(axis=0)
        for c, then, now in zip(paired.plant.channels, p.share * had, has, strict=True):
            if now < 0.5 * then:
                runs.setdefault(c.name, []).append(p.name)
    return ", ".join(f"{channel} ({', '.join(names)})" for channel, names in runs.items())
