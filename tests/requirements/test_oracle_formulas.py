"""Margins beside the definition of the logic, by a naive oracle of the tests' own, and beside a public monitor."""

import math
import sys
import typing
from random import Random

import numpy as np
import pytest

from cosim.language.formula import nowhere, parse
from cosim.requirements.monitor import Monitor
from cosim.requirements.terms import Scope, Seen

from . import naive_semantics as naive

sys.modules["typing.io"] = typing  # which the public monitor's parser imports, and newer Pythons lack
import rtamt  # noqa: E402

FLEETS = {(): (), (3,): ("robot",), (3, 2): ("robot", None)}


def look(text, position):
    shape = naive.SHAPES.get(text, ())
    return Seen(text, shape, FLEETS[shape], np.dtype(bool if text in naive.BOOLEAN else float), None)


def monitor(text, native=True):
    return Monitor(parse(text), Scope(look, nowhere, native))


def arrays(found):
    return {name: np.array([sample[name] for sample in found]) for name in naive.SHAPES}


def feed(one, times, data, batches):
    """Give a monitor its samples in batches that end behind these samples."""
    for begin, end in zip([0, *batches], [*batches, len(times)], strict=True):
        one.update(times[begin:end], {name: values[begin:end] for name, values in data.items()})
    return one


def case(seed, open_ends=True):
    """A random formula with samples and batches, and what the oracle says."""
    random = Random(seed)  # noqa: S311
    node = naive.formula(random, random.randint(1, 3), open_ends)
    ticks = naive.ticks(random, random.randint(1, 25), uniform=random.random() < 0.6)
    samples = naive.samples(random, len(ticks))
    batches = sorted(random.randint(0, len(ticks)) for _ in range(random.randint(0, 3)))
    return node, ticks, samples, batches


@pytest.mark.parametrize("begin", range(0, 1200, 300))
def test_random_formulas_have_the_margin_of_the_definition(begin):
    judged = 0
    for seed in range(begin, begin + 300):
        node, ticks, samples, batches = case(seed)
        times, data = np.array(ticks) * naive.STEP, arrays(samples)
        if empty_window(node, ticks):
            continue
        wanted = naive.robustness(node, ticks, samples)
        found = feed(monitor(node.text, native=seed % 2 == 0), times, data, batches).robustness(ended=True)
        if wanted is None:  # a verdict there may be before the end of its windows, by a bound
            assert not found.settled or math.isinf(found.margin), node.text
        else:
            assert found.settled, node.text
            margin, sign = wanted
            assert found.holds is (margin > 0 or (margin == 0 and sign > 0)), (node.text, wanted, found)
            assert found.margin == pytest.approx(margin, rel=1e-12, abs=1e-300), node.text
            judged += 1
    assert judged > 150


def empty_window(node, ticks):
    """Whether a window of the formula lies between two samples."""
    own = False
    if node.kind in ("always", "eventually", "until"):
        start, stop = node.window
        own = any(
            not any(now + start <= t <= (math.inf if stop is None else now + stop) for t in ticks)
            for now in ticks
            if now + naive.horizon(node) <= ticks[-1]
        )
    return own or any(empty_window(part, ticks) for part in node.parts)


def test_native_and_interpreted_have_the_same_bits_in_any_batches():
    for seed in range(300):
        node, ticks, _, batches = case(seed)
        generator = np.random.default_rng(seed)
        data = {
            name: generator.random((len(ticks), *shape)) < 0.5
            if name in naive.BOOLEAN
            else generator.normal(size=(len(ticks), *shape))
            for name, shape in naive.SHAPES.items()
        }
        times = np.array(ticks) * naive.STEP
        found = [
            feed(monitor(node.text, native), times, data, parts).robustness(ended=True)
            for native, parts in ((True, []), (True, batches), (False, batches), (True, list(range(1, len(ticks)))))
        ]
        assert len({repr(one) for one in found}) == 1, node.text


def test_what_is_settled_stays_and_what_is_open_is_bounded():
    """After any number of samples: a settled margin is the last one, a bound holds, and undecided is said of both."""
    early = 0
    for seed in range(400):
        node, ticks, samples, _ = case(seed)
        if empty_window(node, ticks):
            continue
        times, data = np.array(ticks) * naive.STEP, arrays(samples)
        last = feed(monitor(node.text), times, data, []).robustness(ended=True)
        one = monitor(node.text)
        for k in range(len(ticks)):
            one.update(times[k : k + 1], {name: values[k : k + 1] for name, values in data.items()})
            now = one.robustness(ended=False)
            if now.margin is None:
                continue
            early += k < len(ticks) - 1
            assert last.margin is not None, node.text
            if now.settled:
                assert now.margin == last.margin, node.text
                assert now.moment == last.moment or math.isinf(now.margin), node.text
            else:
                assert (last.margin >= now.margin) if now.holds else (last.margin <= now.margin), node.text
    assert early > 500


