"""Which expressions `cosim check` and `cosim run` warn of: those that may jump within an integrator's step."""

import pytest

from cosim.engine import run
from cosim.wiring.overview import describe


@pytest.mark.parametrize(
    ("law", "reader", "column"),
    [
        ('{expression: "2*if(u > 0, 1, -1)", inputs: {u: ramp.y}}', "Integrator", 27),
        ('{expression: "u + floor(time)", inputs: {u: ramp.y}}', "Integrator", 26),
        ('{expression: "if(k > 0, 1, -1) + floor(u)", parameters: {k: 1}, inputs: {u: ramp.y}}', "Integrator", 41),
        ('{expression: "if(k > 0, 1, -1)*u", parameters: {k: 1}, inputs: {u: ramp.y}}', "Integrator", None),  # constant
        ('{expression: "if(u > 0, 1, -1)", inputs: {u: ramp.y}, period: 0.1}', "Integrator", None),  # held anyway
        ('{expression: "if(u > 0, 1, -1)", inputs: {u: hold.y}}', "Integrator", None),  # jumps at samples only
        ('{expression: "if(u > 0, 1, -1)", inputs: {u: ramp.y}}', "Gain", None),  # integrated by nothing
        ('{expression: "u*abs(u) + max(u, 0)", inputs: {u: ramp.y}}', "Integrator", None),  # does not jump
    ],
)
def test_what_jumps_where_it_is_integrated(tmp_path, law, reader, column):
    path = tmp_path / "d.yaml"
    path.write_text(
        "run: {stop: 1.5, step: 0.1, integrator: rk4, method: joint}\nblocks:\n  ramp: {block: Ramp}\n"
        "  hold: {block: ZeroOrderHold, period: 0.1, inputs: {u: ramp.y}}\n"
        f"  law: {law}\n  gain: {{block: Gain, inputs: {{u: law.y}}}}\n"
        f"  sum: {{block: {reader}, inputs: {{u: gain.y}}}}\n"
    )
    said = [warning for warning in describe(run.load(path)).warnings if "may jump within a step" in str(warning)]
    assert [str(warning).split(":")[1:3] for warning in said] == ([["5", str(column)]] if column else [])
    outcome = run.Run(run.load(path), "python").execute()
    assert [*map(str, said)] == [str(w) for w in outcome.warnings if "may jump within a step" in str(w)]


def test_only_what_leads_to_an_integrator_counts(tmp_path):
    """Of two in a ring behind it, neither integrates; another integrator has nothing to do with it."""
    path = tmp_path / "d.yaml"
    path.write_text(
        "run: {stop: 1, step: 0.1}\nblocks:\n  ramp: {block: Ramp}\n"
        '  law: {expression: "floor(u)", inputs: {u: ramp.y}}\n'
        '  one: {expression: "0.1*a + b", inputs: {a: two.y, b: law.y}}\n'
        '  two: {expression: "0.1*a", inputs: {a: one.y}}\n'
        "  other: {block: Integrator, inputs: {u: ramp.y}}\n"
    )
    assert not [w for w in describe(run.load(path)).warnings if "may jump within a step" in str(w)]
