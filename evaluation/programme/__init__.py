"""The design of the programme that a check-up plays."""
