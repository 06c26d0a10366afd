"""Certificates beside closed forms: the error that is told over the true one, its order, its parts."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.optimize import minimize_scalar

from cosim.accuracy import certificate
from cosim.accuracy.accuracies import AGREES, CHANGES
from cosim.accuracy.certificate import Certificate
from cosim.accuracy.limit import NO_ORDER, ORDER, ROUNDING, UNSETTLED
from cosim.accuracy.refinement import TOTAL, Refinement, beside, settings
from cosim.engine import compilation, run
from cosim.errors import NoCertificate, UsageError
from cosim.export.exporter import export_fmu
from cosim.machine import parallel

STOP = 2.0
REDUCTIONS = "max", "min", "mean", "rms", "final"
SPRINGS = np.array([[0, 1, 0, 0], [-4, 0, 3, 0], [0, 0, 0, 1], [1.5, 0, -2.5, 0]])

#: The blocks, the signal that is reduced, and what it is in truth.
PROBLEMS = {
    "oscillator": ("o: {type: Oscillator}", "o.x", lambda t: math.cos(2 * t)),
    "decay": ("a: {type: Decay}", "a.x", lambda t: math.exp(-t)),
    "split decay": (
        "a: {type: Decay, parameters: {k: 0}, inputs: {u: m.y}}, m: {type: Minus, inputs: {u: a.x}}",
        "a.x",
        lambda t: math.exp(-t),
    ),
    "forced": (
        "a: {type: Decay, inputs: {u: w.y}}, w: {type: Wave}",
        "a.x",
        lambda t: 1.5 * math.exp(-t) + (math.sin(t) - math.cos(t)) / 2,
    ),
    "two masses": (
        """a: {type: Mass, start: {x: 1}, inputs: {F: s.F}}, s: {type: Spring, inputs: {a: a.x, b: b.x}},
            b: {type: Mass, parameters: {m: 2, k: 2}, start: {x: -0.5}, inputs: {F: s.back}}""",
        "a.x",
        lambda t: float((expm(SPRINGS * t) @ [1, 0, -0.5, 0])[0]),
    ),
    "logistic": ("a: {type: Logistic}", "a.x", lambda t: 1 / (1 + 9 * math.exp(-t))),
    "riccati": ("a: {type: Riccati}", "a.x", math.tanh),
    "algebraic loop": (
        """a: {type: Decay, parameters: {k: -2}, inputs: {u: p.y}},
            p: {type: Half, inputs: {a: a.x, b: q.y}}, q: {type: Half, inputs: {b: p.y}}""",
        "a.x",
        lambda t: math.exp((-2 + 4 / 3) * t),
    ),
}


def extreme(truth, sign):
    """The largest or smallest value from 0 to STOP."""
    times = np.linspace(0.0, STOP, 401)
    at = int(np.argmax([sign * truth(t) for t in times]))
    bounds = times[max(at - 1, 0)], times[min(at + 1, 400)]
    found = minimize_scalar(lambda t: -sign * truth(t), bounds=bounds, method="bounded", options={"xatol": 1e-12})
    return sign * max(-found.fun, sign * truth(times[at]))


def true_figures(truth):
    mean = quad(truth, 0, STOP, epsabs=1e-13)[0] / STOP
    square = quad(lambda t: truth(t) ** 2, 0, STOP, epsabs=1e-13)[0] / STOP
    return {
        "max": extreme(truth, 1),
        "min": extreme(truth, -1),
        "mean": mean,
        "rms": math.sqrt(square),
        "final": truth(STOP),
    }


def text_of(blocks, signal, step, method="jacobi", integrator="euler", more=""):
    metrics = ", ".join(f"{name}: {{signal: {signal}, reduce: {name}}}" for name in REDUCTIONS)
    return (
        f"run: {{stop: {STOP}, step: {step}, method: {method}, integrator: {integrator}}}\n"
        f"blocks: {{{blocks}}}\nmetrics: {{{metrics}}}\n{more}"
    )


@pytest.mark.parametrize("integrator", ["euler", "rk4"])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
@pytest.mark.parametrize("problem", PROBLEMS)
def test_the_error_that_is_told_is_the_true_one_within_a_factor_of_three(certified, problem, method, integrator):
    blocks, signal, truth = PROBLEMS[problem]
    true = true_figures(truth)
    made = certified(text_of(blocks, signal, 0.04, method, integrator))
    for name, accuracy in made.metrics.items():
        told, error = accuracy.error, abs(accuracy.values[0] - true[name])
        limit = accuracy.limits[0]
        assert limit.low - 1e-12 <= true[name] <= limit.high + 1e-12, name
        if accuracy.kind in (ORDER, UNSETTLED) and error > 1e-12:
            assert 0.3 <= told / error <= 3, name
        else:
            assert told >= error - 1e-12, name
    assert made.metrics["final"].kind in (ORDER, ROUNDING)


@pytest.mark.parametrize(
    ("problem", "method", "integrator", "order"),
    [
        ("decay", "jacobi", "euler", 1),
        ("decay", "jacobi", "heun", 2),
        ("decay", "jacobi", "bogacki-shampine", 3),
        ("decay", "jacobi", "rk4", 4),  # the block is alone: nothing is coupled
        ("two masses", "jacobi", "rk4", 1),
        ("two masses", "gauss-seidel", "rk4", 1),
        ("two masses", "joint", "rk4", 4),
        ("forced", "jacobi", "rk4", 1),
        ("forced", "joint", "heun", 2),
    ],
)
def test_the_order_is_that_of_theory(certified, problem, method, integrator, order):
    blocks, signal, _ = PROBLEMS[problem]
    final = certified(text_of(blocks, signal, 0.02, method, integrator)).metrics["final"]
    assert final.kind == ORDER and final.order == pytest.approx(order, abs=0.1)


K, STEP, INNER = -1.5, 0.02, 2
COUPLED = f"""
run: {{stop: {STOP}, step: {STEP}, inner_steps: {INNER}}}
blocks:
  a: {{type: Decay, parameters: {{k: {K}}}, inputs: {{u: m.y}}}}
  m: {{type: Minus, inputs: {{u: a.x}}}}
