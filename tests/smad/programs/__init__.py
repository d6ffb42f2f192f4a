"""Programs that arm, on virtual time, stopped in every phase."""
