"""Arithmetic as a block: what its names stand for, its sizes, and mistakes at their places."""

import numpy as np
import pytest

from cosim.engine import run
from cosim.errors import (
    DiagramErrors,
    DroppedValue,
    ExpressionError,
    UnknownKey,
    UnknownParameter,
    UnknownPort,
    WrongDataType,
    WrongShape,
    WrongType,
    WrongValue,
)

HEAD = """\
run: {stop: 0.2, step: 0.1}
blocks:
  a: {block: Sine}
  v: {block: Constant, parameters: {value: [1, 2, 3]}}
  w: {block: Constant, parameters: {value: [1, 2]}}
  on: {block: Compare, inputs: {u: a.y}}
"""
#: What stands below `blocks:` in line 7, the mistake, its column, what is said, and the fix.
MISTAKES = [
    (
        "{expression: 'k*u', inputs: {u: a.y}}",
        ExpressionError,
        20,
        "`k` is neither an input nor a parameter",
        "add `k:`",
    ),
    ("{expression: '2 + gian*u', parameters: {gain: 2}, inputs: {u: a.y}}", ExpressionError, 24, "`gian`", "`gain`?"),
    ("{expression: 'u', inputs: {u: a.y}, parameters: {k: 2}}", WrongValue, 55, "the parameter `k` is in no", "remove"),
    ("{expression: 'u', inputs: {u: a.y, w: a.y}}", WrongValue, 41, "the input `w` is in no expression", "use it"),
    ("{expression: 'u +', inputs: {u: a.y}}", ExpressionError, 22, "`u +` is neither a number nor", "arithmetic"),
    ("{expression: '2*(u', inputs: {u: a.y}}", ExpressionError, 22, "`2*(u` is neither", "close each bracket"),
    ("{expression: '2u', inputs: {u: a.y}}", ExpressionError, 20, "`2u` is neither", "write 2*u"),
    ("{expression: 'u^2', inputs: {u: a.y}}", ExpressionError, 20, "`^` in `u^2` is not a power", "write `**`"),
    ("{expression: 'u > 0 && u < 1', inputs: {u: a.y}}", ExpressionError, 26, "is neither", "write `and`"),
    ("{expression: ''}", WrongType, 19, "`blocks.b.expression` is an empty text", "write one text"),
    ("{expression: {}}", WrongValue, 19, "`blocks.b.expression` is an empty mapping", 'write such as {y: "2*u"}'),
    ("{expression: 2}", WrongType, 19, "`blocks.b.expression` must be text, not `2`", "quotation marks"),
    ("{expression: [u]}", WrongType, 19, "`blocks.b.expression` must be text, not a list of 1", "write one text"),
    ("{expression: {r: [1]}}", WrongType, 23, "`blocks.b.expression.r` must be text, not a list", "write one text"),
    ("{expression: {r: 2, q: '1'}}", WrongType, 23, "`blocks.b.expression.r` must be text, not `2`", "quotation"),
    ("{expression: '2*y'}", ExpressionError, 22, "`y` is what the expression computes", "inputs: {x: b.y}"),
    ("{expression: 'y*2', inputs: {y: a.y}}", WrongValue, 35, "`y` is an output and an input too", '{u: "…"}'),
    ("{expression: {p: '1 + q', q: p}}", ExpressionError, 28, "the outputs `p`, `q` read each other", "{x: b.q}"),
    ("{expression: {p: u}, inputs: {u: 1, p: 1}}", WrongValue, 42, "`p` is an output and an input too", "another name"),
    (
        "{expression: 'u', inputs: {u: a.y}, parameters: {u: 1}}",
        WrongValue,
        55,
        "`u` is an input and a parameter",
        "ano",
    ),
    ("{expression: 'time*i'}", ExpressionError, 25, "`i`, the number of a fleet's member", 'parameters: {i: "i"}'),
    ("{expression: 'u/N', inputs: {u: a.y}}", ExpressionError, 22, "`N`, the size of a fleet", 'parameters: {N: "N"}'),
    (
        "{expression: 'u[1]', inputs: {u: v.y}}",
        ExpressionError,
        20,
        "`u[1]` is not arithmetic",
        "such as block.port[1]",
    ),
    ("{expression: 'u', inputs: {u: v.y, 'u[1]': a.y}}", WrongValue, 41, "no expression can name the input", "`u_1`"),
    ("{expression: 'u', inputs: {u: v.y, lambda: a.y}}", WrongValue, 41, "it has a meaning of its own", "`lambda_`"),
    ("{expression: 'lambda*2'}", ExpressionError, 20, "`lambda*2` is neither", "`lambda_`"),
    ("{expression: '1 + a.y'}", ExpressionError, 24, "`a.y` is not arithmetic", "read by an input only"),
    ("{expression: 'sqrt'}", ExpressionError, 20, "the function `sqrt` has no argument", "write sqrt(…)"),
    ("{expression: 'sqr(u)', inputs: {u: a.y}}", ExpressionError, 20, "unknown function `sqr`", "`sqrt`?"),
    (
        "{expression: 'u*k(2)', inputs: {u: a.y}}",
        ExpressionError,
        22,
        "unknown function `k`",
        "write k*(…) for a product",
    ),
    (
        "{expression: 'atan2(u)', inputs: {u: a.y}}",
        ExpressionError,
        20,
        "a function of 2 numbers, not of 1",
        "atan2(a, b)",
    ),
    (
        "{expression: 'x + u', inputs: {x: v.y, u: w.y}}",
        WrongShape,
        48,
        "`u` has the shape (2), and `x` (3)",
        "element by",
    ),
    (
        "{expression: 'x*k', parameters: {k: [1, 2]}, inputs: {x: v.y}}",
        WrongShape,
        42,
        "`k` has the shape (2)",
        "element",
    ),
    (
        "{expression: 'if(u, 1, 2)', inputs: {u: a.y}}",
        WrongDataType,
        46,
        "input `u` is bool, but a.y is float64",
        "u > 0",
    ),
    ("{expression: 'u + 1', inputs: {u: on.above}}", WrongDataType, 40, "`u` is float64, but on.above", "if(u, 1, 0)"),
    ("{expression: 'if(u, u, 2)', inputs: {u: a.y}}", ExpressionError, 26, "`u` is a number here and a truth", "> 0"),
    (
        "{expression: 'if(2*u, 1, 2)', inputs: {u: a.y}}",
        ExpressionError,
        23,
        "`2*u` is a number where a condition",
        "> 0",
    ),
    (
        "{expression: '(u > 0)*2', inputs: {u: a.y}}",
        ExpressionError,
        21,
        "`u > 0` is a truth value",
        "if(condition, 1, 0)",
    ),
    (
        "{expression: {p: 'u > 0', q: 'p + 1'}, inputs: {u: a.y}}",
        ExpressionError,
        36,
        "`p` is a truth value",
        "if(p, 1, 0)",
    ),
    (
        "{expression: {p: 'u', q: 'not p'}, inputs: {u: a.y}}",
        ExpressionError,
        36,
        "`p` is a number, and stands",
        "`> 0`",
    ),
    ("{expression: 'if(time, 1, 2)'}", ExpressionError, 23, "`time` is a number, and stands", "`> 0`"),
    ("{expression: 'u + sqrt(-1)', inputs: {u: a.y}}", ExpressionError, 24, "`sqrt(-1)` has no value", "check its"),
    (
        "{expression: 'u*(1/0)', inputs: {u: a.y}}",
        ExpressionError,
        23,
        "`1/0` has no value: float division",
        "check its",
    ),
    (
        "{expression: 'u + (-8)**(1/3)', inputs: {u: a.y}}",
        ExpressionError,
        24,
        "`(-8)**(1/3)` is not a real",
        "check its",
    ),
    (
        "{expression: 'u + 1e300*1e300', inputs: {u: a.y}}",
        ExpressionError,
        24,
        "`1e300*1e300` is too large",
        "check its",
    ),
    ("{expression: 'u + 9**9**9', inputs: {u: a.y}}", ExpressionError, 24, "`9**9**9` has no value", "check its"),
    (
        "{expression: 'u', inputs: {u: a.y}, integrator: rk4}",
        UnknownKey,
        42,
        "`integrator` does not go with",
        "`block:`",
    ),
    ("{expression: 'u', inputs: {u: a.y}, isolate: true}", UnknownKey, 42, "`isolate` does not go with", "`fmu:`"),
    (
        "{expression: 'u', inputs: {u: a.y}, dimensions: {n: 3}}",
        UnknownParameter,
        55,
        "has no dimension `n`",
        "sizes are",
    ),
    (
        "{expression: 'u', block: Gain, inputs: {u: a.y}}",
        WrongValue,
        7,
        "two types, `block` and `expression`",
        "one of them",
    ),
    ("{expression: 'u', inputs: {u: a.y}, start: {u: 1}}", WrongValue, 50, "input `u` is wired", "remove it"),
    ("{expression: 'u', inputs: {u: a.y}, start: {y: 1}}", WrongValue, 50, "output `y` is computed", "remove it"),
    ("{expression: 'time', inputs: {time: a.y}}", WrongValue, 36, "it is the simulated time", "`t`"),
    ("{expression: {time: '1'}}", WrongValue, 20, "an output cannot be called `time`", "`t`"),
    ("{expression: {2x: '1'}}", WrongValue, 20, "an output cannot be called `2x`", "`u_2x`"),
    ("{expression: 'µ', inputs: {'µ': a.y}}", WrongValue, 33, "letters are read in their plain form", "write `μ`"),
    ("{expression: '" + "x" * 1001 + "'}", ExpressionError, 20, "an expression of 1001 characters is too long", "1000"),
    ("{expression: '" + "-" * 60 + "1'}", ExpressionError, 71, "is nested more than 50 levels deep", "fewer levels"),
    ("{expression: '1'}\n  c: {block: Gain, inputs: {u: b.z}}", UnknownPort, 32, "has no output `z`", "one of: y"),
    ("{expresion: 'u'}", UnknownKey, 7, "has no key `expresion`", "`expression`?"),
]


