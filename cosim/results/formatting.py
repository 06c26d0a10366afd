"""Figures as people read them: four digits, events one a line, and what changed since the run before."""

from __future__ import annotations

import math
from collections.abc import Mapping
from decimal import ROUND_CEILING, Decimal
from typing import Any

from cosim.results.metrics import for_json

EVENTS_SHOWN = 8
MOST_DIGITS = 10**9
VISIBLE_CHANGE = 5e-5
"""Four digits show a relative change from here on, if not always."""
ELEMENTS_SHOWN = 6
MOST_SHOWN = 10
"""Digits beyond these are not read, however small the error is."""


def format_value(value: Any) -> str:
    """A metric's value with four significant digits; events one a line, such as `1–6 at 2.35 s`."""
    if value is None:
        return "—"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:#.4g}".removesuffix(".")
    if isinstance(value, int):
        return str(value) if abs(value) < MOST_DIGITS else f"{Decimal(value):.3e}"
    if not isinstance(value, list):
        return str(value)
    if value and isinstance(value[0], Mapping):
        lines = [_format_event(event) for event in value[:EVENTS_SHOWN]]
        rest = len(value) - len(lines)
        return "\n".join([*lines, f"and {rest} more"] if rest else lines)
    more = ["…"] if len(value) > ELEMENTS_SHOWN else []
    return f"[{', '.join([*map(format_value, value[:ELEMENTS_SHOWN]), *more])}]" if value else "none"


def format_change(value: Any, previous: Mapping[str, Any], name: str) -> str:
    """What changed since the previous run: `same`, `new`, per cent, a factor from 10 on, or just `changed`.

    Nothing, where it is a change of digits that the figures do not show.
    """
    if name not in previous:
        return "new"
    before = previous[name]
    if for_json(value) == for_json(before):  # one of which comes from a file
        return "same"
    if not (_is_number(value) and _is_number(before) and before):
        return "changed"
    try:
        change = (value - before) / abs(before)
    except OverflowError:
        return "changed"
    if not math.isfinite(change):
        return "changed"
    rounded = isinstance(value, float) or abs(value) >= MOST_DIGITS
    if rounded and (abs(change) < VISIBLE_CHANGE or format_value(value) == format_value(before)):
        return ""
    if change >= 9 and before > 0:
        return f"× {value / before:.3g}"
    per_cent = 100 * change
    return f"{per_cent:+.1f} %" if 0.1 <= abs(per_cent) < 1e5 else f"{per_cent:+.2g} %"


def format_duration(seconds: float) -> str:
    """A duration in the two largest units that matter, such as `2 min 5 s`."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def format_seconds(seconds: float, digits: int = 12) -> str:
    """A step, such as `0.5 ms`."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= 0.1 * size:
            return f"{seconds / size:.{digits}g} {unit}"
    return f"{seconds / 1e-6:.{digits}g} µs"


def format_with_error(value: Any, error: float | None) -> str:
    """A value to the digit that its error leaves, such as `0.1319 ± 0.0004`; the error's one digit, or two, rounded up.

    A list has one error, that of its worst element.
    """
    if error is None:
        return format_value(value)
    if not _is_number(value):
        return (
            f"{format_value(value)}{chr(10) if value and isinstance(value[0], Mapping) else ' '}± {format_error(error)}"
        )
    if not 0.0 < error < math.inf:
        return f"{format_value(value)} ± {error:g}"
    exact, off = Decimal(value), _rounded_up(error)
    last = off.as_tuple().exponent
    assert isinstance(last, int)
    if exact and last < exact.adjusted() - MOST_SHOWN:
        return f"{value:.{MOST_SHOWN}g} ± {format_error(error)}"
    shown = exact.quantize(off)
    shown = shown or shown.copy_abs()  # no -0.0
    largest = max(shown.copy_abs(), off).adjusted()
    if -5 < largest < 7:
        return f"{shown:f} ± {off:f}"
    return f"({shown.scaleb(-largest):f} ± {off.scaleb(-largest):f})e{largest:+03d}"


def format_error(error: float) -> str:
    """An error with one digit, or two, rounded up."""
    if not 0.0 < error < math.inf:
        return f"{error:g}"
    off = _rounded_up(error)
    return f"{off:f}" if -5 < off.adjusted() < 7 else f"{float(off):g}"


def _rounded_up(error: float) -> Decimal:
    """One digit, or two where the first is a 1; never less than the error itself."""
    exact = Decimal(repr(error))  # of 0.1, one digit
    digits = 2 if exact.as_tuple().digits[0] == 1 else 1
    unit = Decimal(1).scaleb(exact.adjusted() + 1 - digits)
    return exact.quantize(unit, ROUND_CEILING)


def _format_event(event: Mapping[str, Any]) -> str:
    who = "–".join(str(member) for member in event["pair"]) if "pair" in event else str(event["member"])
    when = event["time"]
    return f"{who} at {when:.3g} s" if 0 < when < 0.1 else f"{who} at {when:.2f} s"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < float("inf")
