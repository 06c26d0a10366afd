"""Solves the named dimensions of a diagram from its wires and values."""

from __future__ import annotations

from collections.abc import Iterable

from cosim.authoring.variables import OpenDimension, Variable
from cosim.errors import FleetMismatch, Problems, UnsolvedDimension, WrongShape
from cosim.language.source import Node
from cosim.language.values import Value
from cosim.wiring import widths
from cosim.wiring.network import Axis, Component, Signal
from cosim.wiring.open_dimensions import (
    close_known,
    close_one,
    is_unknown,
    is_waiting,
    learn,
    open_dimension,
    shape_text,
    spelled_out,
)

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
        """From wires, then from values, until nothing new is learnt; what is open then is closed."""
        while (
            self._learn_from_wires()
            or self._learn_from_values()
            or close_known(self.components)
            or self._learn_from_values(waiting=True)
            or close_one(self.components)
        ):
            pass

    def _learn_from_wires(self) -> bool:
        before = self._known()
        for component in self.components.values():
            for name, dimension in component.declaration.dimensions.items():
                if dimension.of in component.axes and name not in component.axes:
                    component.axes[name] = Axis(component.axes[dimension.of].size - dimension.less)
            widths.widen(component)
            for port in list(component.wires):
                self.problems.attempt(self._learn_from_wire, component, port)
        return before != self._known()

    def _learn_from_values(self, waiting: bool = False) -> bool:
        """waiting: also of components whose wires have not said yet what is open, until one has been learnt from."""
        before = self._known()
        for (name, variable), value in list(self.values.items()):
            component = self.components[name]
            if not waiting and is_waiting(component):
                continue
            if not self.problems.attempt(self._fits, component, component.declaration.variables[variable], value):
                del self.values[name, variable]
            if waiting and before != self._known():
                return True
        return before != self._known()

    def _known(self) -> list[tuple[dict[str, Axis], dict[str, tuple[Axis, ...]]]]:
        return [({**component.axes}, {**component.opened}) for component in self.components.values()]

    def _learn_from_wire(self, component: Component, port: str) -> None:
        variable = component.declaration.variables[port]
        axes = self._arriving(component, port)
        if axes is None:
            return
        node = component.entry.inputs[port]
        if self._is_dealt(component, variable, axes):
            axes = axes[1:]
        origin = f"input `{port}` at {node.position}"
        dimensions = self._learn_open(component, variable, axes, origin)
        if len(axes) != len(dimensions):
            raise self._shape_error(component, variable, axes, node)
        for dimension, axis in zip(dimensions, axes, strict=True):
            if not self._unify(component, dimension, axis, origin):
                raise self._shape_error(component, variable, axes, node)

    def _is_dealt(self, component: Component, variable: Variable, axes: tuple[Axis, ...]) -> bool:
        """Whether what arrives is dealt out to the members of a fleet; to open inputs, what comes from that fleet."""
        if not component.fleet or not axes or axes[0].size != component.count:
            return False
        if is_unknown(component, variable):
            return axes[0].fleet == component.fleet
        return len(axes) == len(spelled_out(component, variable)) + 1

    def _learn_open(
        self, component: Component, variable: Variable, axes: tuple[Axis, ...], origin: str
    ) -> tuple[int | str, ...]:
        """The dimensions of a variable, axis by axis, after its open one has been learnt."""
        if is_unknown(component, variable):
            self.origins.setdefault((component.name, str(open_dimension(variable))), origin)
        learn(component, variable, axes)
        return spelled_out(component, variable)

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
        own = component.fleet if size == component.count else None
        fleet = next((f for f, n in self.fleets.items() if n == size), None)
        return (Axis(size, own or fleet), *parts[0][1:])

    def _axes(self, component: Component, port: str, source: Signal) -> tuple[Axis, ...] | None:
        """The axes of one source of an input; None while they are not known."""
        there = self.components[source.component]
        axes = there.signal_axes(there.declaration.variables[source.variable])
        if axes is None or source.members is None:
            return axes
        last = source.members if isinstance(source.members, int) else source.members[1]
        size = axes[0].size if axes else 0
        if last > size:
            there_is = f"has {size} members" if size else "is one number"
            message = f"block {component.name}: `{source}` for input `{port}`: {source.whole} {there_is}"
            fix = f"take members 1 to {size}" if size else f"write {source.whole}"
            raise WrongShape(message, component.entry.inputs[port].position, fix)
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
        arrived = ", ".join(f"{a.fleet}: {a.size}" if a.fleet else str(a.size) for a in axes)
        expected = shape_text(component, variable)
        message = f"block {component.name}: input `{variable.name}` takes {expected}, but ({arrived}) arrives"
        message += self._origins_text(component, [d for d in variable.shape if isinstance(d, OpenDimension)])
        fleet = axes[0].fleet if axes else None
        fix = f"is `per: {fleet}` missing?" if fleet and not component.fleet else "wire a signal of that shape"
        if not axes and len(variable.shape) == 1 and isinstance(node.value, str):
            fix = f"write [{node.value}], or the sources of all elements, as a list"
        return WrongShape(message, node.position, fix)

    def _origins_text(self, component: Component, dimensions: Iterable[int | str]) -> str:
        """Where the sizes of dimensions come from."""
        given = {d: self.origins[component.name, d] for d in dimensions if (component.name, d) in self.origins}
        return "".join(f"; `{d}` is that of {origin}" for d, origin in given.items())

    def _fits(self, component: Component, variable: Variable, value: Value) -> bool:
        """Learn from a value. Raises: FleetMismatch, WrongShape."""
        shape, dimensions = value.shape, spelled_out(component, variable)
        rank = len(dimensions)
        if shape == () or (is_unknown(component, variable) and widths.follows(component, variable)):
            return True
        if is_unknown(component, variable):
            return self._fits_open(component, variable, value)
        if component.fleet and len(shape) == rank + 1:
            self._check_members(component, variable, value)
            shape = shape[1:]
        elif len(shape) == rank - 1:  # one row, evaluated for each member of the first axis
            if not self._unify_all(component, variable, dimensions[1:], shape, value):
                raise self._value_error(component, variable, value)
            return True
        own = component.axes_of(variable.shape[0]) if variable.shape and variable.shape[0] in component.axes else ()
        if len(shape) == rank and own and own[0].fleet and shape[0] != own[0].size:
            message = f"block {component.name}: `{variable.name}` has {shape[0]} entries for a fleet of {own[0].size}"
            raise FleetMismatch(message, value.position, "give one for each member, or an expression in i")
        if len(shape) != rank or not self._unify_all(component, variable, dimensions, shape, value):
            raise self._value_error(component, variable, value)
        return True

    def _check_members(self, component: Component, variable: Variable, value: Value) -> None:
        """Raises: FleetMismatch where a value has not one entry for each member."""
        if value.shape[0] != component.count:
            members = f"{component.count} {component.fleet}s"
            message = f"block {component.name}: `{variable.name}` has {value.shape[0]} entries for {members}"
            raise FleetMismatch(message, value.position, f"give one for each {component.fleet}, or one value for all")

    def _fits_open(self, component: Component, variable: Variable, value: Value) -> bool:
        """Learn an open dimension. A list with as many entries as there are members has one for each of them."""
        shape, others = value.shape, len(variable.shape) - 1
        if component.fleet and shape[0] == component.count and len(shape) > others:
            shape = shape[1:]
        if len(shape) > others:
            axes, origin = tuple(Axis(size) for size in shape), f"`{variable.name}` at {value.position}"
            dimensions = self._learn_open(component, variable, axes, origin)
            if not self._unify_all(component, variable, dimensions, shape, value):
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
        expected = shape_text(component, variable)
        message = f"block {component.name}: `{variable.name}` has the shape {expected}, not {value.shape}"
        message += self._origins_text(component, variable.shape)
        return WrongShape(message, value.position, "give a list of that shape, or one number for all elements")