def mistakes(path, *settings, **more):
    with pytest.raises(DiagramErrors) as caught:
        run.load(path, settings, **more)
    assert all(error.fix for error in caught.value.errors)
    return caught.value.errors


@pytest.mark.parametrize(("block", "kind", "column", "said", "fix"), MISTAKES, ids=[row[0][:50] for row in MISTAKES])
def test_a_mistake_is_told_at_its_place(tmp_path, block, kind, column, said, fix):
    path = tmp_path / "d.yaml"
    path.write_text(f"{HEAD}  b: {block}\n", encoding="utf-8")
    found = mistakes(path)
    line = 8 if "\n" in block else 7
    assert [e for e in found if type(e) is kind and (e.position.line, e.position.column) == (line, column)], found
    error = next(e for e in found if type(e) is kind and e.position.column == column)
    assert said in error.message and fix in error.fix, error
    assert error.message.startswith(("block b: ", "block `b`: ", "block `b` ", "`blocks.b", "block c: "))


def test_what_is_not_known_is_told_alone(tmp_path):
    """Beside a vector; its size is nobody's mistake then."""
    path = tmp_path / "d.yaml"
    path.write_text(HEAD + "  b: {expression: 'x*z', inputs: {x: v.y, z: nobody.y}}\n")
    (error,) = mistakes(path)
    assert "`nobody.y` names no block" in error.message


