"""A diagram as an object of a program: it is never changed, and whatever changes it makes another one."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.authoring.block import Block
from cosim.drawing import shapes
from cosim.drawing.svg import svg
from cosim.engine import compilation, program
from cosim.engine.run import Run
from cosim.errors import CosimError, KeyPath, WrongType
from cosim.face.finished_run import FinishedRun
from cosim.face.pictures import Picture
from cosim.face.recipe import Recipe
from cosim.language.overlay import Change
from cosim.language.plain import node_of, tree_of
from cosim.machine import files, importing, interruption
from cosim.wiring.network import Network
from cosim.wiring.overview import Overview, describe

if TYPE_CHECKING:
    from cosim.face.stepped_run import SteppedRun
    from cosim.face.study_table import StudyTable


MOST_SHOWN, WIDTH = 200, 80
"""Blocks of a diagram that shows itself as its drawing, and characters of a line of its words."""


def load(path: str | Path, blocks: Iterable[type[Block]] = ()) -> BlockDiagram:
    """A diagram from a YAML file, or an FMU alone.

    blocks: classes of this program, such as those of a notebook's cells, that the diagram names with `block:`.
    Raises: DiagramErrors where the file cannot be read; what it means is judged when it is first needed.
    """
    return _looked_at(Recipe(Path(path), Path.cwd(), classes=_by_name(blocks)))


def diagram(mapping: Mapping[str, Any], folder: str | Path = ".", blocks: Iterable[type[Block]] = ()) -> BlockDiagram:
    """A diagram from the mapping that YAML would say; errors name the path of keys. Arrays and numbers may be NumPy's.

    A block's type may be a class: `{"block": Lag}`. folder: what paths in the mapping are relative to. blocks: as of
    `load`. Raises: DiagramErrors, WrongType.
    """
    base = Path(folder).absolute()
    return _looked_at(Recipe(None, base, tree_of(mapping, str(base)), classes=_by_name(blocks)))


def _looked_at(recipe: Recipe) -> BlockDiagram:
    recipe.look()
    return BlockDiagram(recipe)


def _by_name(blocks: Iterable[type[Block]]) -> dict[str, type[Block]]:
    found: dict[str, type[Block]] = {}
    for block in blocks:
        if not (isinstance(block, type) and issubclass(block, Block)):
            raise WrongType(f"`blocks` takes classes derived from cosim.Block, not {block!r}", fix="blocks=[Lag]")
        if found.setdefault(block.__name__, block) is not block:
            raise WrongType(f"`blocks` has two classes called {block.__name__}", fix="give one of them another name")
    return found


class BlockDiagram:
    """A diagram; made by `load` and `diagram`. It keeps what it was made from, and is wired when it is first needed."""

    def __init__(self, recipe: Recipe) -> None:
        self._recipe = recipe
        self._wired: dict[Path, Network] = {}  # by the working folder, of which the paths in it are

    @property
    def recipe(self) -> Recipe:
        """What it is made from."""
        return self._recipe

    def __reduce__(self) -> tuple[Any, ...]:
        return BlockDiagram, (self._recipe,)

    # ---- other diagrams ----

    def set(self, values: Mapping[str, Any]) -> BlockDiagram:
        """Another diagram with other values, by dotted path as of `--set`: `{"run.stop": 5, "blocks.plant.k": 2}`.

        `blocks.plant.k` is short for `blocks.plant.parameters.k`. Values are numbers, texts, lists, arrays or
        mappings, not YAML's text; None takes away. Raises: DiagramErrors for a path that there is not, WrongType.
        """
        changes = [Change(path, node_of(value, _place("set", path))) for path, value in _items(values, "set")]
        return self._changed(changes)

    def swap(self, types: Mapping[str, Any] | None = None, **by_name: Any) -> BlockDiagram:
        """Another diagram with other types of blocks, as of `--swap`: `.swap(plant="plant.fmu", observer=MyObserver)`.

        types: by block, for names that are no words of Python. A type is a name of the library, `file.py:Class`, an
        .fmu, a .yaml, a class, or an expression. Raises: DiagramErrors for a block that there is not, WrongType.
        """
        pairs = [*(_items(types, "swap") if types is not None else ()), *by_name.items()]
        return self._changed([Change(name, node_of(new, _place("swap", name)), is_swap=True) for name, new in pairs])

    def _changed(self, changes: Iterable[Change]) -> BlockDiagram:
        recipe = replace(self._recipe, changes=(*self._recipe.changes, *changes), files=dict(self._recipe.files))
        return _looked_at(recipe)

    # ---- what it is ----

    @property
    def network(self) -> Network:
        """The wired diagram, as `cosim.describe` and `cosim.export_fmu` take it. Raises: DiagramErrors, ChangedFile."""
        here = Path.cwd()
        with importing.LOADING:
            self._recipe.see_unchanged()
            if here not in self._wired:
                self._wired[here] = self._recipe.wire()
            return self._wired[here]

    def check(self) -> Overview:
        """See, as `cosim check` does, that it can run: its parts, order, loops and conditions, as data.

        Raises: DiagramErrors with all mistakes.
        """
        network = self.network
        with importing.LOADING:
            compilation.compile_program(program.build(network, network.diagram.run.method))
        return describe(network)

    @property
    def yaml(self) -> str:
        """The whole diagram as YAML, all layers merged. Raises: DiagramErrors."""
        return self.network.diagram.resolved()

    def draw(self, output: str | Path | None = None) -> Picture:
        """Its blocks and wires as a picture. output: an .svg where that is written too. Raises: DiagramErrors."""
        picture = Picture(svg(shapes.drawing(self.network)))
        if output is not None:
            picture.save(output)
        return picture

    # ---- runs ----

    def run(
        self,
        engine: str = "native",
        output: str | Path | None = None,
        check: bool = True,
        watch: Callable[[float], None] = lambda time: None,
    ) -> FinishedRun:
        """Run it as `cosim run` does, to the same bits; what is recorded is kept in memory.

        engine: native or python. output: a result file to be written along the run. watch: told the simulated time (s)
        every now and then. Ctrl-C raises KeyboardInterrupt. Raises: DiagramErrors; where the run does not come to its
        end, the error that ended it (Diverged, BlockFailed, Terminated, …), unless `check` is False: then `status` and
        `error` say so. What there is of the run is that error's `run`, and that of the KeyboardInterrupt.
        """
        network, file = self.network, None if output is None else Path(output)
        if file:
            files.require_ending(file, "a result", "nc")
        with importing.LOADING:
            run = Run(network, engine, file, kept=True)
            run.simulation  # noqa: B018  compiled and loaded, which one thread does at a time
        outcome = run.execute(watch)
        finished = FinishedRun(run, outcome)
        if outcome.status == "interrupted":
            stopped = interruption.Interrupted(outcome.signal or interruption.SIGNALS[0])
            stopped.run = finished
            raise stopped
        if check and outcome.error:
            outcome.error.run = finished
            raise outcome.error
        return finished

    def sweep(
        self,
        runs: Iterable[Mapping[str, Any]],
        threads: int = 0,
        progress: bool | Callable[[int, int], None] = False,
    ) -> StudyTable:
        """Run it once for each mapping of changed values, as of `set`, on all cores, as `cosim study` does.

        threads, progress: as of `ParameterStudy.run`. Raises: DiagramErrors for paths that there are not and
        values of which none of that kind fits; a run that fails is a row that says so, unless all do.
        """
        from cosim.face.parameter_study import listed

        return listed(self._recipe, runs).run(threads=threads, progress=progress)

    def start(self, engine: str = "native") -> SteppedRun:
        """A run by hand: `with diagram.start() as sim: sim.step()`. Raises: DiagramErrors."""
        from cosim.face.stepped_run import SteppedRun

        return SteppedRun(self.network, engine)

    # ---- words ----

    def __repr__(self) -> str:
        try:
            network = self.network
        except CosimError as error:
            return f"a diagram that cannot run:\n{error}"
        run, title = network.diagram.run, network.diagram.title
        parts = ", ".join(_part(network, name) for name in network.components)
        return f"{title}: {run.stop:g} s in steps of {run.step:g} s ({run.method})\n{textwrap.fill(parts, WIDTH)}"

    def _repr_mimebundle_(self, **_: Any) -> dict[str, str]:
        """Its drawing for a notebook; where it has mistakes, those. Too many blocks for a screen are not drawn."""
        try:
            if len(self.network.components) > MOST_SHOWN:
                return {"text/plain": repr(self)}
            return {"image/svg+xml": self.draw().svg, "text/plain": repr(self)}
        except CosimError:
            return {"text/plain": repr(self)}


def _part(network: Network, name: str) -> str:
    component = network.components[name]
    return f"{name} ({f'{component.count} × ' if component.fleet else ''}{component.declaration.name})"


def _items(values: Any, method: str) -> Iterable[tuple[str, Any]]:
    if not isinstance(values, Mapping):
        fix = 'such as .set({"run.stop": 5})' if method == "set" else 'such as .swap(plant="plant.fmu")'
        raise WrongType(f".{method}() takes a mapping, not a {type(values).__name__}", fix=fix)
    return [(str(key).strip(), value) for key, value in values.items()]


def _place(method: str, key: str) -> KeyPath:
    return KeyPath(method, keys=f".{method}({key})", base=str(Path.cwd()))
