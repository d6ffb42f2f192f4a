"""Where bench and simulator disagree, which law is missing there, and what it is called.

`diagnose` asks *differs* and *changed* of any `PlantModel`; check-ups are `smad.checkup`.
"""

from smad.diagnosis.answer import Answer
from smad.diagnosis.diagnose import diagnose
from smad.diagnosis.verdict import Verdict

__all__ = ["Answer", "Verdict", "diagnose"]
