"""What the controller can be told to do: typed, checked, and the vocabulary of the command server.

Units are in the names. The bounds here are those of the wire and of common sense; the configured
limits are tighter and are checked when the controller takes the command. Both refuse with the
field, the value and the limit.
"""

from typing import Annotated, Any, ClassVar, Literal, get_args

import msgspec
from msgspec import Meta, Struct

from smad.config.bounds import field_and_words, value_at
from smad.errors import CommandError

LONGEST_SAMPLES = 1500
"""Points in one command: fits one message of the command server, and is checked within a control
period."""

LONGEST_INPUTS = 500
"""Rows of inputs in one command, for the same two reasons: a row holds up to eight numbers."""

Spring = Literal["x", "y"]
"""Which spring of the pair. Displacement is positive when X pulls."""

Displacement = Annotated[float, Meta(ge=-50.0, le=50.0)]
Amplitude = Annotated[float, Meta(ge=0.0, le=50.0)]
Duration = Annotated[float, Meta(gt=0.0, le=86_400.0)]
Frequency = Annotated[float, Meta(gt=0.0, le=50.0)]
Count = Annotated[int, Meta(ge=1, le=10_000)]
Current = Annotated[float, Meta(ge=0.0, le=4.0)]
Duty = Annotated[float, Meta(ge=0.0, le=1.0)]
Temperature = Annotated[float, Meta(ge=0.0, le=120.0)]
Gain = Annotated[float, Meta(ge=0.0, le=1000.0)]
TemperatureGain = Annotated[float, Meta(ge=0.0, le=100.0)]

Times = tuple[Annotated[float, Meta(ge=0.0, le=86_400.0)], ...]
Currents = Annotated[tuple[Current, ...], Meta(max_length=LONGEST_INPUTS)]
Duties = Annotated[tuple[Duty, ...], Meta(max_length=LONGEST_INPUTS)]
Drains = Annotated[tuple[bool, ...], Meta(max_length=LONGEST_INPUTS)]
Recorded = tuple[Annotated[float, Meta(ge=-1000.0, le=1000.0)] | None, ...]
"""What a sensor showed at each row; None where it showed nothing."""
Watched = Annotated[
    Recorded, Meta(max_length=LONGEST_INPUTS, description="recorded; empty: not watched")
]


