"""Solves the named dimensions of a diagram from its wires and values."""

from __future__ import annotations

from cosim.authoring.variables import Variable
from cosim.errors import FleetMismatch, Problems, UnsolvedDimension, WrongShape
from cosim.language.source import Node
from cosim.language.values import Value
from cosim.wiring.network import Axis, Component, Signal

Values = dict[tuple[str, str], Value]


def solve(components: dict[str, Component], values: Values, fleets: dict[str, int], problems: Problems) -> None:
    """Fill in `Component.axes`; values: by component and variable. Mistakes go to `problems`."""
    _Dimensions(components, values, fleets, problems).solve()


class _Dimensions:
    def __init__(
        self, components: dict[str, Component], values: Values, fleets: dict[str, int], problems: Problems
    ) -> None:
        self.components = components
        self.values = values
        self.fleets = fleets
        self.problems = problems
        self.origins: dict[tuple[str, int | str], str] = {}  # by component and dimension: what gave it its size

    def solve(self) -> None:
        """From wires, then from values, until nothing new is learnt."""
        learnt = True
        while learnt:
            before = {n: dict(s.axes) for n, s in self.components.items()}
            for component in self.components.values():
                for port in list(component.wires):
                    self.problems.attempt(self._learn_from_wire, component, port)
            for (name, variable), value in list(self.values.items()):
                component = self.components[name]
                if not self.problems.attempt(self._fits, component, component.declaration.variables[variable], value):
                    del self.values[name, variable]
            learnt = any(before[n] != s.axes for n, s in self.components.items())

    def _learn_from_wire(self, component: Component, port: str) -> None:
        variable = component.declaration.variables[port]
        axes = self._arriving(component, port)
        if axes is None:
            return
        node = component.entry.inputs[port]
        if component.fleet and len(axes) == len(variable.shape) + 1 and axes[0].size == component.count:
            axes = axes[1:]
        if len(axes) != len(variable.shape):
            raise self._shape_error(component, variable, axes, node)
        for dimension, axis in zip(variable.shape, axes, strict=True):
            if not self._unify(component, dimension, axis, f"input `{port}` at {node.position}"):
                raise self._shape_error(component, variable, axes, node)

    def _arriving(self, component: Component, port: str) -> tuple[Axis, ...] | None:
        """The axes that arrive at an input: those of its source, or of its sources joined along the first axis."""
        found = [self._axes(component, port, source) for source in component.wires[port] if source.variable]
        if not found or any(axes is None for axes in found):
            return None
        if not isinstance(component.entry.inputs[port].value, list):
            return found[0]
        rank = max(1, *(len(axes) for axes in found if axes is not None))
        parts = [axes if len(axes) == rank else (Axis(1), *axes) for axes in found if axes is not None]
        if any(len(axes) != rank or axes[1:] != parts[0][1:] for axes in parts):
            message = f"block {component.name}: the sources joined for input `{port}` differ in shape"
            raise WrongShape(message, component.entry.inputs[port].position, "join signals that differ in members only")
        size = sum(axes[0].size for axes in parts)
        fleet = next((f for f, n in self.fleets.items() if n == size), None)
        return (Axis(size, component.fleet or fleet), *parts[0][1:])

    def _axes(self, component: Component, port: str, source: Signal) -> tuple[Axis, ...] | None:
        """The axes of one source of an input; None while they are not known."""
        there = self.components[source.component]
        axes = there.signal_axes(there.declaration.variables[source.variable])
        if axes is None or source.members is None:
            return axes
        last = source.members if isinstance(source.members, int) else source.members[1]
        size = axes[0].size if axes else 0
        if last > size:
            message = f"block {component.name}: `{source}` for input `{port}`: {source.whole} has {size} members"
            raise WrongShape(
                message, component.entry.inputs[port].position, f"take members 1 to {size}" if size else ""
            )
        return source.axes(axes)

    def _unify(self, component: Component, dimension: int | str, axis: Axis, origin: str) -> bool:
        """Whether an axis has the size of a dimension, which it gives it if there is none yet."""
        if isinstance(dimension, int):
            return dimension == axis.size
        known = component.axes.get(dimension)
        if known is None or (known.size == axis.size and known.fleet is None):
            component.axes[dimension] = axis
            self.origins.setdefault((component.name, dimension), origin)
            return True
        return known.size == axis.size

    def _shape_error(self, component: Component, variable: Variable, axes: tuple[Axis, ...], node: Node) -> WrongShape:
        expected = ", ".join(self._dimension_text(component, d) for d in variable.shape)
        arrived = ", ".join(f"{a.fleet}: {a.size}" if a.fleet else str(a.size) for a in axes)
        message = f"block {component.name}: input `{variable.name}` takes ({expected}), but ({arrived}) arrives"
        fleet = axes[0].fleet if axes else None
        fix = f"is `per: {fleet}` missing?" if fleet and not component.fleet else "wire a signal of that shape"
        return WrongShape(message, node.position, fix)

    def _dimension_text(self, component: Component, dimension: int | str) -> str:
        known = component.axes.get(dimension) if isinstance(dimension, str) else None
        return f"{dimension} = {known.size}" if known else str(dimension)

    def _fits(self, component: Component, variable: Variable, value: Value) -> bool:
        """Learn from a value. Raises: FleetMismatch, WrongShape."""
        shape = value.shape
        rank = len(variable.shape)
        if shape == ():
            return True
        if component.fleet and len(shape) == rank + 1:
            if shape[0] != component.count:
                members = f"{component.count} {component.fleet}s"
                message = f"block {component.name}: `{variable.name}` has {shape[0]} entries for {members}"
                fix = f"give one for each {component.fleet}, or one value for all"
                raise FleetMismatch(message, value.position, fix)
            shape = shape[1:]
        elif len(shape) == rank - 1:  # one row, evaluated for each member of the first axis
            if not self._unify_all(component, variable, variable.shape[1:], shape, value):
                raise self._value_error(component, variable, value)
            return True
        if len(shape) == rank and rank and component.counts_members(variable.shape[0]):
            size = component.axes[variable.shape[0]].size
            if shape[0] != size:
                message = f"block {component.name}: `{variable.name}` has {shape[0]} entries for a fleet of {size}"
                raise FleetMismatch(message, value.position, "give one for each member, or an expression in i")
        if len(shape) != rank or not self._unify_all(component, variable, variable.shape, shape, value):
            raise self._value_error(component, variable, value)
        return True

    def _unify_all(
        self,
        component: Component,
        variable: Variable,
        dimensions: tuple[int | str, ...],
        shape: tuple[int, ...],
        value: Value,
    ) -> bool:
        origin = f"`{variable.name}` at {value.position}"
        agree = [self._unify(component, d, Axis(n), origin) for d, n in zip(dimensions, shape, strict=True)]
        return all(agree)

    def _value_error(self, component: Component, variable: Variable, value: Value) -> WrongShape:
        expected = ", ".join(self._dimension_text(component, d) for d in variable.shape)
        message = f"block {component.name}: `{variable.name}` has the shape ({expected}), not {value.shape}"
        given = {d: self.origins[component.name, d] for d in variable.shape if (component.name, d) in self.origins}
        message += "".join(f"; `{d}` is that of {origin}" for d, origin in given.items())
        return WrongShape(message, value.position, "give a list of that shape, or one number for all elements")


