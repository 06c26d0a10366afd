"""Every size that a file can set has a bound, which is judged before anything is allocated."""

import itertools
import os
import resource
from pathlib import Path

import pytest

from cosim import errors
from cosim.engine import compilation, program, run
from cosim.engine.probes import BUFFER_BYTES, Probes
from cosim.engine.simulation import Simulation
from cosim.errors import CosimError, DiagramErrors, ExpressionError, MissingFile, TooLarge, UnsolvedDimension, WrongUnit
from cosim.language import diagram, embedding, expression, overlay, source, units
from cosim.study import plan, study_file
from cosim.study.draws import Draws
from cosim.wiring import given_values, sizes

FLEET = """
run: {{stop: 1, step: 0.01}}
fleets: {{robot: {size}}}
blocks:
  source: {{type: Sine, per: robot}}
  lag: {{type: Lag, per: robot, parameters: {{T: {value}}}, inputs: {{u: source.y}}}}
"""


def mistakes(load, *arguments) -> list[CosimError]:
    with pytest.raises(DiagramErrors) as found:
        load(*arguments)
    return found.value.errors


# ---- memory ----


def test_a_fleet_that_no_memory_holds_is_refused_where_it_is_named(write, monkeypatch):
    """x has two numbers of 8 bytes a member, in three vectors (`layout.VECTORS`), in two arenas."""
    monkeypatch.setattr(sizes, "memory", lambda: 2**34)
    path = write(FLEET.format(size="1e9", value=1))
    (mistake,) = mistakes(run.load, path)
    assert isinstance(mistake, TooLarge)
    line = path.read_text().splitlines()[mistake.position.line - 1]
    assert line.strip().startswith("lag:") and line[mistake.position.column - 1 :].startswith("robot")
    assert "there are 16 GiB" in mistake.message and "fleet `robot`" in mistake.fix
    assert f"block lag: `x` (1000000000 × 2) alone takes {sizes.text(1e9 * 2 * 8 * 3 * 2)}" in mistake.message


def test_a_fleet_that_nothing_counts_is_refused_at_its_number(write):
    (mistake,) = mistakes(run.load, write(FLEET.format(size="1e15", value=1)))
    assert isinstance(mistake, TooLarge) and mistake.position.line == 3 and mistake.fix == "at most 2147483647"


