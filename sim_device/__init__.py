"""A bench that is not there: the board's logic with a physics model of the springs behind it.

It speaks the wire protocol, on a pseudo-terminal or in lockstep on virtual time.
"""
