"""The recipes of "Where a change belongs": one made-up addition of each kind."""

from tests.recipes.steps import Generate, Insert, Recipe

REQUEST = Recipe(
    "message to the board",
    (
        Insert(
            "its class",
            "firmware_protocol/messages.py",
            '''class Blink(Message, frozen=True, gc=False):
    """Lets the board's lamp blink, to find it among others."""

    info = MessageInfo(number=0x30, direction=Direction.TO_BOARD, pace="request", replies=("Done",))
    axis: Annotated[int, Wire("u8", "axis")]
    times: Annotated[int, Wire("u8", "how often")]


''',
            before="MESSAGES: tuple[type[Message], ...] = (",
        ),
        Insert(
            "its line in MESSAGES",
            "firmware_protocol/messages.py",
            "    Blink,\n",
            before="    Ident,\n    Description,\n",
        ),
        Insert(
            "the board's event",
            "firmware_protocol/events.py",
            '''class BlinkRequested(BoardEvent, frozen=True, gc=False):
    """Answer with DONE."""

    request: Request


''',
            before="class ClearFaultRequested(",
        ),
        Insert(
            "the handler of the board's session",
            "firmware_protocol/board.py",
            "            m.Blink: lambda _, request, __: e.BlinkRequested(request),\n",
            before="            m.Describe: self._on_describe,\n",
        ),
        Insert(
            "what the simulated board does",
            "sim_device/commands.py",
            "            heard.BlinkRequested: lambda e, us: board.session.done(e.request, us),\n",
            before="            heard.ParameterChanged: self._parameter,\n",
        ),
        Insert(
            "its place among the firmware's messages",
            "firmware/core/inbox.h",
            "    struct smad_blink blink;\n",
            before="    struct smad_time_request time_request;\n",
        ),
        Insert(
            "how the firmware reads it",
            "firmware/core/inbox.c",
            """    case SMAD_BLINK_NUMBER:
        return as_reading(smad_unpack_blink(&m->blink, data, size));
""",
            before="    case SMAD_TIME_REQUEST_NUMBER:\n",
        ),
        Insert(
            "what the firmware does",
            "firmware/core/session.c",
            """    case SMAD_BLINK_NUMBER:
        session_done(now_us);
        break;
""",
            before="    case SMAD_PARAM_SAVE_NUMBER:\n",
        ),
        Generate(),
    ),
    (
        "tests/firmware_protocol/test_every_message.py",
        "tests/sim_device/test_told_anything.py::test_the_board_acts_on_every_event_of_its_session",
        "tests/firmware/test_session.py::test_every_request_of_the_table_is_carried_out_and_its_axis_is_looked_at[host]",
    ),
)

NEWS = Recipe(
    "message to the host",
    (
        Insert(
            "its class",
            "firmware_protocol/messages.py",
            '''class ButtonPressed(Message, frozen=True, gc=False):
    """Somebody pressed the button on the board."""

    info = MessageInfo(number=0xA0, direction=Direction.TO_HOST, pace="when it happens")
    t_us: Annotated[int, Wire("u32", "board time when it was pressed", unit="us")]


''',
            before="MESSAGES: tuple[type[Message], ...] = (",
        ),
        Insert(
            "its line in MESSAGES",
            "firmware_protocol/messages.py",
            "    ButtonPressed,\n",
            before=')\n"""All messages, in the order of the document."""',
        ),
        Insert(
            "the host's event",
            "firmware_protocol/events.py",
            '''class ButtonReported(HostEvent, frozen=True, gc=False):
    """Somebody pressed the button on the board."""

    t_us: int


''',
            before="class ErrorReceived(",
        ),
        Insert(
            "the handler of the host's session",
            "firmware_protocol/host.py",
            "            m.ButtonPressed: lambda it, _, to: to.append(e.ButtonReported(it.t_us)),\n",  # noqa: E501
            before="            m.Description: self._on_reply,\n",
        ),
        Insert(
            "what the daemon does",
            "smad/daemon/link/watch.py",
            """            case ButtonReported():
                self._say("note", "somebody pressed the button on the board", {})
""",
            before="            case ErrorReceived(error):\n",
        ),
        Insert(
            "its import in the daemon",
            "smad/daemon/link/watch.py",
            "    ButtonReported,\n",
            before="    Connected,\n",
        ),
        Generate(),
    ),
    (
        "tests/firmware_protocol/test_every_message.py",
        "tests/smad/daemon/test_small_parts.py::"
        "test_every_event_of_a_session_is_taken_by_the_daemon",
    ),
)