def report_unsolved(components: dict[str, Component], values: Values, problems: Problems) -> None:
    """An UnsolvedDimension for every named dimension that nothing determines."""
    for component in components.values():
        opened = {open_dimension(v) for v in component.declaration.variables.values()}
        for name in sorted(set(component.declaration.dimension_names()) - set(component.axes) - opened):
            message = (
                f"block {component.name}: nothing determines the dimension `{name}` of {component.declaration.name}"
            )
            fix = f"add `{name}: <size>` under blocks.{component.name}.dimensions"
            filled = _filled(component, name, values)
            if filled:
                variable, value = filled
                if not (variable.dtype.hasobject or value.is_arithmetic):
                    problems.attempt(value.array, (), variable.dtype, {})
                    continue
                one = f"{'[' * len(variable.shape)}{value.content}{']' * len(variable.shape)}"
                fix = f"write `{variable.name}: {one}` where it is one number, or {fix}"
            problems.add(UnsolvedDimension(message, filled[1].position if filled else component.entry.position, fix))


def _filled(component: Component, dimension: str, values: Values) -> tuple[Variable, Value] | None:
    """The first variable with a dimension for which the diagram gives one number, which would fill it."""
    for variable in component.declaration.variables.values():
        value = values.get((component.name, variable.name))
        if variable.name in component.given and value and value.shape == () and dimension in variable.shape:
            return variable, value
    return None


def report_sizes(components: dict[str, Component], values: Values, problems: Problems) -> None:
    """A WrongShape for every block with an axis of 0 elements, or of more than kernels can count.

    Kernels are compiled for sizes from 1 to 2^31 - 1. It names what is given of such a size, else what has it first.
    """
    for component in (c for c in components.values() if not c.declaration.foreign):
        several = component.declaration.variables.values()
        wrong = {v: size for v in several for size in [_wrong_size(component, v)] if size is not None}
        if wrong:
            variable = next((v for v in wrong if v.name in component.given), next(iter(wrong)))
            named = component.entry.dimensions.values()
            value = values.get((component.name, variable.name))
            place = value.position if value else next((n.position for n in named), component.entry.position)
            message = f"block {component.name}: `{variable.name}` has an axis of {wrong[variable]} elements"
            problems.add(WrongShape(message, place, "every dimension has from 1 to 2147483647 elements"))


def _wrong_size(component: Component, variable: Variable) -> int | None:
    """The size of an axis that is none for a kernel."""
    return next((a.size for a in component.signal_axes(variable) or () if not 0 < a.size < 1 << 31), None)
