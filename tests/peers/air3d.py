"""The air3D game of Mitchell, Bayen and Tomlin (2005), solved by hj_reachability.

`cargo xtask bench peers` calls this script and solves the same game with Sidestep. The script writes
the values as float32 in C order and prints one line of JSON: versions, nodes and the fastest wall time.
"""

import argparse
import json
import os
import time

# Use as many cores as Sidestep uses threads. XLA reads the number when it is imported.
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:2])

import hj_reachability as hj
import jax
import jax.numpy as jnp
import numpy as np

SPEED_MPS = 5.0
TURN_RATE_RADPS = 1.0
RADIUS_M = 5.0
HORIZON_S = 2.8
CFL = 0.75
# A solve with this horizon compiles the code for any horizon, because the horizon is an argument.
WARM_UP_S = 1e-3


def main():
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--grid", required=True, help="nodes, as in 51x40x50")
    options.add_argument("--accuracy", required=True, choices=["medium", "very_high"])
    options.add_argument("--runs", type=int, default=1, help="the fastest counts")
    options.add_argument("--values", required=True, help="the .npy file to write")
    options = options.parse_args()

    grid = hj.Grid.from_lattice_parameters_and_boundary_conditions(
        hj.sets.Box(lo=np.array([-6.0, -10.0, 0.0]), hi=np.array([20.0, 10.0, 2 * np.pi])),
        tuple(int(nodes) for nodes in options.grid.split("x")),
        periodic_dims=2,
    )
    dynamics = hj.systems.Air3d(
        evader_speed=SPEED_MPS,
        pursuer_speed=SPEED_MPS,
        evader_max_turn_rate=TURN_RATE_RADPS,
        pursuer_max_turn_rate=TURN_RATE_RADPS,
    )
    settings = hj.SolverSettings.with_accuracy(
        options.accuracy,
        hamiltonian_postprocessor=hj.solver.backwards_reachable_tube,
        CFL_number=CFL,
    )
    start = jnp.linalg.norm(grid.states[..., :2], axis=-1) - RADIUS_M

    def solve(horizon_s):
        values = hj.step(settings, dynamics, grid, 0.0, start, -horizon_s, progress_bar=False)
        return values.block_until_ready()

    solve(WARM_UP_S)
    wall_s = float("inf")
    for _ in range(options.runs):
        began = time.perf_counter()
        values = solve(HORIZON_S)
        wall_s = min(wall_s, time.perf_counter() - began)

    np.save(options.values, np.ascontiguousarray(values, dtype=np.float32))
    axes = [[float(nodes[0]), float(nodes[-1]), len(nodes)] for nodes in grid.coordinate_vectors]
    versions = {"hj_reachability": hj.__version__, "jax": jax.__version__}
    print(json.dumps({"wall_s": wall_s, "axes": axes, "versions": versions}))


if __name__ == "__main__":
    main()
