"""Constants of the decisions, from development banks."""
