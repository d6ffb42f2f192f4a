r"""What a command prints for a program.

A byte of a file name that is no UTF-8 is written as `\xff`: JSON has no letter for it.
"""

import json
import re

import msgspec


def json_text(value: object, indent: int) -> bytes:
    """Return a value as JSON; with an indent of -1 on one line."""
    try:
        text = msgspec.json.encode(value, enc_hook=str)
    except UnicodeEncodeError:
        plain = json.dumps(msgspec.to_builtins(value, enc_hook=str), ensure_ascii=False)
        escaped = re.sub("[\udc80-\udcff]", lambda byte: rf"\\x{ord(byte[0]) & 0xFF:02x}", plain)
        # What is no number is null, as above.
        text = msgspec.json.encode(json.loads(escaped, parse_constant=lambda _: None))
    return msgspec.json.format(text, indent=indent)
