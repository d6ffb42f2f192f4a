"""What a CURVE key looks like as text (Z85, https://rfc.zeromq.org/spec/32/). Pure."""

KEY_CHARACTERS = 40
_DIGITS = "0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ.-:+=^!/*?&<>()[]{}@%$#"
_VALUES = {digit: value for value, digit in enumerate(_DIGITS)}
_GROUP = 5


def is_curve_key(text: str) -> bool:
    """Return whether the text is 32 bytes in Z85: eight groups of five digits, each below 2³²."""
    if len(text) != KEY_CHARACTERS or not set(text) <= _VALUES.keys():
        return False
    for start in range(0, KEY_CHARACTERS, _GROUP):
        value = 0
        for digit in text[start : start + _GROUP]:
            value = value * len(_DIGITS) + _VALUES[digit]
        if value >= 2**32:
            return False
    return True
