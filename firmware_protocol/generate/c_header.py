"""The C header: constants, enumerations, records, prototypes."""

from __future__ import annotations

import msgspec

from firmware_protocol import framing
from firmware_protocol.board import MAX_SETPOINT_AGE_US
from firmware_protocol.codec import Codec
from firmware_protocol.generate.c_names import declared, enums_of, macro, struct_name, upper
from firmware_protocol.messages import NO_FIELD, PROTOCOL_MAJOR, PROTOCOL_MINOR, Message
from firmware_protocol.parameters import PARAMETERS
from firmware_protocol.rates import periodic
from firmware_protocol.schema import describe, schema_crc
from firmware_protocol.wire import Direction, fields_of

_FLASH = """\
/* Tables that stay in flash where RAM has an address space of its own. */
#ifdef __AVR__
#define SMAD_FLASH __flash
#else
#define SMAD_FLASH
#endif
"""

_PROTOTYPES = """\
/* CRC-32 as in zlib, Ethernet and PNG. */
uint32_t smad_crc32(const uint8_t *data, size_t size);

/* Carries on a CRC-32 over more bytes; the CRC of none is 0. */
uint32_t smad_crc32_more(uint32_t crc, const uint8_t *data, size_t size);

/* Writes the frame of a payload, delimiter included, to `out` (SMAD_MAX_WIRE bytes).
 * Returns its length, or 0 if the payload is longer than SMAD_MAX_PAYLOAD. */
size_t smad_frame_encode(uint8_t type, uint8_t seq, uint16_t session, const uint8_t *payload,
                         size_t size, uint8_t *out);

struct smad_frame {
    uint8_t type;
    uint8_t seq;
    uint16_t session;
    uint8_t size; /* of the payload */
    uint8_t payload[SMAD_MAX_PAYLOAD];
};

struct smad_decoder {
    uint32_t frames;
    uint32_t length_errors;
    uint32_t cobs_errors;
    uint32_t crc_errors;
    uint32_t dropped_bytes;
    uint16_t size;
    bool too_long;
    uint8_t buffer[SMAD_MAX_ENCODED];
};

void smad_decoder_init(struct smad_decoder *decoder);

/* Takes in one byte. Returns true, and fills `frame`, if it completed a good frame. */
bool smad_decoder_byte(struct smad_decoder *decoder, uint8_t byte, struct smad_frame *frame);

/* The door for setpoints, one for each axis; clear it when a session begins. */
struct smad_setpoint_gate {
    int64_t ref_us;
    uint8_t seq;
    bool passed;
};

/* Returns the age in us of a setpoint that may pass, -1 for one that is too old or was overtaken.
 * `now_us` is the board's time, not wrapped: 32 bits cannot tell a setpoint that comes after a
 * pause of 36 to 72 minutes from one that was overtaken. */
int64_t smad_setpoint_gate_admit(struct smad_setpoint_gate *gate, uint32_t t_ref_us, uint8_t seq,
                                 int64_t now_us);

struct smad_parameter {
    uint16_t number;
    uint8_t kind;
    bool shared; /* one for the whole board, kept by axis 0 */
    bool never_zero;
    int32_t initial;
    int32_t minimum;
    int32_t maximum;
    char name[SMAD_PARAMETER_NAME];
};

extern const SMAD_FLASH struct smad_parameter smad_parameters[SMAD_PARAMETER_COUNT];

/* The description that DESCRIBE hands out: JSON, compressed with zlib. */
extern const SMAD_FLASH uint8_t smad_schema[SMAD_SCHEMA_SIZE];
"""


def render(codec: Codec, schema_size: int) -> str:
    """Return the text of smad_protocol.h."""
    parts = [
        "/* Made by `python -m firmware_protocol.generate`; do not edit.\n"
        " * Every number on the wire is little-endian. See docs/protocol.md. */\n",
        "#ifndef SMAD_PROTOCOL_H\n#define SMAD_PROTOCOL_H\n",
        "#include <stdbool.h>\n#include <stddef.h>\n#include <stdint.h>\n",
        _FLASH,
        _constants(schema_size),
        *(_enumeration(kind) for kind in enums_of(codec)),
        *(_message(codec, cls) for cls in codec.messages),
        _PROTOTYPES,
        "#endif",
    ]
    return "\n".join(parts) + "\n"


def _constants(schema_size: int) -> str:
    values = {
        "PROTOCOL_MAJOR": PROTOCOL_MAJOR,
        "PROTOCOL_MINOR": PROTOCOL_MINOR,
        "SCHEMA_CRC": f"0x{schema_crc(describe()):08X}u",
        "SCHEMA_SIZE": schema_size,
        "PARAMETER_COUNT": len(PARAMETERS),
        "PARAMETER_NAME": 1 + max(len(p.name) for p in PARAMETERS),
        "MAX_DECODED": framing.MAX_DECODED,
        "MAX_PAYLOAD": framing.MAX_PAYLOAD,
        "MAX_ENCODED": framing.MAX_ENCODED,
        "MAX_WIRE": framing.MAX_ENCODED + 1,
        "PERIODIC_BYTES_PER_S": f"{periodic(Direction.TO_HOST)}u",
        "SETPOINT_AGE_US": MAX_SETPOINT_AGE_US,
        "NO_FIELD": f"0x{NO_FIELD:02X}",
        "INVALID_U8": "0xFF",
        "INVALID_U16": "0xFFFF",
        "INVALID_I16": "(-32767 - 1)",
        "INVALID_I32": "(-2147483647 - 1)",
    }
    return "\n".join(f"#define SMAD_{name} {value}" for name, value in values.items()) + "\n"


def _enumeration(kind: type) -> str:
    prefix = upper(kind.__name__)
    lines = [f"    SMAD_{prefix}_{member.name} = {int(member)}," for member in kind]  # type: ignore[attr-defined]
    return f"enum smad_{prefix.lower()} {{\n" + "\n".join(lines) + "\n};\n"


def _message(codec: Codec, cls: type[Message]) -> str:
    layout = codec.layout(cls)
    lines = [
        f"#define {macro(cls)}_NUMBER 0x{layout.number:02X}",
        f"#define {macro(cls)}_SIZE {layout.size}",
    ]
    if layout.size:
        name = struct_name(cls)
        short = name.removeprefix("smad_")
        lines += [
            "",
            f"struct {name} {{",
            *(f"    {_commented(cls, field.name)}" for field in fields_of(cls)),
            "};",
            "",
            f"void smad_pack_{short}(const struct {name} *m, uint8_t out[{macro(cls)}_SIZE]);",
            f"bool smad_unpack_{short}(struct {name} *m, const uint8_t *data, size_t size);",
        ]
    return "\n".join(lines) + "\n"


def _commented(cls: type[msgspec.Struct], name: str) -> str:
    field = next(field for field in fields_of(cls) if field.name == name)
    kind = field.enum or field.wire.bits
    notes = [field.wire.unit, f"enum smad_{upper(kind.__name__).lower()}" if kind else ""]
    comment = ", ".join(note for note in notes if note)
    return declared(field) + (f" /* {comment} */" if comment else "")
