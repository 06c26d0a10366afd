"""Every mistake ends in exit code 2 and a message that names block, port, file:line:column and the fix."""

import json
import re

import pytest

from cosim.terminal import cli

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
    "sampled, without a period": ("period: 0.2, ", "", 13, "is sampled, and has no `period`", "add `period: 0.1`"),
    "an offset of nothing": ("oscillator: {", "oscillator: {offset: 0.2, ", 12, "that of a `period`", "write `period`"),
    "bad expression": ("T: [1, 2, 3]", "T: [1, 2, 'pj/3']", 9, "pj", "`pi`"),
    "text for a number": ("step: 0.1", "step: fast", 2, "fast", ""),
    "unknown recording": ("signals: [lag.x]", "signals: [lag.xx]", 14, "has no variable `xx`", "x"),
    "unknown reduction": ("reduce: max", "reduce: maxx", 16, "maxx", "`max`"),
    "unknown method": ("step: 0.1", "step: 0.1, method: jacoby", 2, "jacoby", "`jacobi`"),
    "missing file of blocks": ("type: Lag", "python: nowhere.py:Lag", 7, "nowhere.py", ""),
    "too many members": ("u: source.y", 'u: "source.y[2..4]"', 10, r"source.y has 3 members", "members 1 to 3"),
    "joined sources that differ beyond their members": (
        "inputs: {u: lag.x}",
        "inputs: {u: [lag.x, three.x]}}\n"
        "  three: {type: Integrator, per: robot, dimensions: {n: 3}, inputs: {u: three.x}",
        11,
        "joined for input `u` differ",
        "members only",
    ),
    "a truth for a number": ("T: [1, 2, 3]", "T: true", 9, "`true` is no number", "write 1"),
    "a truth among numbers": ("T: [1, 2, 3]", "T: [1, 2, true]", 9, "`true` is no number", "write 1"),
    "a key without a value": ("T: [1, 2, 3]", "T: ", 9, "`blocks.lag.parameters.T` has no value", "~"),
    "nothing to take away": ("T: [1, 2, 3]", "T: ~", 9, "takes away .* and nothing does", "remove"),
    "a date": ("T: [1, 2, 3]", "T: 2021-11-12", 9, "is a date", "spaces"),
    "too large for a float": ("T: [1, 2, 3]", "T: 1e400", 9, "beyond the range", "1.7e308"),
    "too small for a float": ("T: [1, 2, 3]", "T: 1e-400", 9, "beyond the range", "1.7e308"),
    "400 digits": ("T: [1, 2, 3]", f"T: {'9' * 400}", 9, "beyond the range", "1.7e308"),
    "an expression that is too large": ("T: [1, 2, 3]", "T: 1e308*10", 9, "too large for a number", "inf"),
    "not a number": ("T: [1, 2, 3]", "T: .nan", 9, "no value to calculate with", "give a number"),
    "a look-alike of a minus sign": ("T: [1, 2, 3]", "T: −1", 9, "neither a number nor", "minus sign of the keyboard"),
    "a number with a unit": ("T: [1, 2, 3]", "T: 3 s", 9, "neither a number nor", "write a number"),
    "a division by zero": ("T: [1, 2, 3]", "T: 1/(N-3)", 9, "cannot be evaluated: .*division by zero", "check"),
    "a file name with NUL": ("type: Lag", 'python: "no\\0where.py:Lag"', 7, "invisible character NUL", "remove"),
    "a fleet of no size": ("{robot: 3}", "{robot: 0}", 3, "must be a whole number from 1", "such as"),
    "another name of the fleet": ("{robot: 3}", "{ship: 3}", 5, "no fleet `robot`, nor for lag", "ship"),
    "a window before the run": ("reduce: max", "reduce: max, from: -1", 16, "before the run does", "0"),
    "an output of nothing": ("metrics:", "outputs: {y: lagg.x}\nmetrics:", 15, "names no block", "`lag`"),
    "an input for nothing": ("metrics:", "inputs: {u: lag.uu}\nmetrics:", 15, "Lag .lag. has no input `uu`", "`u`"),
    "nothing to drop": (
        "    per: robot\n    par",
        "    per: robot\n    drop: [T]\n    par",
        9,
        "nothing called `T`",
        "~",
    ),
    "digits that are grouped oddly": ("stop: 1,", "stop: 1_0,", 2, "`1_0` groups digits", "10 or 1.0"),
    "a signal twice": ("[lag.x]", "[lag.x, source.y, lag.x]", 14, "`lag.x` is recorded twice", "once"),
    "a space before the dot": ("[lag.x]", "[lag .x]", 14, "spaces around the dot of `lag .x`", "lag.x"),
    "a start of what is wired": (
        "    inputs: {u: source.y}",
        "    start: {u: [1, 2]}\n    inputs: {u: source.y}",
        10,
        "input `u` is wired, so that its start value has no effect",
        "remove it",
    ),
    "an empty list of sources": ("u: source.y", "u: []", 10, "`blocks.lag.inputs.u` is an empty list", "plant.x"),
    "a number among sources": ("u: source.y", "u: [source.y, 5]", 10, "lists `5` beside what it reads", "block.port"),
    "a window that ends before it begins": (
        "reduce: max",
        "reduce: max, from: 0.8, to: 0.2",
        16,
        "ends at 0.2 s, before it begins at 0.8 s",
        "exchange",
    ),
    "a stop too large for a float": ("stop: 1,", "stop: 1e400,", 2, "beyond the range", "1.7e308"),
    "a text for a size": (
        "    par",
        "    dimensions: {n: two}\n    start: {x: [1, 2]}\n    par",
        9,
        "unknown name `two`",
        "",
    ),
    "a member's number without a fleet": (
        "source: {type: Sine, per: robot}",
        "source: {type: Sine}",
        5,
        "block source: the default of `A`: `i` in `i` is the number of a fleet's member",
        "write `per:`",
    ),
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


