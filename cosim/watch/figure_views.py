"""Metrics and margins beside those of the run before, as the page shows them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cosim.requirements.verdict import Verdict, change
from cosim.results.formatting import format_change, format_value
from cosim.watch.orders import Figures, View


def metrics(now: Figures, before: Figures | None) -> list[View]:
    """A row for each metric. What meant something else before is not compared."""
    known = {name: v for name, v in before.metrics.items() if _same(now, before, name)} if before else {}
    return [_metric(now, name, known, compared=before is not None) for name in now.metrics]


def _same(now: Figures, before: Figures, name: str) -> bool:
    return before.meanings.get(name) == now.meanings.get(name)


def _metric(now: Figures, name: str, known: Mapping[str, Any], compared: bool) -> View:
    value = now.metrics[name]
    return {
        "name": name,
        "value": format_value(value),
        "unit": "" if isinstance(value, list) else now.units.get(name, ""),
        "window": now.windows.get(name, ""),
        "before": format_value(known[name]) if name in known else "",
        "change": format_change(value, known, name) if compared else "",
    }


def requirements(now: Figures, before: Figures | None) -> list[View]:
    """A row for each requirement. One of another formula is not compared."""
    return [_requirement(fields, before.requirements if before else None) for fields in now.requirements.values()]


def _requirement(fields: Mapping[str, Any], before: Mapping[str, Mapping[str, Any]] | None) -> View:
    verdict = Verdict(**fields)
    known = (before or {}).get(verdict.name)
    same = known is not None and known["formula"] == verdict.formula
    return {
        "name": verdict.name,
        "formula": verdict.formula,
        "word": verdict.word,
        "holds": verdict.holds,
        "margin": verdict.margin_text,
        "unit": verdict.unit,
        "place": verdict.place,
        "before": format_value(known["margin"]) if known and same else "",
        "change": "" if before is None else change(known, fields) if known and same else "new",
    }