metrics: {{x: {{signal: a.x, reduce: final}}}}
"""


def test_coupling_and_integration_are_those_of_the_closed_form(certified):
    """dx/dt = k x + u with u = -x held over a step H: exactly, x grows by e^kH - (e^kH - 1) / k in each.

    What m Euler steps make of it instead is the integration's error; what that differs from exp((k - 1) t), coupling's.
    """
    found = certified(COUPLED).metrics["x"]
    steps, growth = round(STOP / STEP), math.exp(K * STEP)
    held = (growth - (growth - 1) / K) ** steps
    euler = 1 + K * STEP / INNER
    computed = (euler**INNER - (euler**INNER - 1) / K) ** steps
    assert found.values[0] == pytest.approx(computed, rel=1e-12)
    assert found.integration.signed and found.integration.error == pytest.approx(computed - held, rel=0.05)
    assert found.coupling.signed and found.coupling.error == pytest.approx(held - math.exp((K - 1) * STOP), rel=0.05)
    assert found.coupling.order == pytest.approx(1, abs=0.1) and found.integration.order == pytest.approx(1, abs=0.1)


def test_a_block_alone_has_no_coupling_and_an_exact_one_no_integration(certified):
    """x ← u alone: held inputs are integrated exactly. x' = -x alone: nothing is held. Joint: neither is."""
    alone = certified(text_of(*PROBLEMS["decay"][:2], 0.02)).metrics["final"]
    assert alone.coupling.kind == ROUNDING and alone.integration.kind == ORDER
    assert alone.integration.error == pytest.approx(alone.values[0] - math.exp(-STOP), rel=0.02)
    split = certified(text_of(*PROBLEMS["split decay"][:2], 0.02)).metrics["final"]
    assert split.integration.kind == ROUNDING and split.coupling.kind == ORDER
    assert split.coupling.error == pytest.approx(split.values[0] - math.exp(-STOP), rel=0.02)
    joint = certified(text_of(*PROBLEMS["decay"][:2], 0.02, "joint")).metrics["final"]
    assert joint.coupling.kind == ROUNDING and joint.integration.kind == ORDER


SWITCHED = "a: {{type: Decay, parameters: {{k: 0}}, inputs: {{u: w.y}}}}, w: {{type: Switched, parameters: {{T: {}}}}}"


