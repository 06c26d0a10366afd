"""Open dimensions, `"n?"`: one class for scalars, vectors, matrices and fleets; what is wired says which."""

from pathlib import Path

import numpy as np
import pytest

from cosim.engine import run
from cosim.errors import DiagramErrors

FILE = Path(__file__).with_name("open_blocks.py")
HEAD = """
title: Open
run: {stop: 0.02, step: 0.01}
fleets: {robot: 2}
blocks:
"""


def network(tmp_path, blocks):
    """Wire blocks, a line each: name, type, and what else there is."""
    path = tmp_path / "d.yaml"
    lines = [f"  {name}: {{python: '{FILE}:{kind}', {rest}}}" for name, kind, rest in blocks]
    path.write_text(HEAD + "\n".join(lines) + "\n")
    return run.load(path)


def shapes(net, *signals):
    found = {}
    for signal in signals:
        name, variable = signal.split(".")
        component = net.components[name]
        found[signal] = tuple(a.size for a in component.signal_axes(component.declaration.variables[variable]))
    return [found[s] for s in signals]


def last(trajectories, net, *names):
    both = [trajectories(net, *names, engine=engine) for engine in ("native", "python")]
    for name in names:
        np.testing.assert_array_equal(both[0][name], both[1][name])
    return [both[0][name][-1] for name in names]


def test_scalars_vectors_and_matrices(tmp_path, trajectories):
    for value, shape in (("3", ()), ("[3]", (1,)), ("[3, 4]", (2,)), ("[[3, 4, 5], [6, 7, 8]]", (2, 3))):
        net = network(
            tmp_path,
            [
                ("scale", "Scale", "inputs: {u: value.y}"),
                ("value", "Value", f"parameters: {{value: {value}}}"),
                ("lag", "Follow", "inputs: {u: scale.y}"),
            ],
        )
        assert shapes(net, "value.y", "scale.y", "lag.x") == [shape, shape, (*shape, 2)]
        y, x = last(trajectories, net, "scale.y", "lag.x")
        np.testing.assert_array_equal(y, 2.0 * np.array(eval(value)))  # noqa: S307  # ours
        np.testing.assert_allclose(x[..., 0], y * (1 - 0.99**2), rtol=1e-12)  # two Euler steps


def test_parameters_broadcast_and_say_what_wires_do_not(tmp_path, trajectories):
    net = network(
        tmp_path,
        [
            ("value", "Value", "parameters: {value: [1, 2, 3]}"),
            ("s", "Scale", "inputs: {u: value.y}, parameters: {k: [1, 10, 100]}"),
        ],
    )
    np.testing.assert_array_equal(last(trajectories, net, "s.y")[0], [1, 20, 300])
    net = network(
        tmp_path,
        [
            ("value", "Value", "parameters: {value: [[1, 2], [3, 4]]}"),
            ("s", "Scale", "inputs: {u: value.y}, parameters: {k: [1, 10]}"),
        ],
    )
    np.testing.assert_array_equal(last(trajectories, net, "s.y")[0], [[1, 20], [3, 40]])


def test_an_input_left_out_has_the_shape_of_the_others(tmp_path, trajectories):
    net = network(
        tmp_path,
        [("value", "Value", "parameters: {value: [1, 2]}"), ("p", "Plus", "inputs: {u: value.y}, start: {v: 5}")],
    )
    np.testing.assert_array_equal(last(trajectories, net, "p.y")[0], [6, 7])


def test_fleets(tmp_path, trajectories):
    net = network(
        tmp_path,
        [
            ("one", "Value", "parameters: {value: [1, 2]}, per: robot"),  # one number each
            ("each", "Scale", "inputs: {u: one.y}, per: robot, parameters: {k: [3, 5]}"),
            ("pair", "Value", "parameters: {value: [[1, 2, 3], [4, 5, 6]]}, per: robot"),
            ("vectors", "Scale", "inputs: {u: pair.y}, per: robot"),
            ("plain", "Value", "parameters: {value: [7, 8]}"),
            ("whole", "Scale", "inputs: {u: plain.y}, per: robot"),  # no fleet's: each member gets all of it
            ("all", "Scale", "inputs: {u: pair.y}, parameters: {k: [[1, 1, 1], [2, 2, 2]]}"),
            ("joined", "Scale", "inputs: {u: [one.y, one.y]}"),
            ("lag", "Follow", "inputs: {u: each.y}, per: robot, start: {x: [[1, 2], [3, 4]]}"),
        ],
    )
    assert shapes(net, "one.y", "each.y", "pair.y", "whole.y", "all.y") == [(2,), (2,), (2, 3), (2, 2), (2, 3)]
    each, vectors, whole, all_, joined, x = last(
        trajectories, net, "each.y", "vectors.y", "whole.y", "all.y", "joined.y", "lag.x"
    )
    np.testing.assert_array_equal(each, [3, 10])
    np.testing.assert_array_equal(vectors, [[2, 4, 6], [8, 10, 12]])
    np.testing.assert_array_equal(whole, [[14, 16], [14, 16]])
    np.testing.assert_array_equal(all_, [[1, 2, 3], [8, 10, 12]])
    np.testing.assert_array_equal(joined, [2, 4, 2, 4])
    assert x.shape == (2, 2)


