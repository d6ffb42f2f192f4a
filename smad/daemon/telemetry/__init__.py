"""What becomes of a finished sample: the published stream and the run log."""
