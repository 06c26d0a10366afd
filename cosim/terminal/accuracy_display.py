"""What a person sees of a certificate of accuracy."""

from __future__ import annotations

from collections.abc import Mapping

from cosim.accuracy.accuracies import AGREES, CHANGES, Accuracy, ErrorPart
from cosim.accuracy.certificate import Certificate
from cosim.accuracy.limit import NO_ORDER, ROUNDING, UNSETTLED
from cosim.results.formatting import format_error, format_seconds, format_with_error
from cosim.results.text_table import TextTable
from cosim.terminal import study_display
from cosim.terminal.screen import print_wrapped

WORDS = {NO_ORDER: "none", UNSETTLED: "~", ROUNDING: "rounding", AGREES: "agrees", CHANGES: "CHANGES"}
MEANINGS = {
    NO_ORDER: "no order: interval from three steps",
    UNSETTLED: "the order is not settled at such steps, so the error is on the safe side",
    ROUNDING: "at rounding, the same at all steps",
}


def show(certificate: Certificate) -> None:
    """Print the tables of metrics and signals, and what is to be said of them."""
    both = (*certificate.metrics.values(), *certificate.signals.values())
    more = [("coupling", _coupling), ("integration", _integration)] if any(a.coupling for a in both) else []
    more += [("largest step", _step)] if any(a.wanted is not None for a in both) else []
    for table, accuracies in (
        (_metrics(certificate.metrics), certificate.metrics),
        (_signals(certificate.signals), certificate.signals),
    ):
        if table.rows:
            table.head += [name for name, _ in more]
            for row, accuracy in zip(table.rows, accuracies.values(), strict=True):
                row += [cell(accuracy) for _, cell in more]
            study_display.show(table)
    if certificate.requirements:
        study_display.show(_requirements(certificate.requirements))
    _say_changes(certificate)
    for kind in dict.fromkeys(accuracy.kind for accuracy in both):
        if kind in MEANINGS:
            print_wrapped(f"{WORDS[kind]}: {MEANINGS[kind]}", 2)
    _say_runs(certificate)


def print_notes(certificate: Certificate) -> None:
    """Print what is to be said of metrics that have been shown with their errors."""
    _say_changes(certificate)
    for kind, words in MEANINGS.items():
        names = [name for name, accuracy in certificate.metrics.items() if accuracy.kind == kind]
        if names:
            print_wrapped(f"{', '.join(names)}: {words}", 2)
    _say_runs(certificate)


def _say_changes(certificate: Certificate) -> None:
    for line in certificate.changing:
        print_wrapped(line, 2)


def _say_runs(certificate: Certificate) -> None:
    for line in certificate.notes:
        print_wrapped(line, 2)
    steps = ", ".join(map(format_seconds, certificate.steps))
    cost = f"{certificate.runs} runs, {certificate.cost:.3g} times the work of one, {certificate.seconds:.3g} s"
    print_wrapped(f"steps of {steps} ({certificate.method}; {cost})", 2)


def _metrics(metrics: Mapping[str, Accuracy]) -> TextTable:
    values = {name: accuracy.values[0] for name, accuracy in metrics.items()}
    units = {name: "" if isinstance(value, list) else metrics[name].unit for name, value in values.items()}
    rows = [[name, format_with_error(values[name], a.error), units[name], _order(a)] for name, a in metrics.items()]
    return TextTable("", ["metric", "value", "unit", "order"], rows)


def _requirements(margins: Mapping[str, Accuracy]) -> TextTable:
    rows = [[name, format_with_error(a.values[0], a.error), a.unit] for name, a in margins.items()]
    return TextTable("", ["requirement", "margin", "unit"], rows)


def _signals(signals: Mapping[str, Accuracy]) -> TextTable:
    rows = [[name, _error(a), _relative(a), _order(a)] for name, a in signals.items()]
    return TextTable("", ["signal", "error", "of range", "order"], rows)


def _order(accuracy: Accuracy) -> str:
    if accuracy.kind == UNSETTLED:
        return f"~ {accuracy.order:.2f}"
    return WORDS.get(accuracy.kind) or f"{accuracy.order:.2f}"


def _error(accuracy: Accuracy) -> str:
    if accuracy.error is None:
        return ""
    return f"{format_error(accuracy.error)} {accuracy.unit if accuracy.unit != '1' else ''}".rstrip()


def _relative(accuracy: Accuracy) -> str:
    return (
        "" if accuracy.relative is None or accuracy.kind == ROUNDING else f"{format_error(100 * accuracy.relative)} %"
    )


def _coupling(accuracy: Accuracy) -> str:
    return _part(accuracy.coupling)


def _integration(accuracy: Accuracy) -> str:
    return _part(accuracy.integration)


def _part(part: ErrorPart | None) -> str:
    """With its sign where it is known; two parts may cancel."""
    if part is None:
        return ""
    if part.kind == ROUNDING:
        return "rounding"
    return f"{part.error:+.1e}" if part.signed else f"±{part.error:.1e}"


def _step(accuracy: Accuracy) -> str:
    if accuracy.wanted is None:
        return ""
    return "none known" if accuracy.largest_step is None else format_seconds(accuracy.largest_step)
