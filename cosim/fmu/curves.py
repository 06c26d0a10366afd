"""How inputs go on in a step of FMI 2's Co-Simulation, for FMUs that interpolate them: derivatives at its begin.

An input that the loop extrapolates, or interpolates where a step is repeated, is a polynomial of the time over a step.
It is looked at at as many times, from begin to end, as it has coefficients, and a matrix makes derivatives of that:

    u(t + s h) = c_0 + c_1 s + c_2 s^2 …         u^(k)(t) = k! c_k / h^k
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cosim.fmu.event_mode import communication_step, reals_of
from cosim.fmu.fields import (
    CLOCK,
    CURVE_ELEMENTS,
    CURVE_HISTORY,
    CURVE_MATRIX,
    CURVE_ORDER,
    CURVE_POINTS,
    CURVE_REFERENCES,
    CURVE_SLOT,
    CURVE_WIDTH,
    CURVE_WORDS,
    CURVES,
    CURVES_WORDS,
    HANDLE,
    LINK,
    LINK_WORDS,
    N_CURVES,
    N_DERIVATIVES,
    ORDERS,
    PLAN_CURVES,
    SET_INPUT_DERIVATIVES,
    START_TIME,
    VALUES,
)
from cosim.fmu.transfer import bad
from cosim.machine.memory import reals_at, words_at
from cosim.master.histories import HISTORY_WORDS, TO, trace


def matrix(order: int) -> np.ndarray:
    """What makes k! c_k, k = 1 … order, of a polynomial's values at 0, 1 / order, …, 1: (order, order + 1)."""
    places = np.linspace(0.0, 1.0, order + 1)
    factorials = np.array([math.factorial(k) for k in range(1, order + 1)])
    coefficients: np.ndarray = np.linalg.inv(np.vander(places, increasing=True))[1:]
    made: np.ndarray = factorials[:, None] * coefficients
    return made


def set_derivatives(base: int, link: Any, plan: Any, f: Any, r: Any, info: int, k: int) -> bool:
    """Tell instance k how its inputs go on from the step's begin. Returns whether that failed, as of `transfer`."""
    if plan[PLAN_CURVES] == 0:
        return False
    table = words_at(plan[PLAN_CURVES], CURVES_WORDS)
    values, step, at = reals_at(table[VALUES], table[N_DERIVATIVES]), communication_step(f), 0
    begin = reals_of(info)[CLOCK] - reals_at(f[LINK], LINK_WORDS)[START_TIME]
    for j in range(table[N_CURVES]):
        curve = words_at(table[CURVES] + j * CURVE_WORDS * 8, CURVE_WORDS)
        if k == 0:
            look(base, curve, begin, step)
        slot, history = curve[CURVE_SLOT], words_at(base + curve[CURVE_HISTORY], HISTORY_WORDS)
        differentiate(curve, (f[slot] + k * f[slot + 1] - history[TO]) // 8, step, values, at)
        at += curve[CURVE_ELEMENTS] * curve[CURVE_ORDER]
    arguments = (r[HANDLE], table[CURVE_REFERENCES], table[N_DERIVATIVES], table[ORDERS], table[VALUES])
    return bad(link, link[SET_INPUT_DERIVATIVES], arguments)


def look(base: int, curve: Any, begin: float, step: float) -> None:
    """What an input is, for all instances, from the begin of a step to its end (s)."""
    n = curve[CURVE_ORDER]
    for p in range(n + 1):
        trace(base, curve[CURVE_HISTORY], begin + step * p / n, curve[CURVE_POINTS] + p * curve[CURVE_WIDTH] * 8, 1)


def differentiate(curve: Any, first: int, step: float, values: Any, at: int) -> None:
    """The derivatives of one instance's elements, which begin with the number `first`, into `values` from `at` on."""
    n, width = curve[CURVE_ORDER], curve[CURVE_WIDTH]
    weights, points = reals_at(curve[CURVE_MATRIX], n * (n + 1)), reals_at(curve[CURVE_POINTS], (n + 1) * width)
    for e in range(curve[CURVE_ELEMENTS]):
        scale = 1.0
        for d in range(n):
            scale *= step
            total = 0.0
            for p in range(n + 1):
                total += weights[d * (n + 1) + p] * points[p * width + first + e]
            values[at + e * n + d] = total / scale