BOARD = Recipe(
    "board type",
    (
        Insert(
            "its class",
            "sim_device/undrained.py",
            '''"""A board without a drain valve."""

from collections.abc import Mapping
from typing import ClassVar

from firmware_protocol.enums import Capability
from sim_device.board import CAPABILITIES, Board


class UndrainedBoard(Board):
    """A board whose tubes stay full."""

    capabilities: ClassVar[Mapping[str, int]] = {
        fixture: has & ~Capability.DRAIN for fixture, has in CAPABILITIES.items()
    }
''',
        ),
        Insert(
            "its line in BOARDS",
            "smad/processes/boards.py",
            """    "undrained": BoardType(
        about="a model without a drain valve",
        baud=921_600,
        bench=partial(_python, "sim_device.undrained:UndrainedBoard"),
    ),
""",
            before='    "host": BoardType(\n',
        ),
    ),
    (
        "tests/smad/test_boards.py::"
        "test_a_board_of_the_table_says_the_speed_of_the_table[undrained]",
    ),
)

KEY = Recipe(
    "key of the configuration",
    (
        Insert(
            "its field",
            "smad/config/model.py",
            """    automatic_name: Annotated[
        str,
        Meta(
            pattern=r"^[A-Za-z0-9_-]{0,32}\\Z",
            description="name of the logs that arming starts; empty: run",
        ),
    ] = ""
""",
            before="    max_file_MB: Annotated[",
        ),
        Insert(
            "where the daemon reads it",
            "smad/daemon/command/arming.py",
            "bench.config.recorder.automatic_name or ",
            before='"", by_command=False)',
        ),
    ),
    (
        "tests/smad/test_config.py",
        "tests/smad/daemon/test_service.py::"
        "test_arming_records_by_itself_and_the_log_ends_after_cooling",
    ),
)

CHANNEL = Recipe(
    "channel",
    (
        Insert(
            "its field",
            "smad/runlog/schema.py",
            """\
    heat_x_W: Annotated[float | None, _of("W", "i_meas, v", "heat into the wire, X")] = None
    heat_y_W: Annotated[float | None, _of("W", "i_meas, v", "heat into the wire, Y")] = None
""",
            before="    duty_x: Annotated[\n",
        ),
        Insert(
            "its value",
            "smad/runlog/rows.py",
            """        heat_x_W=sample.i_meas_A[0] * sample.v_V[0],
        heat_y_W=sample.i_meas_A[1] * sample.v_V[1],
""",
            before="        duty_x=",
        ),
        Generate(),
    ),
    (
        "tests/smad/runlog/test_schema.py",
        "tests/smad/daemon/test_control.py::test_a_step_is_followed_and_recorded_samples_say_so",
        "tests/smad/view/test_forms_and_state.py",
    ),
)

IMPORT = Recipe(
    "file format of records",
    (
        Insert(
            "its reader",
            "smad/records/tab_table.py",
            '''"""Tables whose columns are tabulated."""

from pathlib import Path

from smad.records.csv_table import CsvFormat, CsvTable, open_csv


def open_tab(path: Path, form: CsvFormat) -> CsvTable:
    """The table at `path`. Raises LogImportError when it cannot be read."""
    return open_csv(path, form)
''',
        ),
        Insert(
            "its import",
            "smad/records/tables.py",
            "from smad.records.tab_table import open_tab\n",
            before="from smad.runlog.bounds import require_bounded\n",
        ),
        Insert(
            "its line in _OPEN",
            "smad/records/tables.py",
            '    ".tab": open_tab,\n',
            before='    **dict.fromkeys((".csv"',
        ),
        Insert("the guide", "docs/guide/run-logs.md", "TAB, ", before="LVM and gzipped"),
    ),
    ("tests/smad/records/test_tables.py",),
)

