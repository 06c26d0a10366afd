"""The extremes of Lemma 2: of P_1, of Q_1 and of L_1 + B, for six robots as for twenty thousand.

L_1 + B is a nonsingular M-matrix, so its inverse and its solution q of (L_1 + B) q = 1 are positive. The lower ends of
both spectra are the same question: up to which t is Z - t J a nonsingular M-matrix? For Q_1, Z = Q_1 and J = I; for
sigma(L_1 + B), Z has the blocks L_1 + B and its transpose, and J exchanges them. Every positive x answers with a lower
bound, the least (Z x)_i / (J x)_i (Collatz and Wielandt), and every vector with an upper one (Rayleigh). What is
returned lies between both, so it is right however well an iteration went.
"""

from collections.abc import Callable
from functools import lru_cache
from heapq import heapify, heappop, heappush
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Up to so many robots, dense linear algebra is faster than sparse.
DENSE = 300

#: Up to so many, it is what is left for graphs that sparse linear algebra cannot take.
DENSE_AT_MOST = 1500

#: The multiplications that eliminating a graph's robots one by one may take; beyond, it is too entangled.
WORK = 20_000_000

#: How far apart both bounds of a value may be: relative to it, and to the largest sum of a row for one near zero.
TOLERANCE = 2e-7
NEAR_ZERO = 1e-12

#: How far (L_1 + B) q may be from 1. As the inverse is positive, each element of q is relatively as right.
RESIDUAL = 1e-9

#: How many factorizations a value may take, and below which part of the largest element a vector is lifted in between.
TRIALS = 60
LIFTED = 1e-8

EPSILON = float(np.finfo(float).eps)

Array = NDArray[Any]


class NotJudged(Exception):
    """Why the extremes of Lemma 2 are not known. holds: False where what asks for them fails for certain."""

    def __init__(self, reason: str, holds: bool | None = None) -> None:
        super().__init__(reason)
        self.holds = holds


class LowerEnds(NamedTuple):
    """Of Lemma 2. p: the (smallest, largest) eigenvalue of P_1. q_1: the smallest one of Q_1. sigma: sigma(L_1 + B)."""

    p: tuple[float, float]
    q_1: float
    sigma: float


def lower_ends(hears: Array, b: Array) -> LowerEnds:
    """What the conditions of Theorem 3 are made of, within 1e-6.

    hears: (robots, heard), whom each robot hears, from 1; 0: nobody. b: (robots,) weights of the references.
    Raises: NotJudged.
    """
    return _lower_ends(*_content(hears, b))


def network_extremes(hears: Array, b: Array) -> tuple[Array, Array, Array]:
    """(smallest, largest) eigenvalue of P_1, eigenvalue of Q_1, and singular value of L_1 + B, Lemma 2.

    The proof of Theorem 3 uses sigma(L_1 + B) as the inverse of a bound of ||(L_1 + B)^-1||, and sigma_max(L + B) as a
    bound of ||L + B||, hence singular values. Arguments as of `lower_ends`. Raises: NotJudged.
    """
    low = lower_ends(hears, b)
    q_most, sigma_most = _upper_ends(*_content(hears, b))
    return np.array(low.p), np.array([low.q_1, q_most]), np.array([low.sigma, sigma_most])


def _content(hears: Array, b: Array) -> tuple[int, bytes, bytes]:
    """What calls with equal arguments share: conditions come in pairs, and a network is large."""
    return len(hears), np.ascontiguousarray(hears, np.int64).tobytes(), np.ascontiguousarray(b, float).tobytes()


@lru_cache(maxsize=8)
def _lower_ends(robots: int, hears: bytes, b: bytes) -> LowerEnds:
    pinned, sparse = _pinned(robots, hears, b)
    p = _p(pinned, sparse)
    q_1 = _q_1(pinned, p)
    if sparse:
        least, sigma = _smallest_eigenvalue(q_1), _smallest_singular_value(pinned)
    else:
        least, sigma = float(np.linalg.eigvalsh(q_1)[0]), _dense_singular_values(pinned)[1]
    return LowerEnds((float(p.min()), float(p.max())), least, sigma)


@lru_cache(maxsize=8)
def _upper_ends(robots: int, hears: bytes, b: bytes) -> tuple[float, float]:
    """The largest eigenvalue of Q_1 and singular value of L_1 + B."""
    pinned, sparse = _pinned(robots, hears, b)
    q_1 = _q_1(pinned, _p(pinned, sparse))
    if sparse:
        return _largest_eigenvalue(q_1), _largest_eigenvalue(_interleaved(None, pinned.T, pinned, None))
    return float(np.linalg.eigvalsh(q_1)[-1]), _dense_singular_values(pinned)[0]


