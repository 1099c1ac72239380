"""Computes the motion of two beads with intruders by SciPy's DOP853, for tests/all/springs.rs.

    python springs_by_scipy.py

Prints the rows of that test: for each case the velocities of the bodies, then a row for each intruder: its own numbers,
displacement and velocity relative to what carries it, and the energy that it has dissipated, all at the end.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp

END = 1e-3


def sphere(radius, density):
    return 4 / 3 * math.pi * radius**3 * density


def theta(young, poisson):
    return 3 * (1 - poisson**2) / (4 * young)


def kappa(a, b):
    return 1 / (theta(*a[1]) + theta(*b[1])) / math.sqrt(1 / a[0] + 1 / b[0])


STEEL, BAKELITE = (203e9, 0.27), (4.5e9, 0.44)
STRIKER, BEAD = (0.0045, STEEL), (0.019, BAKELITE)
MASSES = [sphere(0.0045, 7980), sphere(0.019, 1775), sphere(0.019, 1775)]
STIFFNESS = [kappa(STRIKER, BEAD), kappa(BEAD, BEAD)]


def solve(intruders):
    """`intruders` are bead, mass, k, k3, c and, if it is inside another intruder, that one's number of each."""
    shells = np.array(MASSES)
    n, count = len(shells), len(intruders)
    carriers, laws = [], []
    for bead, mass, k, k3, c, *inside in intruders:
        shells[bead] -= mass
        carriers.append(n + inside[0] if inside else bead)
        laws.append((mass, k, k3, c))
    masses = np.concatenate([shells, [mass for mass, *_ in laws]])

    def rate(_, y):
        u, v = y[:n], y[n : 2 * n]
        places, speeds, _ = np.split(y[2 * n :], 3)
        all_places, all_speeds = np.concatenate([u, places]), np.concatenate([v, speeds])
        forces = np.zeros(n + count)
        for j, stiffness in enumerate(STIFFNESS):
            force = stiffness * max(u[j] - u[j + 1], 0.0) ** 1.5
            forces[j] -= force
            forces[j + 1] += force
        powers = np.zeros(count)
        for i, (carrier, (_, k, k3, c)) in enumerate(zip(carriers, laws)):
            x, w = places[i] - all_places[carrier], speeds[i] - all_speeds[carrier]
            pull = k * x + k3 * x**3 + c * w
            forces[carrier] += pull
            forces[n + i] -= pull
            powers[i] = c * w * w
        accelerations = forces / masses
        return np.concatenate([v, accelerations[:n], speeds, accelerations[n:], powers])

    start = np.zeros(2 * n + 3 * count)
    start[n] = 0.45
    options = dict(method="DOP853", rtol=1e-13, atol=1e-18, max_step=1e-7)
    end = solve_ivp(rate, (0, END), start, **options).y[:, -1]
    u, v = end[:n], end[n : 2 * n]
    places, speeds, lost = np.split(end[2 * n :], 3)
    all_places, all_speeds = np.concatenate([u, places]), np.concatenate([v, speeds])
    return places - all_places[carriers], speeds - all_speeds[carriers], v, lost


CASES = {
    "hardening": [(2, 3.7e-3, 1e5, 2e16, 12.0)],
    "softening": [(2, 3.7e-3, 3.95e5, -2e16, 12.0)],
    "both": [(1, 2e-3, 2e5, 5e16, 5.0), (2, 3.7e-3, 3.95e5, -1e16, 12.0)],
    "several in a bead": [(1, 2e-3, 2e5, 5e16, 5.0), (2, 3.7e-3, 3.95e5, 0.0, 12.0), (2, 1.5e-3, 9e5, 0.0, 3.0)],
    "one in another": [(2, 3.7e-3, 3.95e5, 0.0, 12.0), (2, 0.8e-3, 3e5, 2e16, 2.0, 0)],
    "two and one in another": [
        (1, 2e-3, 2e5, 5e16, 5.0),
        (2, 3.7e-3, 3.95e5, 0.0, 12.0),
        (2, 0.8e-3, 3e5, 0.0, 2.0, 1),
        (2, 0.3e-3, 2e5, 1e16, 1.0, 2),
        (2, 0.5e-3, 4e5, 0.0, 3.0, 1),
    ],
}
for name, intruders in CASES.items():
    places, speeds, velocities, lost = solve(intruders)
    print(name.replace(" ", "-"), *map(float, velocities))
    for (bead, mass, k, k3, c, *inside), *motion in zip(intruders, places, speeds, lost):
        print("   ", bead, mass, k, k3, c, inside[0] + 1 if inside else 0, *map(float, motion))
