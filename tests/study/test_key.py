"""The key of a member changes with everything that its result depends on, and with nothing else."""

import copy
from dataclasses import fields, is_dataclass
from fractions import Fraction
from types import FunctionType

import numpy as np
import pytest

from cosim.authoring.variables import Variable
from cosim.engine import run_key as keys
from cosim.errors import Position
from cosim.language.source import Node
from cosim.study import plan
from cosim.study.variants import Variants
from tests.study.conftest import DIAGRAM

RECORDED = "{diagram: diagram.yaml, record: true}"


@pytest.fixture
def of(study):
    """The key of the one member of a study."""

    def found(text="diagram: diagram.yaml", diagram=DIAGRAM):
        loaded = study(text, diagram)
        (one,) = plan.members(loaded, None)
        return Variants(loaded).prepared(one).key

    return found


UNCHANGED = {
    "title of the study": ("{diagram: diagram.yaml, title: another}", DIAGRAM),
    "title of the diagram": ("diagram: diagram.yaml", "\n    title: x" + DIAGRAM),
    "name of the variant": ("{diagram: diagram.yaml, variants: {other: {description: words}}}", DIAGRAM),
    "a comment and spaces": ("diagram: diagram.yaml", DIAGRAM.replace("Sine, per", "Sine,   per") + "\n    # words"),
    "a value that is the same": ("{diagram: diagram.yaml, grid: {blocks.swing.parameters.w: [2]}}", DIAGRAM),
    "tables": ("{diagram: diagram.yaml, tables: {t: {columns: [top]}}}", DIAGRAM),
}
GRIDS = {
    "a parameter": ("blocks.swing.parameters.w", "2.0000000000000004"),
    "one member's parameter": ("blocks.lag.parameters.T", "[0.5, 0.5, 0.6]"),
    "a start": ("blocks.lag.start.x.0.0", "0.1"),
    "run.stop": ("run.stop", "1.01"),
    "run.step": ("run.step", "0.005"),
    "run.method": ("run.method", "gauss-seidel"),
    "run.integrator": ("run.integrator", "rk4"),
    "run.inner_steps": ("run.inner_steps", "2"),
    "run.patience": ("run.patience", "9"),
    "a block's integrator": ("blocks.lag.integrator", "rk4"),
    "a block's inner steps": ("blocks.lag.inner_steps", "3"),
}
DIAGRAMS = {
    "the window of a metric": ("low: {signal: swing.x, reduce: min}", "low: {signal: swing.x, reduce: min, from: 0.5}"),
    "its end": ("low: {signal: swing.x, reduce: min}", "low: {signal: swing.x, reduce: min, to: 0.5}"),
    "its reduction": ("reduce: min", "reduce: mean"),
    "its signal": ("low: {signal: swing.x", "low: {signal: swing.v"),
    "its name": ("low:", "lowest:"),
    "one metric more": ("low:", "more: {signal: swing.v, reduce: max}\n      low:"),
    "the record's period": ("period: 0.1", "period: 0.2"),
    "the record's signals": ("[lag.x, swing.x]", "[lag.x]"),
}


@pytest.mark.parametrize("what", UNCHANGED)
def test_words_are_not_in_the_key(of, what):
    assert of(*UNCHANGED[what]) == of()


@pytest.mark.parametrize("what", GRIDS)
def test_each_setting_of_a_diagram_is_in_the_key(of, what):
    path, value = GRIDS[what]
    assert of(f"{{diagram: diagram.yaml, grid: {{{path}: [{value}]}}}}") != of()


@pytest.mark.parametrize("what", DIAGRAMS)
def test_what_is_reduced_and_recorded_is_in_the_key(of, what):
    old, new = DIAGRAMS[what]
    assert DIAGRAM.count(old) == 1
    assert of(RECORDED, DIAGRAM.replace(old, new)) != of(RECORDED)


def test_recording_is_in_the_key(of):
    assert of(RECORDED) != of()


def test_metrics_that_are_left_out_are_not_in_the_row_and_not_in_the_key(of):
    assert of("{diagram: diagram.yaml, metrics: [top]}") != of()


def altered(value):
    """Another value of the same kind, or of another."""
    if isinstance(value, bool | np.bool_):
        return not value
    if isinstance(value, int | float | Fraction):
        return value + 1 if np.isfinite(value) else 1.0
    if isinstance(value, str):
        return value + "x"
    if isinstance(value, dict):
        return dict(list(value.items())[:-1]) if value else {"other": 1}
    if isinstance(value, list | tuple):
        return [*value, 1]
    if isinstance(value, set | frozenset):
        return {*value, "other"}
    if isinstance(value, np.ndarray):
        return np.append(value.reshape(-1), value.reshape(-1)[:1]) if value.size else np.ones(1)
    if isinstance(value, FunctionType):
        return lambda x: x
    return Node("other", Position("")) if value is None or not isinstance(value, Node) else None


