"""modelDescription.xml of the exported unit, for FMI 2.0 and 3.0, and where its sources lie."""

from collections.abc import Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from smad.fmi.variables import BASE_UNITS, Variable
from smad.version import VERSION

IDENTIFIER = "spring_pair"
SOURCE = {2: "fmi2.c", 3: "fmi3.c"}
"""The file to compile, by version of FMI; it includes the others of `sources/`."""
_TITLE = "antagonistic shape-memory-alloy springs with water cooling"
_STEP_S = "0.01"


def description(version: int, variables: Sequence[Variable], token: str) -> bytes:
    """Return modelDescription.xml for FMI 2.0 (`version` 2) or 3.0 (3)."""
    describe = {2: _description_2, 3: _description_3}[version]
    return _as_bytes(describe(variables, token))


def build_description() -> bytes:
    """Return sources/buildDescription.xml of FMI 3.0: what to compile."""
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    build = SubElement(root, "BuildConfiguration", {"modelIdentifier": IDENTIFIER})
    files = SubElement(build, "SourceFileSet", {"language": "C11"})
    SubElement(files, "SourceFile", {"name": SOURCE[3]})
    return _as_bytes(root)


def _as_bytes(root: Element) -> bytes:
    ElementTree.indent(root)
    return bytes(ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True))


def _root(version: str, token_name: str, token: str, **more: str) -> Element:
    return Element(
        "fmiModelDescription",
        {
            "fmiVersion": version,
            "modelName": "SpringPair",
            token_name: token,
            "description": _TITLE,
            "version": VERSION,
            "generationTool": f"smad {VERSION}",
            **more,
        },
    )


def _units(root: Element, variables: Sequence[Variable]) -> None:
    units = SubElement(root, "UnitDefinitions")
    for name in sorted({v.unit for v in variables} - {""}):
        unit = SubElement(units, "Unit", {"name": name})
        SubElement(unit, "BaseUnit", {key: f"{x:.17g}" for key, x in BASE_UNITS[name].items()})


def _attributes(v: Variable) -> dict[str, str]:
    numbers = {"min": v.low, "max": v.high, "start": v.start}
    written = {key: f"{number:.17g}" for key, number in numbers.items() if number is not None}
    return (
        ({"unit": v.unit} if v.unit else {})
        | ({"relativeQuantity": "true"} if v.relative else {})
        | written
    )


def _described(v: Variable, reference: int) -> dict[str, str]:
    return {
        "name": v.name,
        "valueReference": str(reference),
        "description": v.description,
        "causality": v.causality,
        "variability": "fixed" if v.causality == "parameter" else "continuous",
        **({"initial": "calculated"} if v.causality == "output" else {}),
    }


def _parts(root: Element, variables: Sequence[Variable], state: str) -> list[Element]:
    """Add what both versions have; returns its CoSimulation, ModelVariables and ModelStructure."""
    about = {
        "modelIdentifier": IDENTIFIER,
        "canHandleVariableCommunicationStepSize": "true",
        f"canGetAndSet{state}": "true",
        f"canSerialize{state}": "true",
    }
    unit = SubElement(root, "CoSimulation", about)
    _units(root, variables)
    SubElement(root, "DefaultExperiment", {"startTime": "0", "stepSize": _STEP_S})
    return [unit, SubElement(root, "ModelVariables"), SubElement(root, "ModelStructure")]


def _description_2(variables: Sequence[Variable], token: str) -> Element:
    root = _root("2.0", "guid", token, variableNamingConvention="flat")
    unit, model_variables, structure = _parts(root, variables, "FMUstate")
    SubElement(SubElement(unit, "SourceFiles"), "File", {"name": SOURCE[2]})
    outputs, initial = SubElement(structure, "Outputs"), SubElement(structure, "InitialUnknowns")
    for reference, v in enumerate(variables):
        if v.causality == "output":
            for unknowns in (outputs, initial):
                SubElement(unknowns, "Unknown", {"index": str(reference + 1)})
        variable = SubElement(model_variables, "ScalarVariable", _described(v, reference))
        SubElement(variable, "Real", _attributes(v))
    return root


def _description_3(variables: Sequence[Variable], token: str) -> Element:
    root = _root("3.0", "instantiationToken", token)
    _, model_variables, structure = _parts(root, variables, "FMUState")
    for reference, v in enumerate(variables):
        SubElement(model_variables, "Float64", {**_described(v, reference), **_attributes(v)})
    for kind in ("Output", "InitialUnknown"):
        for reference, v in enumerate(variables):
            if v.causality == "output":
                SubElement(structure, kind, {"valueReference": str(reference)})
    time = {
        "name": "time",
        "valueReference": str(len(variables)),
        "causality": "independent",
        "variability": "continuous",
        "description": "time that the unit has run",
        "unit": "s",
    }
    SubElement(model_variables, "Float64", time)
    return root
