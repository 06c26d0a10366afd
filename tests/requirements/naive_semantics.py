"""Signal temporal logic by its definition, sample by sample, in a time that grows with the square of the samples.

It shares nothing with the package: formulas are trees of its own, which it also writes as text; times are whole ticks,
so that a window's bounds are exact; numbers are Python's, in nested lists. A margin is a pair: the number, and -1 or 1
by which `<` and `<=` part where the number is zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from random import Random

STEP = 0.01
"""What a tick is in seconds, no binary fraction."""
SHAPES = {"m.a": (), "m.b": (), "m.v": (3,), "m.w": (3, 2), "m.ok": (), "m.flags": (3,)}
BOOLEAN = ("m.ok", "m.flags")


@dataclass
class Term:
    """text: as a formula has it; of: what makes nested lists of shape `shape` of a sample's signals."""

    text: str
    shape: tuple[int, ...]
    of: object


@dataclass
class Node:
    """A condition. kind: atom, not, and, or, implies, always, eventually, until; window: in ticks, None for no end."""

    kind: str
    text: str
    shape: tuple[int, ...]
    parts: tuple = ()
    window: tuple[int, int | None] = (0, 0)
    of: object = None  # of an atom: the margin of a sample


# ---- elements ----


def mapped(function, shape, *values):
    """A function of scalars on nested lists, each repeated along the last axes that it lacks."""
    if not shape:
        return function(*values)
    rows = [[v[k] if isinstance(v, list) else v for v in values] for k in range(shape[0])]
    return [mapped(function, shape[1:], *row) for row in rows]


def flat(value):
    return [x for part in value for x in flat(part)] if isinstance(value, list) else [value]


def longer(*shapes):
    """The shape that others are the beginning of; None if there is none."""
    whole = max(shapes, key=len)
    return whole if all(whole[: len(s)] == s for s in shapes) else None


def opposite(margin):
    return -margin[0], -margin[1]


# ---- semantics ----


def horizon(node):
    """How many ticks a condition looks ahead; of an open window, to where it begins."""
    own = 0
    if node.kind in ("always", "eventually", "until"):
        own = node.window[0] if node.window[1] is None else node.window[1]
    return own + max(map(horizon, node.parts), default=0)


def course(node, ticks, samples):
    """The margin at each sample; None where there is not as much behind it as the condition looks ahead."""
    inner = [course(part, ticks, samples) for part in node.parts]
    found = []
    for i, now in enumerate(ticks):
        if now + horizon(node) > ticks[-1]:
            found.append(None)
            continue
        found.append(_margin(node, i, now, ticks, samples, inner))
    return found


def _margin(node, i, now, ticks, samples, inner):
    if node.kind == "atom":
        return node.of(samples[i])
    if node.kind == "not":
        return mapped(opposite, node.shape, inner[0][i])
    if node.kind in ("and", "or", "implies"):
        values = [one[i] for one in inner]
        if node.kind == "implies":
            values[0] = mapped(opposite, node.parts[0].shape, values[0])
        return mapped(lambda *m: min(m) if node.kind == "and" else max(m), node.shape, *values)
    start, stop = node.window
    last = math.inf if stop is None else now + stop
    within = [j for j, t in enumerate(ticks) if now + start <= t <= last and all(one[j] is not None for one in inner)]
    if node.kind in ("always", "eventually"):
        pick = min if node.kind == "always" else max
        empty = (math.inf, 1) if node.kind == "always" else (-math.inf, -1)
        return mapped(lambda *m: pick(m, default=empty), node.shape, *(inner[0][j] for j in within)) if within else None
    reached = []
    for j in within:
        before = [inner[0][m] for m in range(i, j)]
        reached.append(mapped(lambda *m: min(m), node.shape, inner[1][j], *before))
    return mapped(lambda *m: max(m), node.shape, *reached) if within else None


def robustness(node, ticks, samples):
    """The margin from the first sample on of the element that has least; None if it looks beyond the last sample."""
    first = course(node, ticks, samples)[0]
    return None if first is None else min(flat(first))


# ---- random formulas ----


def formula(random: Random, depth: int, open_ends: bool = True, longest: int = 6) -> Node:
    """A random condition with a temporal operator on top."""
    while True:
        node = _condition(random, depth, open_ends, longest)
        if node and node.kind in ("always", "eventually", "until"):
            return node


def _condition(random, depth, open_ends, longest):
    if depth == 0 or random.random() < 0.15:
        return _atom(random)
    kind = random.choice(["not", "and", "or", "implies", "until", "always", "eventually", "always", "eventually"])
    count = {"and": random.randint(2, 3), "or": 2, "implies": 2, "until": 2}.get(kind, 1)
    parts = tuple(_condition(random, depth - 1, open_ends, longest) for _ in range(count))
    if None in parts or (shape := longer(*(p.shape for p in parts))) is None:
        return None
    if kind == "not":
        return Node(kind, f"not ({parts[0].text})", shape, parts)
    if kind in ("and", "or", "implies"):
        return Node(kind, f" {kind} ".join(f"({p.text})" for p in parts), shape, parts)
    window, bounds = _window(random, open_ends, longest)
    if kind == "until":
        text = f"({parts[0].text}) until{bounds} ({parts[1].text})"
    else:
        text = f"{kind}{bounds}({parts[0].text})"
    return Node(kind, text, shape, parts, window)


