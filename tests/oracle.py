"""An independent simulation of small diagrams, in plain numpy, written from the definition of the methods.

It shares no code with the framework, but the sine, which has tests of its own: no order of evaluation (an output is
computed when somebody asks for it), no table, no memory layout. The time of communication point k is t_k = k h.

At point k, blocks that are sampled and due take their next state; then every output has its value of t_k. Outputs of
blocks with `update` and without derivatives change where they are due only. From point k to k + 1, where those that are
due compute their next states first:

=============  ===================================================================================================
jacobi         each block integrates its states with its inputs held at their values of t_k
joint          all states are integrated as one system; sampled outputs are held
gauss-seidel   the blocks with continuous states take turns, each a block after those that it reads, those that read
               each other after what they read besides; of a ring, one with feedthrough goes as soon as something that
               it reads has stepped, and else the first without it.
               A block integrates with its inputs held at the newest values: of t_(k+1) for what has stepped, for
               sources (which depend on the time alone), and for what blocks without states compute of such; else of
               t_k. Then its own outputs are computed from the newest values, for t_(k+1).
=============  ===================================================================================================
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cosim.compiling.interpreted.libm import as_compiled


@dataclass
class Kind:
    """What a kind of block computes. outputs: name → (inputs that it reads, whether it reads the time, function)."""

    outputs: dict[str, tuple[tuple[str, ...], bool, Any]] = field(default_factory=dict)
    derivative: Any = None  # of (t, x, z, inputs, outputs, parameters)
    update: Any = None  # of (t, z, inputs, parameters)
    inputs: tuple[str, ...] = ("u",)


def _mean(u):
    total = np.zeros(2)
    for row in u:
        total = total + row / len(u)
    return total


# An output is a function of (t, x, z, inputs, the block's other outputs, parameters).
KINDS = {
    "Wave": Kind({"y": ((), True, lambda t, x, z, i, o, p: p["A"] * _sin(p["f"] * t) * np.ones(2))}, inputs=()),
    "Sum": Kind(
        {"y": (("u", "w"), False, lambda t, x, z, i, o, p: p["a"] * i["u"] + p["b"] * i["w"])}, inputs=("u", "w")
    ),
    "Drift": Kind({"y": (("u",), True, lambda t, x, z, i, o, p: i["u"] + p["a"] * t)}),
    "Integral": Kind({}, lambda t, x, z, i, o, p: i["u"] + 0.0 * x),
    "Leak": Kind(
        {"y": (("u",), False, lambda t, x, z, i, o, p: x + p["a"] * i["u"])},
        lambda t, x, z, i, o, p: p["a"] * i["u"] - p["b"] * x,
    ),
    "Chain": Kind(
        {
            "p": (("u",), False, lambda t, x, z, i, o, p: p["a"] * x + i["u"]),
            "y": (("u",), False, lambda t, x, z, i, o, p: 0.5 * o("p") + x),
        },
        lambda t, x, z, i, o, p: p["a"] * t - o("y"),
    ),
    "Pair": Kind(
        {
            "f": ((), False, lambda t, x, z, i, o, p: 2.0 * x),
            "h": (("u",), False, lambda t, x, z, i, o, p: x + p["a"] * i["u"]),
        },
        lambda t, x, z, i, o, p: p["a"] - x,
    ),
    "Hold": Kind({}, update=lambda t, z, i, p: i["u"] + 0.0 * z),
    "Sampled": Kind(
        {"y": (("u",), True, lambda t, x, z, i, o, p: z + p["a"] * i["u"] + 0.125 * t)},
        update=lambda t, z, i, p: 0.5 * z + i["u"],
    ),
    "Mixed": Kind({}, lambda t, x, z, i, o, p: z - p["a"] * x, lambda t, z, i, p: 0.5 * i["u"] + 0.0 * z),
    "Mean": Kind({"y": (("u",), False, lambda t, x, z, i, o, p: _mean(i["u"]))}),
}


def _sin(values):
    """Of cosim's own, which has its tests: what is looked at here is of what it is computed, and when."""
    return np.vectorize(as_compiled("sin", 1), otypes=[float])(values)


@dataclass
class Block:
    """One block. parameters: (members, 1) or scalars. sources: for each input a list of (block, port, members)."""

    name: str
    kind: str
    parameters: dict[str, Any]
    sources: dict[str, list[tuple[str, str, slice | int | None]]]
    members: int  # 0: no fleet
    x: np.ndarray | None = None
    z: np.ndarray | None = None
    every: int = 1
    integrator: str = "euler"
    inner_steps: int = 1

    @property
    def what(self) -> Kind:
        return KINDS[self.kind]

    @property
    def turns(self) -> bool:
        return self.what.derivative is not None

    @property
    def sampled(self) -> bool:
        return self.what.update is not None and not self.turns

    @property
    def feeds_through(self) -> bool:
        return any(reads for reads, _, _ in self.what.outputs.values())