PLACES = {
    "    expression: u + gian": (8, 21),
    "    expression: 'u + gian'": (8, 22),
    '    expression: "u + gian"': (8, 22),
    '    expression: "u + φ*gian"': (8, 24),
    "    expression: |\n      u +\n        gian": (10, 9),
    "    expression: >\n      u + gian": (9, 11),
    '    expression: "u \\x2b gian"': (8, 17),  # where it stands otherwise than it is read, the text alone
    "    expression: &it u + gian": (8, 17),
    "    expression:\n      r: u + gian": (9, 14),
}


@pytest.mark.parametrize("text", PLACES)
def test_a_name_is_told_at_its_own_place(tmp_path, text):
    path = tmp_path / "d.yaml"
    inputs = "u: a.y" + (", φ: a.y" if "φ" in text else "")
    path.write_text(f"{HEAD}  b:\n{text}\n    inputs: {{{inputs}}}\n", encoding="utf-8")
    (error,) = mistakes(path)
    assert (error.position.line, error.position.column) == PLACES[text]


def test_all_mistakes_of_a_block_come_at_once(tmp_path):
    path = tmp_path / "d.yaml"
    path.write_text(HEAD + "  b: {expression: {p: 'x + z', q: 'x +* 1'}, inputs: {u: a.y, x: a.y, 1: 2}}\n")
    assert [e.position.column for e in mistakes(path)] == [28, 39, 71]
    path.write_text(HEAD + "  b: {expression: {p: 'x + z', q: 'sqrt(z, x)*w'}, inputs: {u: a.y, x: a.y}}\n")
    assert [e.position.column for e in mistakes(path)] == [28, 36]
    path.write_text(HEAD + "  b: {expression: {p: 'x + z + z', q: 'w*z'}, inputs: {u: a.y, x: a.y}}\n")
    assert [e.position.column for e in mistakes(path)] == [28, 40, 42, 56]