@pytest.mark.parametrize("integrator", ["euler", "rk4"])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
@pytest.mark.parametrize("step", [0.04, 0.02, 0.01])
def test_a_switch_between_two_steps_has_no_order_and_the_interval_holds_the_truth(certified, step, method, integrator):
    """It is seen late by less than a step; with steps of h, h/2 and h/4 often by the same: all agree, and are wrong."""
    time = math.sqrt(math.pi) / 2
    final = certified(text_of(SWITCHED.format(time), "a.x", step, method, integrator)).metrics["final"]
    truth = 1.0 + 2.0 * time - STOP
    assert final.kind == NO_ORDER
    assert final.limits[0].low <= truth <= final.limits[0].high
    assert final.error >= abs(final.values[0] - truth) > 1e-4


@pytest.mark.parametrize("integrator", ["euler", "rk4"])
@pytest.mark.parametrize("time", np.linspace(0.3, 1.7, 15) + 0.0123)
def test_the_error_of_a_switch_is_never_told_far_too_small(certified, time, integrator):
    final = certified(text_of(SWITCHED.format(time), "a.x", 0.04, "joint", integrator)).metrics["final"]
    assert final.error >= 0.3 * abs(final.values[0] - (1.0 + 2.0 * time - STOP))


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
@pytest.mark.parametrize("step", [0.04, 0.02, 0.03125])
def test_what_slides_has_no_order_and_the_interval_holds_the_truth(certified, step, method):
    """dx/dt = -sign(x) from 1.0372 comes to 0 and stays; computed, it chatters by less than a step."""
    relay = (
        "a: {type: Decay, parameters: {k: 0}, start: {x: 1.0372}, inputs: {u: w.y}}, w: {type: Relay, inputs: {u: a.x}}"
    )
    final = certified(text_of(relay, "a.x", step, method)).metrics["final"]
    assert final.values[0] != 0.0
    assert final.error >= abs(final.values[0])
    assert final.kind == NO_ORDER or final.limits[0].low <= 0.0 <= final.limits[0].high


NOISE = """
run: {stop: 2, step: 0.01}
blocks:
  n: {type: Noise, period: 0.05}
  lag: {type: Decay, inputs: {u: n.y}}
  sum: {type: Decay, parameters: {k: 0}, inputs: {u: n.y}}
  lone: {type: Decay}
record: {period: 0.1, signals: [lag.x, sum.x, lone.x]}
metrics:
  lag: {signal: lag.x, reduce: final}
  sum: {signal: sum.x, reduce: rms}
  lone: {signal: lone.x, reduce: final}
"""


@pytest.mark.parametrize("seed", range(1, 8))
def test_noise_at_every_time_has_no_order_and_what_it_does_not_reach_has_one(certified, seed):
    made = certified(NOISE.replace("Noise, period: 0.05", "Scramble"), f"blocks.n.parameters={{seed: {seed}}}")
    assert {name: made.metrics[name].kind for name in ("lag", "sum")} == {"lag": NO_ORDER, "sum": NO_ORDER}
    assert made.metrics["lone"].kind == ORDER
    assert {made.signals[name].kind for name in ("lag.x", "sum.x")} == {NO_ORDER}


@pytest.mark.parametrize("seed", range(20))
def test_noise_that_is_a_function_of_time_is_not_taken_for_an_order_by_chance(certified, seed):
    """Its integral walks at random, and one figure of it in ten falls as if in order.

    No sampled block tells of it, and the one whose period is the step leaves no steps that lie elsewhere.
    """
    text = """
    run: {stop: 2, step: 0.02}
    blocks:
      s: {type: Scramble}
      a: {type: Decay, parameters: {k: 0}, inputs: {u: s.y}}
      lone: {type: Noise, period: 0.02}
    metrics: {x: {signal: a.x, reduce: final}}
    """
    made = certified(text, f"blocks.s.parameters.seed={seed}")
    assert made.runs == 7 and made.metrics["x"].kind == NO_ORDER


