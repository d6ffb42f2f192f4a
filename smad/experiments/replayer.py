"""Runs played again on a bench, each begun from the rest that the recorded one began from."""

from dataclasses import dataclass

from smad.control.commands import DriveCurrent
from smad.control.plan import Plan
from smad.experiments.errors import ExperimentError
from smad.experiments.live import LiveDriver
from smad.experiments.rest import NEAR_K, NEAR_MM, Start, start_of_row
from smad.progress import Say

STROKE_DEGC = 45.0
STROKE_A = 2.5
LONGEST_STROKE_S = 60.0
COLD_K = 1.0
SETTLE_S = 1.0


@dataclass(eq=False, kw_only=True)
class RestFirstDriver(LiveDriver):
    """Brings the springs to a known rest before each run.

    `start` is the rest that the next run is to begin from; None: any cold one. With `strokes` each
    spring is heated once before, always in the same order, so that what the springs keep of earlier
    runs is the same every time; without, only when the bench is not at its start. `elsewhere` is
    told when it does not come to its start; without it that is an error.
    """

    start: Start | None = None
    strokes: bool = False
    elsewhere: Say | None = None

    def rest(self, plan: Plan) -> None:
        """Cool, make the strokes, and wait until the bench is where it was, or say why not."""
        self.cool(plan, COLD_K)
        if self.strokes or self._away():
            self._stroke(
                plan, DriveCurrent(i_y_A=STROKE_A, stop_spring="y", stop_above_degC=STROKE_DEGC)
            )
            self._stroke(
                plan, DriveCurrent(i_x_A=STROKE_A, stop_spring="x", stop_above_degC=STROKE_DEGC)
            )
        self.pause(plan, SETTLE_S)
        away = self._away()
        if away and self.elsewhere is not None:
            self.elsewhere(f"{plan.name} starts from another state than the run it repeats: {away}")
        elif away:
            raise ExperimentError(
                f"run {plan.name}: the bench does not return to the state in which the recorded "
                "run began",
                value=away,
                limit=f"{NEAR_MM:g} mm and {NEAR_K:g} K either way",
                action="check whether the tendon moves freely, or start from the present state "
                "with --as-is",
            )

    def _stroke(self, plan: Plan, command: DriveCurrent) -> None:
        self.client.current(command)
        self.until_done(plan, "the spring does not warm up", LONGEST_STROKE_S)
        self.cool(plan, COLD_K)

    def _away(self) -> str:
        row = self.client.status().sample
        if self.start is None or row is None:
            return ""
        return self.start.mismatch(start_of_row(row))


class InPlaceDriver(LiveDriver):
    """Begins each run where the bench is."""

    def rest(self, plan: Plan) -> None:
        """Nothing to wait for."""