def test_an_expression_on_the_command_line_is_its_own_place(tmp_path):
    path = tmp_path / "d.yaml"
    path.write_text(HEAD + "  b: {block: Gain, inputs: {u: a.y}}\n")
    (error,) = mistakes(path, swaps=("b=gian*u",))
    assert str(error.position) == "--swap b=gian*u" and "`gian` is neither" in error.message
    (error,) = mistakes(path, "blocks.b.expression=gian*u")
    assert str(error.position) == "--set blocks.b.expression=gian*u"


# ---- overlays and swaps

SPRING = (
    HEAD
    + """\
  b:
    expression: {f: "k*(r - x)", e: "r - x"}
    parameters: {k: 2}
    inputs: {x: a.y, r: 0.5}
metrics: {f: {signal: b.f, reduce: final}}
"""
)


def load(tmp_path, text, *settings, **more):
    """A diagram that lies over SPRING."""
    (tmp_path / "base.yaml").write_text(SPRING)
    (tmp_path / "over.yaml").write_text("extends: base.yaml\n" + text)
    return run.load(tmp_path / "over.yaml", settings, **more)


def written(network, name="b"):
    return network.components[name].declaration.doc.split("\n")


def test_an_overlay_changes_one_output_and_keeps_the_others(tmp_path):
    network = load(tmp_path, 'blocks: {b: {expression: {e: "abs(r - x)"}}}\n')
    assert written(network) == ["f = k*(r - x)", "e = abs(r - x)"]
    before, after = "`f = k*(r - x); e = r - x`", "`f = k*(r - x); e = abs(r - x)`"
    assert [str(swap) for swap in network.swaps] == [f"b: {before} → {after}: keeps k, x, r"]
    assert written(load(tmp_path, "blocks: {b: {expression: {e: ~}}}\n")) == ["f = k*(r - x)"]
    assert written(load(tmp_path, "", "blocks.b.expression.g=2*e")) == ["f = k*(r - x)", "e = r - x", "g = 2*e"]
    assert load(tmp_path, 'blocks: {b: {expression: {e: "r - x"}}}\n').swaps == []


