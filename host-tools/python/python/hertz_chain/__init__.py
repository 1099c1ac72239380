"""Granular chains with absorbers, and the beads that measure them, for NumPy.

>>> import hertz_chain as hc
>>> run = hc.simulate(hc.Scenario.paper())
>>> round(run.summary["peak_force"][7]["force"], 2)
5.6

All quantities are in SI units. Every result equals that of the command line `bead` to the last bit.
"""

from ._hertz_chain import RecordingError, ScenarioError, __version__
from .estimator import Estimator
from .many import Ensemble, Optimum, Sweep, ensemble, optimise, sweep
from .periodic import Periodic, periodic
from .recording import Recording
from .scenario import Scenario
from .simulation import OBSERVABLES, Simulation, simulate

__all__ = [
    "OBSERVABLES",
    "Ensemble",
    "Estimator",
    "Optimum",
    "Periodic",
    "Recording",
    "RecordingError",
    "Scenario",
    "ScenarioError",
    "Simulation",
    "Sweep",
    "__version__",
    "ensemble",
    "optimise",
    "periodic",
    "simulate",
    "sweep",
]