EXPORT = Recipe(
    "format of an export",
    (
        Insert(
            "what writes it",
            "smad/runlog/export.py",
            """def _write_npz(run: Run, path: Path) -> None:
    arrays: dict[str, Any] = {"header": np.array(header_document(run)), **_used(run)}
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


""",
            before="WRITERS: Mapping[",
        ),
        Insert(
            "its row in WRITERS",
            "smad/runlog/export.py",
            '    ".npz": _write_npz,\n',
            before='    ".mat": _write_mat,\n',
        ),
        Insert("its name", "smad/runlog/formats.py", '"npz", ', before='"mat", "rosbag2"'),
        Insert(
            "the guide",
            "docs/guide/run-logs.md",
            "| `.npz` | an array for each channel | `header` (JSON text) |\n",
            before="| `.mat` | ",
        ),
    ),
    ("tests/smad/runlog/test_export_import.py", "tests/smad/runlog/test_log_commands.py"),
)

HOOK = Recipe(
    "event of the hooks",
    (
        Insert("its name", "smad/hooks/events.py", '"on_room_hot", ', before='"on_disk_low"]'),
        Insert(
            "when it happens",
            "smad/hooks/events.py",
            """    def _of_room(self, look: Observation) -> Iterator[Event]:
        sample = None if look.status is None else look.status.sample
        degC = None if sample is None else sample.rtd_ambient_degC
        hot = degC is not None and degC > self._config.room_hot_degC
        if hot and not self._room_told:
            yield self._event(look, "on_room_hot", f"the room has {degC:.1f} °C")
        self._room_told = hot

""",
            before="    def _of_disk(",
        ),
        Insert(
            "what was told",
            "smad/hooks/events.py",
            "        self._room_told = False\n",
            before="        self._runner_told = False\n",
        ),
        Insert(
            "its call",
            "smad/hooks/events.py",
            "*self._of_room(look), ",
            before="*self._of_disk(look)]",
        ),
        Insert(
            "its keys",
            "smad/config/hooks.py",
            """\
    on_room_hot: Annotated[Command, about("the room is warmer than `room_hot_degC`")] = ()
    room_hot_degC: Annotated[float, between(-40.0, 200.0, "temperature of the room")] = 35.0
""",
            before="    timeout_s: ",
        ),
        Insert(
            "its test",
            "tests/smad/hooks/test_events.py",
            """def test_a_hot_room_is_told_once() -> None:
    sample = Telemetry(timestamp=1.0, sequence=1, t_s=1.0, rtd_ambient_degC=40.0)
    hot = msgspec.structs.replace(STATUS, sample=sample)
    assert [event for event, _ in told(look(0, hot), look(1, hot))] == ["on_room_hot"]


""",
            before="def test_every_event_has_its_key",
        ),
        Insert(
            "the test's import",
            "tests/smad/hooks/test_events.py",
            "    Telemetry,\n",
            before="    Timing,\n",
        ),
    ),
    ("tests/smad/hooks/test_events.py", "tests/smad/test_config.py"),
)

FAULT = Recipe(
    "fault to inject",
    (
        Insert(
            "its row",
            "sim_device/faults.py",
            """\
    FaultKind("driver_locked", "actuator", "a driver locks itself", _driver("open"), None, _X,
              (Fault.DRIVER_OPEN,), 2.0),
""",
            before='    FaultKind("wire_cut"',
        ),
        Insert(
            "its row in the campaign",
            "campaign/faults/catalogue.py",
            """\
    _of("driver_locked", Then.STOPS, _X, must=frozenset({"heating", "water", "air"})),
""",
            before='    _of("wire_cut"',
        ),
        Insert(
            "its case",
            "tests/sim_device/test_faults.py",
            '    "driver_locked": ({}, FULL),\n',
            before='    "wire_cut": (',
        ),
    ),
    (
        "tests/sim_device/test_faults.py",
        "tests/campaign/test_lockstep.py::test_every_fault_of_the_device_is_in_the_campaign",
    ),
)

