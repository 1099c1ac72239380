"""hertz_chain beside SciPy's solvers: achieved error, and time. docs/benchmarks.md has compiled solvers.

    pip install hertz-chain scipy
    python benchmark.py

The paper's strike, of which the energy that the intruder dissipates is compared with a run at the tightest tolerance.
Each solver integrates the same equations with its best settings for a range of tolerances; times are the least of
several runs, side by side in this process. SciPy's right-hand side is vectorised NumPy, as a user would write it.
"""

import time

import numpy as np
from scipy.integrate import solve_ivp

import hertz_chain as hc

SCENARIO = hc.Scenario.paper()
TABLES = SCENARIO.to_dict()


def chain():
    """Masses (kg), contact stiffnesses (N/m^1.5) and relaxation times (s) of the paper's chain."""
    striker, beads = TABLES["striker"], TABLES["chain"]

    def mass(of):
        return 4 / 3 * np.pi * of["radius"] ** 3 * of["density"]

    def theta(of):
        return 3 * (1 - of["poisson"] ** 2) / (4 * of["young"])

    count = beads["beads"]
    masses = np.array([mass(striker)] + [mass(beads)] * count)
    radii = np.array([striker["radius"]] + [beads["radius"]] * count)
    thetas = np.array([theta(striker)] + [theta(beads)] * count)
    stiffness = 1 / (thetas[:-1] + thetas[1:]) / np.sqrt(1 / radii[:-1] + 1 / radii[1:])
    return masses, stiffness, beads["relaxation"]


MASSES, STIFFNESS, TAU = chain()
INTRUDER = TABLES["intruder"][0]
HOST = INTRUDER["beads"][0] if isinstance(INTRUDER["beads"], list) else INTRUDER["beads"]
SHELLS = MASSES.copy()
SHELLS[HOST] -= INTRUDER["mass"]
N = len(MASSES)


def rates(_, y):
    """The equations of docs/physics.md: displacements and velocities of the bodies and the intruder, and its loss."""
    u, v = y[:N], y[N : 2 * N]
    x, w = y[2 * N] - u[HOST], y[2 * N + 1] - v[HOST]
    overlap = u[:-1] - u[1:]
    root = np.sqrt(np.maximum(overlap, 0.0))
    force = STIFFNESS * root * (np.maximum(overlap, 0.0) + 1.5 * TAU * (v[:-1] - v[1:]))
    total = np.zeros(N)
    total[1:] += force
    total[:-1] -= force
    pull = INTRUDER["stiffness"] * x + INTRUDER["damping"] * w
    total[HOST] += pull
    loss = INTRUDER["damping"] * w * w
    return np.concatenate([v, total / SHELLS, [y[2 * N + 1], -pull / INTRUDER["mass"], loss]])


def best_time(run):
    """Least time of a run, s, of as many as two seconds hold, and its result."""
    took, begun = [], time.perf_counter()
    while len(took) < 3 or (time.perf_counter() - begun < 2.0 and len(took) < 50):
        start = time.perf_counter()
        result = run()
        took.append(time.perf_counter() - start)
    return min(took), result


def main():
    begin = np.zeros(2 * N + 3)
    begin[N] = TABLES["striker"]["velocity"]
    end = TABLES["duration"]
    reference = hc.simulate(SCENARIO, observables=[]).energy["dissipated_intruders"]

    def ours(tolerance, longest_step):
        run = hc.simulate(SCENARIO, observables=[], tolerance=tolerance, longest_step=longest_step, rate=1e3)
        return run.energy["dissipated_intruders"]

    def scipy(method, tolerance):
        # No step may pass over a collision of bodies in free flight.
        found = solve_ivp(rates, (0.0, end), begin, method, rtol=tolerance, atol=1e-3 * tolerance * 1e-6, max_step=2e-5)
        return found.y[-1, -1]

    rows = [
        ("hertz_chain", f"{tolerance:.0e}", lambda tolerance=tolerance, step=step: ours(tolerance, step))
        for tolerance, step in ((1e-6, 1.0), (1e-8, 0.5), (1e-10, 0.5), (1e-12, 0.25), (1e-14, 0.125))
    ]
    rows += [
        (f"scipy {method}", f"{tolerance:.0e}", lambda method=method, tolerance=tolerance: scipy(method, tolerance))
        for method, tolerance in (("DOP853", 1e-6), ("DOP853", 1e-9), ("LSODA", 1e-6), ("LSODA", 1e-9))
    ]
    print(f"{'solver':<16}{'tolerance':>10}{'achieved error':>16}{'time (ms)':>12}{'ratio':>10}")
    base: float | None = None
    for name, tolerance, run in rows:
        took, found = best_time(run)
        base = base or took
        print(f"{name:<16}{tolerance:>10}{abs(found / reference - 1):>16.1e}{1e3 * took:>12.3f}{took / base:>10.1f}")

    count = 100_000
    velocities = np.random.default_rng(1).uniform(0.3, 1.5, count)
    start = time.perf_counter()
    hc.sweep(scenario=SCENARIO, axes={"striker.velocity": velocities})
    took = time.perf_counter() - start
    print(f"sweep of {count} chains: {count / took:.0f} a second on all cores")


if __name__ == "__main__":
    main()