@pytest.mark.parametrize("integrator", ["euler", "rk4"])
@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "joint"])
@pytest.mark.parametrize("early", [0.0005, 0.004, 0.009])
def test_a_switch_just_before_a_point_that_all_steps_have_in_common_is_seen(certified, early, method, integrator):
    """At 1.2 s less 0.5, 4 or 9 ms, where steps of 40, 20, 10 and 36.4 ms meet: all see it there, and all are wrong."""
    time = 1.2 - early
    text = text_of(SWITCHED.format(time), "a.x", 0.04, method, integrator, "record: {signals: [a.x]}")
    made = certified(text)
    truth = 1.0 + 2.0 * time - STOP
    for final in (made.metrics["final"], made.signals["a.x"]):
        assert final.error >= abs(made.metrics["final"].values[0] - truth)


@pytest.mark.parametrize("early", [0.0005, 0.004, 0.009])
def test_a_margin_that_such_a_switch_makes_is_as_unsure(certified, early):
    """The margin is 3 - x at the end, x = 1 + 2 (1.2 - early) - 2 in truth; 0.009 s late it is 0.018 larger."""
    more = "requirements: {low: always(a.x < 3)}"
    made = certified(text_of(SWITCHED.format(1.2 - early), "a.x", 0.04, more=more))
    assert made.requirements["low"].error >= 2.0 * early


def test_a_switch_at_a_point_that_all_steps_have_in_common_costs_no_certainty(certified):
    made = certified(text_of(SWITCHED.format(1.2), "a.x", 0.04, more="requirements: {low: always(a.x < 3)}"))
    assert made.metrics["final"].kind == ROUNDING and made.metrics["final"].error < 1e-12
    assert made.requirements["low"].error < 1e-12


def test_no_run_stops_early_where_inputs_are_extrapolated(diagram):
    """An extrapolation through two samples 25 us apart is another one than through two that are a step apart."""
    text = text_of(*PROBLEMS["two masses"][:2], 0.1, integrator="rk4")
    found = [beside(run.load(diagram(text), [f"run.extrapolation={order}"])) for order in (0, 1)]
    assert [[refinement.early for refinement in several] for several in found] == [[0, 10], [0]]


@pytest.mark.parametrize("step", [0.05, 0.04, 0.025, 0.02, 0.0125])
def test_the_error_of_an_extreme_is_what_lies_between_its_samples(certified, step):
    """rk4 is exact beside it. All steps may have the same sample next to the extreme, so no difference shows it."""
    blocks, signal, _ = PROBLEMS["oscillator"]
    least = certified(text_of(blocks, signal, step, "joint", "rk4")).metrics["min"]
    assert least.error == pytest.approx(least.values[0] + 1.0, rel=0.05)


def test_noise_with_a_period_is_the_same_at_all_steps(certified):
    """And drives what it drives with an order; the period stays, the step is halved."""
    made = certified(NOISE)
    assert made.metrics["lag"].kind == ORDER and made.metrics["lag"].order == pytest.approx(1, abs=0.1)
    assert made.notes == []


EVENTS = """
run: {stop: 2, step: 0.01}
blocks:
  a: {type: Decay}
  w: {type: Watch, parameters: {level: 0.5}, inputs: {u: a.x}}
record: {period: 0.1, signals: [w.below]}
metrics: {when: {signal: w.log, reduce: events}, below: {signal: w.below, reduce: max}}
"""


def test_events_that_agree_have_times_no_surer_than_the_steps(certified):
    made = certified(EVENTS)
    when = made.metrics["when"]
    assert when.kind == AGREES and made.metrics["below"].kind == AGREES and made.changing == []
    assert abs(when.values[0][0]["time"] - math.log(2)) <= when.error <= 0.03


def test_an_event_that_all_steps_see_at_one_time_may_still_be_one_step_earlier(certified):
    """What happens at 0.8701 s is seen at 0.88 s, with steps of 40, 20 and 10 ms."""
    text = """
    run: {stop: 2, step: 0.04}
    blocks:
      s: {type: Switched, parameters: {T: 0.8701}}
      w: {type: Watch, parameters: {level: 0}, inputs: {u: s.y}}
    metrics: {when: {signal: w.log, reduce: events}}
    """
    when = certified(text).metrics["when"]
    assert when.values[0][0]["time"] == pytest.approx(0.88) and when.kind == AGREES
    assert 0.0099 <= when.error <= 0.02