CHECK = Recipe(
    "safety check",
    (
        Insert(
            "the fault's number",
            "firmware_protocol/enums.py",
            "    SUPPLY_HIGH = 32\n",
            before="\n\nclass Warning(enum.IntEnum):",
        ),
        Insert(
            "the fault's text",
            "firmware_protocol/supervisor/faults.py",
            """    Fault.SUPPLY_HIGH: FaultText(
        "mV",
        False,
        "The supply voltage is above what the driver stands.",
        "Set the power supply to 12 V.",
    ),
""",
            before="    Fault.LOOP_OVERRUN: FaultText(\n",
        ),
        Insert(
            "its limit",
            "firmware_protocol/supervisor/limits.py",
            '    supply_high_mV: Annotated[int, Row(15_000, 15_000, "mV", "driver: 18 V")]\n',
            before='    pump_rpm: Annotated[int, Row(6000, 6000, "rpm"',
        ),
        Insert(
            "the check",
            "firmware_protocol/supervisor/checks.py",
            '''def supply_high(s: Memory, m: Measurements, lim: Limits, k: int) -> int:
    """The supply is above what the driver stands."""
    if m.vbus_mV > lim.supply_high_mV:
        return bad(s, m.vbus_mV, lim.supply_high_mV)
    return GOOD


''',
            before="def sensor_open(",
        ),
        Insert(
            "its row of the check table",
            "firmware_protocol/supervisor/table.py",
            """    _row(
        Fault.SUPPLY_HIGH, checks.supply_high, _BOARD, ALWAYS,
        "supply > {supply_high_mV}", samples=_TWO,
    ),
""",
            before='    _row(Fault.LEAK, checks.leak, _BOARD, ALWAYS, "leak',
        ),
        Insert(
            "a case that trips it",
            "tests/firmware_protocol/supervisor/test_checks.py",
            '    ("supply high", put("vbus_mV", 15_001), Fault.SUPPLY_HIGH, 4, 0.02, 0.02),\n',
            before='    ("parameters damaged", put("parameters_ok", 0)',
        ),
        Generate(),
    ),
    (
        "tests/firmware_protocol/supervisor/test_checks.py",
        "tests/firmware_protocol/supervisor/test_limits.py",
    ),
)