def test_an_overlay_says_what_it_drops(tmp_path):
    (tmp_path / "base.yaml").write_text(SPRING)
    (tmp_path / "over.yaml").write_text('extends: base.yaml\nblocks: {b: {expression: {f: "2*x", e: "x"}}}\n')
    (error,) = mistakes(tmp_path / "over.yaml")
    assert type(error) is DroppedValue and error.position.line == 2
    assert "`f = 2*x; e = x` does not take what the diagram gives `f = k*(r - x); e = r - x`" in error.message
    assert "parameters.k at" in error.message and "inputs.r at" in error.message and "drop: [k, r]" in error.fix
    network = run.load(tmp_path / "over.yaml", ["blocks.b.drop=[k, r]"])
    assert network.swaps[0].drops == ("k", "inputs.r") and network.swaps[0].keeps == ("x",)


def test_a_block_gives_way_to_an_expression_and_back(tmp_path):
    path = tmp_path / "d.yaml"
    path.write_text(
        HEAD + "  b: {block: Gain, parameters: {k: 3}, inputs: {u: a.y}}\nmetrics: {y: {signal: b.y, reduce: max}}\n"
    )
    network = run.load(path, swaps=["b=k*sin(u)"])
    assert written(network) == ["y = k*sin(u)"]
    assert str(network.swaps[0]) == "b: Gain → `y = k*sin(u)`: keeps k, u"
    (error,) = mistakes(path, swaps=["b=2*sin(u)"])
    assert type(error) is DroppedValue and "drop: k" in error.fix.replace("[", "").replace("]", "")
    back = tmp_path / "back.yaml"
    back.write_text("extends: d.yaml\nblocks: {b: {expression: 'k*sin(u)'}}\n")
    assert str(run.load(back, swaps=["b=Gain"]).swaps[0]) == "b: `y = k*sin(u)` → Gain: keeps k, u"
    assert "did you mean `Gain`?" in mistakes(path, swaps=["b=Gian"])[0].fix


def test_the_resolved_text_says_the_expressions(tmp_path):
    network = load(tmp_path, "")
    text = network.diagram.resolved()
    (tmp_path / "copy.yaml").write_text(text)
    copy = run.load(tmp_path / "copy.yaml")
    assert copy.diagram.resolved() == text and "f: k*(r - x)" in text


def test_inside_a_diagram_and_handed_values(tmp_path):
    (tmp_path / "inner.yaml").write_text(
        'inputs: {pos: law.x}\noutputs: {force: law.y}\nblocks: {law: {expression: "k*(r - x)", parameters: {k: 1}, '
        "start: {r: 0}}}\n"
    )
    path = tmp_path / "d.yaml"
    path.write_text(
        HEAD + "  b: {diagram: inner.yaml, parameters: {law.k: 5}, start: {law.r: 2}, inputs: {pos: a.y}}\n"
        "metrics: {f: {signal: b.force, reduce: max}}\n"
    )
    outcome = run.Run(run.load(path)).execute()
    assert outcome.metrics["f"] == 10.0  # at first, where the sine is 0
    network = run.load(path, ["blocks.b/law.expression=k*r - x"])
    assert written(network, "b/law") == ["y = k*r - x"]
    (error,) = mistakes(path, "blocks.b.inputs=~")
    assert "`x` is neither an input nor a parameter" in error.message


def test_values_from_a_file_and_late_wires(tmp_path):
    (tmp_path / "t.csv").write_text("k\n1\n2\n3\n")
    path = tmp_path / "d.yaml"
    path.write_text(
        HEAD + "  b: {expression: 'k*x', parameters: {k: {file: t.csv, column: k}}, start: {x: 7},\n"
        "      inputs: {x: {from: v.y, delay: 0.1}}}\nmetrics: {y: {signal: b.y, reduce: final}}\n"
    )
    assert run.Run(run.load(path)).execute().metrics["y"] == [1.0, 4.0, 9.0]
    outcome = run.Run(run.load(path, ["run.stop=0.1", "run.step=0.1", "blocks.b.inputs.x.delay=0.2"])).execute()
    assert outcome.metrics["y"] == [7.0, 14.0, 21.0]


