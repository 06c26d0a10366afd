"""What a study says in two places has to fit together: before anything is wired, and once its diagrams are known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import combinations

from cosim.errors import (
    CosimError,
    DiagramErrors,
    MetricError,
    PlotError,
    Position,
    Problems,
    TooLarge,
    UnknownSetting,
    WrongValue,
    nearest,
)
from cosim.language.source import Node
from cosim.plot.figures import Figure
from cosim.study import file_names, plan
from cosim.study.definition import MOST_MEMBERS, STEP_TIME, Study
from cosim.wiring.network import Network

OWN = ("variant", "draw", "status", "reason", "steps", "seconds", "conditions", STEP_TIME)
"""What the data set or the tables of every study have; a metric of such a name would take its place."""


def check(study: Study, variants: Mapping[str, Node], problems: Problems) -> None:
    """Report what contradicts itself within the study's file."""
    _variants(variants, problems)
    _paths(study, problems)
    _axes(study, problems)
    _titles(study, problems)
    _size(study, problems)
    for figure in study.figures:
        if not figure.distribution and not study.records:
            message = f"`figures.{figure.name}` shows signals, and the study records none"
            problems.add(PlotError(message, figure.position, "write `record: true`"))


def _variants(variants: Mapping[str, Node], problems: Problems) -> None:
    """Variants are names of files, so they have to be fit for that, and different on every file system."""
    known: dict[str, str] = {}
    for name, node in variants.items():
        fix = "letters, digits, spaces, _ and -, beginning with a letter or digit"
        if flaw := file_names.flaw(name):
            problems.add(WrongValue(f"a variant cannot be called {name!r}: {flaw}", node.place, fix))
        elif (same := file_names.folded(name)) in known:
            message = f"the variants `{known[same]}` and `{name}` have one name where letter case does not count"
            problems.add(WrongValue(message, node.place, "rename one of them"))
        else:
            known[same] = name


def _size(study: Study, problems: Problems) -> None:
    count = plan.size(study)
    if count > MOST_MEMBERS:
        draws = study.random.draws if study.random else ()
        nodes = [*(axis.node for axis in study.grid), *(draw.node for draw in draws)]
        message = f"the study has {count} members: variants, grid and draws are multiplied"
        fix = f"at most {MOST_MEMBERS}; take fewer values, or random draws in place of a grid"
        problems.add(TooLarge(message, nodes[0].place if nodes else None, fix))


def _paths(study: Study, problems: Problems) -> None:
    """Two places that set the same value: one of them would win without a word."""
    setters = list(_setters(study))
    for (one, first, _), (two, second, place) in combinations(setters, 2):
        if _within(one, two) or _within(two, one):
            message = f"{first} and {second} set the same value" + (
                f": `{one}` and `{two}`" if one != two else f" `{one}`"
            )
            problems.add(WrongValue(message, place, "remove one of them"))
    for variant in (*study.variants.values(), *(change for axis in study.grid for change in axis.changes)):
        for path, node in variant.settings.items():
            wins = [name for other, name, _ in setters if _within(path, other)]
            if wins:
                message = f"variant `{variant.name}` sets `{path}`, which {wins[0]} replaces in every run"
                problems.add(WrongValue(message, node.place, "remove one of them"))


def _setters(study: Study) -> Iterator[tuple[str, str, Position]]:
    for axis in study.grid:
        yield from ((path, "`grid`", axis.node.place) for path in axis.paths)
    for draw in study.random.draws if study.random else ():
        yield from ((path, "`random.draws`", draw.node.place) for path in draw.paths)


def _within(path: str, other: str) -> bool:
    """Whether a dotted path is another, or leads below it."""
    return path == other or path.startswith(f"{other}.")


def _axes(study: Study, problems: Problems) -> None:
    seen: dict[str, Position] = {}
    for axis in study.grid:
        if axis.name in OWN:
            message = f"no axis of the grid can be called `{axis.name}`, which the data set has already"
            problems.add(WrongValue(message, axis.node.place, "give it another name"))
        if axis.name in seen:
            message = f"two axes of the grid are called `{axis.name}`"
            problems.add(WrongValue(message, axis.node.place, "rename the block"))
        seen[axis.name] = axis.node.place
        twice = [label for label, count in Counter(axis.labels).items() if count > 1]
        if twice:
            message = f"`grid.{', '.join(axis.paths)}` has the value {twice[0]} twice"
            problems.add(WrongValue(message, axis.node.position, "remove one of them"))


def _titles(study: Study, problems: Problems) -> None:
    """Tables and pictures are files, named by their titles."""
    for things in ([(t.title, t.node.place) for t in study.tables], [(f.name, f.position) for f in study.figures]):
        known: dict[str, str] = {}
        for title, place in things:
            stem = file_names.stem(title)
            if stem in known:
                message = f"`{known[stem]}` and `{title}` would be written to one file, `{stem}`"
                problems.add(WrongValue(message, place, "give them titles that differ in letters or digits"))
            known.setdefault(stem, title)