def parts(value, found):
    """One instance of each class that a prepared member is made of."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list | tuple):
        for item in value:
            parts(item, found)
    elif (is_dataclass(value) or isinstance(value, Variable)) and not isinstance(value, type | Node | Position):
        found.setdefault(type(value), value)
        for name in names_of(value):
            parts(getattr(value, name), found)
    return found


def names_of(part):
    """The fields of a part that count."""
    names = [f.name for f in fields(part)] if is_dataclass(part) else [n for n in vars(part) if n != "description"]
    return [name for name in names if name not in keys.IGNORED.get(type(part), ())]


def test_every_field_of_all_that_a_run_is_handed_is_in_the_key(study):
    loaded = study(RECORDED)
    (one,) = plan.members(loaded, None)
    made = Variants(loaded).prepared(one)

    def key():
        return keys.key(
            keys.structure(made.network, made.program, made.kernels), made.program, keys.all_values(made.network)
        )

    before = key()
    seen = []
    for kind, part in parts([made.network, made.program], {}).items():
        for name in names_of(part):
            old = getattr(part, name)
            if is_dataclass(old):
                continue  # it has fields of its own
            own = name == "settings"  # of which some are in the component
            object.__setattr__(part, name, {**old, "other": Node(1, Position(""))} if own else altered(old))
            assert key() != before, f"{kind.__name__}.{name} is not in the key"
            object.__setattr__(part, name, old)
            seen.append(f"{kind.__name__}.{name}")
    assert key() == before
    some = "RunSettings.step Record.period MetricEntry.start Program.rows Call.frame State.start Attempts.tolerance"
    some += " Function.python Place.offset BlockEntry.settings Declaration.compiled Diagram.metrics"
    assert set(some.split()) <= set(seen)


def test_every_ignored_field_exists():
    for kind, names in keys.IGNORED.items():
        assert names <= {field.name for field in fields(kind)}, kind


def test_values_and_the_arena_are_each_members_own(study):
    loaded = study(RECORDED)
    (one,) = plan.members(loaded, None)
    made = Variants(loaded).prepared(one)
    table, network = copy.copy(made.program), made.network
    table.image = table.image.copy()
    table.image[-1] ^= 1
    assert keys.key(made.shared, table, made.digests) != made.key
    component = network.components["swing"]
    found = {made.key}
    for text in ("a", "b"):  # such as an FMU may have, and which is in no arena
        component.values = {**component.values, "text": np.array([text], object)}
        found.add(keys.key(made.shared, made.program, keys.all_values(network)))
    assert len(found) == 3


def test_an_unknown_kind_of_value_is_an_error_and_not_left_out(study):
    loaded = study(RECORDED)
    (one,) = plan.members(loaded, None)
    made = Variants(loaded).prepared(one)
    made.network.diagram.run.patience = object()
    with pytest.raises(TypeError, match="cannot be part of a member's key"):
        keys.structure(made.network, made.program, made.kernels)


def test_the_program_is_in_the_key(study, monkeypatch):
    loaded = study()
    one = next(plan.members(loaded, Variants(loaded).draws()))
    before = Variants(loaded).prepared(one).key
    monkeypatch.setattr(keys, "own_files", lambda: b"edited")
    assert Variants(loaded).prepared(one).key != before


def test_a_default_that_is_written_out_changes_no_key(study):
    """`integrator: euler` where the run has it: what a component has counts, not who said so."""
    loaded = study(RECORDED)
    (one,) = plan.members(loaded, None)
    made = Variants(loaded).prepared(one)
    before = keys.key(
        keys.structure(made.network, made.program, made.kernels), made.program, keys.all_values(made.network)
    )
    for component in made.network.components.values():
        component.entry.settings["integrator"] = Node("euler", Position("d.yaml"))
        component.entry.settings["inner_steps"] = Node(1, Position("d.yaml"))
    assert (
        keys.key(keys.structure(made.network, made.program, made.kernels), made.program, keys.all_values(made.network))
        == before
    )
    component.entry.settings["mode"] = Node("model-exchange", Position("d.yaml"))
    assert (
        keys.key(keys.structure(made.network, made.program, made.kernels), made.program, keys.all_values(made.network))
        != before
    )


def test_the_content_of_a_table_is_in_the_key(of, tmp_path):
    """By whatever layer it comes, and not its name: an edited table never shows an old figure."""
    table = DIAGRAM.replace("{T: 0.5}", "{T: {file: t.csv, column: T}}")
    variant = "{diagram: diagram.yaml, variants: {a: {set: {blocks.lag.parameters.T: {file: t.csv, column: T}}}}}"
    found = {}
    for last in (0.7, 0.8):
        (tmp_path / "t.csv").write_text(f"time,T\n0,0.5\n1,0.6\n2,{last}\n")
        (tmp_path / "other.csv").write_text(f"T\n0.5\n0.6\n{last}\n")
        assert of(variant) == of("diagram: diagram.yaml", table.replace("t.csv", "other.csv"))
        found[of("diagram: diagram.yaml", table)] = of(variant)
    (old, over), (new, anew) = found.items()
    assert old != new and over != anew
    assert new == of("diagram: diagram.yaml", DIAGRAM.replace("{T: 0.5}", "{T: [0.5, 0.6, 0.8]}"))