def test_what_is_counted_and_depends_on_the_step_is_told_with_the_steps(certified):
    """Euler's (1 - h)^n is below exp(-t), and less so with a smaller step: a level between is crossed at h only."""
    level = ((1 - 0.01) ** 200 + (1 - 0.005) ** 400) / 2
    made = certified(EVENTS, f"blocks.w.parameters.level={level!r}")
    assert made.metrics["below"].kind == CHANGES and made.metrics["below"].error is None
    said = "below: yes at 10 ms, no at 5 ms, no at 2.5 ms, "
    assert any(line.startswith(said) and line.endswith(": depends on the step") for line in made.changing)


COLLISION = """
extends: {}
run: {{stop: 1}}
blocks:
  plant:
    start:
      x:
        - [-0.6813810623346259, -2.0043377287105844, -0.9341849535197446]
        - [0.507594995203382, 1.0267450574531085, -0.6748692801906224]
        - [1.833773937676102, -1.2202402678778068, -1.4537805069888792]
        - [1.0734542428481197, 2.3830565728931745, 2.8879019726199617]
        - [-0.6784610271987042, 1.1916537465711814, -0.45365020979240667]
        - [-2.3288551735669083, 0.7708051779981355, 1.859613706124306]
metrics: {{N_x: ~, N_v: ~, N_w: ~, delta_x: ~, e_x: ~, S: ~}}
"""


def test_a_collision_that_a_search_has_found_is_seen_to_be_numerical(certified, formation):
    """Robots 5 and 6 touch at 1 ms, and at no smaller step."""
    made = certified(COLLISION.format(formation))
    assert [event["pair"] for event in made.metrics["collisions"].values[0]] == [[5, 6]]
    assert len(made.changing) == 1
    assert made.changing[0].startswith("collisions: 1 at 1 ms, 0 at 0.5 ms, 0 at 0.25 ms")
    gap = made.metrics["min_gap"]
    assert gap.kind == NO_ORDER and gap.values[0] < 0.0 < gap.limits[0].high


DRAG = """
run: {stop: 1, step: 0.01}
blocks: {a: {type: Drag, parameters: {k: 250}}}
metrics: {a: {signal: a.x, reduce: final}}
"""
SAMPLES = """
run: {stop: 1, step: 0.01}
blocks: {a: {type: Decay}, d: {type: Delay, parameters: {most: 150}, inputs: {u: a.x}}}
metrics: {a: {signal: a.x, reduce: final}}
"""


def test_a_step_that_is_too_large_for_the_method_is_told_with_those_that_are_not(certified):
    with pytest.raises(
        NoCertificate, match=r"with steps of 10 ms the run diverges: block a: .* at 5 ms and 2.5 ms it comes"
    ):
        certified(DRAG)


def test_a_run_that_fails_at_a_smaller_step_is_told_with_it(certified):
    with pytest.raises(NoCertificate, match=r"with steps of 5 ms the run fails: block d: .*too many samples") as caught:
        certified(SAMPLES)
    assert caught.value.position and caught.value.position.line == 3


def test_a_run_that_only_the_parts_need_may_fail(certified, monkeypatch):
    """The total error is known all the same."""
    inner = "run: {stop: 1, step: 0.01}", "run: {stop: 1, step: 0.01, inner_steps: 500000}"
    made = certified(SAMPLES.replace("most: 150", "most: 1000").replace(*inner).replace("stop: 1,", "stop: 0.01,"))
    assert made.metrics["a"].kind in (ORDER, ROUNDING) and made.metrics["a"].coupling is None
    assert any("no more than 1000000 inner steps" in note for note in made.notes)


def test_a_co_simulation_fmu_has_the_total_error_of_the_block_that_it_was(certified, tmp_path, diagram):
    """It takes one step of Euler's method in each, as the block does; its inner steps are its own."""
    text = text_of(*PROBLEMS["two masses"][:2], 0.02)
    native = certified(text)
    export_fmu(run.load(diagram(text)), ["a"], tmp_path / "mass.fmu", "3.0")
    foreign = certified(text.replace("type: Mass, start", "fmu: mass.fmu, start", 1))
    for name, accuracy in foreign.metrics.items():
        assert accuracy.errors == native.metrics[name].errors
        assert accuracy.coupling is None and accuracy.integration is None
    assert [note.partition(",")[0] for note in foreign.notes] == [
        "of a",
        "coupling and integration are not told apart: the inner steps of a cannot be halved",
    ]


