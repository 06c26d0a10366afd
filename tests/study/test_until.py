"""Studies that draw until a probability is known: intervals hold whenever one stops, on any number of threads."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import binom

from cosim.study import sequential
from cosim.study.definition import Sought
from cosim.study.sequential import Trials
from cosim.terminal.cli import main

# x(1) = start + 1, exact under any method: violated with the probability share of starts above 0.5.
DIAGRAM = """
run: {stop: 1, step: 0.25}
blocks: {x: {block: Integrator, inputs: {u: 1}, start: {x: 0}}}
metrics: {last: {signal: x.x, reduce: final}}
requirements: {low: always(x.x < 1.5)}
"""
STUDY = """
diagram: diagram.yaml
random: {count: 400, seed: 3, draws: {blocks.x.start.x: {uniform: [0, 1]}}}
until: {low: {probability: 0.3, confidence: 0.95}}
"""


def study(folder: Path, text: str, *options: str, capsys, code: int = 3) -> dict:
    folder.mkdir(exist_ok=True)
    (folder / "diagram.yaml").write_text(DIAGRAM)
    (folder / "study.yaml").write_text(text)
    results = ["--results", str(folder / "results")]
    assert main(["study", str(folder / "study.yaml"), *results, "--json", *options]) == code
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(("violated", "draws"), [(0, 10), (3, 40), (40, 40), (250, 500)])
def test_the_bounds_are_where_the_mixture_of_likelihoods_is_one_over_alpha(violated, draws):
    """By quadrature: the likelihood at p over its mean under the density 1/(pi sqrt(q (1 - q))), with q = sin^2."""
    best = violated / draws

    def log_likelihood(q: float) -> float:
        return (violated and violated * math.log(q)) + (draws - violated and (draws - violated) * math.log1p(-q))

    def scaled(angle: float) -> float:
        q = min(max(math.sin(angle) ** 2, 1e-300), 1 - 1e-16)
        return math.exp(log_likelihood(q) - log_likelihood(best)) / (math.pi / 2)

    mean = quad(scaled, 0, math.pi / 2, points=[math.asin(math.sqrt(best))], epsrel=1e-11, limit=500)[0]
    low, high = sequential.interval(violated, draws, 0.99)
    for p in (low, high):
        if 0 < p < 1:
            assert mean / math.exp(log_likelihood(p) - log_likelihood(best)) == pytest.approx(100, rel=1e-6)
    assert (low == 0) == (violated == 0)
    assert (high == 1) == (violated == draws)


def test_a_wrong_verdict_is_as_rare_as_is_said_whenever_one_stops():
    """1,000 streams of 2,000 draws of exactly the probability that is asked for: each verdict on them is a mistake."""
    generator = np.random.default_rng(5)
    until = Sought("low", None, None, 0.1, 0.9, None)
    wrong = 0
    for _ in range(1000):
        outcomes: list[bool | None] = (generator.random(2000) < 0.1).tolist()
        wrong += Trials(until, ("base", ()), outcomes).known_after() is not None
    assert wrong <= binom.ppf(1 - 1e-3, 1000, 0.1)
    assert wrong > 10  # which is not for nothing: most of the 10 % are used


def test_what_nobody_knows_may_be_either():
    until = Sought("low", None, None, 0.5, 0.95, None)
    known = Trials(until, ("base", ()), [False] * 30)
    half = Trials(until, ("base", ()), [False] * 20 + [None] * 10)
    assert known.known_after() is not None
    assert half.interval(30)[1] == sequential.interval(10, 30, 0.95)[1]
    assert half.interval(30)[0] == 0.0
    assert Trials(until, ("base", ()), [None] * 500).known_after() is None


def test_a_study_ends_as_soon_as_it_is_known_on_any_number_of_threads(tmp_path, capsys):
    """By hand from the draws: the first number of them after which 0.3 is left out."""
    answers = [
        study(tmp_path / n, STUDY, "--threads", n, capsys=capsys) for n in ("1", "3") if not (tmp_path / n).mkdir()
    ]
    one, three = answers
    assert one["until"] == three["until"]
    assert one["members"] == three["members"]
    (known,) = one["until"]
    starts = [np.random.default_rng([3, k]).random() for k in range(400)]
    violated = np.cumsum(np.array(starts) >= 0.5)
    limits = [sequential.interval(int(k), n + 1, 0.95) for n, k in enumerate(violated)]
    first = next(n for n, (low, _) in enumerate(limits) if low > 0.3) + 1
    assert (known["draws"], known["verdict"]) == (first, "above 30.00 %")
    assert known["probability"] == pytest.approx(limits[first - 1], rel=1e-9)
    assert one["members"] == first < 400
    assert one["requirements"][0]["runs"] == first
    assert one["requirements"][0]["probability"] is None  # of so many runs, as was decided beforehand
    again = study(tmp_path / "1", STUDY, capsys=capsys)
    assert (again["ran"], again["until"]) == (0, one["until"])


def test_every_variant_and_a_metric_have_their_own_and_as_many_draws(tmp_path, capsys):
    text = STUDY + "variants: {slow: {set: {blocks.x.inputs.u: 0.7}}, fast: {}}\n"
    text = text.replace("{low: ", "{last: {above: 1.6, probability: 0.2}, low: ")
    answer = study(tmp_path, text, capsys=capsys)
    verdicts = {(one["name"], one["variant"]): one for one in answer["until"]}
    assert verdicts["low", "fast"]["verdict"] == "above 30.00 %"
    assert verdicts["last", "fast"]["verdict"] == "above 20.00 %"
    draws = max(one["draws"] for one in answer["until"])
    assert answer["members"] == 2 * draws
    main(["study", str(tmp_path / "study.yaml"), "--results", str(tmp_path / "results")])
    shown = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    for one in answer["until"]:  # the table says the same
        low, high = (f"{100 * end:.3g}" for end in one["probability"])
        counted = f"{one['variant']} {one['name']} {one['violated']} of {one['draws']}"
        assert f"{counted} {low} … {high} %, {100 * one['confidence']:g} % {one['verdict']}" in shown


def test_what_is_not_known_after_all_draws_is_said(tmp_path, capsys):
    text = STUDY.replace("count: 400", "count: 50").replace("probability: 0.3", "probability: 0.5")
    answer = study(tmp_path, text, capsys=capsys)
    assert (answer["members"], answer["until"][0]["verdict"]) == (50, "not known yet")
    assert main(["study", str(tmp_path / "study.yaml"), "--results", str(tmp_path / "results")]) == 3
    assert "not known yet" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("{low: {", "{lw: {", "there is no metric `lw`"),
        ("{low: {", "{last: {", "does not say what a violation is"),
        ("probability: 0.3", "probability: 1", "no number of draws shows"),
        ("probability: 0.3, ", "", "has no `probability`"),
        ("count: 400", "method: sobol, count: 400", "are no independent trials"),
        ("random: {count: 400, seed: 3, draws: {blocks.x.start.x: {uniform: [0, 1]}}}", "", "needs draws"),
        ("confidence: 0.95", "confidence: 95", "must be a number from 0.5 to 1"),
        ("confidence: 0.95", "confidence: 1", "nor anything with certainty"),
    ],
)
def test_a_mistake_has_its_place(tmp_path, capsys, old, new, told):
    assert old in STUDY
    (tmp_path / "diagram.yaml").write_text(DIAGRAM)
    (tmp_path / "study.yaml").write_text(STUDY.replace(old, new))
    assert main(["study", str(tmp_path / "study.yaml"), "--results", str(tmp_path / "results")]) == 2
    shown = capsys.readouterr().err
    assert told in shown
    assert "study.yaml:4:" in shown or not new
