"""The library's diagrams against scipy and closed forms."""

import math
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from tests.blocks.library_runs import run_diagram

DIAGRAMS = Path(__file__).parents[2] / "diagrams"


def found(name, *signals):
    return run_diagram((DIAGRAMS / name).read_text(encoding="utf-8"), *signals)


def test_the_motor_with_pid_anti_windup_saturation_and_a_load_step_is_scipys():
    text = (DIAGRAMS / "motor.yaml").read_text(encoding="utf-8")
    assert text.count("\n") <= 15
    run = run_diagram(text, "motor.x", "controller.u", "controller.i")
    k_p, k_i, k_d, t_f = 0.5, 5.0, 0.01, 0.01
    t_t = math.sqrt(k_d / k_i)

    def slope(t, z, r, load):
        current, speed, i, x = z
        v = k_p * (r - speed) + i + k_d * (-speed - x) / t_f
        u = min(max(v, -24.0), 24.0)
        drive = [-500 * current - 50 * speed + 500 * u, 100 * current - 0.1 * speed - 1000 * load]
        return [*drive, k_i * (r - speed) + (u - v) / t_t, (-speed - x) / t_f]

    z, parts = np.zeros(4), []
    for begin, end, r, load in ((0.0, 0.1, 0, 0), (0.1, 1.5, 150, 0), (1.5, 3.0, 150, 0.5)):
        times = run["time"][(run["time"] >= begin - 1e-9) & (run["time"] < end - 1e-9)]
        solved = solve_ivp(
            slope, (begin, end), z, "DOP853", [*times, end], args=(r, load), rtol=1e-10, atol=1e-10, max_step=1e-3
        )
        parts.append(solved.y[:, :-1])
        z = solved.y[:, -1]
    expected = np.concatenate([*parts, z[:, None]], axis=1)
    # order 4: 500/s at 1 ms is (0.5)^5 / 120 a step where the current rises, and is forgotten
    np.testing.assert_allclose(run["motor.x"][:, 1], expected[1], atol=0.02)
    assert run["controller.u"].max() == 24.0
    np.testing.assert_allclose(run["motor.x"][-1, 1], 150.0, atol=1e-3)
    without = run_diagram(text.replace("T_f: 0.01, lower", "T_f: 0.01, T_t: 1e9, lower"), "motor.x")
    assert without["motor.x"][:, 1].max() > run["motor.x"][:, 1].max() + 5, "anti-windup is what keeps the speed low"


def test_the_thermostats_limit_cycle_has_its_closed_form():
    """K P = 20 and T = 500 s: from 10 to 12 degrees above it heats for T ln(10 / 8), and cools likewise."""
    run = found("thermostat.yaml", "thermostat.y", "temperature.y")
    on = run["thermostat.y"] > 0
    assert run["temperature.y"][run["time"] > 400].min() >= 20 - 1e-9
    assert run["temperature.y"].max() <= 22 + 1e-9
    edges = run["time"][1:][np.diff(on.astype(int)) != 0]
    heats, cools = 500 * math.log(10 / 8), 500 * math.log(12 / 10)
    first = 500 * math.log(20 / 8)
    expected, t, k = [], first, 0
    while t < 3000:
        expected.append(t)
        t += cools if k % 2 == 0 else heats
        k += 1
    assert len(edges) == len(expected)
    np.testing.assert_allclose(edges, np.ceil(expected), atol=1e-9)  # samples are 1 s apart


def test_the_sampled_pi_with_a_delay_is_an_exact_recursion():
    """Between samples the plant is linear with constant inputs: T = 0.8 s, gain 2, a delay of 30 ms of 100 ms.

    Order 5: (h / T)^6 / 720 = 5e-15 of the plant's 2 u a step, and 4e-13 in its memory, T / h steps.
    """
    run = found("sampled_pi.yaml", "controller.u", "plant.x")
    early, late = math.exp(-0.03 / 0.8), math.exp(-0.07 / 0.8)
    x = i = u = 0.0
    for k in range(50):
        at = round(k * 10)
        np.testing.assert_allclose(run["plant.x"][at], x, atol=2e-12)
        r = 1.0 if k >= 5 else 0.0
        before, u = u, 1.2 * (r - x) + i
        i += 1.5 * 0.1 * (r - x)
        np.testing.assert_allclose(run["controller.u"][at], u, atol=2e-12)
        x = 2 * before + (x - 2 * before) * early
        x = 2 * u + (x - 2 * u) * late
