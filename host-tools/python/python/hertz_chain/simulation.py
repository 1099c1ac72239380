"""One run of a chain, with its observables over time."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _hertz_chain
from .scenario import Scenario

if TYPE_CHECKING:
    import xarray

#: Each observable with its unit and its second axis: `body` (0 is the striker, then the beads), `contact` (contact j
#: joins bodies j - 1 and j; the first column is contact 1), `intruder` (by host bead), or None.
OBSERVABLES: dict[str, tuple[str, str | None]] = {
    "displacement": ("m", "body"),
    "velocity": ("m/s", "body"),
    "force": ("N", "contact"),
    "intruder_displacement": ("m", "intruder"),
    "intruder_velocity": ("m/s", "intruder"),
    "intruder_acceleration": ("m/s2", "intruder"),
    "intruder_dissipated": ("J", "intruder"),
    "striker_energy": ("J", None),
    "chain_energy": ("J", None),
    "intruders_energy": ("J", None),
    "dissipated_contacts": ("J", None),
    "dissipated_intruders": ("J", None),
    "dissipated_ground": ("J", None),
}


@dataclass(frozen=True)
class Simulation:
    """The result of `simulate`. Arrays belong to NumPy and are not copied.

    >>> run = simulate(Scenario.paper(), rate=1e6)
    >>> run["force"].shape
    (6001, 16)
    """

    #: The scenario.
    scenario: Scenario
    #: Times, s, shape (n,).
    time: NDArray[np.float64]
    #: The observables by name: shape (n, k), or (n,) for energies of the whole.
    observables: dict[str, NDArray[np.float64]]
    #: Numbers of the bodies, contacts and hosts that the second axes have.
    bodies: NDArray[np.int64]
    contacts: NDArray[np.int64]
    intruders: NDArray[np.int64]
    #: Peaks, final state, energies by cause and cost, as `bead simulate --format json` prints them.
    summary: dict[str, Any]
    #: Time that the integration took, s; the rest of a call's time goes into handing the arrays to Python.
    seconds: float

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """An observable by its name."""
        return self.observables[name]

    @property
    def energy(self) -> dict[str, float]:
        """Energies by cause, J: striker, chain, intruders, dissipated in contacts and in intruders."""
        energies: dict[str, float] = self.summary["energy"]
        return energies

    @property
    def peak_force(self) -> NDArray[np.float64]:
        """Greatest force of each contact, N, shape (contacts,); NaN for one that never carried any."""
        peaks = np.full(len(self.contacts), np.nan)
        for peak in self.summary["peak_force"]:
            peaks[peak["contact"] - 1] = peak["force"]
        return peaks

    def to_xarray(self) -> xarray.Dataset:
        """All observables as one Dataset, whose variables have units. It needs xarray."""
        import xarray

        coordinates: dict[str, Any] = {"time": ("time", self.time, {"units": "s"})}
        for axis, numbers in (("body", self.bodies), ("contact", self.contacts), ("intruder", self.intruders)):
            coordinates[axis] = (axis, numbers)
        variables = {}
        for name, values in self.observables.items():
            unit, axis_of = OBSERVABLES[name]
            axes = ("time",) if axis_of is None else ("time", axis_of)
            variables[name] = (axes, values, {"units": unit})
        attributes = {"scenario": self.scenario.to_toml(), **{f"{key}_j": value for key, value in self.energy.items()}}
        return xarray.Dataset(variables, coordinates, attributes)


def simulate(
    scenario: Scenario,
    *,
    rate: float = 1e6,
    observables: list[str] | tuple[str, ...] | None = None,
    tolerance: float = 1e-14,
    longest_step: float = 0.125,
) -> Simulation:
    """Simulate a scenario to a stated error.

    Args:
        scenario: the chain and its strike.
        rate: times a second of the arrays, Hz. It has no influence on the error.
        observables: names of `OBSERVABLES`; all of them by default, none for only the summary.
        tolerance: relative error of a step. The default is that of the command line.
        longest_step: longest step as a part of the shortest time of contact.

    Raises:
        ScenarioError: a value is out of range, or the run would not end.
        KeyboardInterrupt: Ctrl-C.

    Other threads of Python run meanwhile.
    """
    names = list(OBSERVABLES) if observables is None else list(observables)
    found = _hertz_chain.simulate(scenario._native, rate, names, tolerance, longest_step)
    return Simulation(
        scenario=scenario,
        time=found["time"],
        observables=found["observables"],
        bodies=np.arange(found["bodies"]),
        contacts=np.arange(1, found["contacts"] + 1),
        intruders=np.array(found["intruders"], dtype=np.int64),
        summary=json.loads(found["summary"]),
        seconds=found["seconds"],
    )