# ---- The matrices ----------------------------------------------------------------------------------------------


def _pinned(robots: int, hears: bytes, b: bytes) -> tuple[Any, bool]:
    """(L_1 + B, whether it is sparse, with its robots in the order of elimination). Few robots need no SciPy.

    Raises: NotJudged if it is singular, or too large for either kind.
    """
    lists, weights = np.frombuffer(hears, np.int64).reshape(robots, -1), np.frombuffer(b)
    rows, columns = np.nonzero(lists)[0], lists[lists != 0] - 1
    edges = list(zip(rows.tolist(), columns.tolist(), strict=True))
    _refuse_singular(edges, weights)
    diagonal = np.bincount(rows, minlength=robots) + weights
    order = None if robots <= DENSE else _elimination_order(robots, edges)
    if order is not None:
        from scipy.sparse import csc_array, diags_array

        adjacency = csc_array((np.ones(len(rows)), (rows, columns)), shape=(robots, robots))
        return csc_array(diags_array(diagonal) - adjacency)[:, order][order], True
    if robots > DENSE_AT_MOST:
        raise NotJudged(f"the static graph of {robots} robots is too entangled for the spectrum of L_1 + B")
    pinned = np.diag(diagonal)
    pinned[rows, columns] -= 1.0
    return pinned, False


def _refuse_singular(edges: list[tuple[int, int]], b: Array) -> None:
    """Raises: NotJudged where a robot hears nobody, directly or through others, who knows a reference."""
    heard_by: list[list[int]] = [[] for _ in b]
    for i, j in edges:
        heard_by[j].append(i)
    reached = set(np.flatnonzero(b).tolist())
    waiting = list(reached)
    while waiting:
        new = set(heard_by[waiting.pop()]) - reached
        reached |= new
        waiting += new
    lost = [i for i in range(len(b)) if i not in reached]
    if lost:
        more = f" (and {len(lost) - 1} more)" if len(lost) > 1 else ""
        text = f"L_1 + B is singular: robot {lost[0] + 1}{more} hears nobody, directly or through others, with b > 0"
        raise NotJudged(text, holds=False)


def _elimination_order(robots: int, edges: list[tuple[int, int]]) -> Array | None:
    """The robots by least degree, as the others are joined; None where that takes more than `WORK`."""
    near: list[set[int]] = [set() for _ in range(robots)]
    for i, j in edges:
        near[i].add(j)
        near[j].add(i)
    heap = [(len(others), i) for i, others in enumerate(near)]
    heapify(heap)
    order: dict[int, None] = {}
    work = 0
    while heap:
        degree, i = heappop(heap)
        if i in order or degree != len(near[i]):
            continue
        rest = robots - len(order)
        joined = degree == rest - 1
        work += rest**3 // 3 if joined else degree**2
        if work > WORK:
            return None
        order[i] = None
        if joined:
            return np.array([*order, *near[i]])
        for j in near[i]:
            near[j] |= near[i]
            near[j] -= {i, j}
            heappush(heap, (len(near[j]), j))
    raise AssertionError("the last robot is joined with all the others, none")


def _p(pinned: Any, sparse: bool) -> Array:
    """The diagonal of P_1, 1/q of (L_1 + B) q = 1. Raises: NotJudged.

    A positive q with a positive image proves that L_1 + B is a nonsingular M-matrix.
    """
    ones = np.ones(pinned.shape[0])
    q = _solution(pinned, ones) if sparse else _dense_solution(pinned, ones)
    if not (q.min() > 0.0 and abs(pinned @ q - 1.0).max() < RESIDUAL):
        raise NotJudged("L_1 + B is too near a singular matrix for its spectrum to be known")
    return 1.0 / q


def _q_1(pinned: Any, p: Array) -> Any:
    weighted = pinned * p[:, np.newaxis]
    return weighted + weighted.T


def _interleaved(*blocks: Any) -> Any:
    """Four square blocks as one matrix, both unknowns of a robot side by side, which keeps the order of elimination."""
    from scipy.sparse import block_array, csc_array

    matrix = block_array([blocks[:2], blocks[2:]], format="csc")
    order = np.arange(matrix.shape[0]).reshape(2, -1).T.ravel()
    return csc_array(matrix[:, order][order])