def test_there_has_to_be_a_figure(diagram):
    network = run.load(diagram("run: {stop: 1, step: 0.1}\nblocks: {w: {type: Wave}}\n"))
    with pytest.raises(UsageError, match="no metric, no requirement and no recorded signal"):
        certificate.require_figures(network, signals=True)


def test_both_engines_give_the_same_certificate(certified):
    text = text_of(*PROBLEMS["two masses"][:2], 0.1, "gauss-seidel", "rk4", "record: {signals: [a.x, s.F]}")
    native, python = (certified(text, engine=engine).as_json() for engine in ("native", "python"))
    assert {**native, "seconds": 0} == {**python, "seconds": 0}


def test_nothing_is_compiled_for_another_step(refined, diagram, monkeypatch):
    calls = []
    compile_program = compilation.compile_program
    monkeypatch.setattr(compilation, "compile_program", lambda built: calls.append(built) or compile_program(built))
    certificate.certify(refined(diagram(text_of(*PROBLEMS["decay"][:2], 0.1))))
    assert len(calls) == 1


def test_watch_hears_of_all_work(refined, diagram):
    heard = []
    runs = refined(diagram(text_of(*PROBLEMS["decay"][:2], 0.1)))
    runs._watch = lambda done, total: heard.append((done, total))
    made: Certificate = certificate.certify(runs)
    assert (made.runs, made.cost) == (8, pytest.approx(19.2))
    assert heard[-1][0] == pytest.approx(heard[-1][1]) and heard[-1][1] == pytest.approx(19.2 * STOP)


def test_a_refinement_changes_steps_and_keeps_times(diagram):
    text = """
    run: {stop: 2, step: 0.01, inner_steps: 2}
    blocks:
      a: {type: Decay, inner_steps: 3}
      n: {type: Noise, period: 0.05}
    record: {signals: [a.x]}
    metrics: {x: {signal: a.x, reduce: max, from: 0.3, to: 0.9}}
    """
    path = diagram(text)
    network = run.load(path)
    for refinement, step, inner in ((Refinement(2), 0.005, (2, 3)), (Refinement(1, 4), 0.01, (8, 12))):
        other = run.load(path, settings(network, refinement))
        assert other.diagram.run.step == step and other.diagram.record.period == 0.01
        assert (float(other.components["n"].clock.period), other.diagram.metrics["x"].start) == (0.05, 0.3)
        assert (other.diagram.run.inner_steps, other.components["a"].integration.inner_steps) == inner
    elsewhere, early = beside(network)
    assert early == Refinement(early=5)
    other = run.load(path, settings(network, elsewhere))
    # 5 steps to a period: six of the other run's.
    assert other.diagram.run.step == pytest.approx(0.01 * 5 / 6) and other.components["n"].clock.period == Fraction(
        1, 20
    )
    assert settings(network, TOTAL[0]) == []
    assert beside(run.load(path, ["blocks.n.period=0.01"])) == [Refinement(early=1)]
    text = "run: {stop: 1.3, step: 0.1}\nblocks: {w: {type: Wave}}\n"
    assert beside(run.load(diagram(text))) == [Refinement(14, 1, 13), Refinement(early=13)]


def test_one_step_is_certified_too(certified):
    made = certified(text_of(*PROBLEMS["decay"][:2], STOP, "joint", "rk4", "record: {signals: [a.x]}"))
    truth = math.exp(-STOP)
    final = made.metrics["final"]
    assert made.runs == 7 and final.error >= abs(final.values[0] - truth)


def test_arrays_have_the_error_of_their_worst_element(certified):
    text = """
    run: {stop: 1, step: 0.01}
    fleets: {robot: 3}
    blocks: {a: {type: Decay, per: robot, parameters: {k: [-1, 0, -3]}}}
    metrics: {x: {signal: a.x, reduce: final}}
    """
    found = certified(text).metrics["x"]
    errors = np.abs(np.array(found.values[0]) - np.exp([-1, 0, -3]))
    assert found.error == pytest.approx(1.25 * errors.max(), rel=0.1)
    assert len(found.limits) == 3 and found.coupling.kind == ROUNDING


