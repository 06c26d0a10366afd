"""Whether equal steps of an explicit integrator are too long for what decays fast: looked at once, at the start.

    J by differences, of a bank's derivatives to its states, along some directions (Arnoldi's method)
    for the eigenvalues λ that this finds:
        if a motion that decays, e^(λ t), becomes one that grows, R(h λ)^n, within the run: say so

Done with compiled functions whatever the engine, so that nobody who debugs meets it. Of large fleets, only those
members are looked at whose derivatives change most with a change of all states.

Where a derivative has a jump or a root, small changes do not make small differences: no J, no verdict.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from cosim.compiling.kernels import Kernels
from cosim.engine import hosts
from cosim.engine.binding import Binding
from cosim.engine.probes import Buffers
from cosim.engine.program import Program
from cosim.errors import CosimError
from cosim.integrators import Tableau
from cosim.machine import floating, memory
from cosim.master import tables
from cosim.wiring.network import Component

MOST_DIRECTIONS = 10
MOST_STATES = 50_000
PIECE = 100_000  # states at a time, of more
CHANGE = 1e-6  # of a state over its size
LARGER = 100.0  # times that: where J is one, it gives the same
ALIKE = 0.1  # over an eigenvalue
SMALL = 1e-3  # size of a state that is zero
NOTHING = 1e-9  # of a new direction, over what it is left of
GROWTH = math.log(10.0)  # of a disturbance in the course of the run


def warnings(program: Program, kernels: Kernels, arena: np.ndarray, wanted: Callable[[], bool]) -> list[CosimError]:
    """What is to be said of each block, or of all together; arena: of a run, initialized, which is used up.

    wanted: whether somebody wants the run to stop. Raises: BlockFailed, KeyboardInterrupt where a function does not
    return.
    """
    banks = [bank for bank in program.banks if _is_looked_at(program, kernels, bank)]
    if not banks:
        return []
    look = _Look(program, kernels, arena)
    found: list[CosimError] = []

    def command() -> int:
        with floating.standard(), np.errstate(all="ignore"):
            found.extend(warning for bank in banks if (warning := look.warning(bank)))
        return tables.OK

    watch = hosts.Watch(program, look.control, {})
    host = hosts.Here({}, {"look": command}, watch, program.network.diagram.run.patience, (look, kernels))
    try:
        host.run("look", wanted)
    finally:
        host.close(terminate=False)
    return found


def _is_looked_at(program: Program, kernels: Kernels, bank: np.ndarray) -> bool:
    """Whether a bank takes equal steps of an explicit integrator, and all that gives its derivatives is compiled."""
    if bank[tables.CONTROLLED] or bank[tables.IMPLICIT] or bank[tables.BEGIN] == bank[tables.END]:
        return False
    rows = [row for begin, end in _rows(program, bank) for row in program.rows[begin:end]]
    called = {program.calls[int(row[tables.A])].component for row in rows if row[tables.KIND] == tables.CALL}
    components = [program.network.components[name] for name in called]
    return all(kernels.modules[c.name] is not None and not c.declaration.foreign for c in components)


def _rows(program: Program, bank: np.ndarray) -> list[tuple[int, int]]:
    """The rows that give a bank's derivatives to its states; where a step has one stage only, outputs come first."""
    inner = int(bank[tables.INNER_BEGIN]), int(bank[tables.INNER_END])
    first = int(bank[tables.FIRST_BEGIN]), int(bank[tables.FIRST_END])
    return [inner] if inner[0] < inner[1] else [program.phases["EVALUATE"], first]


