"""A bench as its own control: programme, baseline, check-up, investigation."""
