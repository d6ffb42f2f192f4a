"""Every error of the withheld check; each message says cause, value, limit and what to do."""


class WithheldError(Exception):
    """Anything that stops a bank, a score or a quiz."""


class BankError(WithheldError):
    """A bank folder that cannot be made, resumed or read."""


class KeyMismatchError(WithheldError):
    """A key that does not belong to the bank, or is not the one that was sealed."""


class QuizError(WithheldError):
    """A quiz that cannot be started or revealed."""