@pytest.mark.parametrize("name", ["formation.yaml", "fleet_1000.yaml"])
def test_what_a_run_is_said_to_need_is_what_its_arena_takes(name, monkeypatch):
    """Never more than that, and for a large fleet not much less."""
    network = run.load(Path(__file__).parents[2] / "diagrams" / name)
    arena = program.build(network, network.diagram.run.method).arena.nbytes
    for there, fits in ((sizes.COPIES * arena, True), (arena // 10, False)):
        monkeypatch.setattr(sizes, "memory", lambda there=there: there)
        assert sizes.fit(network.components.values(), errors.Problems()) == fits


def test_nothing_is_evaluated_for_what_does_not_fit(write, monkeypatch):
    monkeypatch.setattr(sizes, "memory", lambda: 1_000_000)
    monkeypatch.setattr(given_values, "array", lambda *_: pytest.fail("it was evaluated"))
    assert isinstance(mistakes(run.load, write(FLEET.format(size=100_000, value=1)))[0], TooLarge)


@pytest.mark.parametrize(("value", "times"), [("'1+1'", 1), ("'i/N'", 0), ("'min(i, 1000)/N'", 1000)])
def test_what_is_the_same_for_all_members_is_evaluated_once_and_what_is_not_at_once(write, monkeypatch, value, times):
    texts = []
    real = expression.evaluate

    def evaluate(text, *more):
        texts.append(text)
        return real(text, *more)

    monkeypatch.setattr(expression, "evaluate", evaluate)
    network = run.load(write(FLEET.format(size=1000, value=value)))
    assert texts.count(value.strip("'")) == times
    assert network.components["lag"].values["T"].reshape(-1).tolist() == (
        [2.0] if times == 1 else [k / 1000 for k in range(1, 1001)]
    )


CONTAINERS = {
    "version 2": ({"a/b/memory.max": "5000", "a/memory.max": "max", "memory.max": "9000"}, "0::/a/b\n", [5000, 9000]),
    "version 2, the outer one is less": ({"a/b/memory.max": "5000", "a/memory.max": "400"}, "0::/a/b\n", [5000, 400]),
    "version 1": ({"memory/d/memory.limit_in_bytes": "700"}, "4:cpu:/x\n3:memory:/d\n1:name=systemd:/\n", [700]),
    "none": ({}, "0::/\n", []),
}


@pytest.mark.parametrize("name", CONTAINERS)
def test_the_limits_of_containers(tmp_path, name):
    files, own, limits = CONTAINERS[name]
    for path, text in files.items():
        (tmp_path / "cgroup" / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "cgroup" / path).write_text(text + "\n")
    (tmp_path / "own").write_text(own)
    assert list(sizes._of_container(tmp_path / "cgroup", tmp_path / "own")) == limits


def test_the_least_limit_counts(monkeypatch):
    physical = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert 0 < sizes.memory() <= physical
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (12345, 12345))
    assert sizes.memory() == 12345


def test_sizes_as_people_read_them():
    assert [sizes.text(n) for n in (1, 1023, 1024, 1.5 * 2**30, 2**70)] == [
        "1 bytes", "1.02e+03 bytes", "1 KiB", "1.5 GiB", "1.05e+06 PiB"
    ]  # fmt: skip


# ---- counts ----


@pytest.mark.parametrize("where", ["run.inner_steps=1e12", "blocks.lag.inner_steps=1000001"])
def test_inner_steps_are_bounded(write, where):
    (mistake,) = mistakes(run.load, write(FLEET.format(size=2, value=1)), [where])
    assert isinstance(mistake, TooLarge) and mistake.fix == "at most 1000000"
    run.load(write(FLEET.format(size=2, value=1)), [where.partition("=")[0] + "=1000000"])


STUDIES = {
    "linspace": ("grid: {blocks.lag.parameters.T: {linspace: [0, 1, 1e9]}}", "1e9"),
    "geomspace": ("grid: {blocks.lag.parameters.T: {geomspace: [1, 2, 1e9]}}", "1e9"),
    "range": ("grid: {blocks.lag.parameters.T: {range: [0, 1, 1e-15]}}", "1e-15"),
    "count": ("random: {count: 1e9, draws: {blocks.lag.parameters.T: {uniform: [0, 1]}}}", "1e9"),
    "a product": (
        "grid: {blocks.lag.parameters.T: {linspace: [0, 1, 10000]}, run.step: {linspace: [1, 2, 10000]}}", "blocks.lag"
    ),
    "draws and a grid": (
        "grid: {blocks.lag.parameters.T: {linspace: [1, 2, 10000]}}\n"
        "random: {count: 10000, draws: {blocks.source.parameters.w: {uniform: [0, 1]}}}", "blocks.lag"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", STUDIES)
def test_the_members_of_a_study_are_bounded(tmp_path, name):
    text, word = STUDIES[name]
    (tmp_path / "study.yaml").write_text(f"diagram: d.yaml\n{text}\n")
    (mistake,) = mistakes(study_file.load, tmp_path / "study.yaml")
    assert isinstance(mistake, TooLarge) and "at most" in mistake.fix
    assert (mistake.position.line, mistake.position.column) == (2, text.index(word) + 1)


def test_the_members_of_a_large_study_are_made_one_by_one(tmp_path):
    grid = "".join(f"  blocks.b.parameters.p{k}: {{linspace: [0, 1, 200]}}\n" for k in range(3))
    (tmp_path / "study.yaml").write_text(f"diagram: d.yaml\ngrid:\n{grid}")
    study = study_file.load(tmp_path / "study.yaml")
    assert plan.size(study) == 8_000_000
    assert [m.grid for m in itertools.islice(plan.members(study, None), 2)] == [(0, 0, 0), (0, 0, 1)]
    assert next(plan.names(study)) == "base-0-0-0"


def test_draws_that_no_memory_holds_are_refused(tmp_path, monkeypatch):
    (tmp_path / "study.yaml").write_text(
        "diagram: d.yaml\nrandom: {count: 10000, draws: {blocks.lag.start.x: {uniform: [0, 1]}}}\n"
    )
    random = study_file.load(tmp_path / "study.yaml").random
    monkeypatch.setattr(sizes, "memory", lambda: 2**30)
    Draws(random, [(100,)], lambda settings: True)
    with pytest.raises(TooLarge, match=r"10000 random draws need 7.45 GiB of memory") as found:
        Draws(random, [(100_000,)], lambda settings: True)
    assert found.value.position.line == 2


@pytest.mark.parametrize("stop", ["1e12", "9e12"])
def test_a_long_run_begins_at_once(wired, stop):
    """Nothing is allocated for each step: the first batch comes as soon as that of a short run."""
    network = wired(f"run: {{stop: {stop}, step: 1.0e-3}}\nblocks:\n  o: {{type: Oscillator}}\n")
    built = program.build(network, "jacobi")
    signal = network.find("o.x", None)
    one = Simulation(built, compilation.compile_program(built), [Probes((signal,)), Probes((signal,), 1000)])
    one.initialize()
    next(one.batches())
    assert 0 < one.done < one.ticks
    row = 16  # bytes of a time and a number: there is room for one more, as the run may end in between
    assert sum(buffer.nbytes for buffer in one.buffers.arrays) <= 2 * (BUFFER_BYTES + row)


# ---- files ----


def test_files_that_embed_each_other_twice(tmp_path):
    for k in range(25):
        text = (
            f"run: {{stop: 1, step: 0.1}}\nblocks:\n  a: {{diagram: e{k + 1}.yaml}}\n  b: {{diagram: e{k + 1}.yaml}}\n"
        )
        (tmp_path / f"e{k}.yaml").write_text(text)
    (tmp_path / "e25.yaml").write_text("run: {stop: 1, step: 0.1}\nblocks: {x: {block: ForceLimit}}\n")
    (mistake,) = mistakes(diagram.load, tmp_path / "e0.yaml")
    assert isinstance(mistake, TooLarge) and "more than 1000 diagrams" in mistake.message and mistake.position.line
    diagram.load(tmp_path / "e17.yaml")


def test_the_blocks_of_diagrams_in_diagrams_are_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(embedding, "MOST_BLOCKS", 20)
    head = "run: {stop: 1, step: 0.1}\nblocks:\n"
    (tmp_path / "in.yaml").write_text(head + "".join(f"  b{k}: {{block: ForceLimit}}\n" for k in range(8)))
    (tmp_path / "two.yaml").write_text(head + "".join(f"  d{k}: {{diagram: in.yaml}}\n" for k in range(2)))
    (tmp_path / "three.yaml").write_text(head + "".join(f"  d{k}: {{diagram: in.yaml}}\n" for k in range(3)))
    assert len(diagram.load(tmp_path / "two.yaml").blocks) == 16
    (mistake,) = mistakes(diagram.load, tmp_path / "three.yaml")
    assert isinstance(mistake, TooLarge) and mistake.position.line == 5


@pytest.mark.parametrize("depth", [40, 400])
def test_diagrams_in_diagrams_have_a_depth(tmp_path, depth):
    for k in range(depth):
        (tmp_path / f"e{k}.yaml").write_text(
            f"run: {{stop: 1, step: 0.1}}\nblocks: {{a: {{diagram: e{k + 1}.yaml}}}}\n"
        )
    (tmp_path / f"e{depth}.yaml").write_text("run: {stop: 1, step: 0.1}\nblocks: {x: {block: ForceLimit}}\n")
    if depth == 40:
        assert len(diagram.load(tmp_path / "e0.yaml").blocks) == 1
    else:
        (mistake,) = mistakes(diagram.load, tmp_path / "e0.yaml")
        assert isinstance(mistake, TooLarge) and "50 levels" in mistake.message


def test_layers_of_a_diagram_are_bounded(tmp_path):
    for k in range(overlay.MOST_LAYERS + 1):
        (tmp_path / f"e{k}.yaml").write_text(f"extends: e{k + 1}.yaml\n")
    (mistake,) = mistakes(diagram.load, tmp_path / "e0.yaml")
    assert isinstance(mistake, TooLarge) and mistake.position.line == 1


@pytest.fixture(params=["pipe", "device"])
def endless(request, tmp_path):
    """Something that has a name and is no file: reading it would wait for ever, or never end."""
    path = tmp_path / "endless.py"
    if request.param == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/zero")
    return path


PLACES = {
    "extends": "extends: {}",
    "a diagram": "blocks: {{a: {{diagram: {}}}}}",
    "a Python file": "blocks: {{a: {{python: '{}:A'}}}}",
    "an FMU": "blocks: {{a: {{fmu: {}}}}}",
}


@pytest.mark.parametrize("place", PLACES)
def test_what_is_no_file_is_not_read(tmp_path, endless, place):
    (tmp_path / "d.yaml").write_text("run: {stop: 1, step: 0.1}\n" + PLACES[place].format(endless) + "\n")
    (mistake,) = mistakes(run.load, tmp_path / "d.yaml")
    assert isinstance(mistake, MissingFile) and "pipe or a device" in mistake.message
    assert mistake.position.line == 2


def test_the_diagram_itself_is_no_file(endless):
    for load in (run.load, study_file.load):
        (mistake,) = mistakes(load, endless)
        assert "pipe or a device" in mistake.message


def test_a_file_that_is_too_long(tmp_path, monkeypatch):
    monkeypatch.setattr(source, "MOST_FILE_BYTES", 1 << 20)
    path = tmp_path / "d.yaml"
    path.write_text("run: {stop: 1, step: 0.1}\n#" + "x" * (1 << 20))
    (mistake,) = mistakes(diagram.load, path)
    assert isinstance(mistake, TooLarge) and "more than 1 MiB" in mistake.message


# ---- text ----


@pytest.mark.parametrize(
    "text",
    [
        "9**9**9",
        "9**" * 300 + "9",
        "2**-9**9**9",
        "-" * 990 + "x",
        "(" * 490 + "1" + ")" * 490,
        "'a' * 10**9",
        "[0] * 9**9",
    ],
)
def test_expressions_that_would_not_end(text):
    with pytest.raises(ExpressionError):
        expression.evaluate(text)


@pytest.mark.parametrize("text", ["m" * 50_000, "m*" * 50_000, "(" * 50_000, "kg." * 50_000 + "x"])
def test_units_that_would_not_end(text):
    with pytest.raises(WrongUnit, match="too long"):
        units.base(text)


def test_no_nearest_name_is_looked_for_among_too_many():
    many = [f"block{k}" for k in range(5000)]
    assert errors.nearest("blok1", many) == ""
    assert errors.nearest("x" * 10_000, many[:10]) == ""
    assert "block1" in errors.nearest("blok1", many[:10])


def test_of_names_that_are_equally_near_the_first_is_meant():
    assert errors.nearest("u", [f"u_{k}" for k in range(1, 7)]) == "did you mean `u_1`?"
    assert errors.nearest("motr", ["motor", "motto", "rotor"]) == "did you mean `motor`?"


@pytest.mark.parametrize(
    ("signs", "kind", "said"),
    [("+-", ExpressionError, "`+-` is neither a number nor"), ("-1", UnsolvedDimension, "determines the dimension")],
)
def test_a_text_that_is_no_number_is_no_size_that_is_missing(write, signs, kind, said):
    text = "run: {stop: 1, step: 1}\nblocks:\n  a: {block: Step}\n"
    block = f"  s: {{block: Sum, inputs: {{u_1: a.y, u_2: a.y}}, parameters: {{signs: '{signs}'}}}}\n"
    (mistake,) = mistakes(run.load, write(text + block))
    assert isinstance(mistake, kind) and said in mistake.message
    assert mistake.position.line == 4
