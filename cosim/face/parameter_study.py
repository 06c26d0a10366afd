"""Many runs of one diagram from a program: a study of a file, of a diagram in memory, or of runs that are listed."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from cosim.errors import DiagramErrors, KeyPath, Problems, RuleViolation, UsageError, WrongType
from cosim.face.recipe import Recipe
from cosim.face.study_table import StudyTable
from cosim.language.overlay import set_value
from cosim.language.plain import GIVEN, node_of, tree_of
from cosim.language.source import Node
from cosim.machine import importing
from cosim.study import dataset, executors, running, study_file, table_files, text_tables
from cosim.study.counter import Counter
from cosim.study.definition import RunsAxis, Study
from cosim.study.running import Options
from cosim.study.variants import Variants

NUMBER = "run"
"""What the axis of runs is called that are listed one by one."""


class Cooked(Protocol):
    """What a recipe has been followed for: a `BlockDiagram`."""

    @property
    def recipe(self) -> Recipe:
        """What it is made from."""


def load_study(path: str | Path, settings: Mapping[str, Any] | None = None) -> ParameterStudy:
    """A study of a YAML file; settings replace values in it: `{"random.count": 20}`. Raises: DiagramErrors."""
    given = {path: node_of(value, KeyPath("settings", keys=path)) for path, value in (settings or {}).items()}
    file = Path(path)
    return ParameterStudy(study_file.build(lambda problems: study_file.changed(file, given, problems), file))


def study(
    diagram: Cooked,
    grid: Mapping[str, Any] | None = None,
    random: Mapping[str, Any] | None = None,
    **sections: Any,
) -> ParameterStudy:
    """A study of a diagram; the arguments are the sections of a study's file, as `cosim keys` has them.

    grid: values by path, `{"blocks.plant.mass": [4, 5, 6]}`; random: `{"count": 100, "draws": {…}}`; sections:
    variants, metrics and the like. Raises: DiagramErrors, WrongType.
    """
    recipe = diagram.recipe
    given = {**sections, **({"grid": grid} if grid else {}), **({"random": random} if random else {})}
    tree = tree_of(given, str(recipe.folder))
    return ParameterStudy(_of(recipe, tree), recipe)


def _of(recipe: Recipe, tree: Node) -> Study:
    """The study of a recipe's diagram that a tree says. Raises: DiagramErrors."""
    place = KeyPath(GIVEN, keys="the diagram", base=str(recipe.folder))
    whole = replace(tree, value={"diagram": Node(str(recipe.path), place, place), **tree.value})
    made = study_file.build(lambda problems: whole, recipe.path.with_name("study"))
    own = Path(recipe.path)
    variants = {
        name: replace(variant, layers=recipe.read)
        if variant.diagram_position == place or variant.diagram == own
        else variant
        for name, variant in made.variants.items()
    }
    made.variants, made.classes = variants, recipe.classes
    return made


def listed(recipe: Recipe, runs: Iterable[Mapping[str, Any]]) -> ParameterStudy:
    """A study of runs that are listed by what each of them changes. Raises: DiagramErrors, WrongType."""
    given: list[tuple[tuple[str, Any], ...]] = []
    first: dict[str, Node] = {}
    for k, changed in enumerate(runs):
        if not isinstance(changed, Mapping):
            raise WrongType(f"run {k} is a {type(changed).__name__}, not a mapping", fix='such as {"run.stop": 5}')
        nodes = {str(p).strip(): node_of(v, KeyPath("sweep", keys=f".sweep([{k}], {p})")) for p, v in changed.items()}
        for path, node in nodes.items():
            first.setdefault(path, node)
        given.append(tuple((path, node.plain()) for path, node in nodes.items()))
    if not given:
        raise UsageError(
            "a sweep of no runs", fix='give mappings: [{"blocks.plant.mass": 4}, {"blocks.plant.mass": 5}]'
        )
    _refuse_unknown(recipe, first)
    made = _of(recipe, Node({}, KeyPath(GIVEN, keys=GIVEN)))
    numbers = Node(list(range(len(given))), KeyPath("sweep", keys=".sweep()"))
    made.grid = (RunsAxis(NUMBER, tuple(first), tuple(range(len(given))), numbers, listed=tuple(given)),)
    _refuse_unfit(made, given)
    return ParameterStudy(made, recipe)


def _refuse_unknown(recipe: Recipe, first: Mapping[str, Node]) -> None:
    """Raises: DiagramErrors with every path that there is not."""
    problems = Problems()
    tree, _ = recipe.read(problems)
    for path, node in first.items():
        problems.attempt(set_value, tree, path, node, node.position)
    problems.raise_if_any()


def _refuse_unfit(made: Study, given: Iterable[tuple[tuple[str, Any], ...]]) -> None:
    """What the first run of each kind sets, by the names that it sets, has a meaning. Raises: DiagramErrors."""
    problems, seen = Problems(), set[frozenset[str]]()
    variants = Variants(made)
    for settings in given:
        names = frozenset(path for path, _ in settings)
        if names in seen:
            continue
        seen.add(names)
        try:
            with importing.LOADING:
                variants.wire(next(iter(made.variants)), settings)
        except DiagramErrors as found:
            for mistake in found.errors:
                if not isinstance(mistake, RuleViolation):
                    problems.add(mistake)
    problems.raise_if_any()


class ParameterStudy:
    """A study that is ready to run; made by `study` and `load_study`."""

    def __init__(self, definition: Study, recipe: Recipe | None = None) -> None:
        self.definition = definition
        self._recipe = recipe

    def run(
        self,
        results: str | Path | None = None,
        threads: int = 0,
        progress: bool | Callable[[int, int], None] = False,
    ) -> StudyTable:
        """Run all members on all cores, to the bits that `cosim study` gives.

        results: a folder where it is kept, and whence it goes on where it was stopped, as `cosim study` does in
        results/; without one it is kept in memory. threads: 0 for one each processor. progress: True for a bar, or
        what is told how many are done, of how many. Ctrl-C raises KeyboardInterrupt.
        Raises: DiagramErrors, ResultError; the first failure where not one run comes to its end.
        """
        if self.definition.records and results is None:
            fix = '.run(results="results"), or leave `record` out'
            raise UsageError("this study records signals, which need a folder", fix=fix)
        folder = None if results is None else Path(results) / self.definition.path.stem
        bar = Counter() if progress is True else nullcontext()
        with bar as counter:
            watch = counter.update if counter else progress if callable(progress) else lambda done, total: None
            options = Options(folder, threads, watch=watch)
            self._send(options)
            found = running.run(self.definition, options)
        if folder:
            dataset.write(folder / "study.nc", found)
            table_files.write(found, text_tables.tables(found))
        return StudyTable(found).completed()

    def _send(self, options: Options) -> None:
        """How processes of their own get the study, where members need some."""
        if not self._recipe:
            return
        self._recipe.see_unchanged()
        try:
            mine = pickle.dumps(self.definition)
        except (pickle.PicklingError, TypeError, AttributeError):
            options.here = True
            return
        if b"__main__" in mine:  # a class of the program's own script or notebook, which no other process has
            options.here = True
        else:
            options.origin = executors.PickledStudy(mine)

    def __repr__(self) -> str:
        made = self.definition
        sizes = [f"{len(made.variants)} variants"] if len(made.variants) > 1 else []
        sizes += [f"{len(axis.values)} of {axis.name}" for axis in made.grid]
        sizes += [f"{made.random.count} draws"] if made.random else []
        return f"a study of {' × '.join(sizes) or 'one run'}: .run()"