def _window(random, open_ends, longest):
    if open_ends and random.random() < 0.3:
        start = random.choice([0, 0, random.randint(0, 3)])
        return (start, None), random.choice(
            [f"[{start * STEP:g}, inf]", "" if not start else f"[{start * STEP:g},inf]"]
        )
    start, stop = sorted((random.randint(0, longest), random.randint(0, longest)))
    return (start, stop), f"[{start * STEP:g}, {stop * STEP:g}]"


def _atom(random):
    if random.random() < 0.15:
        name = random.choice(BOOLEAN)
        shape = SHAPES[name]
        return Node(
            "atom", name, shape, of=lambda s: mapped(lambda x: (math.inf, 1) if x else (-math.inf, -1), shape, s[name])
        )
    terms = [_term(random, random.randint(0, 2)) for _ in range(random.choice([2, 2, 2, 3]))]
    if (shape := longer(*(t.shape for t in terms))) is None or not any("m." in t.text for t in terms):
        return None
    signs = [random.choice(["<", "<=", ">", ">="]) for _ in terms[1:]]
    text = terms[0].text + "".join(f" {sign} {term.text}" for sign, term in zip(signs, terms[1:], strict=True))

    def of(sample):
        values = [term.of(sample) for term in terms]
        pairs = [
            mapped(lambda a, b, s=sign: ((b - a) if "<" in s else (a - b), 1 if "=" in s else -1), shape, one, two)
            for sign, one, two in zip(signs, values, values[1:], strict=False)
        ]
        exact = [mapped(lambda m: m if m[0] == 0 else (m[0], 0), shape, pair) for pair in pairs]
        return mapped(lambda *m: min(m), shape, *exact)

    return Node("atom", text, shape, of=of)


def _term(random, depth):
    if depth == 0:
        return _plain_term(random)
    a, b = _term(random, depth - 1), _term(random, depth - 1)
    kind = random.choice(["+", "-", "*", "max", "abs", "min", "sum", "norm", "overall"])
    if kind in ("abs", "sum", "norm", "overall"):
        return _function_of_one(kind, a)
    if (shape := longer(a.shape, b.shape)) is None:
        return a
    if kind in ("max", "min"):
        pick = max if kind == "max" else min
        return Term(f"{kind}({a.text}, {b.text})", shape, lambda s: mapped(pick, shape, a.of(s), b.of(s)))
    compute = {"+": lambda x, y: x + y, "-": lambda x, y: x - y, "*": lambda x, y: x * y}[kind]
    return Term(f"({a.text}) {kind} ({b.text})", shape, lambda s: mapped(compute, shape, a.of(s), b.of(s)))


def _function_of_one(kind, a):
    if kind == "abs":
        return Term(f"abs({a.text})", a.shape, lambda s: mapped(abs, a.shape, a.of(s)))
    if kind == "sum":
        return Term(f"sum({a.text})", (), lambda s: sum(flat(a.of(s))))
    if kind == "overall":
        return Term(f"max({a.text})", (), lambda s: max(flat(a.of(s))))
    if a.text != "m.w":  # of the fleet itself, a length for each member
        return a
    return Term("norm(m.w)", (3,), lambda s: [math.hypot(*row) for row in s["m.w"]])


def _plain_term(random):
    if random.random() < 0.35:
        number = random.choice([0, 1, 2, -1])
        return Term(str(number) if number >= 0 else f"({number})", (), lambda s: float(number))
    name = random.choice([n for n in SHAPES if n not in BOOLEAN])
    shape = SHAPES[name]
    index = [random.randint(1, size) for size in shape[: random.randint(0, len(shape))]]

    def of(sample):
        value = sample[name]
        for k in index:
            value = value[k - 1]
        return value

    return Term(f"{name}[{', '.join(map(str, index))}]" if index else name, shape[len(index) :], of)


# ---- random samples ----


def ticks(random: Random, count: int, uniform: bool) -> list[int]:
    """Rising times from 0, in ticks."""
    if uniform:
        return list(range(count))
    return sorted({0, *random.sample(range(1, 3 * count), count - 1)})


def samples(random: Random, count: int) -> list[dict]:
    """Small whole numbers, so that margins are zero now and then, and sums are exact."""

    def value(name, shape):
        if shape:
            return [value(name, shape[1:]) for _ in range(shape[0])]
        return random.random() < 0.5 if name in BOOLEAN else float(random.randint(-3, 3))

    return [{name: value(name, shape) for name, shape in SHAPES.items()} for _ in range(count)]
