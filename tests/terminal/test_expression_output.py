"""Expressions in the terminal: what is checked, what is wrong, what there is, what differs."""

import pytest

from cosim.terminal.cli import main

SPRING = """\
title: A cart on a spring
run: {stop: 1, step: 0.01, method: joint, integrator: rk4}
blocks:
  spring:
    expression: "k*(x_ref - x) - d*v"
    parameters: {k: 40, d: 2}
    inputs: {x: cart.x, v: speed.x, x_ref: 0.5}
  speed: {block: Integrator, inputs: {u: spring.y}}
  cart: {block: Integrator, inputs: {u: speed.x}}
  polar:
    expression: {r: "sqrt(x**2 + y**2)", phi: "atan2(y, x)"}
    inputs: {x: cart.x, y: speed.x}
record: {signals: [cart.x]}
"""
CHECKED = """\
A cart on a spring: 4 blocks, valid
joint, 1 s in 100 steps of 0.01 s

spring  Expression  y = k*(x_ref - x) - d*v; x ← cart.x; v ← speed.x;
                    x_ref = 0.5
speed   Integrator  u ← spring.y
cart    Integrator  u ← speed.x
polar   Expression  r = sqrt(x**2 + y**2); phi = atan2(y, x); x ← cart.x;
                    y ← speed.x

"""
WRONG = """\
d.yaml:5:23: error: block spring: `x_fer` is neither an input nor a parameter
      5 |     expression: "2*k*(x_fer - x) - d*v"
        |                       ^
    fix: did you mean `x_ref`? Else add `x_fer:` under blocks.spring.inputs or .parameters
d.yaml:7:37: error: block spring: the input `x_ref` is in no expression of the block
      7 |     inputs: {x: cart.x, v: speed.x, x_ref: 0.5}
        |                                     ^
    fix: use it, or remove it
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    (tmp_path / "d.yaml").write_text(SPRING)
    return tmp_path


def test_check_shows_what_is_computed_of_what(capsys):
    assert main(["check", "d.yaml"]) == 0
    assert capsys.readouterr().out.startswith(CHECKED)


def test_a_mistake_is_shown_where_it_is(folder, capsys):
    (folder / "d.yaml").write_text(SPRING.replace("k*(x_ref", "2*k*(x_fer"))
    assert main(["check", "d.yaml"]) == 2
    error = capsys.readouterr().err
    assert [line for line in WRONG.splitlines() if line not in error] == []


@pytest.mark.parametrize(
    ("arguments", "place", "line"),
    [
        (
            [],
            "d.yaml:4:23: error: block c: output `v` is not finite (inf) at t = 0.5 s",
            '  c: {expression: {v: "1/(time - 0.5)"}}',
        ),
        (["--set", "blocks.c.expression.v=log(0.5 - time)"], "--set blocks.c.expression.v=log(0.5 - time): error", ""),
        (["--swap", "c=log(0.5 - time)"], "--swap c=log(0.5 - time): error: block c: output `y` is not finite", ""),
    ],
)
def test_what_has_no_value_in_a_run_is_shown_where_it_was_written(folder, capsys, arguments, place, line):
    text = 'title: d\nrun: {stop: 1, step: 0.125}\nblocks:\n  c: {expression: {v: "1/(time - 0.5)"}}\n'
    (folder / "d.yaml").write_text(text)
    assert main(["run", "d.yaml", *arguments]) == 1
    error = capsys.readouterr().err
    assert error.startswith(place) and line in error and "not finite" in error.splitlines()[0]


def test_runs_of_two_expressions_are_compared(capsys):
    assert main(["run", "d.yaml", "-o", "a.nc"]) == 0
    assert main(["run", "d.yaml", "--swap", "spring=k*(x_ref - x)**3 - d*v", "-o", "b.nc"]) == 0
    swap = "spring: `y = k*(x_ref - x) - d*v` → `y = k*(x_ref - x)**3 - d*v`: keeps k, d, x, v, x_ref"
    assert swap in capsys.readouterr().out
    assert main(["compare", "a.nc", "b.nc"]) == 1
    told = "  blocks.spring.expression  k*(x_ref - x) - d*v → k*(x_ref - x)**3 - d*v\n"
    assert told in capsys.readouterr().out


def test_what_may_be_written_is_listed(capsys):
    assert main(["blocks", "expression"]) == 0
    said = capsys.readouterr().out
    assert 'expression: "k*(r - x)"' in said and "hypot, if(condition, a, b)" in said
    assert main(["keys", "blocks"]) == 0
    rows = {line.split()[0]: line for line in capsys.readouterr().out.splitlines() if line.strip()}
    assert "arithmetic of its inputs and parameters" in " ".join(rows.values())
    assert "text, or one for each output" in rows["expression"]
