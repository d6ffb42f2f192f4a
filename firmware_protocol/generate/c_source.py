"""The C source: CRC, COBS, frames, and pack and unpack of each message. Portable C99."""

from __future__ import annotations

import enum
from collections.abc import Iterator

from firmware_protocol.codec import Codec
from firmware_protocol.generate.c_names import (
    checked_enums,
    elements,
    enum_checks,
    macro,
    struct_name,
    upper,
)
from firmware_protocol.messages import Message
from firmware_protocol.parameters import PARAMETERS
from firmware_protocol.wire import fields_of

_FRAMES = """\
uint32_t smad_crc32_more(uint32_t crc, const uint8_t *data, size_t size)
{
    static const SMAD_FLASH uint32_t table[256] = {
CRC_TABLE
    };
    crc ^= 0xFFFFFFFFu;
    for (size_t i = 0; i < size; i++) {
        crc = table[(uint8_t)crc ^ data[i]] ^ (crc >> 8);
    }
    return crc ^ 0xFFFFFFFFu;
}

uint32_t smad_crc32(const uint8_t *data, size_t size)
{
    return smad_crc32_more(0, data, size);
}

size_t smad_frame_encode(uint8_t type, uint8_t seq, uint16_t session, const uint8_t *payload,
                         size_t size, uint8_t *out)
{
    if (size > SMAD_MAX_PAYLOAD) {
        return 0;
    }
    uint8_t header[4];
    uint8_t trailer[4];
    put_u8(header, type);
    put_u8(header + 1, seq);
    put_u16(header + 2, session);
    put_u32(trailer, smad_crc32_more(smad_crc32(header, 4), payload, size));

    /* COBS: each zero becomes the distance to the next one. Frames are short, so that no
     * distance reaches 255, where COBS would need another byte. */
    uint8_t length = (uint8_t)(size + 8);
    uint8_t mark = 0;
    const uint8_t *from = header;
    for (uint8_t i = 0; i < length; i++) {
        if (i == 4) {
            from = payload;
        }
        if (i == (uint8_t)(size + 4)) {
            from = trailer;
        }
        uint8_t byte = *from++;
        if (byte == 0) {
            out[mark] = (uint8_t)(i + 1 - mark);
            mark = (uint8_t)(i + 1);
        } else {
            out[i + 1] = byte;
        }
    }
    out[mark] = (uint8_t)(length + 1 - mark);
    out[length + 1] = 0;
    return length + 2;
}

void smad_decoder_init(struct smad_decoder *decoder)
{
    memset(decoder, 0, sizeof *decoder);
}

/* Undoes COBS in place. Returns false if the distances do not end where the block ends. */
static bool cobs_decode(uint8_t *block, size_t size)
{
    size_t position = 0;
    while (position < size) {
        size_t step = block[position];
        block[position] = 0;
        position += step;
    }
    return position == size;
}

/* Judges the block between two delimiters. */
static bool judge(struct smad_decoder *decoder, struct smad_frame *frame)
{
    size_t size = decoder->size;
    if (size < 9) {
        decoder->length_errors++;
        return false;
    }
    if (!cobs_decode(decoder->buffer, size)) {
        decoder->cobs_errors++;
        return false;
    }
    const uint8_t *body = decoder->buffer + 1;
    size_t covered = size - 5;
    if (smad_crc32(body, covered) != get_u32(body + covered)) {
        decoder->crc_errors++;
        return false;
    }
    frame->type = body[0];
    frame->seq = body[1];
    frame->session = get_u16(body + 2);
    frame->size = (uint8_t)(covered - 4);
    memcpy(frame->payload, body + 4, frame->size);
    decoder->frames++;
    return true;
}

bool smad_decoder_byte(struct smad_decoder *decoder, uint8_t byte, struct smad_frame *frame)
{
    bool good = false;
    if (byte != 0) {
        if (decoder->too_long) {
            decoder->dropped_bytes++;
        } else if (decoder->size == SMAD_MAX_ENCODED) {
            decoder->too_long = true;
            decoder->length_errors++;
            decoder->dropped_bytes += (uint32_t)decoder->size + 1;
            decoder->size = 0;
        } else {
            decoder->buffer[decoder->size++] = byte;
        }
        return false;
    }
    if (decoder->size > 0) {
        good = judge(decoder, frame);
        if (!good) {
            decoder->dropped_bytes += decoder->size;
        }
    }
    decoder->size = 0;
    decoder->too_long = false;
    return good;
}
"""

_GATE = """\
int64_t smad_setpoint_gate_admit(struct smad_setpoint_gate *gate, uint32_t t_ref_us, uint8_t seq,
                                 int64_t now_us)
{
    /* A time in the future is as wrong as one too far back: modulo 2^32 it is a great age. */
    uint32_t age_us = (uint32_t)now_us - t_ref_us;
    int64_t ref_us = now_us - (int64_t)age_us;
    uint8_t step = (uint8_t)(seq - gate->seq);
    if (age_us > SMAD_SETPOINT_AGE_US) {
        return -1;
    }
    if (gate->passed
        && (ref_us < gate->ref_us || (ref_us == gate->ref_us && (step == 0 || step > 127)))) {
        return -1;
    }
    gate->ref_us = ref_us;
    gate->seq = seq;
    gate->passed = true;
    return (int64_t)age_us;
}
"""

