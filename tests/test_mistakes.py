"""Every mistake ends in exit code 2 and a message that names block, port, file:line:column and the fix."""

import re

import pytest

from cosim import cli

GOOD = """
run: {stop: 1, step: 0.1}
fleets: {robot: 3}
blocks:
  source: {type: Sine, per: robot}
  lag:
    type: Lag
    per: robot
    parameters: {T: [1, 2, 3]}
    inputs: {u: source.y}
  average: {type: Average, inputs: {u: lag.x}}
  oscillator: {type: Oscillator}
  sampled: {type: Counter, period: 0.2, inputs: {u: oscillator.x}}
record: {period: 0.1, signals: [lag.x]}
metrics:
  largest: {signal: lag.y, reduce: max}
"""
FORMATION = "extends: {formation}\nblocks:\n"

# mistake: (what is replaced, by what, line of the message, its words, the fix)
MISTAKES = {
    "unknown block": ("type: Lag", "block: Lagg", 7, "block `lag`.* no block type `Lagg`", ""),
    "unknown class in a file": ("type: Lag", "type: Lagg", 7, "`lag`.*no block class `Lagg`", "`Lag`"),
    "unknown source block": ("u: source.y", "u: sorce.y", 10, "block lag: `sorce.y` names no block", "`source`"),
    "unknown output": ("u: source.y", "u: source.z", 10, r"block lag: Sine \(source\) has no output `z`", "y"),
    "unknown input": ("u: source.y", "uu: source.y", 10, "block lag: Lag has no input `uu`", "`u`"),
    "unknown parameter": ("T: [1, 2, 3]", "TT: 1", 9, "block lag: Lag has no parameter `TT`", "`T`"),
    "misspelt key": ("parameters: {T", "paramters: {T", 9, "no key `paramters`", "`parameters`"),
    "misspelt top-level key": ("metrics:", "metric:", 15, "no key `metric`", "`metrics`"),
    "unconnected input": ("    inputs: {u: source.y}\n", "", 6, "block lag: input `u` is not connected", "block.port"),
    "wrong shape": (
        "inputs: {u: lag.x}",
        "inputs: {u: oscillator.x}",
        11,
        r"average: input `u` takes \(robots, n\)",
        "shape",
    ),
    "forgotten per": ("    per: robot\n    par", "    par", 9, "input `u` takes.*robot: 3", "per: robot"),
    "a local is no port": ("u: oscillator.x", "u: oscillator.v", 13, "`oscillator.v` is a local variable", "measuring"),
    "fleet and list": ("T: [1, 2, 3]", "T: [1, 2]", 9, "lag: `T` has 2 entries for 3 robots", "one for each robot"),
    "ragged list": ("T: [1, 2, 3]", "T: [1, [2], 3]", 9, "lag.T: the rows of the list differ", "shape"),
    "unknown fleet": ("per: robot\n    par", "per: robots\n    par", 8, "no fleet `robots`", "`robot`"),
    "broken YAML": ("T: [1, 2, 3]", "T: [1, 2, 3", 9, "broken YAML", "bracket"),
    "duplicate key": ("  average:", "  lag: {type: Gain}\n  average:", 11, "`lag` is here a second time", "remove"),
    "a step of zero": ("step: 0.1", "step: 0", 2, "run.step", ""),
    "no whole number of steps": ("step: 0.1", "step: 0.3", 2, "whole number", ""),
    "a period between steps": ("period: 0.2", "period: 0.25", 13, "period", "0.2"),
    "a period without samples": ("oscillator: {", "oscillator: {period: 0.2, ", 12, "not sampled", "remove `period`"),
    "bad expression": ("T: [1, 2, 3]", "T: [1, 2, 'pj/3']", 9, "pj", "`pi`"),
    "text for a number": ("step: 0.1", "step: fast", 2, "fast", ""),
    "unknown recording": ("signals: [lag.x]", "signals: [lag.xx]", 14, "has no variable `xx`", "x"),
    "unknown reduction": ("reduce: max", "reduce: maxx", 16, "maxx", "`max`"),
    "unknown method": ("step: 0.1", "step: 0.1, method: jacoby", 2, "jacoby", "`jacobi`"),
    "missing file of blocks": ("type: Lag", "python: nowhere.py:Lag", 7, "nowhere.py", ""),
    "algebraic loop": ("u: source.y", "u: lag.y", 10, "algebraic loop: lag.y → lag.y", "state"),
    "too many members": ("u: source.y", 'u: "source.y[2..4]"', 10, r"source.y has 3 members", "members 1 to 3"),
    "joined sources that differ": ("u: source.y", "u: [source.y, oscillator.x]", 10, "joined for input `u` differ", ""),
}


def check(path, capsys, *options):
    """Exit code and standard error of `cosim check`."""
    code = cli.main(["check", str(path), *options])
    return code, capsys.readouterr().err