class _Look:
    """Derivatives are asked for in an arena, initialized, which is used up."""

    def __init__(self, program: Program, kernels: Kernels, arena: np.ndarray) -> None:
        self.program = program
        self.arena = arena
        self.control = _words(tables.CONTROL_WORDS)
        self._binding = Binding(program, kernels, arena, self.control, memory.private)
        self._binding.fill(Buffers(program, arena, (), 1, _words))
        self.control[tables.N_PUBLISHED] = self.control[tables.N_PUBLISHED32] = 0  # nothing of this is published
        self.control[tables.TICK] = 1  # sampled blocks that are not due at every step hold what they gave

    def warning(self, bank: np.ndarray) -> CosimError | None:
        """What is to be said of a bank's steps, if anything."""
        run, states = self.program.network.diagram.run, self._states(bank)
        h = run.step / int(bank[tables.INNER_STEPS])
        states[:] = self._vector(bank, "X")
        x, f = states.copy(), self._derivative(bank).copy()
        if not np.isfinite(f).all():
            return None
        kept = np.arange(x.size) if x.size <= MOST_STATES else self._fastest(bank, self._gains(bank, x, f, h))
        states[:] = x
        x, f = x[kept], f[kept]
        scale = _sizes(x, f, h)

        def along(direction: np.ndarray, change: float) -> np.ndarray:
            """J times a direction, by a change; all over the states' sizes."""
            states[kept] = x + change * scale * direction
            return np.asarray((self._derivative(bank)[kept] - f) / (change * scale))

        def component(direction: np.ndarray) -> Component:
            """Whose state moves most."""
            return self._owner(bank, int(kept[np.argmax(np.abs(direction))]))

        integration = component(x).integration
        method, steps = integration.method, run.steps * integration.inner_steps
        assert isinstance(method, Tableau)
        for value, direction in eigenvalues(along, x.size):
            decays = run.stop * value.real < -GROWTH
            grows = steps * math.log(max(abs(amplification(method, h * value)), 1e-300)) > GROWTH
            if decays and grows and _is_seen(along, value, direction):
                return _warning(component(direction), method, h, value, run.step)
        return None

    def _gains(self, bank: np.ndarray, x: np.ndarray, f: np.ndarray, h: float) -> np.ndarray:
        """By how much each derivative, f at x, changes with a change of all states; infinite where it is no number."""
        states, pieces = self._states(bank), [slice(begin, begin + PIECE) for begin in range(0, x.size, PIECE)]
        for piece in pieces:
            states[piece] += CHANGE * _sizes(x[piece], f[piece], h) * _any_direction(piece.start, x[piece].size)
        gains = self._derivative(bank)
        for piece in pieces:
            gains[piece] = np.abs(gains[piece] - f[piece]) / (CHANGE * _sizes(x[piece], f[piece], h))
        gains[np.isnan(gains)] = math.inf
        return gains

    def _fastest(self, bank: np.ndarray, gains: np.ndarray) -> np.ndarray:
        """The numbers, in a bank, of states of those members of each fleet that have the largest of `gains`."""
        fleets: dict[str | None, list[Component]] = {}
        for component in self.program.owners(bank):
            fleets.setdefault(component.fleet, []).append(component)
        found = []
        for components in fleets.values():
            numbers = np.concatenate([self.program.layout.states_of(c) for c in components], axis=1)
            numbers -= int(bank[tables.BEGIN])
            room = MOST_STATES // (len(fleets) * numbers.shape[1])
            members = np.argsort(-gains[numbers].max(axis=1), kind="stable")[: max(room, 1)]
            found.append(numbers[members].reshape(-1))
        return np.sort(np.concatenate(found))

    def _owner(self, bank: np.ndarray, state: int) -> Component:
        """Whose a bank's state is."""
        offset = self.program.layout.vectors["X"] + 8 * (int(bank[tables.BEGIN]) + state)
        return self.program.network.components[self.program.owner(offset)[0].component]

    def _vector(self, bank: np.ndarray, name: str) -> np.ndarray:
        begin = self.program.layout.vectors[name] + 8 * int(bank[tables.BEGIN])
        return self.arena[begin : begin + 8 * int(bank[tables.END] - bank[tables.BEGIN])].view(float)

    def _states(self, bank: np.ndarray) -> np.ndarray:
        """Those at which a bank's derivatives are asked for."""
        return self._vector(bank, "X" if bank[tables.IN_PLACE] else "W")

    def _derivative(self, bank: np.ndarray) -> np.ndarray:
        """A bank's derivatives at `_states`, valid until the next ones; no numbers where a function fails."""
        derivatives = self._vector(bank, "D")
        for begin, end in _rows(self.program, bank):
            self.control[tables.FIRST_ROW], self.control[tables.END_ROW] = begin, end
            status = self._binding.commands["execute"](0.0, self.arena.ctypes.data, self.control.ctypes.data)
            if status > tables.WARNING:
                derivatives[:] = np.nan
                return derivatives
        return derivatives