TOLD_ONCE = (
    "an empty list of sources",
    "a number among sources",
    "a window that ends before it begins",
    "a stop too large for a float",
    "a text for a size",
)


@pytest.mark.parametrize("mistake", TOLD_ONCE)
def test_a_mistake_is_told_once(write, capsys, mistake):
    old, new, *_ = MISTAKES[mistake]
    _, text = check(write(GOOD.replace(old, new)), capsys)
    assert text.count("error:") == 1, text


def test_a_diagram_in_a_diagram_may_start_what_the_outer_one_wires(write, capsys):
    """So that it runs alone too; one that is open in both says how to drive it from outside."""
    inner = "run: {stop: 1, step: 0.1}\ninputs: {u: gain.u}\nblocks:\n  gain: {type: Gain, start: {u: [3, 4]}}\n"
    write(inner, "inner.yaml")
    outer = "run: {stop: 1, step: 0.1}\nblocks:\n  s: {type: Sine, parameters: {A: 1}}\n"
    assert check(write(f"{outer}  sub: {{diagram: inner.yaml, inputs: {{u: s.y}}}}\n"), capsys) == (0, "")
    write(inner.replace(", start: {u: [3, 4]}", ""), "inner.yaml")
    code, text = check(write(f"{outer}  sub: {{diagram: inner.yaml}}\n"), capsys)
    assert code == 2 and "block sub/gain: input `u` is not connected" in text
    assert "inputs: {u: gain.u}, and wire it under blocks.sub.inputs" in text


OWN = """
from cosim import Block, Input, Output, Parameter


def factorial(n):
    return 1.0 if n < 1.0 else n * factorial(n - 1.0)


class Recursive(Block):
    u = Input(start=3.0)
    y = Output()

    def outputs(u, y):
        y[0] = factorial(u)
"""


@pytest.mark.parametrize(
    ("default", "said", "fix"),
    [
        ('"two +"', "`two +` is neither a number nor an arithmetic expression", "2\\*pi/3"),
        ('[1, ["ii"]]', "unknown name `ii` in `ii`", "`i`"),
    ],
)
def test_a_default_that_is_no_number_is_named_in_the_authors_file(tmp_path, capsys, default, said, fix):
    (tmp_path / "own.py").write_text(OWN.replace("    y = Out", f"    k = Parameter(default={default})\n    y = Out"))
    (tmp_path / "d.yaml").write_text("run: {stop: 1, step: 0.1}\nblocks:\n  b: {python: own.py:Recursive}\n")
    code, text = check(tmp_path / "d.yaml", capsys)
    assert code == 2 and re.search(rf"own.py:11:5: error: .*default of `k`: {re.escape(said)}", text), text
    assert re.search(f"fix: .*{fix}", text)


