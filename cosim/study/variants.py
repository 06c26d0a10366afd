"""Wires each structure of a study once, and gives its members their values without wiring again.

Members with the same variant, the same structural settings and values of the same shapes share a `Template`: a program
whose arena is copied and given other numbers. Everything else goes through the diagram's own rules for layers.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.compiling.kernels import Kernels
from cosim.engine import compilation, program, run_key
from cosim.engine.program import Program
from cosim.engine.simulation import Simulation
from cosim.errors import (
    CosimError,
    DiagramErrors,
    MetricError,
    Position,
    Problems,
    RuleViolation,
    UnknownSetting,
    WrongFile,
    WrongShape,
    nearest,
)
from cosim.language import diagram, overlay
from cosim.language.keys import ADDS
from cosim.language.source import Node
from cosim.language.values import Value
from cosim.machine import importing
from cosim.study import consistency, plan
from cosim.study.addresses import address_of, is_value, with_element, written
from cosim.study.definition import Draw, Random, Study, Variant
from cosim.study.draws import Draws
from cosim.study.plain_values import as_content, as_node, names_member, shape_of
from cosim.study.plan import Member
from cosim.wiring import library, resolution
from cosim.wiring.network import Network, Signal
from cosim.wiring.revaluing import revalue

Settings = tuple[tuple[str, Any], ...]


@dataclass(frozen=True)
class Prepared:
    """A member ready to run; the program is its own, the kernels are everybody's.

    shared: as of `run_key.structure`; digests: of all its values.
    """

    network: Network
    program: Program
    kernels: Kernels
    shared: bytes
    digests: Mapping[Signal, bytes]

    @property
    def key(self) -> str:
        """What its result depends on, as a digest."""
        return run_key.key(self.shared, self.program, self.digests)


class Template:
    """One wired structure."""

    def __init__(self, network: Network) -> None:
        self.network = network
        self.program = program.build(network, network.diagram.run.method)
        self.kernels = compilation.compile_program(self.program)
        self.kernels.load()
        self.shared = run_key.structure(network, self.program, self.kernels)
        self._digests = run_key.all_values(network)

    def prepared(self, settings: Settings, positions: dict[str, Position]) -> Prepared:
        """With other values, of the shapes that the template was wired with. Raises: DiagramErrors, ExpressionError."""
        contents: dict[Signal, Node] = {}
        for path, value in settings:
            address = address_of(self.network, path)
            if address:
                before = contents.get(address.signal) or written(self.network, address)
                new = as_content(value, positions[path])
                contents[address.signal] = with_element(before, address.indices, new)
        values = {signal: Value.read(node, str(signal)) for signal, node in contents.items()}
        network = revalue(self.network, values)
        digests = {**self._digests, **run_key.values(network, values)}
        return Prepared(network, self.program.revalued(network, values), self.kernels, self.shared, digests)


class Variants:
    """The templates of a study, each made when it is first needed; may be used from several threads."""

    def __init__(self, study: Study) -> None:
        self.study = study
        self._templates: dict[str, Template] = {}
        self._bases: dict[str, Network] = {}
        self._trees: dict[tuple[str, ...], tuple[Node, list[Path]]] = {}
        self._changes = {(axis.paths[0], change.name): change for axis in study.grid for change in axis.changes}
        self._crossed = {path for path, _ in self._changes}
        grid = {path: axis.node.place for axis in study.grid for path in axis.paths}
        drawn = {path: d.node.place for space in study.spaces for d in space.draws for path in d.paths}
        self.positions: dict[str, Position] = _Places({**grid, **drawn})

    def check(self) -> None:
        """Wire every variant, and its first grid point with typical draws; rules may be broken there.

        Raises: DiagramErrors, with all mistakes of all variants.
        """
        problems = Problems()
        for name in self.study.variants:
            try:
                self.base(name)
                for chosen in plan.crossings(self.study)[1:]:
                    self.wire(name, chosen)
            except CosimError as error:
                problems.add(error)
        problems.raise_if_any()
        consistency.check_against(self.study, self._bases, problems)
        point = plan.grid_settings(self.study, (0,) * len(self.study.grid))
        draws = [None, *(problems.attempt(self.draws_of, space) for space in self.study.spaces)]
        for name, drawn in itertools.product(self.study.variants, draws):
            try:
                self.wire(name, (*point, *(drawn.typical() if drawn else ())))
            except DiagramErrors as found:
                for mistake in found.errors:
                    if not isinstance(mistake, RuleViolation):
                        problems.add(mistake)
        problems.raise_if_any()

    def shareable(self) -> bool:
        """Whether members may run at once in one process: not with the code of FMUs, which nobody vouches for."""
        return not any(self.base(name).has_foreign for name in self.study.variants)

    def base(self, variant: str) -> Network:
        """A variant without grid and draws, with the first of those that it is crossed with. Raises: DiagramErrors."""
        if variant not in self._bases:
            self._bases[variant] = self.wire(variant, plan.crossings(self.study)[0])
        return self._bases[variant]

    def draws(self) -> Draws | None:
        """The draws of the study, as of `draws_of`; None if it has none."""
        return None if self.study.random is None else self.draws_of(self.study.random)

    def draws_of(self, random: Random) -> Draws:
        """Draws; they are judged, and have the shapes that they have, in the study's first variant."""
        first = next(iter(self.study.variants))
        network = self.base(first)
        problems = Problems()
        signals = []
        for bounds in random.accept:
            try:
                signals.append((network.find(bounds.signal, bounds.node.place), bounds))
            except CosimError as error:
                problems.add(error)
        problems.raise_if_any()
        point = plan.grid_settings(self.study, (0,) * len(self.study.grid))

        beginnings = _Beginnings()

        def accepts(settings: Settings) -> bool:
            if not signals:
                return True
            try:
                start = beginnings.at(self.prepared(Member(first, settings=(*point, *settings))))
            except CosimError:
                return False
            found = [(start.value(signal), bounds) for signal, bounds in signals]
            return all(bool(np.all((b.least <= v) & (v <= b.most))) for v, b in found)

        shapes = [problems.attempt(self._draw_shape, network, draw) for draw in random.draws]
        problems.raise_if_any()
        return Draws(random, shapes, accepts)

    def prepared(self, member: Member) -> Prepared:
        """A member's program. Raises: DiagramErrors, KernelError."""
        base = self.base(member.variant)
        values = tuple((path, value) for path, value in member.settings if is_value(base, path, value))
        structure = [pair for pair in member.settings if pair not in values]
        kinds = [(path, str(shape_of(value)), names_member(value)) for path, value in values]
        kind = json.dumps([member.variant, structure, kinds])
        with importing.LOADING:
            if kind not in self._templates:
                self._templates[kind] = Template(self.wire(member.variant, member.settings))
            template = self._templates[kind]
        return template.prepared(values, self.positions)

    def wire(self, variant: str, settings: Settings) -> Network:
        """A member through the diagram's own layers, all of it. Raises: DiagramErrors."""
        problems = Problems()
        changes = [self._changes[pair] for pair in settings if pair[0] in self._crossed]
        tree, files = self._tree((self.study.variants[variant], *changes), problems)
        for path, value in settings:
            if path in self._crossed:
                continue
            try:
                tree = overlay.set_value(tree, path, as_node(value, self.positions[path]), self.positions[path])
            except CosimError as error:
                problems.add(error)
        with importing.LOADING, library.offering(self.study.classes):
            return resolution.wire(diagram.build(tree, files, problems), problems)

    def layers(self, variant: str) -> tuple[Node, list[Path]]:
        """The tree of a variant with all its layers, and the files that it was read from. Raises: DiagramErrors."""
        problems = Problems()
        found = self._tree((self.study.variants[variant],), problems)
        problems.raise_if_any()
        return found

    def _tree(self, changes: tuple[Variant, ...], problems: Problems) -> tuple[Node, list[Path]]:
        """Layers of a variant and of those crossed with it; with the study's metrics, and the recording it asks for."""
        variant, names = changes[0], tuple(change.name for change in changes)
        if names not in self._trees:
            tree, files = self._layers(variant, problems)
            if diagram.is_study(tree):
                message = f"`{variant.diagram}` is a study, not a diagram"
                raise WrongFile(message, variant.diagram_position, "name a diagram, such as the one of that study")
            for change in changes:
                tree = _changed(tree, change)
            self._trees[names] = self._measured(tree), files
        return self._trees[names]

    def _layers(self, variant: Variant, problems: Problems) -> tuple[Node, list[Path]]:
        if variant.layers:
            return variant.layers(problems)
        return overlay.read_layers(variant.diagram, problems, variant.diagram_position)

    def _measured(self, tree: Node) -> Node:
        study, place = self.study, tree.position
        if study.added_metrics:
            tree = overlay.merge(tree, Node({"metrics": study.added_metrics}, place))
        if study.requirements:
            tree = overlay.merge(tree, Node({"requirements": study.requirements}, place))
        entries = dict(tree.value)
        known = entries["metrics"].value if "metrics" in entries else {}
        if study.metrics is not None and isinstance(known, dict):  # of anything else the diagram's grammar tells
            for node in study.metrics:
                if node.value not in known:
                    message = f"there is no metric `{node.value}`"
                    raise MetricError(message, node.position, nearest(str(node.value), known))
            chosen = {node.value: known[node.value] for node in study.metrics}
            entries["metrics"] = replace(entries.get("metrics", tree), value=chosen)
        if study.record is None:
            entries.pop("record", None)
        elif any(key.endswith(ADDS) for key in study.record.value):
            return overlay.merge(replace(tree, value=entries), Node({"record": study.record}, place))
        elif study.record.value:
            entries["record"] = study.record
        return replace(tree, value=entries)

    def _draw_shape(self, network: Network, draw: Draw) -> tuple[int, ...]:
        """The shape of the value that a draw replaces: what stands there is drawn element by element.

        Raises: UnknownSetting, WrongShape.
        """
        path, place = draw.paths[0], draw.node.place
        address = address_of(network, path)
        shape: tuple[int, ...] = ()
        if address:
            node = written(network, address)
            for index in address.indices:
                if not isinstance(node.value, list) or index >= len(node.value):
                    message = f"`{path}`: there is no element {index}"
                    raise UnknownSetting(message, place, "count from 0, and draw an element of a list only")
                node = node.value[index]
            shape = Value.read(node, path).shape
        drawn = np.broadcast_shapes(draw.a.shape, draw.b.shape)
        try:
            return np.broadcast_shapes(shape, drawn)
        except ValueError:
            message = f"`{path}` has the shape {shape}, and its draw the shape {drawn}"
            raise WrongShape(message, place, "give one number for all elements, or one for each") from None