# ---- sizes


def final(tmp_path, blocks, signal="b.y", fleets="", engine="native"):
    path = tmp_path / "d.yaml"
    path.write_text(f"{fleets}{HEAD}{blocks}metrics: {{y: {{signal: {signal}, reduce: final}}}}\n")
    outcome = run.Run(run.load(path), engine=engine).execute()
    assert outcome.status == "completed", outcome.error
    return np.asarray(outcome.metrics["y"]).tolist()


SIZES = [
    ("{expression: 'v + s', inputs: {v: v.y, s: 10}}", [11.0, 12.0, 13.0]),
    ("{expression: 's*v', inputs: {s: c.y, v: v.y}}", [5.0, 10.0, 15.0]),  # one number serves all elements
    ("{expression: 'k*s', parameters: {k: [1, 2]}, inputs: {s: c.y}}", [5.0, 10.0]),
    ("{expression: 'k*v', parameters: {k: [1, 2, 3]}, inputs: {v: v.y}}", [1.0, 4.0, 9.0]),
    ("{expression: 'k*v', parameters: {k: [2]}, inputs: {v: v.y}}", [2.0, 4.0, 6.0]),
    ("{expression: 'm*s', inputs: {m: [[1, 2], [3, 4]], s: c.y}}", [[5.0, 10.0], [15.0, 20.0]]),
    ("{expression: 'x*x', inputs: {x: 'v.y[2]'}}", 4.0),
    ("{expression: 'x*x', inputs: {x: ['v.y[1..2]', 'v.y[1]']}}", [1.0, 4.0, 1.0]),
    ("{expression: {e: 'v - s', y: 'e*e + c', c: 1 + 1}, inputs: {v: v.y, s: c.y}}", [18.0, 11.0, 6.0]),
    ("{expression: '7 - 2*time*0'}", 7.0),
    ("{expression: 'if(v > s, v, s)', inputs: {v: v.y, s: 2}}", [2.0, 2.0, 3.0]),
]


@pytest.mark.parametrize(("block", "wanted"), SIZES, ids=[row[0][:40] for row in SIZES])
def test_element_by_element(tmp_path, block, wanted):
    assert final(tmp_path, f"  c: {{block: Constant, parameters: {{value: 5}}}}\n  b: {block}\n") == wanted


def test_in_a_ring_that_learns_its_size_late(tmp_path):
    """Of either order: the loop's size is that of what is wired into it, or of a start value."""
    e, i = (
        "  b: {expression: 'k*(r - x)', parameters: {k: 2}, inputs: {%s}}\n",
        "  i: {block: Integrator, inputs: {u: b.y}%s}\n",
    )
    for wires in ("x: i.x, r: v.y", "r: v.y, x: i.x"):
        for blocks in (e % wires + i % "", i % "" + e % wires):
            assert final(tmp_path, blocks) == pytest.approx([1.28, 2.56, 3.84])  # 2 r 0.8^2, by Euler's method
    blocks = e % "x: i.x, r: 1" + i % ", start: {x: [0, 1]}"
    assert final(tmp_path, blocks) == pytest.approx([1.28, 0.0])


def test_members_of_a_fleet(tmp_path):
    fleets = "fleets: {robot: 3}\n"
    own = "  s: {block: Constant, per: robot, parameters: {value: i}}\n"
    each = "  b: {expression: 'k*x + c', per: robot, parameters: {k: [1, 10, 100], c: i/N}, inputs: {x: s.y}}\n"
    assert final(tmp_path, own + each, fleets=fleets) == pytest.approx([1 + 1 / 3, 20 + 2 / 3, 301.0])
    whole = "  b: {expression: 'x*w', parameters: {w: [1, 2, 3]}, inputs: {x: s.y}}\n"
    assert final(tmp_path, own + whole, fleets=fleets) == [1.0, 4.0, 9.0]
    many = "  b: {expression: 'x*w', per: robot, inputs: {x: s.y, w: v.y}}\n"  # of all else each takes the whole
    assert final(tmp_path, own + many, fleets=fleets) == [[k * w for w in (1.0, 2.0, 3.0)] for k in (1, 2, 3)]
    dealt = whole + "  g: {expression: '2*x', per: robot, inputs: {x: b.y}}\n"
    assert final(tmp_path, own + dealt, "g.y", fleets=fleets) == [2.0, 8.0, 18.0]


