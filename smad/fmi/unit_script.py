"""The script that lies inside an exported unit; pythonfmu runs it on the importing machine."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

from sim_device.plant.errors import PlantError
from smad.fmi.errors import FmiError
from smad.fmi.pair import UnitOfPair
from smad.fmi.variables import BASE_UNITS, Variable


class SpringPair(Fmi2Slave):  # type: ignore[misc]
    """Two shape-memory-alloy springs on one tendon, as a co-simulation unit."""

    description = "antagonistic shape-memory-alloy springs with water cooling"

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        self._pair = UnitOfPair(Path(self.resources))
        for variable in self._pair.variables:
            self.register_variable(self._real(variable), nested=False)

    def _real(self, v: Variable) -> Any:
        pair = self._pair
        return Real(
            v.name,
            causality=Fmi2Causality[v.causality],
            variability=Fmi2Variability.fixed
            if v.causality == "parameter"
            else Fmi2Variability.continuous,
            description=v.description,
            getter=lambda: pair.get(v.name),
            setter=lambda value: pair.set(v.name, value),
        )

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        with _told():
            super().set_real(vrs, values)

    def exit_initialization_mode(self) -> None:
        with _told():
            self._pair.started()

    def do_step(self, current_time: float, step_size: float) -> bool:
        with _told():
            self._pair.step(step_size)
        return True

    def to_xml(self, *options: Any) -> Element:
        """The description, with what pythonfmu leaves out: units, ranges, initial unknowns."""
        root: Element = super().to_xml(*options)
        used = {v.unit for v in self._pair.variables} - {""}
        units = Element("UnitDefinitions")
        for name in sorted(used):
            unit = SubElement(units, "Unit", {"name": name})
            SubElement(unit, "BaseUnit", {k: f"{x:.17g}" for k, x in BASE_UNITS[name].items()})
        root.insert(1, units)
        nodes = root.find("ModelVariables")
        structure = root.find("ModelStructure")
        assert nodes is not None
        assert structure is not None
        initial = SubElement(structure, "InitialUnknowns")
        for at, (node, v) in enumerate(zip(nodes, self._pair.variables, strict=True), start=1):
            more = {"unit": v.unit, "relativeQuantity": "true" if v.relative else ""}
            more |= {"min": _text(v.low), "max": _text(v.high)}
            node[0].attrib.update({key: text for key, text in more.items() if text})
            if v.causality == "output":
                SubElement(initial, "Unknown", {"index": str(at)})
        return root


@contextmanager
def _told() -> Iterator[None]:
    # pythonfmu logs the repr of an exception, which has the whole line only in a plain one.
    try:
        yield
    except (FmiError, PlantError) as error:
        raise RuntimeError(str(error)) from None


def _text(value: float | None) -> str:
    return "" if value is None else f"{value:.17g}"
