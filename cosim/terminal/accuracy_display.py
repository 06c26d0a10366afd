"""What a person sees of a certificate of accuracy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from cosim.accuracy.accuracies import AGREES, CHANGES, Accuracy, ErrorPart
from cosim.accuracy.certificate import Certificate
from cosim.accuracy.limit import NO_ORDER, ROUNDING, UNSETTLED
from cosim.results.formatting import format_error, format_seconds, format_with_error
from cosim.study.text_tables import TextTable
from cosim.terminal import study_display
from cosim.terminal.screen import print_wrapped, say

WORDS = {NO_ORDER: "none", ROUNDING: "rounding", AGREES: "agrees", CHANGES: "CHANGES"}


def show(certificate: Certificate) -> None:
    """Print the tables of metrics and signals, and what is to be said of them."""
    both = (*certificate.metrics.values(), *certificate.signals.values())
    more = [("coupling", _coupling), ("integration", _integration)] if any(a.coupling for a in both) else []
    more += [("largest step", _step)] if any(a.wanted is not None for a in both) else []
    for table in (_metrics(certificate.metrics), _signals(certificate.signals)):
        if table.rows:
            accuracies = certificate.metrics if table.head[0] == "metric" else certificate.signals
            table.head += [name for name, _ in more]
            for row, accuracy in zip(table.rows, accuracies.values(), strict=True):
                row += [cell(accuracy) for _, cell in more]
            study_display.show(table)
            print()
    print_notes(certificate)


def print_notes(certificate: Certificate) -> None:
    """Print what depends on the step, what orders mean, what to bear in mind, and what was run."""
    for line in certificate.changing:
        say(line)
    for line in (*_meanings(certificate), *certificate.notes):
        print_wrapped(line, 2)
    steps = ", ".join(map(format_seconds, certificate.steps))
    times = f"{certificate.cost:.3g} times as long as one" if certificate.runs else ""
    say(f"steps of {steps} ({certificate.method}; {certificate.runs} runs, {times}, {certificate.seconds:.3g} s)")


def _meanings(certificate: Certificate) -> Iterator[str]:
    by_kind: dict[str, list[str]] = {}
    for name, accuracy in {**certificate.metrics, **certificate.signals}.items():
        by_kind.setdefault(accuracy.kind, []).append(name)
    if NO_ORDER in by_kind:
        yield f"no order: interval from three steps: {', '.join(by_kind[NO_ORDER])}"
    if UNSETTLED in by_kind:
        yield f"~, order not settled: the steps are large, and the error rather too: {', '.join(by_kind[UNSETTLED])}"
    if ROUNDING in by_kind:
        yield f"at rounding, the same at all steps: {', '.join(by_kind[ROUNDING])}"


def _metrics(metrics: Mapping[str, Accuracy]) -> TextTable:
    values = {name: accuracy.values[0] for name, accuracy in metrics.items()}
    units = {name: "" if isinstance(value, list) else metrics[name].unit for name, value in values.items()}
    rows = [[name, format_with_error(values[name], a.error), units[name], _order(a)] for name, a in metrics.items()]
    return TextTable("", ["metric", "value", "unit", "order"], rows)


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