def test_a_recursion_is_named_in_the_authors_file(tmp_path, capsys):
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "d.yaml").write_text("run: {stop: 1, step: 0.1}\nblocks:\n  b: {python: own.py:Recursive}\n")
    code, text = check(tmp_path / "d.yaml", capsys)
    assert code == 2 and re.search(r"own.py:5:1: error: block b: factorial\(\) calls itself", text), text


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


def test_a_path_that_begins_with_a_block_is_told_where_blocks_stand(write, capsys):
    code, text = check(write(GOOD), capsys, "--set", "lag.T=2")
    assert code == 2 and "the diagram` has no `lag`" in text
    assert "fix: write blocks.lag.parameters.T, or .start. for a state" in text
    code, text = check(write(GOOD), capsys, "--set", "lag=2")
    assert code == 2 and "the diagram` has no `lag`" in text and "write blocks" not in text


def test_one_port_cannot_have_two_drivers(write, capsys):
    """Inputs are written where they are read, so a second driver can only be a second key."""
    code, text = check(write(GOOD.replace("{u: source.y}", "{u: source.y, u: lag.x}")), capsys)
    assert code == 2 and re.search(r":10:\d+: error: .*`u`", text)


RULES = {
    "observer.parameters.beta_1=0.5": "0.5 < beta_1 < 1",
    "observer.parameters.beta_1=1": "0.5 < beta_1 < 1",
    "potential_field.parameters.epsilon_2=4": "R_c",
    "potential_field.parameters.epsilon_1=1": "epsilon_1 > 1",
    "topology.parameters.eta_1=0": "0 < eta_1 <= 1",
    "topology.parameters.eta_2=-14": "eta_2 > 0 and eta_3 > 0 (eq. 44)",
    "topology.parameters.eta_3=0": "eta_2 > 0 and eta_3 > 0 (eq. 44)",
    "differentiator.parameters.eta=[6, 8, 0, 6]": "eta > 0",
    "topology.parameters.hears=[[2], [1], [4], [3], [6], [5]]": "strongly connected",
}


@pytest.mark.parametrize("setting", RULES)
def test_a_parameter_that_breaks_a_blocks_rule_is_refused(formation, capsys, setting):
    code, text = check(formation, capsys, "--set", f"blocks.{setting}")
    block = setting.partition(".")[0]
    assert code == 2 and f"block {block}: " in text and RULES[setting] in text and "fix:" in text
    assert f"--set blocks.{setting}" in text


def test_no_radius_of_a_pair_is_negative(formation, capsys):
    """0 is allowed: then a gap is the distance of the centres."""
    path = formation.with_name("measured_pairs.yaml")
    code, text = check(path, capsys, "--set", "blocks.pairs.parameters.radii=-0.1")
    assert code == 2 and "block pairs: PairGaps requires radii >= 0" in text and "fix: change radii" in text


