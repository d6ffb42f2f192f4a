"""The generated C codec as a program: built with the host's compiler, driven over a pipe.

The program reads bytes in hex, a line at a time. For a line it decodes the frames, prints each
frame and the values of its message, packs the values again into a frame, and prints the counters.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import firmware_protocol
from firmware_protocol.generate.c_names import elements, macro, struct_name
from firmware_protocol.messages import MESSAGES, Message
from firmware_protocol.wire import fields_of

FOLDER = Path(firmware_protocol.__file__).parent / "c"
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined", "-O1"]
COMPILER = shutil.which("cc")

_HEAD = """\
#include "smad_protocol.h"
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

static void print_hex(const void *data, size_t size)
{
    const unsigned char *bytes = data;
    for (size_t i = 0; i < size; i++) {
        printf("%02x", bytes[i]);
    }
}

static void print_frame(uint8_t type, uint8_t seq, uint16_t session, const uint8_t *payload,
                        size_t size)
{
    uint8_t wire[SMAD_MAX_WIRE];
    size_t length = smad_frame_encode(type, seq, session, payload, size, wire);
    printf(" repacked=");
    print_hex(wire, length);
}

static void show(const struct smad_frame *f)
{
    printf("frame %u %u %u ", f->type, f->seq, f->session);
    print_hex(f->payload, f->size);
    switch (f->type) {
"""

_TAIL = """\
    default:
        printf(" unknown");
    }
    printf("\\n");
}

int main(void)
{
    int high = -1;
    struct smad_decoder decoder;
    struct smad_frame frame;
    smad_decoder_init(&decoder);
    for (int c = getchar(); c != EOF; c = getchar()) {
        if (c == '\\n') {
            printf("counters %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32 "\\n",
                   decoder.frames, decoder.length_errors, decoder.cobs_errors, decoder.crc_errors,
                   decoder.dropped_bytes);
            fflush(stdout);
            smad_decoder_init(&decoder);
            continue;
        }
        int digit = c <= '9' ? c - '0' : c - 'a' + 10;
        if (high < 0) {
            high = digit;
        } else {
            if (smad_decoder_byte(&decoder, (uint8_t)(high << 4 | digit), &frame)) {
                show(&frame);
            }
            high = -1;
        }
    }
    return 0;
}
"""


def _case(cls: type[Message]) -> str:
    lines = [f"    case {macro(cls)}_NUMBER: {{"]
    if fields_of(cls):
        name = struct_name(cls)
        short = name.removeprefix("smad_")
        lines += [
            f"        struct {name} m;",
            f"        uint8_t payload[{macro(cls)}_SIZE];",
            f"        if (!smad_unpack_{short}(&m, f->payload, f->size)) {{",
            '            printf(" bad");',
            "            break;",
            "        }",
        ]
        for element in elements(cls, "m."):
            if element.kind in ("char", "bytes"):
                lines.append('        printf(" ");')
                lines.append(f"        print_hex({element.value}, {element.length});")
            else:
                sign = "PRId32" if element.kind.startswith("i") else "PRIu32"
                cast = "int32_t" if element.kind.startswith("i") else "uint32_t"
                lines.append(f'        printf(" %" {sign}, ({cast}){element.value});')
        lines.append(f"        smad_pack_{short}(&m, payload);")
        lines.append("        print_frame(f->type, f->seq, f->session, payload, sizeof payload);")
    else:
        lines.append("        print_frame(f->type, f->seq, f->session, NULL, 0);")
    return "\n".join([*lines, "        break;", "    }"]) + "\n"


def build(folder: Path) -> Path:
    """Compile codec and program; return the program."""
    source = folder / "peer.c"
    source.write_text(_HEAD + "".join(_case(cls) for cls in MESSAGES) + _TAIL)
    program = folder / "peer"
    command = [str(COMPILER), *FLAGS, f"-I{FOLDER}", str(source), str(FOLDER / "smad_protocol.c")]
    done = subprocess.run(
        [*command, "-o", str(program)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return program


class CPeer:
    """The running program."""

    def __init__(self, program: Path) -> None:
        self._process = subprocess.Popen(
            [str(program)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def feed(self, data: bytes) -> tuple[list[list[str]], list[int]]:
        """Return the frames found, as words, and the counters."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(data.hex() + "\n")
        self._process.stdin.flush()
        frames = []
        for line in self._process.stdout:
            words = line.split()
            if words[0] == "counters":
                return frames, [int(word) for word in words[1:]]
            frames.append(line.rstrip("\n").split(" ")[1:])
        raise AssertionError(f"the program ended with status {self._process.wait()}")

    def close(self) -> int:
        """End the program; return its status (the sanitizers make it non-zero)."""
        self._process.communicate("")
        return self._process.returncode