TRAJECTORY = Recipe(
    "trajectory",
    (
        Insert(
            "its class",
            "smad/control/commands.py",
            '''class Triangle(Piece, tag="triangle", frozen=True, kw_only=True):
    """To a displacement and back, both at a constant speed."""

    displacement_mm: Annotated[Displacement, Meta(description="where to turn")]
    rate_mm_per_s: Annotated[float, Meta(gt=0.0, le=1000.0, description="how fast")]


''',
            before="class Sine(Piece",
        ),
        Insert(
            "its place in the union",
            "smad/control/commands.py",
            "Triangle | ",
            before="Step | Hold | Ramp | Sine",
        ),
        Insert(
            "how it is followed",
            "smad/control/trajectories.py",
            """def _triangle(piece: Triangle, from_m: float) -> Compiled:
    to_m = piece.displacement_mm * MM
    rate = piece.rate_mm_per_s * MM
    turn_s = abs(to_m - from_m) / rate
    sign = math.copysign(1.0, to_m - from_m)
    return Compiled(
        lambda t: to_m - sign * rate * abs(turn_s - t),
        2.0 * turn_s,
        from_m,
        from_m,
        min(from_m, to_m),
        max(from_m, to_m),
        rate,
    )


""",
            before="def _sine(piece: Sine",
        ),
        Insert(
            "its row of the table of kinds",
            "smad/control/trajectories.py",
            '    Triangle: _Kind(_triangle, "displacement_mm", "rate_mm_per_s"),\n',
            before="    Sine: _Kind(_sine",
        ),
        Insert(
            "its import there",
            "smad/control/trajectories.py",
            "    Triangle,\n",
            before=")\nfrom smad.errors import CommandError",
        ),
        Insert(
            "an example for the test of what the limits look at",
            "tests/smad/control/test_trajectories.py",
            "        Triangle(displacement_mm=3.0, rate_mm_per_s=2.0),\n",
            before="        Sine(amplitude_mm=2.0, period_s=4.0, cycles=2, offset_mm=1.0),\n",
        ),
        Insert(
            "the example's import",
            "tests/smad/control/test_trajectories.py",
            "    Triangle,\n",
            before=")\nfrom smad.control.trajectories import KINDS",
        ),
        Insert(
            "an example for the soak",
            "campaign/soak/draws.py",
            "        lambda: Triangle(displacement_mm=_place(rng), rate_mm_per_s=5.0),\n",
            before="        lambda: Sine(\n",
        ),
        Insert(
            "its import in the soak",
            "campaign/soak/draws.py",
            "    Triangle,\n",
            before="    Tune,\n",
        ),
        Generate(),
    ),
    (
        "tests/smad/control/test_trajectories.py",
        "tests/smad/cli/test_move.py",
        "tests/campaign/test_soak.py::test_a_soak_draws_every_trajectory",
    ),
)

COMMAND = Recipe(
    "command",
    (
        Insert(
            "its parameters",
            "smad/api/methods.py",
            '''class Greet(Params, frozen=True, kw_only=True):
    """Nothing but an answer."""


''',
            before="class ResetTiming(",
        ),
        Insert(
            "its row in METHODS",
            "smad/api/methods.py",
            '    Method("greet", Greet, Motion, "watch"),\n',
            before='    Method("timing.reset", ResetTiming',
        ),
        Insert(
            "what the service does",
            "smad/daemon/command/service.py",
            '''    def greet(self, params: api.Greet, caller: Caller) -> api.Motion:
        """Nothing but an answer."""
        return self._status.motion(self._bench.named(caller.axes))

''',
            before="    def timing_reset(self, params",
        ),
        Insert(
            "the clients' method",
            "smad/client/async_commands.py",
            '''    async def greet(self) -> api.Motion:
        """Nothing but an answer."""
        return await self._call(api.Greet(), api.Motion)

''',
            before="    async def reset_timing",
        ),
        Insert(
            "its call in the clients' test",
            "tests/smad/test_client.py",
            "        client.greet,\n",
            before="        lambda: client.move(Step(displacement_mm=1.0, duration_s=1.0)),\n",
        ),
        Insert(
            "how often a soak draws it",
            "campaign/soak/draws.py",
            '    "greet": Drawn(0.2, lambda rng: api.Greet()),\n',
            before='    "timing.reset": Drawn',
        ),
        Generate("its seed", ("-m", "campaign.fuzz.seeds")),
        Generate(),
    ),
    (
        "tests/smad/daemon/test_service.py::"
        "test_every_method_of_the_api_is_carried_out_by_the_service",
        "tests/smad/test_client.py::test_there_is_a_client_method_for_every_method_of_the_api",
        "tests/campaign/test_soak.py::"
        "test_every_method_can_be_drawn_and_what_is_no_command_is_named",
        "tests/campaign/fuzz/test_corpus.py::"
        "test_the_seeds_are_in_the_corpus_and_small_enough_to_be_mutated[commands]",
    ),
)