def test_a_band_beyond_all_numbers_is_nobodys_mistake(formation, capsys):
    """Theorem 2's regions are powers of 10, and 10^399 is no number: nobody can say, and no function is to blame."""
    assert cli.main(["check", str(formation), "--set", "blocks.observer.parameters.c_v=400"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert re.search(r"open observer: Theorem 2, .*K, at least, band by band: 294 < inf; ", said)


def test_a_renamed_block_is_one_mistake_with_its_new_name(formation, write, capsys):
    path = write(formation.read_text().replace("\n  plant:", "\n  robots:"))
    code, text = check(path, capsys)
    assert code == 2 and text.count("error: ") == 1, text
    assert re.search(r"no block `plant`, which \d+ wires and signals name, the others at \d+:\d+, \d+:\d+", text)
    assert re.search(rf"{re.escape(str(path))}:\d+:\d+: error", text)
    assert "did you mean `robots`, which has radius, v, x?" in text


def test_two_ports_are_enough_to_know_a_renamed_block(write, capsys):
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  swinging: {type: Oscillator}\n  b: {type: Lag, inputs: {u: pq.x}}\n"
    code, said = check(write(text + "record: {signals: [pq.v]}\n"), capsys)
    assert code == 2 and "did you mean `swinging`, which has v, x?" in said, said


def test_an_overlay_that_names_a_block_wrongly(formation, write, capsys):
    code, text = check(write(f"extends: {formation}\nblocks: {{obsever: {{parameters: {{width: 3}}}}}}\n"), capsys)
    assert code == 2 and "block `obsever` has no type" in text and "did you mean `observer`?" in text


def test_a_study_is_no_diagram_and_a_diagram_no_study(formation, capsys):
    """Whichever command is given the wrong kind of file says what the file is, and which command takes it."""
    study = formation.parent / "studies" / "observers.yaml"
    code, text = check(study, capsys)
    assert code == 2 and text.count("error: ") == 1
    assert "is a study, not a diagram" in text and f"fix: cosim study {study}" in text
    for path in (formation, formation.with_name("oft_observer.yaml")):
        code = cli.main(["study", str(path)])
        text = capsys.readouterr().err
        assert code == 2 and text.count("error: ") == 1
        assert "is a diagram, not a study" in text and f"fix: cosim run {path}" in text


def test_a_mistake_in_what_is_inherited_says_so(formation, write, capsys):
    overlay = write(f"extends: {formation}\nblocks: {{observer: {{parameters: {{gamma_1: [200]}}}}}}\n")
    code, text = check(overlay, capsys)
    assert code == 2 and re.search(rf"{re.escape(str(formation))}:\d+:\d+: error: block observer: `gamma_2`", text)
    assert re.search(rf"`bands` is that of `gamma_1` at {re.escape(str(overlay))}:2:\d+", text)
    assert f"inherited: {overlay} extends {formation}" in text


def test_a_mistake_in_what_was_written_for_another_type_says_for_which(write, capsys):
    write(GOOD.replace("{T: [1, 2, 3]}", "{T: [1, 2, 3], k: [1, 2]}"), "base.yaml")
    overlay = write("extends: base.yaml\nblocks: {lag: {type: Gain, drop: [T]}}\n", "over.yaml")
    code, text = check(overlay, capsys)
    assert code == 2 and re.search(r"base.yaml:9:\d+: error: block lag: `k` has 2 entries for 3 robots", text), text
    assert re.search(r"\(inherited: written at \S*base.yaml:9:\d+ for \S*signal_blocks.py:Lag\)", text)


def test_rules_and_metrics_are_judged_beside_other_mistakes(formation, capsys):
    settings = (
        "blocks.observer.parameters.beta_1=4",
        "blocks.topology.parameters.hears=[[2], [1], [4], [3], [6], [5]]",
        "blocks.plant.parameters.massive=3",
        "metrics.N_x.reduce=events",
        "record.signals=[plant.y]",
    )
    code, text = check(formation, capsys, *(word for setting in settings for word in ("--set", f"{setting}")))
    assert code == 2
    for words in ("0.5 < beta_1 < 1", "strongly connected", "`massive`", "metric N_x: `events` needs", "variable `y`"):
        assert words in text, words
    assert text.rstrip().endswith("5 errors")


BROKEN_RULES = {
    "raises": ("1 / 0 > k", "ZeroDivisionError"),
    "a triple": ("(True, 'a', 'b')", "TypeError: it returned .*, of type tuple"),
    "an array": ("__import__('numpy').array([True, False])", "TypeError: it returned .*, of type ndarray"),
    "an array of one": ("__import__('numpy').array([True])", "TypeError: it returned .*, of type ndarray"),
    "a number": ("3.7", "TypeError: it returned 3.7, of type float"),
    "a whole number": ("0", "TypeError: it returned 0, of type int"),
    "a text": ("'k is odd'", "TypeError: it returned 'k is odd', of type str"),
    "a list": ("[False, 'no']", "TypeError: it returned .*, of type list"),
    "an empty mapping": ("{}", "TypeError: it returned {}, of type dict"),
    "a text first": ("('no', False)", "TypeError: it returned .*, of type tuple"),
    "a number in place of the text": ("(True, k)", "TypeError: it returned .*, of type tuple"),
}


@pytest.mark.parametrize("kind", ["rule", "condition"])
@pytest.mark.parametrize("broken", BROKEN_RULES)
def test_a_rule_that_cannot_be_judged_names_its_line(write, tmp_path, capsys, kind, broken):
    body, words = BROKEN_RULES[broken]
    (tmp_path / "own.py").write_text(
        "from cosim import Block, Output, Parameter, condition, rule\n"
        "class Odd(Block):\n    k = Parameter(default=1.0)\n    y = Output()\n"
        f"    odd = {kind}('k is odd')(lambda k: {body})\n"
        "    def outputs(k, y):\n        y[0] = k\n"
    )
    path = write("run: {stop: 1, step: 0.1}\nblocks:\n  one: {python: own.py:Odd}\n")
    code, text = check(path, capsys)
    assert code == 2 and "Traceback" not in text
    assert re.search(
        rf"diagram.yaml:3:3: error: block one: the {kind} `k is odd` of Odd cannot be judged: {words}", text
    )
    assert re.search(r"fix: correct its function at \S*own.py:5", text)


def test_nobody_can_say_is_no_answer_to_a_rule(write, tmp_path, capsys):
    (tmp_path / "own.py").write_text(
        "from cosim import Block, Output, Parameter, condition, rule\n"
        "class Odd(Block):\n    k = Parameter(default=1.0)\n    y = Output()\n"
        "    odd = KIND('k is odd')(lambda k: RESULT)\n"
        "    def outputs(k, y):\n        y[0] = k\n"
    )
    text = (tmp_path / "own.py").read_text()
    path = write("run: {stop: 1, step: 0.1}\nblocks:\n  one: {python: own.py:Odd}\n")
    for result in ("None", "(None, 'unknown')"):
        (tmp_path / "own.py").write_text(text.replace("KIND", "rule").replace("RESULT", result))
        code, said = check(path, capsys)
        assert code == 2 and "cannot be judged: TypeError: it returned" in said
        (tmp_path / "own.py").write_text(text.replace("KIND", "condition").replace("RESULT", result))
        assert check(path, capsys)[0] == 0


def test_a_broken_rule_names_every_place_that_may_be_wrong(write, tmp_path, capsys):
    (tmp_path / "own.py").write_text(
        "from cosim import Block, Output, Parameter, condition, rule\n"
        "class Odd(Block):\n    a = Parameter(default=1.0)\n    b = Parameter(default=2.0)\n    y = Output()\n"
        "    order = rule('a < b')(lambda a, b: a < b)\n"
        "    def outputs(a, b, y):\n        y[0] = a + b\n"
    )
    path = write(
        "run: {stop: 1, step: 0.1}\nblocks:\n  one:\n    python: own.py:Odd\n    parameters:\n      a: 3\n      b: 2\n"
    )
    _, text = check(path, capsys)
    assert re.search(r"diagram.yaml:6:10: error: block one: Odd requires a < b", text)
    assert re.search(r"fix: change a \(\S*diagram.yaml:6:10\), b \(\S*diagram.yaml:7:10\)", text)
    path.write_text(path.read_text().replace("      a: 3\n      b: 2\n", "      b: -2\n"))
    _, text = check(path, capsys)
    assert re.search(r"diagram.yaml:6:10: error: block one", text) and "fix: change a, b" in text


EXITS = ["exit(0)", "quit()", "raise SystemExit", "sys.exit('enough')"]
JUDGED = {"a rule": ("rule", "k"), "a condition": ("condition", "k"), "a condition along the run": ("condition", "y")}


@pytest.mark.parametrize("leave", EXITS)
@pytest.mark.parametrize("judged", JUDGED)
def test_code_that_exits_is_a_mistake_at_its_line(write, tmp_path, monkeypatch, capsys, judged, leave):
    kind, name = JUDGED[judged]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(
        "import sys\nfrom cosim import Block, Output, Parameter, condition, rule\n"
        "class Odd(Block):\n    k = Parameter(default=1.0)\n    y = Output()\n"
        f"    @{kind}('it is odd')\n    def odd({name}):\n        {leave}\n"
        "    def outputs(k, y):\n        y[0] = k\n"
    )
    write("run: {stop: 1, step: 0.1}\nblocks:\n  one: {python: own.py:Odd}\n")
    command = "run" if name == "y" else "check"
    assert cli.main([command, "diagram.yaml", "--json"] if command == "run" else [command, "diagram.yaml"]) == 2
    out, said = capsys.readouterr()
    assert re.search(r"own.py:8:\d+: error: a block's code asks the whole program to end: SystemExit\(.*\)", said)
    assert "fix: " in said and "Traceback" not in said
    assert command == "check" or '"status": "failed"' in out


@pytest.mark.parametrize("leaves", ["SystemExit", "KeyboardInterrupt", "GeneratorExit"])
def test_plain_python_that_exits_stops_the_run(leaves, write, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(
        "from cosim import Block, Output\nclass Odd(Block, compiled=False):\n    y = Output()\n"
        f"    def outputs(time, y):\n        y[0] = time\n        if time > 0.5:\n            raise {leaves}(0)\n"
    )
    write("run: {stop: 1, step: 0.1}\nblocks:\n  one: {python: own.py:Odd}\n")
    for engine in ("native", "python"):
        assert cli.main(["run", "diagram.yaml", "--engine", engine]) == 1
        assert f"block one: outputs() failed at t = 0.6 s: {leaves}: 0" in capsys.readouterr().err


def test_without_code_no_python_file_is_run_and_the_rest_is_checked(write, tmp_path, capsys):
    (tmp_path / "own.py").write_text("raise SystemExit('it ran')\n")
    good = "run: {stop: 1, step: 0.1}\nblocks:\n  one: {python: own.py:Odd, inputs: {u: two.x_c}}\n"
    good += "  two: {block: SineWavePath}\nrecord: {signals: [one.y, two.x_c]}\n"
    good += "metrics: {most: {signal: one.y, reduce: max}, last: {signal: two.x_c, reduce: final}}\n"
    path = write(good)
    assert cli.main(["check", str(path), "--no-code"]) == 0
    said = capsys.readouterr().out
    assert "2 blocks, valid as far as can be told without their code" in said
    assert re.search(r"not checked, as only their code tells what they are:\s+one\s+\(\S*own.py\)", said)
    path = write(good.replace("block: SineWavePath", "block: SineWavePath, parameters: {sped: 1}"))
    code, text = check(path, capsys, "--no-code")
    assert code == 2 and "no parameter `sped`" in text and "it ran" not in text
    code, text = check(path, capsys)
    assert code == 2 and "it ran" in text


def test_no_text_of_a_file_steers_the_terminal(write, capsys):
    path = write(GOOD.replace("run:", 'title: "red \\e[31m \\u009b31m \\u202eturned \\a"\nrun:', 1))
    assert cli.main(["check", str(path)]) == 0
    said = capsys.readouterr()
    assert r"red \x1b[31m \x9b31m \u202eturned \x07" in said.out
    path = write(GOOD.replace("  lag:", '  "lag\\e]0;x\\a":', 1))
    code, text = check(path, capsys)
    assert code == 2 and "\x1b" not in text and r"lag\x1b]0;x\x07" in text


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


NO_INTEGERS = {".nan": "calculate with", ".inf": "no whole number", "inf": "no whole number", "2.5": "no whole number"}


@pytest.mark.parametrize("value", [*NO_INTEGERS, "1e30", "true"])
def test_what_is_no_integer_is_refused_where_one_is_needed(formation, capsys, value):
    code, text = check(formation, capsys, "--set", f"blocks.topology.parameters.hears.0.0={value}")
    assert code == 2 and "Traceback" not in text and "fix:" in text
    assert f"--set blocks.topology.parameters.hears.0.0={value}: error:" in text
    assert NO_INTEGERS.get(value, "error") in text


def test_a_value_that_is_neither_true_nor_false(write, tmp_path, capsys):
    (tmp_path / "own.py").write_text(
        "from cosim import Block, Output, Parameter\n"
        "class Switch(Block):\n    on = Parameter(dtype=bool, default=False)\n    y = Output()\n"
        "    def outputs(on, y):\n        y[0] = 1.0 if on else 0.0\n"
    )
    text = "run: {stop: 1, step: 0.1}\nblocks: {s: {python: own.py:Switch, parameters: {on: WHAT}}}\n"
    for right in ("true", "false", "1", "0"):
        assert check(write(text.replace("WHAT", right)), capsys) == (0, "")
    for wrong in ("2", "-1", "0.5", "pi"):
        code, said = check(write(text.replace("WHAT", wrong)), capsys)
        assert (
            code == 2 and "neither true nor false" in said and ":2:54: error" in said and "write true or false" in said
        )


def test_the_settings_of_the_manual(formation, capsys):
    """What README tells to try works as it stands there; the lengths of the two rates belong together."""
    both = "blocks.observer.parameters={gamma_1: [200], gamma_2: [20]}"
    assert check(formation, capsys, "--set", both)[0] == 0
    one, other = "blocks.observer.parameters.gamma_1=[200]", "blocks.observer.parameters.gamma_2=[20]"
    assert check(formation, capsys, "--set", one, "--set", other)[0] == 0
    code, text = check(formation, capsys, "--set", one)
    assert code == 2 and f"`bands` is that of `gamma_1` at --set {one}" in text


def test_command_line_settings_that_name_nothing(write, capsys):
    path = write(GOOD)
    for option, value, words in (
        ("--set", "blocks.lagg.parameters.T=1", "`lag`"),
        ("--set", "run.stp=1", "`stop`"),
        ("--swap", "lagg=Gain", "`lag`"),
    ):
        code, text = check(path, capsys, option, value)
        assert code == 2 and words in text and f"{option} {value}" in text


def test_a_wire_of_members_without_quotes(write, capsys):
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  b: {type: Lag, inputs: {u: source.y[1..2]}}\n"
    code, said = check(write(text), capsys)
    assert code == 2 and 'quote a wire that takes members: "source.y[1..2]"' in said, said


@pytest.mark.parametrize("members", ["[2..1]", "[0]", "[1:2]"])
def test_members_that_are_none_are_told_how_to_be_written(write, capsys, members):
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  s: {type: Sine}\n"
    text += f'  b: {{type: Lag, inputs: {{u: "s.y{members}"}}}}\n'
    code, said = check(write(text), capsys)
    assert code == 2 and "members are counted from 1, such as y[2] or y[1..3]" in said, said


def test_what_a_rule_prints_is_not_in_the_json(tmp_path, capsys):
    (tmp_path / "own.py").write_text(
        "from cosim import Block, Output, Parameter, rule\n\nclass Own(Block):\n    k = Parameter(default=1.0)\n"
        "    y = Output()\n    def outputs(k, y):\n        y[0] = k\n    @rule('k is fit')\n    def fit(k):\n"
        "        print('looking')\n        return True\n"
    )
    (tmp_path / "d.yaml").write_text("run: {stop: 1, step: 1}\nblocks: {b: {python: own.py:Own}}\n")
    assert cli.main(["run", str(tmp_path / "d.yaml"), "--json", "-o", str(tmp_path / "d.nc")]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["status"] == "completed" and "looking" in said.err


def test_a_number_of_the_module_does_not_stand_for_a_parameter(tmp_path, capsys):
    (tmp_path / "own.py").write_text(
        "from cosim import Block, Output, Parameter\n\nk = 2.0\n\nclass Own(Block):\n    k = Parameter(default=5.0)\n"
        "    y = Output()\n    def outputs(y):\n        y[0] = k\n"
    )
    (tmp_path / "d.yaml").write_text("run: {stop: 1, step: 1}\nblocks: {b: {python: own.py:Own}}\n")
    assert cli.main(["check", str(tmp_path / "d.yaml")]) == 2
    said = capsys.readouterr().err
    assert "uses `k` of the module, not the variable `k` of the block" in said and ":9:16" in said


def test_two_classes_of_one_name_are_a_mistake(tmp_path, capsys):
    block = "class Own(Block):\n    y = Output()\n    def outputs(time, y):\n        y[0] = {} * time\n"
    (tmp_path / "own.py").write_text(f"from cosim import Block, Output\n{block.format(1)}{block.format(2)}")
    (tmp_path / "d.yaml").write_text("run: {stop: 1, step: 1}\nblocks: {b: {python: own.py:Own}}\n")
    assert cli.main(["check", str(tmp_path / "d.yaml")]) == 2
    said = capsys.readouterr().err
    assert "own.py:6:1: error: class Own is defined twice, and the first definition is lost" in said, said


def test_a_type_that_several_blocks_name_wrongly_is_one_mistake(write, capsys):
    text = "run: {stop: 1, step: 1}\nblocks:\n"
    text += "".join(f"  b{k}: {{block: NeuralObservr, inputs: {{x: b{k}.x_hat}}}}\n" for k in range(3))
    assert cli.main(["check", str(write(text))]) == 2
    said = capsys.readouterr().err
    assert said.count("error:") == 1 and "no block type `NeuralObservr`, also at 4:15, 5:15" in said
    assert "did you mean `NeuralObserver`?" in said