def test_a_list_that_has_no_entry_for_each_member_is_a_vector_for_all(tmp_path):
    blocks = [("v", "Value", "parameters: {value: [1, 2, 3]}, per: robot")]
    assert shapes(network(tmp_path, blocks), "v.y") == [(2, 3)]


def test_rings(tmp_path):
    ring = [
        ("a", "Follow", "inputs: {u: b.y}, dimensions: {order: 1}, parameters: {T: 1}"),
        ("b", "Scale", "inputs: {u: c.y}"),
        ("c", "Value", ""),
    ]
    assert shapes(network(tmp_path, ring), "a.x") == [(1,)]
    ring = [("a", "Plus", "inputs: {u: b.y}"), ("b", "Scale", "inputs: {u: a.y}, parameters: {k: [0.1, 0.2]}")]
    assert shapes(network(tmp_path, ring), "a.y", "b.y") == [(2,), (2,)]
    ring = [("a", "Plus", "inputs: {u: b.y}"), ("b", "Scale", "inputs: {u: a.y}")]
    assert shapes(network(tmp_path, ring), "a.y", "b.y") == [(), ()]


def test_of_a_matrix_with_one_row_comes_a_scalar(tmp_path, trajectories):
    blocks = [
        ("value", "Value", "parameters: {value: [1, 2]}"),
        ("mix", "Mix", "inputs: {u: value.y}, parameters: {D: [[3, 4]]}"),
    ]
    net = network(tmp_path, blocks)
    assert shapes(net, "mix.y") == [()]
    assert last(trajectories, net, "mix.y")[0] == 11
    blocks = [("value", "Value", ""), ("mix", "Mix", "inputs: {u: value.y}, parameters: {D: [[3], [4]]}")]
    np.testing.assert_array_equal(last(trajectories, network(tmp_path, blocks), "mix.y")[0], [3, 4])


@pytest.mark.parametrize(
    ("blocks", "said"),
    [
        (
            [("v", "Value", ""), ("s", "Scale", "inputs: {u: v.y}, parameters: {k: [1, 2]}")],
            ["`k` has the shape (), not (2,); `n` is that of input `u` at", "d.yaml:7:"],
        ),
        (
            [
                ("v", "Value", "parameters: {value: [1, 2, 3]}"),
                ("s", "Scale", "inputs: {u: v.y}, parameters: {k: [1, 2]}"),
            ],
            ["`k` has the shape (n = 3), not (2,); `n` is that of input `u` at", "d.yaml:7:"],
        ),
        (
            [
                ("v", "Value", "parameters: {value: [1, 2, 3]}"),
                ("w", "Value", ""),
                ("s", "Plus", "inputs: {u: v.y, v: w.y}"),
            ],
            ["input `v` takes (n = 3), but () arrives; `n` is that of input `u`", "d.yaml:8:"],
        ),
        (
            [("v", "Value", ""), ("s", "Scale", "inputs: {u: v.y}, per: robot, parameters: {k: [1, 2, 3]}")],
            ["`k` has 3 entries for 2 robots"],
        ),
    ],
)
def test_mistakes_are_told_with_their_places(tmp_path, blocks, said):
    with pytest.raises(DiagramErrors) as caught:
        network(tmp_path, blocks)
    assert len(caught.value.errors) == 1
    for part in said:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("value", "per"), [("3", ""), ("[3, 4]", ""), ("[[1, 2], [3, 4]]", ""), ("[3, 4]", ", per: robot")]
)
@pytest.mark.parametrize("settings", ["", "run.method=joint run.integrator=rodas5p"])
def test_algebraic_loops_and_implicit_integrators(tmp_path, trajectories, value, per, settings):
    """y = u + y / 2, so y = 2 u; and dx/dt = y - x, a member each."""
    path = tmp_path / "d.yaml"
    path.write_text(
        HEAD + f"  v: {{python: '{FILE}:Value', parameters: {{value: {value}}}{per}}}\n"
        f"  sum: {{python: '{FILE}:Plus', inputs: {{u: v.y, v: half.y}}{per}}}\n"
        f"  half: {{python: '{FILE}:Scale', parameters: {{k: 0.5}}, inputs: {{u: sum.y}}{per}}}\n"
        f"  lag: {{python: '{FILE}:Follow', inputs: {{u: sum.y}}, parameters: {{T: [1]}}{per}}}\n"
    )
    net = run.load(path, settings.split())
    y, x = last(trajectories, net, "sum.y", "lag.x")
    np.testing.assert_allclose(y, 2.0 * np.array(eval(value)), rtol=1e-14)  # noqa: S307  # ours
    expected = 1 - np.exp(-0.02) if settings else 1 - 0.99**2  # exact to order 5, or two Euler steps
    np.testing.assert_allclose(x[..., 0], y * expected, rtol=1e-9)