def test_the_diagram_without_mistakes_is_valid(write, capsys):
    assert check(write(GOOD), capsys) == (0, "")


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named_with_its_place_and_its_fix(write, capsys, mistake):
    old, new, line, words, fix = MISTAKES[mistake]
    assert GOOD.count(old) == 1
    path = write(GOOD.replace(old, new))
    code, text = check(path, capsys)
    assert code == 2 and "Traceback" not in text
    assert re.search(rf"{re.escape(str(path))}:{line}:\d+: error: .*{words}", text), text
    assert re.search(rf"fix: .*{re.escape(fix)}", text), text


def test_all_mistakes_are_reported_in_one_go(write, capsys):
    text = GOOD
    chosen = (
        "unknown output",
        "fleet and list",
        "misspelt top-level key",
        "a local is no port",
        "no whole number of steps",
    )
    for mistake in chosen:
        old, new, *_ = MISTAKES[mistake]
        text = text.replace(old, new)
    code, said = check(write(text), capsys)
    assert code == 2
    for mistake in chosen:
        assert re.search(MISTAKES[mistake][3], said), mistake


def test_units_and_data_types_of_a_wire_must_agree(write, tmp_path, capsys):
    (tmp_path / "own.py").write_text(
        "from cosim import Block, Input, Output\n"
        "class Force(Block):\n    u = Input(unit='N')\n    k = Input(dtype=int, start=0)\n    y = Output()\n"
        "    def outputs(u, k, y):\n        y[0] = u * k\n"
    )
    path = write(GOOD + "\n", "units.yaml")
    path.write_text(
        path.read_text().replace("\nrecord", "\n  force: {python: 'own.py:Force', inputs: {u: oscillator.x}}\nrecord")
    )
    code, text = check(path, capsys)
    assert code == 2 and "block force: input `u` is in N, but oscillator.x is in m" in text and ":14:" in text
    path.write_text(
        path.read_text().replace("{u: oscillator.x}}\nrecord", "{u: sampled.held, k: sampled.held}}\nrecord")
    )
    code, text = check(path, capsys)
    assert code == 2 and "input `k` is int64, but sampled.held is float64" in text


def test_missing_files_and_overlays_that_extend_themselves(write, tmp_path, capsys):
    code, text = check(tmp_path / "none.yaml", capsys)
    assert code == 2 and "none.yaml" in text
    a, b = write("extends: b.yaml\n", "a.yaml"), write("extends: a.yaml\n", "b.yaml")
    code, text = check(a, capsys)
    assert code == 2 and str(b) in text and "extends" in text and "fix:" in text


def test_one_port_cannot_have_two_drivers(write, capsys):
    """Inputs are written where they are read, so a second driver can only be a second key."""
    code, text = check(write(GOOD.replace("{u: source.y}", "{u: source.y, u: lag.x}")), capsys)
    assert code == 2 and re.search(r":10:\d+: error: .*`u`", text)


RULES = {
    "observer.parameters.beta_1=0.5": "0.5 < beta_1 < 1",
    "observer.parameters.beta_1=1": "0.5 < beta_1 < 1",
    "potential_field.parameters.epsilon_2=4": "R_c",
    "potential_field.parameters.epsilon_1=1": "epsilon_1 > 1",
    "topology.parameters.hears=[[2], [1], [4], [3], [6], [5]]": "strongly connected",
}


@pytest.mark.parametrize("setting", RULES)
def test_a_parameter_that_breaks_a_blocks_rule_is_refused(formation, capsys, setting):
    code, text = check(formation, capsys, "--set", f"blocks.{setting}")
    block = setting.partition(".")[0]
    assert code == 2 and f"block {block}: " in text and RULES[setting] in text and "fix:" in text
    assert f"--set blocks.{setting}" in text


SECRETS = {
    "observer.inputs.x": "plant.v",
    "controller.inputs.v_hat": "plant.v",
    "controller.inputs.xi_2": "reference.dx_d",
    "controller.inputs.xi_3": "centre.ddx_c",
    "differentiator.inputs.x_d": "reference.dx_d",
    "controller.inputs.w_hat": "estimation.N_w",
}


@pytest.mark.parametrize("port", SECRETS)
def test_limited_information_is_a_property_of_the_wiring(formation, capsys, port):
    """No wire brings an observer, a differentiator or a controller what its robot does not know."""
    code, text = check(formation, capsys, "--set", f"blocks.{port}={SECRETS[port]}")
    assert code == 2 and f"block {port.partition('.')[0]}: `{SECRETS[port]}`" in text
    assert "local variable" in text or "measuring block" in text


def test_a_condition_of_a_theorem_is_a_warning(formation, capsys):
    settings = [f"--set=blocks.{block}.parameters.lambda_=0.1" for block in ("controller", "formation")]
    code, text = check(formation, capsys, *settings)
    assert code == 0 and re.search(
        r"formation.yaml:\d+:\d+: warning: controller: Theorem 3, .*sigma\(Lambda\) = 0.1", text
    )


def test_command_line_settings_that_name_nothing(write, capsys):
    path = write(GOOD)
    for option, value, words in (
        ("--set", "blocks.lagg.parameters.T=1", "`lag`"),
        ("--set", "run.stp=1", "`stop`"),
        ("--swap", "lagg=Gain", "`lag`"),
    ):
        code, text = check(path, capsys, option, value)
        assert code == 2 and words in text and f"{option} {value}" in text