@pytest.mark.parametrize("engine", ["native", "python"])
def test_whole_numbers_are_read_as_real_ones(tmp_path, engine):
    """Those of a state machine, say; their quotient is no whole number."""
    machine = "  s: {block: StateMachine, period: 0.1, inputs: {u: on.above}, parameters: {values: 0, "
    machine += "table: [[2, 2], [2, 2]]}}\n"
    law = "  b: {expression: 'n/4 + n**3 + if(n == 2, x, 0)', inputs: {n: s.state, x: 1}}\n"
    assert final(tmp_path, machine + law, engine=engine) == 9.5


# ---- names

WORDS = ["i", "N", "e", "pi", "u", "q", "k", "sin", "range", "part_1", "below", "x_", "start", "outputs", "event"]
WORDS += [
    "period",
    "int",
    "double",
    "register",
    "restrict",
    "self",
    "math",
    "np",
    "frame",
    "base",
    "match",
    "type",
    "_",
]
WORDS += ["n_x", "φ", "größe", "size", "abs", "float", "Input", "declaration", "verdict", "True_", "chosen", "if_"]


@pytest.mark.parametrize("engine", ["native", "python"])
def test_any_name_may_be_an_input_a_parameter_or_an_output(tmp_path, engine):
    """What stands for something else elsewhere, too: in Python, in C, in a kernel, in the framework."""
    outputs = {f"{name}2": f"{name} + sin(0*{name}) + if({name} > 0, 1, 0) + abs(x*0)" for name in WORDS}
    inputs = ", ".join(f"'{name}': {k}" for k, name in enumerate(WORDS[::2], 1))
    parameters = ", ".join(f"'{name}': {k}" for k, name in enumerate(WORDS[1::2], 101))
    said = ", ".join(f"'{name}': '{text}'" for name, text in outputs.items())
    block = f"  b: {{expression: {{{said}}}, inputs: {{{inputs}, x: 3}}, parameters: {{{parameters}}}}}\n"
    path = tmp_path / "d.yaml"
    metrics = ", ".join(f"m{k}: {{signal: 'b.{name}2', reduce: final}}" for k, name in enumerate(WORDS))
    path.write_text(f"{HEAD}{block}metrics: {{{metrics}}}\n", encoding="utf-8")
    outcome = run.Run(run.load(path), engine=engine).execute()
    assert outcome.status == "completed", outcome.error
    worth = [k // 2 + (101 if k % 2 else 1) + 1.0 for k in range(len(WORDS))]
    assert [outcome.metrics[f"m{k}"] for k in range(len(WORDS))] == worth


def test_words_of_c_and_python_as_outputs(tmp_path):
    words = [w for w in WORDS if w.isascii()]
    said = ", ".join(f"'{name}': '{k} + x'" for k, name in enumerate(words))
    path = tmp_path / "d.yaml"
    metrics = ", ".join(f"m{k}: {{signal: b.{name}, reduce: final}}" for k, name in enumerate(words))
    path.write_text(f"{HEAD}  b: {{expression: {{{said}}}, inputs: {{x: 1}}}}\nmetrics: {{{metrics}}}\n")
    outcome = run.Run(run.load(path)).execute()
    assert [outcome.metrics[f"m{k}"] for k in range(len(words))] == [k + 1.0 for k in range(len(words))]