def report_unsolved(components: dict[str, Component], problems: Problems) -> None:
    """An UnsolvedDimension for every named dimension that nothing determines."""
    for component in components.values():
        for name in sorted(set(component.declaration.dimension_names()) - set(component.axes)):
            message = (
                f"block {component.name}: nothing determines the dimension `{name}` of {component.declaration.name}"
            )
            fix = f"add `{name}: <size>` under blocks.{component.name}.dimensions"
            problems.add(UnsolvedDimension(message, component.entry.position, fix))


def report_sizes(components: dict[str, Component], values: Values, problems: Problems) -> None:
    """A WrongShape for every variable with an axis of 0 elements, or of more than kernels can count.

    Kernels are compiled for sizes from 1 to 2^31 - 1.
    """
    for component in components.values():
        for variable in component.declaration.variables.values():
            axes = component.signal_axes(variable)
            wrong = next((a.size for a in axes or () if not 0 < a.size < 1 << 31), None)
            if wrong is None or component.declaration.foreign:
                continue
            named = component.entry.dimensions.values()
            value = values.get((component.name, variable.name))
            place = value.position if value else next((n.position for n in named), component.entry.position)
            message = f"block {component.name}: `{variable.name}` has an axis of {wrong} elements"
            problems.add(WrongShape(message, place, "every dimension has from 1 to 2147483647 elements"))