class Oracle:
    """Simulates blocks by one of the three methods; `run` gives every signal at every communication point."""

    def __init__(self, blocks: list[Block], step: float, method: str, integrator: str, inner_steps: int) -> None:
        self.blocks = {block.name: block for block in blocks}
        self.step = step
        self.method = method
        self.joint_integrator, self.joint_inner_steps = integrator, inner_steps
        self.next = {b.name: b.z for b in blocks if b.what.update}
        self.held: dict[tuple[str, str], np.ndarray] = {}  # outputs of sampled blocks
        self.published: dict[tuple[str, str], np.ndarray] = {}

    # ---- values on demand ----

    def output(self, name: str, port: str, t: float, known: dict[tuple[str, str], Any]) -> np.ndarray:
        """A block's output at a time, from the states as they are, computing what it reads first."""
        block = self.blocks[name]
        if port in ("x", "z") and port not in block.what.outputs:
            return getattr(block, port)
        if (name, port) not in known:
            reads, _, function = block.what.outputs[port]
            inputs = {r: self.input(block, r, t, known) for r in reads}
            own = lambda other: self.output(name, other, t, known)  # noqa: E731
            value = function(t, block.x, block.z, inputs, own, block.parameters)
            known[name, port] = value
        return known[name, port]

    def input(self, block: Block, port: str, t: float, known: dict[tuple[str, str], Any]) -> np.ndarray:
        """What arrives at an input."""
        parts = []
        for source, name, members in block.sources[port]:
            value = self.output(source, name, t, known)
            parts.append(value if members is None else value[members])
        if len(parts) == 1 and parts[0].ndim <= 2:
            return parts[0]
        return np.concatenate([part if part.ndim == 2 else part[None] for part in parts])

    # ---- one step ----

    def reach(self, k: int) -> None:
        """Publish at point k."""
        t = k * self.step
        for block in self.blocks.values():
            if block.what.update and k % block.every == 0:
                block.z = self.next[block.name]
        known = {
            key: value
            for key, value in self.held.items()
            if self.blocks[key[0]].sampled and k % self.blocks[key[0]].every
        }
        for name, block in self.blocks.items():
            for port in block.what.outputs:
                self.output(name, port, t, known)
        self.held = {key: value for key, value in known.items() if self.blocks[key[0]].sampled}
        self.published = known

    def advance(self, k: int) -> None:
        t = k * self.step
        for block in self.blocks.values():
            if block.what.update and k % block.every == 0:
                inputs = {port: self.input(block, port, t, dict(self.published)) for port in block.what.inputs}
                self.next[block.name] = block.what.update(t, block.z, inputs, block.parameters)
        {"jacobi": self.jacobi, "joint": self.joint, "gauss-seidel": self.gauss_seidel}[self.method](
            t, (k + 1) * self.step
        )

    def jacobi(self, t: float, later: float) -> None:
        moved = {}
        for block in self.blocks.values():
            if block.turns:
                inputs = {port: self.input(block, port, t, dict(self.published)) for port in block.what.inputs}
                moved[block.name] = self.integrated(block, t, inputs)
        for name, x in moved.items():
            self.blocks[name].x = x

    def gauss_seidel(self, t: float, later: float) -> None:
        done: set[str] = set()
        for name in self.sequence():
            block = self.blocks[name]
            newest = self.newest(done)
            inputs = {port: self.input(block, port, later, dict(newest)) for port in block.what.inputs}
            block.x = self.integrated(block, t, inputs)
            done.add(name)
            known = {key: value for key, value in self.newest(done).items() if key[0] != name}
            for port in block.what.outputs:
                self.published[name, port] = self.output(name, port, later, known)

    def newest(self, done: set[str]) -> dict[tuple[str, str], np.ndarray]:
        """The outputs that are not to be computed anew, once some blocks have had their turn."""
        return {key: value for key, value in self.published.items() if not self.is_stale(*key, done)}

    def is_stale(self, name: str, port: str, done: set[str]) -> bool:
        """Whether an output of a block without turn or samples is of t_k, but not all that it depends on."""
        block = self.blocks[name]
        if block.turns or block.sampled:
            return False
        reads, timed, _ = block.what.outputs[port]
        sources = [(source, out) for r in reads for source, out, _ in block.sources[r]]
        if any(
            source in done or (out in self.blocks[source].what.outputs and self.is_stale(source, out, done))
            for source, out in sources
        ):
            return True
        return timed and not self.reached(sources)

    def integrated(self, block: Block, t: float, inputs: dict[str, np.ndarray]) -> np.ndarray:
        """A block's states one communication step later, with its inputs held."""

        def slope(time: float, x: np.ndarray) -> np.ndarray:
            def own(port: str) -> np.ndarray:
                return block.what.outputs[port][2](time, x, block.z, inputs, own, block.parameters)

            return block.what.derivative(time, x, block.z, inputs, own, block.parameters)

        return _integrated(slope, block.x, t, self.step, block.integrator, block.inner_steps)

    def joint(self, t: float, later: float) -> None:
        blocks = [b for b in self.blocks.values() if b.turns]
        if not blocks:
            return
        sizes = np.cumsum([b.x.size for b in blocks])

        def slope(time: float, x: np.ndarray) -> np.ndarray:
            for block, part in zip(blocks, np.split(x, sizes[:-1]), strict=True):
                block.x = part.reshape(block.x.shape)
            known = dict(self.held)
            slopes = []
            for block in blocks:
                inputs = {port: self.input(block, port, time, known) for port in block.what.inputs}
                own = lambda port, name=block.name: self.output(name, port, time, known)  # noqa: E731
                slopes.append(block.what.derivative(time, block.x, block.z, inputs, own, block.parameters).ravel())
            return np.concatenate(slopes)

        start = np.concatenate([b.x.ravel() for b in blocks])
        end = _integrated(slope, start, t, self.step, self.joint_integrator, self.joint_inner_steps)
        for block, part in zip(blocks, np.split(end, sizes[:-1]), strict=True):
            block.x = part.reshape(block.x.shape)

    # ---- the order of turns ----

    def sequence(self) -> list[str]:
        left = [b.name for b in self.blocks.values() if b.turns]
        done: list[str] = []
        while left:
            unread = {n: self.reads(n) & {*left} for n in left}
            for _ in left:  # now of all that a block reads by way of others too
                unread = {n: sources.union(*(unread[s] for s in sources)) for n, sources in unread.items()}
            free = [n for n in left if all(n in unread[s] for s in unread[n])]  # its ring reads nothing else
            handing = [n for n in free if self.blocks[n].feeds_through and self.reads(n) & {*done}]
            entered = [n for n in free if not self.blocks[n].feeds_through]
            chosen = (handing + entered + free)[0]
            left.remove(chosen)
            done.append(chosen)
        return done

    def reads(self, name: str) -> set[str]:
        """The blocks with turns whose values reach a block's inputs, at once or through blocks without any."""
        return self.reached(
            [(source, port) for wires in self.blocks[name].sources.values() for source, port, _ in wires]
        )

    def reached(self, waiting: list[tuple[str, str]]) -> set[str]:
        """The blocks with turns that outputs come from, at once or through blocks without any."""
        found: set[str] = set()
        waiting, seen = list(waiting), set()
        while waiting:
            source, port = waiting.pop()
            block = self.blocks[source]
            if block.turns:
                found.add(source)
            elif not block.sampled and (source, port) not in seen:
                seen.add((source, port))
                waiting += [(s, p) for r in block.what.outputs[port][0] for s, p, _ in block.sources[r]]
        return found

    # ---- a run ----

    def run(self, steps: int, signals: list[tuple[str, str]]) -> dict[tuple[str, str], np.ndarray]:
        found: dict[tuple[str, str], list[np.ndarray]] = {signal: [] for signal in signals}
        for k in range(steps + 1):
            self.reach(k)
            for name, port in signals:
                value = (
                    self.published[name, port] if (name, port) in self.published else getattr(self.blocks[name], port)
                )
                found[name, port].append(np.array(value))
            if k < steps:
                self.advance(k)
        return {signal: np.stack(values) for signal, values in found.items()}


def _integrated(slope: Any, x: np.ndarray, t: float, step: float, integrator: str, inner_steps: int) -> np.ndarray:
    """x one communication step later: so many equal steps of Euler's or of the classical Runge-Kutta method."""
    h = step / inner_steps
    for s in range(inner_steps):
        time = t + s * h
        k1 = slope(time, x)
        if integrator == "euler":
            x = x + h * k1
            continue
        k2 = slope(time + 0.5 * h, x + 0.5 * h * k1)
        k3 = slope(time + 0.5 * h, x + 0.5 * h * k2)
        k4 = slope(time + h, x + h * k3)
        x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return x