class Piece(Struct, tag_field="kind", frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A piece of motion; `kind` says which.

    `smad move` has a command for each, made from its fields: one without a default is an argument,
    one with a default an option. In `extra`, `usual` makes an option of a field that has no
    default, and `option` gives it another name. `word` is the command's name, if not the tag.
    """

    word: ClassVar[str] = ""


class Command(Struct, tag_field="mode", frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Something to tell the controller; `mode` says what."""


class Step(Piece, tag="step", frozen=True, kw_only=True):
    """Jump to a displacement and stay there."""

    displacement_mm: Annotated[Displacement, Meta(description="where to go")]
    duration_s: Annotated[
        Duration, Meta(description="how long to stay", extra={"option": "for", "usual": 10.0})
    ]


class Hold(Piece, tag="hold", frozen=True, kw_only=True):
    """Stay where the reference is."""

    duration_s: Annotated[Duration, Meta(description="how long to stay")]


class Ramp(Piece, tag="ramp", frozen=True, kw_only=True):
    """Go to a displacement at a constant speed."""

    displacement_mm: Annotated[Displacement, Meta(description="where to go")]
    rate_mm_per_s: Annotated[
        float, Meta(gt=0.0, le=1000.0, description="how fast", extra={"usual": 2.0})
    ]


class Sine(Piece, tag="sine", frozen=True, kw_only=True):
    """A sinusoid that starts at its offset, going up."""

    amplitude_mm: Annotated[Amplitude, Meta(description="from the offset to a peak")]
    period_s: Annotated[Duration, Meta(description="length of one cycle")]
    cycles: Annotated[Count, Meta(description="how many cycles", extra={"usual": 3})]
    offset_mm: Annotated[Displacement, Meta(description="middle of the motion")] = 0.0


class Chirp(Piece, tag="chirp", frozen=True, kw_only=True):
    """A sinusoid with a linear sweep of its frequency."""

    amplitude_mm: Annotated[Amplitude, Meta(description="from the offset to a peak")]
    start_Hz: Annotated[Frequency, Meta(description="frequency at the beginning")]
    end_Hz: Annotated[Frequency, Meta(description="frequency at the end")]
    duration_s: Annotated[
        Duration, Meta(description="how long in all", extra={"option": "for", "usual": 60.0})
    ]
    offset_mm: Annotated[Displacement, Meta(description="middle of the motion")] = 0.0


class Staircase(Piece, tag="staircase", frozen=True, kw_only=True):
    """Equal steps from the reference, one way or there and back."""

    step_mm: Annotated[Displacement, Meta(description="height of a step, negative goes down")]
    steps: Annotated[Count, Meta(description="how many steps")]
    dwell_s: Annotated[Duration, Meta(description="how long on each step", extra={"usual": 10.0})]
    there_and_back: Annotated[
        bool, Meta(description="return the same way", extra={"option": "back"})
    ] = False


class RandomLevels(Piece, tag="random_levels", frozen=True, kw_only=True):
    """Random levels within ±amplitude, drawn with the seed."""

    word: ClassVar[str] = "random"

    amplitude_mm: Annotated[Amplitude, Meta(description="largest distance from the offset")]
    levels: Annotated[Count, Meta(description="how many levels")]
    dwell_s: Annotated[Duration, Meta(description="how long on each level", extra={"usual": 10.0})]
    seed: Annotated[
        int, Meta(ge=0, le=2**32 - 1, description="seed of the levels", extra={"usual": 0})
    ]
    offset_mm: Annotated[Displacement, Meta(description="middle of the motion")] = 0.0


class Samples(Piece, tag="samples", frozen=True, kw_only=True):
    """Given points, joined by straight lines. The first time is 0 and times increase."""

    t_s: Annotated[
        Times, Meta(min_length=2, max_length=LONGEST_SAMPLES, description="times of the points")
    ]
    displacement_mm: Annotated[
        tuple[Displacement, ...],
        Meta(min_length=2, max_length=LONGEST_SAMPLES, description="displacements of the points"),
    ]


Trajectory = Step | Hold | Ramp | Sine | Chirp | Staircase | RandomLevels | Samples
"""A piece of motion. Pieces queue one after the other."""

PIECES: tuple[type[Piece], ...] = get_args(Trajectory)
"""Every kind of piece."""


class Idle(Command, tag="idle", frozen=True, kw_only=True):
    """No current, no water. Ends whatever runs."""


class Follow(Command, tag="displacement", frozen=True, kw_only=True):
    """PI control on displacement along the trajectories; afterwards it holds the last reference."""

    trajectories: Annotated[
        tuple[Trajectory, ...],
        Meta(min_length=1, max_length=1000, description="pieces, one after the other"),
    ]
    queue: Annotated[bool, Meta(description="append to what runs instead of replacing it")] = False


class HoldTemperature(Command, tag="temperature", frozen=True, kw_only=True):
    """PI control on the temperature of one spring; the other gets neither current nor water.

    With `rate_K_per_s` the target ramps from the present temperature. Without `duration_s` it holds
    until another command; with it, the mode is done that long after the ramp's end, and holds on.
    """

    spring: Annotated[Spring, Meta(description="which spring to heat")]
    temperature_degC: Annotated[Temperature, Meta(description="what to hold")]
    rate_K_per_s: Annotated[
        Annotated[float, Meta(gt=0.0, le=50.0)] | None,
        Meta(description="ramp to it at this rate; empty: at once"),
    ] = None
    duration_s: Annotated[Duration | None, Meta(description="how long to hold")] = None
    use_water: Annotated[bool, Meta(description="run this spring's pump while it is too warm")] = (
        True
    )


class DriveCurrent(Command, tag="current", frozen=True, kw_only=True):
    """Plain currents and pump duties, without feedback; idle afterwards.

    Ends after `duration_s`, or as soon as the spring `stop_spring` has reached `stop_above_degC` or
    fallen to `stop_below_degC`, whichever is first. Host limits apply as in every mode.
    """

    i_x_A: Annotated[Current, Meta(description="current in spring X")] = 0.0
    i_y_A: Annotated[Current, Meta(description="current in spring Y")] = 0.0
    pump_x_duty: Annotated[Duty, Meta(description="duty of the pump of spring X")] = 0.0
    pump_y_duty: Annotated[Duty, Meta(description="duty of the pump of spring Y")] = 0.0
    drain_x: Annotated[bool, Meta(description="let the water out of the tube of spring X")] = False
    drain_y: Annotated[bool, Meta(description="let the water out of the tube of spring Y")] = False
    duration_s: Annotated[Duration | None, Meta(description="how long; empty: no end")] = None
    stop_spring: Annotated[Spring, Meta(description="whose temperature ends it")] = "x"
    stop_above_degC: Annotated[
        Temperature | None, Meta(description="end when that spring is at least this warm")
    ] = None
    stop_below_degC: Annotated[
        Temperature | None, Meta(description="end when that spring is at most this warm")
    ] = None


class FollowInputs(Command, tag="inputs", frozen=True, kw_only=True):
    """Currents and pump duties as they were recorded, without feedback; idle afterwards.

    Each row holds until the next one, the last until `end_s`; times count from the first sample.
    With readings, the motion ends as soon as one is further from the recorded one than
    `control.repeat` allows. Host limits apply as in every mode.
    """

    t_s: Annotated[
        Times, Meta(min_length=1, max_length=LONGEST_INPUTS, description="when each row begins")
    ]
    end_s: Annotated[Duration, Meta(description="when the last row ends")]
    i_x_A: Annotated[Currents, Meta(description="current in spring X, for each row")]
    i_y_A: Annotated[Currents, Meta(description="current in spring Y")]
    pump_x_duty: Annotated[Duties, Meta(description="duty of the pump of spring X")]
    pump_y_duty: Annotated[Duties, Meta(description="duty of the pump of spring Y")]
    drain_x: Annotated[Drains, Meta(description="drain the tube of spring X; empty: never")] = ()
    drain_y: Annotated[Drains, Meta(description="drain the tube of spring Y; empty: never")] = ()
    displacement_mm: Watched = ()
    rtd_x_degC: Watched = ()
    rtd_y_degC: Watched = ()
    force_N: Watched = ()
    queue: Annotated[
        bool, Meta(description="go on where the rows that run end, instead of beginning anew")
    ] = False


class MoveStage(Command, tag="stage", frozen=True, kw_only=True):
    """Move the stretching stage, beside whatever else runs (a bench with a stage only)."""

    stage_mm: Annotated[
        float, Meta(ge=0.0, le=200.0, description="extension of the spring by the stage")
    ]
    rate_mm_per_s: Annotated[float, Meta(gt=0.0, le=100.0, description="how fast")]


class Tune(Command, tag="tune", frozen=True, kw_only=True):
    """Change gains and options of the running controller, without a bump. Empty fields stay."""

    kp_A_per_mm: Annotated[Gain | None, Meta(description="proportional gain")] = None
    ki_A_per_mm_s: Annotated[Gain | None, Meta(description="integral gain")] = None
    hold_band_mm: Annotated[
        Annotated[float, Meta(ge=0.0, le=1.0)] | None, Meta(description="band of a quiet hold")
    ] = None
    temperature_kp_A_per_K: Annotated[
        TemperatureGain | None,
        Meta(description="proportional gain on temperature, from the next hold on"),
    ] = None
    temperature_ki_A_per_K_s: Annotated[
        TemperatureGain | None,
        Meta(description="integral gain on temperature, from the next hold on"),
    ] = None
    current_limit_A: Annotated[
        Current | None, Meta(description="largest current; never above the configured one")
    ] = None
    cooling: Annotated[
        Literal["switch", "proportional", "off"] | None, Meta(description="cooling mode")
    ] = None
    feedforward: Annotated[
        bool | None, Meta(description="add the inverse of the model to the PI output")
    ] = None
    drain_before_heating: Annotated[
        bool | None, Meta(description="let the water out of a tube while its spring is heated")
    ] = None


ModeCommand = Idle | Follow | HoldTemperature | DriveCurrent | FollowInputs | MoveStage | Tune
"""Everything `Controller.command` takes."""


def checked(command: ModeCommand) -> ModeCommand:
    """`command` itself when every field is within its bounds.

    Commands that come over the wire are checked when they are decoded; this is for those made in
    Python. Raises CommandError, naming the field, the value and the limit.
    """
    return decoded(msgspec.to_builtins(command))


def decoded(fields: Any) -> ModeCommand:
    """The command that `fields` (JSON objects as dicts) describes. Raises CommandError."""
    try:
        # NaN passes no bound, and every float here has one.
        command: ModeCommand = msgspec.convert(fields, type=ModeCommand)
    except msgspec.ValidationError as refused:
        field, words = field_and_words(str(refused))
        raise CommandError(
            f"the command is not valid: {f'{field}: ' if field else ''}{words}",
            value=value_at(fields, field),
            action="nothing was changed",
        ) from None
    return command