def _sizes(x: np.ndarray, f: np.ndarray, h: float) -> np.ndarray:
    """Those of states, by what they are and by how they change in a step."""
    return np.asarray(np.maximum(np.maximum(np.abs(x), h * np.abs(f)), SMALL))


def _any_direction(begin: int, size: int) -> np.ndarray:
    """As good as any: some elements of a direction."""
    return np.cos(np.arange(begin, begin + size, dtype=float) ** 2 + 1.0)


def _words(*shape: int) -> np.ndarray:
    return memory.private(8 * int(np.prod(shape))).view(np.int64).reshape(shape)


def eigenvalues(along: Callable[[np.ndarray, float], np.ndarray], size: int) -> Iterator[tuple[complex, np.ndarray]]:
    """The eigenvalues that stand out, largest first, with their directions. along: J times a direction, by a change."""
    most = min(size, MOST_DIRECTIONS)
    basis, matrix = np.zeros((most + 1, size)), np.zeros((most + 1, most))
    basis[0] = _any_direction(0, size)
    basis[0] /= _length(basis[0])
    used = 0
    while used < most:
        image = along(basis[used], CHANGE)
        if not np.all(np.isfinite(image)):
            return
        length = _length(image)
        for _ in range(2):  # once is not enough where much cancels
            part = basis[: used + 1] @ image
            matrix[: used + 1, used] += part
            image = image - part @ basis[: used + 1]
        used += 1
        matrix[used, used - 1] = _length(image)
        if matrix[used, used - 1] <= NOTHING * length:
            break
        basis[used] = image / matrix[used, used - 1]
    values, vectors = np.linalg.eig(matrix[:used, :used])
    for k in np.argsort(-np.abs(values)):
        yield complex(values[k]), vectors[:, k] @ basis[:used]


def _length(vector: np.ndarray) -> float:
    """As numpy's norm, without its threads."""
    return math.sqrt(float(np.sum(np.square(np.abs(vector)))))


def _is_seen(along: Callable[[np.ndarray, float], np.ndarray], value: complex, direction: np.ndarray) -> bool:
    """Whether J does to a direction what its eigenvalue says, also by larger changes."""
    image = along(direction.real, LARGER * CHANGE) + 1j * along(direction.imag, LARGER * CHANGE)
    return bool(_length(image - value * direction) <= ALIKE * abs(value))


def amplification(method: Tableau, z: complex) -> complex:
    """By what a step multiplies x where dx/dt = z/h x."""
    slopes, x = [z], 1.0 + 0.0j
    for row in (*method.stages, method.weights):
        x = 1.0 + sum(n * slope for n, slope in zip(row.numerators, slopes, strict=False)) / row.denominator
        slopes.append(z * x)
    return x


def limit(method: Tableau, z: complex) -> float:
    """The largest |z| up to which, in the direction of z, no step amplifies what decays."""
    low, high = 0.0, abs(z)
    for part in np.geomspace(1e-9, 1.0, 2000):
        if abs(amplification(method, part * z)) > 1.0:
            high = part * abs(z)
            break
        low = part * abs(z)
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if abs(amplification(method, middle / abs(z) * z)) > 1.0 else (middle, high)
    return low


def _warning(component: Component, method: Tableau, h: float, value: complex, step: float) -> CosimError:
    name, size = component.integration.integrator, h * abs(value)
    most = limit(method, h * value)
    said = f"at the start h·|λ| = {size:.3g} is beyond the stability limit {most:.3g} of {name}"
    within = 0.99 * step * most / size
    unit = 10.0 ** (math.floor(math.log10(within)) - 1)
    longest = math.floor(within / unit) * unit
    fix = f"at most `run.step` = {longest:g} s, as many `inner_steps` more, or an implicit integrator such as rodas5p"
    return CosimError(f"block {component.name}: {said}", component.entry.position, fix)