def check_against(study: Study, bases: Mapping[str, Network], problems: Problems) -> None:
    """Report what the variants' diagrams, each as it is without grid and draws, do not have."""
    metrics = dict.fromkeys(name for network in bases.values() for name in network.diagram.figures)
    _metric_names(study, bases, problems)
    for where, node, known in _named_metrics(study, bases, list(metrics)):
        if str(node.value) not in known:
            message = f"{where}: there is no metric `{node.value}`"
            problems.add(MetricError(message, node.position, nearest(str(node.value), known)))
        elif shape := _shape(str(node.value), bases):
            message = f"{where}: the metric `{node.value}` has the shape {shape}, and a table takes single numbers"
            problems.add(MetricError(message, node.position, "reduce it with max, min, mean or rms"))
    problems.add(DiagramErrors(_without_limit(study, bases)))
    members = set(plan.names(study)) if any(figure.members for figure in study.figures) else set()
    for figure in study.figures:
        _figure(figure, study, bases, members, problems)


def _without_limit(study: Study, bases: Mapping[str, Network]) -> list[CosimError]:
    """The metrics of `until` that do not say what a violation is."""
    required = {name for network in bases.values() for name in network.diagram.requirements}
    metrics = {name for network in bases.values() for name in network.diagram.metrics}
    return [
        WrongValue(f"`until.{until.name}` does not say what a violation is", until.node.place, "write below: or above:")
        for until in study.until
        if until.above is None and until.below is None and until.name in metrics - required
    ]


def _metric_names(study: Study, bases: Mapping[str, Network], problems: Problems) -> None:
    taken = (*OWN, *study.dimensions)
    for network in bases.values():
        for name, place in _places(network):
            if name in taken or not name.strip(" ./"):
                message = f"in a study no figure can be called `{name}`, which its data set has already"
                problems.add(MetricError(message, place, "rename it"))


def _places(network: Network) -> Iterator[tuple[str, Position]]:
    """Each figure's name, and where it stands."""
    for metric in network.diagram.metrics.values():
        yield metric.name, metric.position
    for requirement in network.diagram.requirements.values():
        yield requirement.name, requirement.position


def _named_metrics(
    study: Study, bases: Mapping[str, Network], known: list[str]
) -> Iterator[tuple[str, Node, list[str]]]:
    """Where the study names a metric, the name, and what it could be."""
    for table in study.tables:
        yield from ((f"`tables.{table.title}`", column.metric, [*known, STEP_TIME]) for column in table.columns)
    if study.question:
        yield "`explain`", study.question.metric, list(bases[study.question.baseline].diagram.figures)
    for until in study.until:
        yield "`until`", Node(until.name, until.node.place), known
    for figure in study.figures:
        if figure.distribution:
            yield f"`figures.{figure.name}`", Node(figure.distribution.metric, figure.position), known
    for item in study.references:
        own = list(bases[item.variant].diagram.figures)
        yield f"`references.{item.origin}.{item.variant}`", item.metric, own


def _shape(name: str, bases: Mapping[str, Network]) -> tuple[int, ...]:
    """The shape of a metric's value, () for a number and for events."""
    for network in bases.values():
        metric = network.diagram.metrics.get(name)
        if metric and metric.reduce == "final":
            return network.shape(network.reduced[name])
    return ()


def _figure(figure: Figure, study: Study, bases: Mapping[str, Network], members: set[str], problems: Problems) -> None:
    """The members that a figure shows are there, and record what it shows."""
    if figure.distribution or not study.records:
        return
    for name in figure.members:
        if name not in members:
            message = f"`figures.{figure.name}`: the study has no member `{name}`"
            problems.add(UnknownSetting(message, figure.position, nearest(name, members)))
    shown = [plan.variant_of(study, name) for name in figure.members if name in members] or list(bases)
    for network in (bases[variant] for variant in shown):
        record = network.diagram.record
        recorded = {str(node.value) for node in record.signals} if record else set()
        for signal in figure.signals():
            if signal not in recorded:
                message = f"`figures.{figure.name}` shows `{signal}`, which is not recorded"
                fix = nearest(signal, recorded) if recorded else "name it below `record: {signals: […]}`"
                problems.add(PlotError(message, figure.position, fix))
    _figure_times(figure, study, [bases[variant] for variant in shown], problems)


def _figure_times(figure: Figure, study: Study, shown: list[Network], problems: Problems) -> None:
    """The times that a figure shows are within the longest of its runs."""
    if any(path == "run.stop" for path, _, _ in _setters(study)):
        return  # each member has its own
    last = max((network.diagram.run.stop for network in shown), default=0.0)
    reaches = f"its runs are from 0 to {last:g} s"
    for panel in figure.panels:
        if panel.span and not panel.over and (panel.span[0] >= last or panel.span[1] <= 0):
            message = f"`figures.{figure.name}` shows nothing from {panel.span[0]:g} to {panel.span[1]:g} s"
            problems.add(PlotError(message, panel.places.get("span"), reaches))
    for time in figure.plane.at if figure.plane else ():
        if not 0 <= time <= last:
            message = f"`figures.{figure.name}` shows bodies at {time:g} s, when there is no run"
            problems.add(PlotError(message, figure.plane.places.get("at") if figure.plane else None, reaches))
