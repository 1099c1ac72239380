"""The chains that are compared, and the search for a solver's fastest setting."""

import time

import numpy as np

# Greatest error of a velocity, as a part of the greatest; and of what intruders absorb, in an ensemble.
ALLOWED = 1e-9
ALLOWED_OF_MANY = 1e-6
# A run that takes longer than this, s, ends the search for better settings of its solver.
LONG = 3.0


class Chain:
    """Bodies 0 to N, N contacts, one intruder. A state is U[0..N], x, V[0..N], w; SI units."""

    def __init__(self, case):
        self.name = case["name"]
        self.stiffness = np.array(case["stiffness"])
        self.viscosity = case["viscosity"]
        self.inverse = np.array(case["inverse"])
        self.host = case["host"]
        self.mass, self.spring, self.damper = case["oscillator"]
        self.speed, self.duration = case["speed"], case["duration"]
        self.end = np.array(case["end"])
        self.bodies = len(self.inverse)

    def start(self):
        state = np.zeros(2 * self.bodies + 2)
        state[self.bodies + 1] = self.speed
        return state

    def velocities(self, state):
        return np.asarray(state)[self.bodies + 1 : 2 * self.bodies + 1]

    def error(self, velocities):
        """Greatest error of a velocity at the end, as a part of the greatest."""
        return float(np.max(np.abs(velocities - self.end)) / np.max(np.abs(self.end)))


class Ensemble:
    """Chains like one case with other speeds and intruders, and what their intruders absorb in a converged run, J."""

    def __init__(self, case, chains):
        self.case = case
        column = lambda key: np.array([chain[key] for chain in chains])
        self.speed, self.spring = column("speed"), column("stiffness")
        self.damper, self.mass = column("damping"), column("mass")
        self.absorbed = column("absorbed")
        self.count = len(chains)
        self.inverse = np.tile(case.inverse, (self.count, 1))
        self.inverse[:, case.host] = 1.0 / (1.0 / case.inverse[case.host] + case.mass - self.mass)

    def error(self, absorbed):
        return float(np.max(np.abs(np.asarray(absorbed) / self.absorbed - 1.0)))


class Fit:
    """The fastest setting of a solver that keeps the error allowed, and all that were tried: error and seconds."""

    def __init__(self, case, solver):
        self.case, self.solver = case, solver
        self.points = []
        self.best = None

    def row(self):
        row = {"case": self.case, "solver": self.solver, "points": self.points}
        if self.best is None:
            least = min((error for error, _ in self.points), default=float("inf"))
            return row | {"left_out": f"the error allowed is not reached; the least is {least:.1e}"}
        seconds, error, setting, _ = self.best
        return row | {"seconds": seconds, "error": error, "settings": setting}


def seconds(run):
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def fit(case, solver, settings, make, error_of, allowed=ALLOWED):
    """Tries settings, from coarse to fine. `make` gives a run, whose result `error_of` judges.

    The first run of each compiles what has to be compiled and gives the error; the time is the least of two more.
    """
    found = Fit(case, solver)
    for name, setting in settings:
        run = make(setting)
        try:
            error = error_of(run())
        except Exception:  # A solver that gives up has not reached it.
            continue
        took = min(seconds(run), seconds(run))
        if np.isfinite(error):
            found.points.append((error, took))
        if error <= allowed and (found.best is None or took < found.best[0]):
            found.best = (took, error, name, run)
        if took > LONG:
            break
    return found
