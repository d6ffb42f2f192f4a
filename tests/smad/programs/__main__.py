"""`python -m tests.smad.programs` prints the table of programs, phases and stops that are tried."""

from tests.smad.programs.table import CASES, PROGRAMS, STOPS

PHASES = ("before arming", "arming", "warm-up", "recording", "between runs", "last phase", "moving")


def lines() -> list[str]:
    """The table in Markdown: the stops of each program in each phase, all five as "all"."""
    out = [f"| program | {' | '.join(PHASES)} |", "|---|" + "---|" * len(PHASES)]
    for program in PROGRAMS:
        cells = [
            _cell([s for p, ph, s in CASES if (p, ph) == (program, phase)]) for phase in PHASES
        ]
        out.append(f"| {program} | {' | '.join(cells)} |")
    return [*out, "", f"{len(CASES)} cases."]


def _cell(stops: list[str]) -> str:
    missing = [stop for stop in STOPS if stop not in stops]
    if not stops:
        return ""
    return "all" if not missing else f"all but {', '.join(missing)}"


if __name__ == "__main__":
    print("\n".join(lines()))
