"""Banks of recorded runs and of check-ups, made with the independent plant, their keys apart."""
