"""What a CURVE key looks like as text (Z85, https://rfc.zeromq.org/spec/32/). Pure."""

import struct

KEY_CHARACTERS = 40


def is_curve_key(text: str) -> bool:
    """Return whether the text is 32 bytes in Z85: eight groups of five digits, each below 2³²."""
    from zmq.utils import z85

    if len(text) != KEY_CHARACTERS:
        return False
    try:
        z85.decode(text)
    except (ValueError, KeyError, struct.error):
        return False
    return True