def test_the_moment_that_decides_has_the_margin():
    """One of the conditions of one instant has that margin there, as it is or with the other sign."""
    for seed in range(600):
        node, ticks, samples, _ = case(seed)
        times, data = np.array(ticks) * naive.STEP, arrays(samples)
        found = feed(monitor(node.text), times, data, []).robustness(ended=True)
        if found.margin is None or empty_window(node, ticks):
            continue
        at = next(k for k, time in enumerate(times) if time == found.moment.time)
        margins = {abs(m[0]) for atom in atoms(node) for m in elements(atom.of(samples[at]), found.moment.element)}
        size = 0.0 if abs(found.margin) < 1e-300 else abs(found.margin)
        assert any(size == pytest.approx(margin, rel=1e-12) for margin in margins), node.text


def atoms(node):
    return [node] if node.kind == "atom" else [atom for part in node.parts for atom in atoms(part)]


def elements(margin, index):
    """The margin's element, or that which the element is part of."""
    for k in index:
        if not isinstance(margin, list):
            break
        margin = margin[k]
    return naive.flat(margin)


# ---- a public monitor ----


def bounded(random, depth):
    """A random formula over m.a and m.b with bounded windows of whole seconds."""
    if depth == 0 or random.random() < 0.15:
        sign = random.choice(["<", "<=", ">", ">="])
        return f"{random.choice(['m.a', 'm.b'])} {sign} {random.choice([0.3, -0.2, 0, 1.1])}"
    kind = random.choice(["not", "and", "or", "implies", "until", "always", "eventually", "always", "eventually"])
    first, second = bounded(random, depth - 1), bounded(random, depth - 1)
    start, stop = sorted((random.randint(0, 6), random.randint(0, 6)))
    if kind == "not":
        return f"not({first})"
    if kind in ("and", "or", "implies"):
        return f"({first}) {kind} ({second})"
    if kind == "until":
        return f"({first}) until[{start},{stop}] ({second})"
    return f"{kind}[{start},{stop}]({first})"


def theirs(text, a, b):
    """Robustness by rtamt, in discrete time with samples 1 s apart."""
    specification = rtamt.StlDiscreteTimeSpecification()
    specification.declare_var("ma", "float")
    specification.declare_var("mb", "float")
    specification.spec = text.replace("m.a", "ma").replace("m.b", "mb").replace(",", ":")
    specification.parse()
    return specification.evaluate({"time": list(range(len(a))), "ma": a.tolist(), "mb": b.tolist()})[0][1]


def test_a_thousand_bounded_formulas_as_a_public_monitor_has_them():
    for seed in range(1000):
        random, generator = Random(seed), np.random.default_rng(seed)  # noqa: S311
        start = random.randint(0, 6)
        text = f"always[{start},{start + random.randint(0, 6)}]({bounded(random, random.randint(1, 3))})"
        a, b = generator.normal(size=60), np.cumsum(generator.normal(size=60)) * 0.3
        found = feed(monitor(text, native=seed % 4 > 0), np.arange(60.0), {"m.a": a, "m.b": b}, [30]).robustness(True)
        assert found.settled
        assert found.margin == pytest.approx(theirs(text, a, b), rel=0, abs=1e-12), text


# ---- terms ----


@pytest.mark.parametrize("shape", [(2,), (3, 2), (32,), (33,), (100,), (7, 5)])
def test_reductions_of_strided_samples_have_the_same_bits_in_any_batches(shape):
    """Samples are parts of rows, as the loop fills them; a batch may have a single one."""
    size = math.prod(shape)
    rows = np.random.default_rng(size).normal(size=(60, size + 3)) * 10.0 ** np.arange(60)[:, None]

    def one(text, batches):
        found = Monitor(
            parse(text),
            Scope(lambda *_: Seen("m.s", shape, (None,) * len(shape), np.dtype(float), None), nowhere),
        )
        for begin, end in zip([0, *batches], [*batches, 60], strict=True):
            found.update(np.arange(60.0)[begin:end], {"m.s": rows[begin:end, 2 : 2 + size].reshape(-1, *shape)})
        return found.robustness(True)

    for name, exact in (
        ("sum", lambda x: x.sum()),
        ("mean", lambda x: x.mean()),
        ("norm", np.linalg.norm),
        ("max", np.max),
    ):
        text = f"always[7, 7]({name}(m.s) < 0)"
        whole = one(text, [])
        assert whole == one(text, [1, 7, 8, 9, 40])
        assert whole.margin == pytest.approx(-exact(rows[7, 2 : 2 + size]), rel=1e-12, abs=1e-6)


@pytest.mark.parametrize("size", [1e-300, 1e-200, 1.0, 1e200, 1e300])
def test_the_length_of_numbers_of_any_size(size):
    found = Monitor(
        parse("always(norm(m.s) < 0)"),
        Scope(lambda *_: Seen("m.s", (2,), (None,), np.dtype(float), None), nowhere),
    )
    found.update(np.array([0.0]), {"m.s": np.array([[3.0, 4.0]]) * size})
    assert found.robustness(True).margin == pytest.approx(-5 * size, rel=1e-15)