def _dense_singular_values(pinned: Any) -> tuple[float, float]:
    """(largest, smallest). Raises: NotJudged where rounding may hide the smallest."""
    values = np.linalg.svd(pinned, compute_uv=False)
    if values[-1] < len(values) * EPSILON / TOLERANCE * values[0]:
        raise NotJudged(f"sigma(L_1 + B) is too small to be known: {values[-1]:.3g}")
    return float(values[0]), float(values[-1])


# ---- The lower ends --------------------------------------------------------------------------------------------


def _smallest_eigenvalue(q_1: Any) -> float:
    from scipy.sparse import eye_array

    size = abs(q_1).sum(axis=1).max()
    below = float((2.0 * q_1.diagonal() - abs(q_1).sum(axis=1)).min() - TOLERANCE * size)  # Gershgorin
    return _margin(q_1, eye_array(q_1.shape[0], format="csc"), lambda x: float(x @ (q_1 @ x) / (x @ x)), below)


def _smallest_singular_value(pinned: Any) -> float:
    from scipy.sparse import eye_array

    def above(x: Array) -> float:
        images = (pinned @ x[::2], x[::2]), (pinned.T @ x[1::2], x[1::2])
        return float(min(np.linalg.norm(image) / np.linalg.norm(of) for image, of in images))

    one = eye_array(pinned.shape[0], format="csc")
    return _margin(_interleaved(pinned, None, None, pinned.T), _interleaved(None, one, one, None), above, 0.0)


def _margin(z: Any, j: Any, above: Callable[[Array], float], low: float) -> float:
    """The t up to which Z - t J is a nonsingular M-matrix, which it is at `low`. Raises: NotJudged.

    above: an upper bound of t from any vector. Each trial solves (Z - target J) y = x for a target just below the least
    upper bound. It is inverse iteration, so a target that is too high gives a better upper bound; one that is not
    gives a positive y, and so a lower bound above the target. One too high falls three quarters of its way to `low`.
    """
    magnitude = abs(z)
    size = float(magnitude.sum(axis=1).max())
    rounding = EPSILON * (1 + int(np.diff(z.tocsr().indptr).max()))
    high, target, x = np.inf, low, np.ones(z.shape[0])
    for _ in range(TRIALS):
        y = abs(_solution(z - target * j, x))
        if y.min() > 0.0:
            low = max(low, float(np.min((z @ y - rounding * (magnitude @ y)) / (j @ y))))
            high = min(high, above(y))
        allowed = max(TOLERANCE * abs(high), NEAR_ZERO * size)
        if high - low <= allowed:
            return (low + high) / 2.0
        if low >= target:
            x, target = np.maximum(y / y.max(), LIFTED), high - allowed / 2.0
        else:
            target = low + (target - low) / 4.0
    raise NotJudged(f"the spectrum of L_1 + B is known between {low:.4g} and {high:.4g} only")


def _solution(matrix: Any, right: Array) -> Array:
    """Of a sparse system whose rows are in the order of elimination; NaN where it has none."""
    try:
        found: Array = _factors(matrix).solve(right)
    except RuntimeError:
        return np.full(len(right), np.nan)
    return found


def _dense_solution(matrix: Any, right: Array) -> Array:
    """Of a system in any order; NaN where it has none."""
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        return np.full(len(right), np.nan)


# ---- The upper ends --------------------------------------------------------------------------------------------


def _largest_eigenvalue(symmetric: Any) -> float:
    """Of a matrix that has a positive one, by bisection: no iteration is slow where eigenvalues lie close together."""
    low, high = 0.0, float(abs(symmetric).sum(axis=1).max())
    while high - low > TOLERANCE * high:
        middle = (low + high) / 2.0
        low, high = (low, middle) if _above_all(middle, symmetric) else (middle, high)
    return (low + high) / 2.0


def _above_all(t: float, symmetric: Any) -> bool:
    """Whether t is above every eigenvalue: elimination without interchanges meets positive pivots only (Sylvester)."""
    from scipy.sparse import eye_array

    try:
        factors = _factors(t * eye_array(symmetric.shape[0], format="csc") - symmetric)
    except RuntimeError:  # a pivot is zero
        return False
    return bool((factors.perm_r == factors.perm_c).all() and (factors.U.diagonal() > 0.0).all())


def _factors(matrix: Any) -> Any:
    """L and U of a matrix whose rows are in the order of elimination. Raises: RuntimeError where a pivot is zero."""
    from scipy.sparse.linalg import splu

    options: Any = {"permc_spec": "NATURAL", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    return splu(matrix.tocsc(), **options)
