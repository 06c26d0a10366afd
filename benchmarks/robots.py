"""Robot-steps a second of a thousand robots: the whole formation, as a diagram and in C, and collision avoidance alone.

    pip install pyrvo
    python benchmarks/robots.py [--rounds 5] [--cc gcc]

`C` is formation.c compiled for diagrams/fleet_1000.yaml: 10 s at 1 ms, with the same measures and a list of neighbours
of the same skin. Its figures are compared with the diagram's first. `cosim, velocity obstacles` has ORCA in the
place of the potential field. pyrvo is RVO2, ORCA in C++: a thousand agents of the same starts and radii with at most
eight neighbours within 1.5 m, whose wanted velocities are set once; it has no plant, observer or controller. The
programs take turns.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import loop
import numpy as np

from cosim.engine import run

DIAGRAM = loop.HERE.parent / "diagrams" / "fleet_1000.yaml"
ROBOTS, STEPS, AVOIDING_STEPS = 1000, 10_000, 1000
OBSTACLES = """
extends: {fleet}
blocks:
  potential_field: {{parameters: {{alpha: 0}}}}
  safety:
    block: VelocityObstacles
    parameters: {{radii: "0.23 + i % 9 / 100", epsilon_1: 1.44, horizon: 1.88, T: 0.0209}}
    inputs:
      x: plant.x
      v_hat: observer.v_hat
      w_hat: observer.w_hat
      u: controller.u
      g: gain.g
      g_inverse: gain.g_inverse
      neighbours: topology.neighbours
  plant: {{inputs: {{u: safety.u_safe}}}}
  observer: {{inputs: {{u: safety.u_safe}}}}
"""


def avoidance(starts: np.ndarray, towards: np.ndarray, radii: np.ndarray) -> float:
    """Seconds a step of RVO2; starts, towards (robots, 2), radii (robots)."""
    from pyrvo import RVOSimulator

    simulator = RVOSimulator()
    simulator.set_time_step(1e-3)
    simulator.set_agent_defaults(1.5, 8, 1.88, 1.88, 0.3, 2.0)
    for place, goal, radius in zip(starts, towards, radii, strict=True):
        number = simulator.add_agent(tuple(place))
        simulator.set_agent_radius(number, float(radius))
        away = goal - place
        simulator.set_agent_pref_velocity(number, tuple(away / max(1.0, float(np.hypot(*away)))))
    began = time.perf_counter()
    for _ in range(AVOIDING_STEPS):
        simulator.do_step()
    return (time.perf_counter() - began) / AVOIDING_STEPS


def circle() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Starts and places on the circle (robots, 2), and radii (robots), as the diagram has them."""
    number = np.arange(1, ROBOTS + 1)
    turn = np.cos(np.pi * number)
    radius = 1.8 * ROBOTS / (2 * np.pi)
    angle, place = 2 * np.pi * (number + turn) / ROBOTS, 2 * np.pi * number / ROBOTS
    starts = (radius + 0.2 * turn)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return starts, radius * np.column_stack([np.cos(place), np.sin(place)]), 0.23 + number % 9 / 100


def main() -> None:
    """Build, compare figures, take turns, print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--cc", default="gcc")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        c = loop.build(options.cc, folder, "fleet", f"-DROBOTS={ROBOTS}")
        tuned = loop.build(options.cc, folder, "tuned", f"-DROBOTS={ROBOTS}", "-march=native", "-fno-math-errno")
        network = run.load(DIAGRAM, loop.SETTINGS)
        (folder / "obstacles.yaml").write_text(OBSTACLES.format(fleet=DIAGRAM), encoding="utf-8")
        obstacles = run.load(folder / "obstacles.yaml", ())
        reference = loop.ours(network, None)
        print("Figures of a thousand robots beside the diagram's:")
        loop.compare("C -O3", c(), reference)
        loop.compare("C -O3 -march=native", tuned(), reference)
        places = circle()
        programs: dict[str, Any] = {
            "C -O3": lambda: c()["seconds"] / STEPS,
            "C -O3 -march=native": lambda: tuned()["seconds"] / STEPS,
            "cosim": lambda: loop.ours(network, None)["seconds"] / STEPS,
            "cosim, velocity obstacles": lambda: loop.ours(obstacles, None)["seconds"] / STEPS,
            "pyrvo, avoidance alone": lambda: avoidance(*places),
        }
        seconds: dict[str, list[float]] = {what: [] for what in programs}
        for _ in range(options.rounds):
            for what, program in programs.items():
                seconds[what].append(program())
    print(f"\nMillions of robot-steps a second, {options.rounds} rounds:  median   quartiles       (range)")
    for what, values in seconds.items():
        print(f"  {what:<28} {loop.quartiles([1e-6 * ROBOTS / v for v in values])}")
    for under in ("C -O3", "C -O3 -march=native"):
        ratios = [a / b for a, b in zip(seconds["cosim"], seconds[under], strict=True)]
        print(f"  {'time of cosim / ' + under:<40} {loop.quartiles(ratios)}")


if __name__ == "__main__":
    main()
