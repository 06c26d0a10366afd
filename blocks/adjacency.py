"""Neighbour lists: which robots a robot hears, and with what weight a_ij, (5) and Section II-B.

A network of robots is two arrays: ``neighbours (robots, capacity)`` holds numbers from 0 in ascending order, -1 after
the last; ``weights (robots, capacity)`` holds a_ij beside them. A static graph G1 is given by people as
``hears (robots, heard)`` with robots' numbers from 1, and 0 for none: i hears j means a_ij = 1.
"""

from numpy.typing import NDArray


def add_neighbour(i: int, j: int, weight: float, count: NDArray, neighbours: NDArray, weights: NDArray) -> None:
    """Insert j into the list of i, of which `count[i]` entries are used.

    Raises: ValueError if the list is full.
    """
    k = count[i]
    if k == neighbours.shape[1]:
        raise ValueError("a robot has more neighbours than `capacity`: raise it under the topology's dimensions")
    while k > 0 and neighbours[i, k - 1] > j:
        neighbours[i, k] = neighbours[i, k - 1]
        weights[i, k] = weights[i, k - 1]
        k -= 1
    neighbours[i, k] = j
    weights[i, k] = weight
    count[i] += 1


def begin_with_static(hears: NDArray, count: NDArray, neighbours: NDArray, weights: NDArray) -> None:
    """Write the lists of G1, A_1 of Section II-B: weight 1 for each robot heard.

    Raises: ValueError if a list is full.
    """
    for i in range(neighbours.shape[0]):
        count[i] = 0
        for k in range(neighbours.shape[1]):
            neighbours[i, k] = -1
            weights[i, k] = 0.0
        for k in range(hears.shape[1]):
            if hears[i, k] > 0:
                add_neighbour(i, hears[i, k] - 1, 1.0, count, neighbours, weights)


def is_heard(hears: NDArray, i: int, j: int) -> bool:
    """Whether robot i hears j in G1, that is a^1_ij = 1 in (5) (numbers from 0)."""
    heard = False
    for k in range(hears.shape[1]):
        heard = heard or hears[i, k] == j + 1
    return heard


def names_robots(hears: NDArray) -> tuple[bool, str]:
    """Whether every robot hears other robots only, each once: a_ii = 0 of Section II-B."""
    for i, row in enumerate(hears.tolist(), start=1):
        others = [j for j in row if j != 0]
        if i in others or len(set(others)) < len(others) or not all(1 <= j <= len(hears) for j in others):
            return False, f"robot {i} hears {others}"
    return True, ""


def strongly_connected(hears: NDArray) -> tuple[bool, str]:
    """Whether every robot reaches every other one along the edges of G1, Section II-B and Lemma 2.

    `names_robots` tells of edges to nobody.
    """
    heard = [[j - 1 for j in row if 1 <= j <= len(hears)] for row in hears.tolist()]
    hearers: list[list[int]] = [[] for _ in heard]
    for i, others in enumerate(heard):
        for j in others:
            hearers[j].append(i)
    if reaches_all(heard) and reaches_all(hearers):
        return True, "1 strongly connected part"
    import networkx  # here alone: it takes as long to import as a whole start

    graph = networkx.DiGraph(dict(enumerate(heard)))
    parts = sorted(sorted(robot + 1 for robot in part) for part in networkx.strongly_connected_components(graph))
    shown = ", ".join("{" + ", ".join(map(str, part)) + "}" for part in parts[:6])
    return False, f"{len(parts)} strongly connected parts: {shown}" + (", …" if len(parts) > 6 else "")


def reaches_all(edges: list[list[int]]) -> bool:
    """Whether the edges lead from the first robot to all."""
    reached, ahead = {0}, [0]
    while ahead:
        new = [j for j in edges[ahead.pop()] if j not in reached]
        reached.update(new)
        ahead.extend(new)
    return len(reached) == len(edges)
