"""Laws in a model file: tables to records and back, with one clear line for what is refused."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from sim_device.plant.errors import InputError, ModelError
from sim_device.plant.laws import Factor, Law, Term, check_laws
from sim_device.plant.textfile import quoted

_LAW_KEYS = {"place", "side", "support", "terms"}
_TERM_KEYS = {"name", "coefficient", "order", "factors"}
_FACTOR_KEYS = ("state", "kind", "lag_s", "centre", "scale")


def laws_as_tables(laws: Sequence[Law]) -> list[dict[str, Any]]:
    """Plain tables of the laws, as they stand in a file. Raises InputError for a refused law."""
    check_laws(laws)
    return [
        {
            "place": law.place,
            "side": law.side,
            "support": {f.state: [f.low, f.high] for t in law.terms for f in t.factors},
            "terms": [
                {
                    "name": term.name,
                    "coefficient": term.coefficient,
                    "order": term.order,
                    "factors": [
                        {key: getattr(factor, key) for key in _FACTOR_KEYS}
                        for factor in term.factors
                    ],
                }
                for term in law.terms
            ],
        }
        for law in laws
    ]


def laws_from_tables(raw: object) -> tuple[Law, ...]:
    """The laws of a file. Raises ModelError, which says where and what is wrong."""
    if not isinstance(raw, list):
        raise ModelError(f"laws is {raw!r}, not a list of tables; write [[laws]]")
    laws = tuple(_law(f"laws[{n}]", entry) for n, entry in enumerate(raw))
    try:
        check_laws(laws)
    except InputError as error:
        raise ModelError(str(error)) from None
    return laws


def _law(where: str, raw: object) -> Law:
    table = _table(where, raw, _LAW_KEYS, required=("place", "side", "terms"))
    support = table.get("support", {})
    if not isinstance(support, Mapping):
        raise ModelError(f"{where}.support is {support!r}, not a table of state = [low, high]")
    spans = {}
    for state, span in support.items():
        if not isinstance(span, list) or len(span) != 2:
            raise ModelError(f"{where}.support.{state} is {span!r}; write [low, high]")
        spans[state] = tuple(_number(f"{where}.support.{state}", bound) for bound in span)
    terms = table["terms"]
    if not isinstance(terms, list):
        raise ModelError(f"{where}.terms is {terms!r}, not a list; write [[laws.terms]]")
    return Law(
        str(table["place"]),
        str(table["side"]),
        tuple(_term(f"{where}.terms[{n}]", entry, spans) for n, entry in enumerate(terms)),
    )


def _term(where: str, raw: object, spans: Mapping[str, tuple[float, ...]]) -> Term:
    table = _table(where, raw, _TERM_KEYS, required=("name", "coefficient"))
    factors = table.get("factors", [])
    if not isinstance(factors, list):
        raise ModelError(f"{where}.factors is {factors!r}, not a list")
    return Term(
        name=str(table["name"]),
        coefficient=_number(f"{where}.coefficient", table["coefficient"]),
        order=int(_number(f"{where}.order", table.get("order", 1))),
        factors=tuple(_factor(f"{where}.factors[{n}]", f, spans) for n, f in enumerate(factors)),
    )


def _factor(where: str, raw: object, spans: Mapping[str, tuple[float, ...]]) -> Factor:
    table = _table(where, raw, _FACTOR_KEYS, required=("state", "centre", "scale"))
    state = str(table["state"])
    if state not in spans:
        raise ModelError(f"{where}: state {state!r} has no support; add support.{state}")
    return Factor(
        state=state,
        kind=str(table.get("kind", "line")),
        lag_s=_number(f"{where}.lag_s", table.get("lag_s", 0.0)),
        low=spans[state][0],
        high=spans[state][1],
        centre=_number(f"{where}.centre", table["centre"]),
        scale=_number(f"{where}.scale", table["scale"]),
    )


def _table(
    where: str, raw: object, known: Collection[str], *, required: Sequence[str]
) -> dict[str, Any]:
    if not isinstance(raw, dict):
        raise ModelError(f"{where} is {raw!r}, not a table")
    for key in raw:
        if key not in known:
            raise ModelError(f"{where}: unknown key {key!r}; known are {sorted(known)}")
    for key in required:
        if key not in raw:
            raise ModelError(f"{where} has no {key!r}; add it")
    return raw


def _number(where: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ModelError(f"{where} is {value!r}, not a number")
    try:
        return float(value)
    except OverflowError:
        raise ModelError(f"{where} is too large a number") from None


def laws_as_toml(tables: Sequence[Mapping[str, Any]]) -> list[str]:
    """Lines of TOML for `laws_as_tables`."""
    lines = []
    for law in tables:
        lines += [
            "",
            "[[laws]]",
            f"place = {quoted(law['place'])}",
            f"side = {quoted(law['side'])}",
        ]
        lines += ["", "[laws.support]"]
        lines += [f"{state} = {span!r}" for state, span in law["support"].items()]
        for term in law["terms"]:
            factors = ", ".join(_inline(factor) for factor in term["factors"])
            lines += [
                "",
                "[[laws.terms]]",
                f"name = {quoted(term['name'])}",
                f"coefficient = {term['coefficient']!r}",
                f"order = {term['order']}",
                f"factors = [{factors}]",
            ]
    return lines


def _inline(table: Mapping[str, Any]) -> str:
    values = ((k, quoted(v) if isinstance(v, str) else repr(v)) for k, v in table.items())
    return "{ " + ", ".join(f"{key} = {value}" for key, value in values) + " }"