EXPERIMENT = Recipe(
    "experiment",
    (
        Insert(
            "its module",
            "smad/experiments/standing.py",
            '''"""At rest: how warm the springs are while nothing is asked of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from sim_device.plant.parameters import ParameterSet
from smad.control.plan import Mark, Pause, Plan
from smad.experiments.base import Comparison, Experiment, Findings, Options
from smad.experiments.driver import Driver
from smad.experiments.recording import Recording


class RestOptions(Options, frozen=True, kw_only=True):
    """Settings of standing."""

    seconds_s: Annotated[float, Meta(ge=1.0, le=600.0)] = 5.0


class Rest(Experiment[RestOptions]):
    """Nothing, for a while."""

    name = "standing"
    title = "The springs at rest"
    needs = frozenset({"rtd_x_degC"})
    options_type = RestOptions

    def conduct(self, trial: str, driver: Driver) -> Recording:
        plan = Plan(self.name, (Mark("begin"), Pause(self.options.seconds_s), Mark("end")))
        return driver.run(plan).between("begin", "end")

    def conclude(self, outcomes: Mapping[str, Any], model: ParameterSet) -> Findings:
        mean_degC = float(np.mean(outcomes[self.name]["rtd_x_degC"]))
        return Findings((Comparison("temperature of X", "not printed", f"{mean_degC:.1f} °C"),), ())
''',
        ),
        Insert(
            "its line in the registry",
            "smad/experiments/registry.py",
            '    "standing": "smad.experiments.standing:Rest",\n',
            before='}\n"""In the order of the report.',
        ),
        Insert(
            "its page",
            "docs/experiments/standing.md",
            "# standing: the springs at rest\n\nNothing is asked of the springs for `seconds_s`.\n",
        ),
        Insert(
            "its row in the list of experiments",
            "docs/experiments/README.md",
            "| [standing](standing.md) | the springs at rest |\n",
            before="\nAll experiments on one page",
        ),
    ),
    (
        "tests/smad/experiments/test_campaign_and_page.py::test_every_experiment_is_registered",
        "tests/smad/experiments/test_campaign_and_page.py::"
        "test_every_experiment_has_its_page_of_documentation",
        "tests/smad/experiments/test_drivers.py::"
        "test_each_part_an_experiment_needs_is_missed_by_name_before_anything_moves",
        "tests/docs/test_links.py",
    ),
)

EFFECT = Recipe(
    "effect",
    (
        Insert(
            "its entry in the registry",
            "sim_device/plant/effects/sensing.py",
            """    Effect(
        name="force_curve",
        title="the force sensor is not linear",
        subsystem="sensors",
        places=("reading_force",),
        equation="F_r = F (1 + c F)",
        parameters=(
            strength("per_N", "1/N", (-0.1, 0.02, 0.1), either(0.02), "curvature c",
                     term="force_curve"),
        ),
        signals=("force",),
        confused_with=("force_gain",),
        separated_by="two dead weights: a gain errs by the same share on both",
        reference="R. S. Figliola, D. E. Beasley, Mechanical Measurements, Wiley 2011",
    ),
""",
            before="""    Effect(
        name="force_gain",
""",
        ),
        Insert(
            "its field among the terms",
            "sim_device/plant/kernel/model.py",
            "    force_curve: float\n",
            before="    force_gain: float\n",
        ),
        Insert(
            "its term in the kernel",
            "sim_device/plant/kernel/sensors.py",
            "    if e.force_curve != 0.0:\n        F = F * (1.0 + e.force_curve * F)\n",
            before="    if e.force_gain != 0.0:\n",
        ),
        Generate(),
    ),
    (
        "tests/sim_device/plant/test_effects.py::"
        "test_every_term_of_the_kernel_belongs_to_one_parameter",
        "tests/sim_device/plant/test_effects.py::test_every_term_is_computed_with",
        "tests/sim_device/plant/test_effects.py::test_an_entry_is_complete",
        "tests/smad/diagnosis/places/test_pair_places.py",
    ),
    shows=("tests.recipes.effect_shows", "force_curve", "force_N"),
)

RECIPES = (
    REQUEST, NEWS, BOARD, KEY, CHANNEL, IMPORT, EXPORT, HOOK, FAULT, CHECK, TRAJECTORY, COMMAND,
    EXPERIMENT, EFFECT,
)  # fmt: skip