def test_a_window_that_steps_elsewhere_do_not_meet_is_judged_without_them(certified):
    text = """
    run: {stop: 1, step: 0.01}
    blocks: {a: {type: Decay}, w: {type: Watch, parameters: {level: 0.5}, inputs: {u: a.x}}}
    metrics:
      x: {signal: a.x, reduce: max, from: 0.5099, to: 0.5101}
      y: {signal: w.below, reduce: max, from: 0.5099, to: 0.5101}
    """
    made = certified(text)
    assert made.metrics["x"].kind == ORDER and made.metrics["y"].kind == AGREES
    assert made.metrics["x"].error >= abs(made.metrics["x"].values[0] - math.exp(-0.51))


def test_steps_that_have_no_point_of_their_own_are_said_to_miss_the_same(certified):
    made = certified(NOISE, "blocks.n.period=0.01")
    assert made.metrics["lag"].kind == ORDER and made.runs == 7
    assert any(note.startswith("all steps have their points in common") for note in made.notes)


def test_a_diagram_inside_a_diagram_is_refined_with_it(certified, diagram):
    """Its block has inner steps of its own: 3 Euler steps in each of 0.02."""
    inner = """
    blocks: {a: {type: Decay, inner_steps: 3}}
    run: {stop: 1, step: 1}
    outputs: {x: a.x}
    """
    diagram(inner, "inner.yaml")
    text = """
    run: {stop: 2, step: 0.02}
    blocks: {outer: {diagram: inner.yaml}}
    record: {period: 0.5, signals: [outer.x]}
    metrics: {x: {signal: outer.x, reduce: final}}
    """
    made = certified(text)
    found = made.metrics["x"]
    assert found.values[0] == pytest.approx((1 - 0.02 / 3) ** 300)
    assert found.integration.error == pytest.approx((1 - 0.02 / 3) ** 300 - math.exp(-2), rel=0.02)
    assert found.coupling.kind == ROUNDING and made.signals["outer/a.x"].kind == ORDER


def test_plain_python_runs_one_after_another(certified, monkeypatch):
    """What its functions share, runs at once would take from each other."""
    monkeypatch.setattr(parallel, "threads", None)
    text = """
    run: {stop: 1, step: 0.1}
    blocks: {a: {type: Decay, inputs: {u: p.y}}, p: {type: Plain}}
    metrics: {x: {signal: a.x, reduce: final}}
    """
    assert certified(text).metrics["x"].kind == ORDER


def test_arrays_that_are_finite_in_part_are_judged_by_that(certified):
    text = """
    run: {stop: 1, step: 0.01}
    blocks: {a: {type: Decay}, w: {type: Watch, parameters: {level: 0.5}, inputs: {u: a.x}}}
    metrics: {x: {signal: w.part, reduce: final}}
    """
    found = certified(text).metrics["x"]
    assert list(found.limits) == [1] and found.kind == ORDER
    assert found.error == pytest.approx(1.25 * abs(0.99**100 - math.exp(-1)), rel=0.02)


def test_what_is_not_finite_is_no_number_to_be_sure_of(certified):
    text = """
    run: {stop: 1, step: 0.01}
    blocks: {a: {type: Decay}, w: {type: Watch, parameters: {level: -1}, inputs: {u: a.x}}}
    metrics: {x: {signal: w.log, reduce: final}, y: {signal: w.log, reduce: max}}
    """
    made = certified(text)
    assert {accuracy.kind for accuracy in made.metrics.values()} == {AGREES}


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("run.coupling_tolerance=1e-3", "`run.coupling_tolerance` chooses steps"),
        ("run.tolerance=1e-6", "`run.tolerance` chooses steps"),
        ("blocks.a.tolerance=1e-6", "`blocks.a.tolerance` chooses steps"),
    ],
)
def test_steps_that_a_tolerance_chooses_are_not_halved(diagram, setting, said):
    """Halving what is only a bound changes nothing, which must not pass for no error."""
    text = """
    run: {stop: 1, step: 0.1, integrator: dormand-prince}
    blocks:
      a: {type: Decay, inputs: {u: b.x}}
      b: {type: Decay, inputs: {u: a.x}}
    metrics: {x: {signal: a.x, reduce: final}}
    """
    with pytest.raises(UsageError, match=said):
        certificate.require_figures(run.load(diagram(text), [setting]), signals=False)