_PUT = """\
static void put_u8(uint8_t *out, uint8_t value)
{
    out[0] = value;
}

static void put_u16(uint8_t *out, uint16_t value)
{
    out[0] = (uint8_t)(value & 0xFFu);
    out[1] = (uint8_t)(value >> 8);
}

static void put_u32(uint8_t *out, uint32_t value)
{
    put_u16(out, (uint16_t)(value & 0xFFFFu));
    put_u16(out + 2, (uint16_t)(value >> 16));
}

static uint16_t get_u16(const uint8_t *data)
{
    return (uint16_t)(data[0] | (uint16_t)((uint16_t)data[1] << 8));
}

static uint32_t get_u32(const uint8_t *data)
{
    return get_u16(data) | (uint32_t)get_u16(data + 2) << 16;
}

/* From two's complement, without relying on what a cast of a large number does. */
static int16_t get_i16(const uint8_t *data)
{
    int32_t value = get_u16(data);
    return (int16_t)(value < 0x8000 ? value : value - 0x10000);
}

static int32_t get_i32(const uint8_t *data)
{
    uint32_t value = get_u32(data);
    return value < 0x80000000u ? (int32_t)value : -(int32_t)(0xFFFFFFFFu - value) - 1;
}
"""

_PUTS = {
    "u8": "put_u8(out + {offset}, {value});",
    "u16": "put_u16(out + {offset}, {value});",
    "i16": "put_u16(out + {offset}, (uint16_t){value});",
    "u32": "put_u32(out + {offset}, {value});",
    "i32": "put_u32(out + {offset}, (uint32_t){value});",
    "char": "memcpy(out + {offset}, {value}, {count});",
    "bytes": "memcpy(out + {offset}, {value}, {count});",
}
_GETS = {
    "u8": "{value} = data[{offset}];",
    "u16": "{value} = get_u16(data + {offset});",
    "i16": "{value} = get_i16(data + {offset});",
    "u32": "{value} = get_u32(data + {offset});",
    "i32": "{value} = get_i32(data + {offset});",
    "char": "memcpy({value}, data + {offset}, {count});",
    "bytes": "memcpy({value}, data + {offset}, {count});",
}


def render(codec: Codec, blob: bytes) -> str:
    """Return the text of smad_protocol.c."""
    parts = [
        "/* Made by `python -m firmware_protocol.generate`; do not edit. */\n",
        '#include "smad_protocol.h"\n\n#include <string.h>\n',
        _PUT,
        _FRAMES.replace("CRC_TABLE", _crc_table()),
        _GATE,
        *(_known_function(kind) for kind in checked_enums(codec)),
        *(_pack(cls) + "\n" + _unpack(cls) for cls in codec.messages if fields_of(cls)),
        _parameters(),
        _schema(blob),
    ]
    return "\n".join(parts)


def _crc_table() -> str:
    entries = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
        entries.append(f"0x{crc:08X}u,")
    rows = [" ".join(entries[start : start + 7]) for start in range(0, 256, 7)]
    return "\n".join(f"        {row}" for row in rows)


def _known_function(kind: type[enum.IntEnum]) -> str:
    name = upper(kind.__name__)
    cases = "\n".join(f"    case SMAD_{name}_{member.name}:" for member in kind)
    return (
        f"static bool known_{name.lower()}(uint8_t code)\n{{\n    switch (code) {{\n{cases}\n"
        "        return true;\n    default:\n        return false;\n    }\n}\n"
    )


def _pack(cls: type[Message]) -> str:
    name = struct_name(cls)
    lines = [f"    {line}" for line in _lines(cls, _PUTS)]
    return (
        f"void smad_pack_{name.removeprefix('smad_')}(const struct {name} *m, "
        f"uint8_t out[{macro(cls)}_SIZE])\n{{\n" + "\n".join(lines) + "\n}\n"
    )


def _unpack(cls: type[Message]) -> str:
    name = struct_name(cls)
    lines = [f"    if (size != {macro(cls)}_SIZE) {{", "        return false;", "    }"]
    lines += [f"    {line}" for line in _lines(cls, _GETS)]
    lines.append(f"    return {' && '.join(enum_checks(cls, 'm->')) or 'true'};")
    return (
        f"bool smad_unpack_{name.removeprefix('smad_')}(struct {name} *m, const uint8_t *data, "
        "size_t size)\n{\n" + "\n".join(lines) + "\n}\n"
    )


def _lines(cls: type[Message], templates: dict[str, str]) -> Iterator[str]:
    offset = 0
    for element in elements(cls, "m->"):
        yield templates[element.kind].format(
            offset=offset, value=element.value, count=element.length
        )
        offset += element.size


def _parameters() -> str:
    rows = [
        f"    {{{p.number}, {int(p.kind)}, {str(p.shared).lower()}, {str(p.never_zero).lower()}, "
        f'{p.default}, {p.minimum}, {p.maximum}, "{p.name}"}},'
        for p in PARAMETERS
    ]
    head = "const SMAD_FLASH struct smad_parameter smad_parameters[SMAD_PARAMETER_COUNT] = {\n"
    return head + "\n".join(rows) + "\n};\n"


def _schema(blob: bytes) -> str:
    rows = [
        "    " + " ".join(f"0x{byte:02x}," for byte in blob[start : start + 16])
        for start in range(0, len(blob), 16)
    ]
    return (
        "const SMAD_FLASH uint8_t smad_schema[SMAD_SCHEMA_SIZE] = {\n" + "\n".join(rows) + "\n};\n"
    )