def _changed(tree: Node, change: Variant) -> Node:
    """A diagram with one variant's overlay, swaps and settings on top. Raises: CosimError."""
    if change.overlay:
        tree = overlay.merge(tree, change.overlay)
    for block, node in change.swaps.items():
        tree = overlay.swap_type(tree, block, node)
    for path, node in change.settings.items():
        tree = overlay.set_value(tree, path, node, node.place)
    return tree


class _Places(dict[str, Position]):
    """Where each path is set; what is set by no file, such as a search's smaller steps, is set as by --set."""

    def __missing__(self, path: str) -> Position:
        return Position(f"--set {path}")


class _Beginnings:
    """Runs that are only begun, to see where they start; one simulation serves all that share a template.

    An FMU is begun only once in its life, so a diagram with one gets a new simulation each time.
    """

    def __init__(self) -> None:
        self._simulations: dict[int, Simulation] = {}

    def at(self, prepared: Prepared) -> Simulation:
        """A simulation of that member at time zero. Raises: BlockFailed."""
        key = id(prepared.kernels)
        if prepared.network.has_foreign or key not in self._simulations:
            self._simulations[key] = Simulation(prepared.program, prepared.kernels)
        simulation = self._simulations[key]
        prepared.program.begin(simulation.arena)
        simulation.initialize()
        simulation.close()
        return simulation
