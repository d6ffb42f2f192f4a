"""docs/physics.md is made from the parameter files and the registry, and is not stale."""

import pytest

from sim_device.plant.docs import PAGE, TABLES, rendered
from sim_device.plant.effects.registry import EFFECTS
from sim_device.plant.fields import FIELDS


def test_the_tables_of_the_page_are_not_stale():
    text = PAGE.read_text(encoding="utf-8")
    assert rendered(text) == text, "run python -m sim_device.plant.docs"


def test_every_parameter_and_effect_has_its_row():
    text = PAGE.read_text(encoding="utf-8")
    for name in [field.name for field in FIELDS] + [entry.name for entry in EFFECTS]:
        assert f"- `{name}`" in text or f"- **`{name}`**" in text


@pytest.mark.parametrize("name", TABLES)
def test_a_page_without_a_marker_is_refused(name):
    text = PAGE.read_text(encoding="utf-8").replace(f"<!-- table: {name} -->", "")
    with pytest.raises(ValueError, match=name):
        rendered(text)
