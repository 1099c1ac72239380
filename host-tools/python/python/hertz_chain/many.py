"""Many chains at once, on all cores: ensembles, sweeps, and searches for absorbers."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _hertz_chain
from .scenario import Scenario, as_json

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Ensemble:
    """The ends of many runs, in the order of their scenarios. NaN where a run was refused."""

    #: Energy that the intruders dissipated, J, shape (n,).
    absorbed: NDArray[np.float64]
    #: Energy that went into the chain, J, shape (n,).
    injected: NDArray[np.float64]
    #: Kinetic energy of the striker before, J, shape (n,).
    striker_energy: NDArray[np.float64]
    #: Greatest force of each contact that was asked for, N, and when, s: shape (n, contacts).
    peak_force: NDArray[np.float64]
    peak_time: NDArray[np.float64]
    #: Why a run was refused, or None.
    error: list[str | None]


def ensemble(
    scenarios: Iterable[Scenario],
    *,
    peaks: Sequence[int] = (),
    progress: Callable[[float], object] | None = None,
) -> Ensemble:
    """Run many scenarios, each over its duration; chains that differ only in numbers are fast.

    The absorbed energy has a relative error of at most 1e-6, a greatest force one of 1e-5, in chains like the paper's.

    Args:
        scenarios: any number of them.
        peaks: contacts, counted from 1, whose greatest force is wanted.
        progress: is called with the completed part, 0 to 1.

    Raises:
        ScenarioError: no scenario has a contact that is asked for.
        KeyboardInterrupt: Ctrl-C.
    """
    natives = [scenario._native for scenario in scenarios]
    return Ensemble(**_hertz_chain.ensemble(natives, list(peaks), progress))


@dataclass(frozen=True)
class Sweep:
    """The table of a sweep."""

    #: Name of the index of each axis, the columns along it, and its length; the last axis turns fastest.
    axes: list[tuple[str, list[str], int]]
    #: The columns of the table by name, one value for each point.
    columns: dict[str, Any]

    def to_xarray(self) -> xarray.Dataset:
        """The results over the axes. It needs xarray."""
        import xarray

        shape = tuple(count for _, _, count in self.axes)
        dimensions = [name for name, _, _ in self.axes]
        along = {column: at for at, (_, columns, _) in enumerate(self.axes) for column in columns}
        coordinates: dict[str, Any] = {}
        variables: dict[str, Any] = {}
        for name, values in self.columns.items():
            if name == "point" or (name in dimensions and name not in along):
                continue
            cube = np.asarray(values, dtype=object if isinstance(values, list) else None).reshape(shape)
            if name in along:
                at = along[name]
                coordinates[name] = (dimensions[at], cube[tuple(slice(None) if n == at else 0 for n in range(cube.ndim))])
            else:
                unit = {"j": "J", "n": "N", "s": "s"}.get(name.rsplit("_", 1)[-1])
                variables[name] = (dimensions, cube, {"units": unit} if unit else {})
        return xarray.Dataset(variables, coordinates)


def sweep(
    definition: str | os.PathLike[str] | dict[str, Any] | None = None,
    *,
    scenario: Scenario | None = None,
    axes: dict[str, Any] | None = None,
    outputs: dict[str, Any] | None = None,
    progress: Callable[[float], object] | None = None,
) -> Sweep:
    """Run a scenario over axes of parameters, on all cores.

    >>> found = sweep(scenario=Scenario.paper(), axes={"intruder.1.stiffness": np.geomspace(1e5, 1e6, 3)})
    >>> found.columns["absorbed_of_injected"].shape
    (3,)

    Args:
        definition: a sweep's TOML file (docs/sweeps.md), or its tables as a dictionary.
        scenario: in place of `definition`, the scenario that every point starts from,
        axes: with the values of each key, such as ``"striker.velocity"`` or ``"intruder.1.stiffness"``,
        outputs: and the results to keep, such as ``{"absorbed": True, "peaks": [1, 8]}``.
        progress: is called with the completed part, 0 to 1.

    Raises:
        ScenarioError: a key or a value that a sweep does not take.
        KeyboardInterrupt: Ctrl-C.
    """
    path, tables = None, None
    if isinstance(definition, dict):
        tables = as_json(definition)
    elif definition is not None:
        path = os.fspath(definition)
    elif scenario is None or not axes:
        raise _hertz_chain.ScenarioError("give a sweep's file or tables, or a scenario and its axes")
    else:
        axis = [{"key": key, "values": np.asarray(values).tolist()} for key, values in axes.items()]
        tables = as_json({"scenario": scenario.to_dict(), "axis": axis, "outputs": outputs or {}})
    found = _hertz_chain.sweep(path, tables, progress)
    return Sweep(axes=found["axes"], columns=found["columns"])


@dataclass(frozen=True)
class Optimum:
    """The best intruders that a search found."""

    #: The scenario with them.
    scenario: Scenario
    #: The objective with them, as a part of that without intruders: of `remaining`, the share of the injected energy
    #: that they leave in the chain.
    share: float
    #: The whole result, as `bead optimise --format json` prints it.
    report: dict[str, Any]


def optimise(
    scenario: Scenario,
    hosts: Sequence[int],
    total_mass: float,
    *,
    objective: str = "remaining",
    loss_factor: float | None = None,
    stroke: float | None = None,
    catalogue: str | os.PathLike[str] | None = None,
    hosts_at_most: int | None = None,
    radii: tuple[Sequence[int], float, float] | None = None,
    spread: str | None = None,
    speeds: Sequence[float] = (),
    worst: bool = False,
    alike: bool = False,
    evaluations: int | None = None,
    callback: Callable[[int, float | None, int], object] | None = None,
) -> Optimum:
    """Find the intruders that leave the least energy in the chain, or the least of another objective.

    Args:
        scenario: the chain and its strike. Its own intruders are left out.
        hosts: the beads that hold an intruder each, or may hold one (`hosts_at_most`).
        total_mass: greatest sum of their masses, kg.
        objective: what is made small: `remaining` (the share of the injected energy that the intruders have not
            dissipated), `force:13` (greatest force of contact 13), `energy-behind:13` (energy of the beads behind
            bead 13 at the end), `impulse:13` (impulse of contact 13).
        loss_factor: c / √(k m) of all intruders, in place of a free damping.
        stroke: greatest displacement of an intruder in its bead, m, at every speed and corner of the spread.
            `report["strokes_m"]` has that of each.
        catalogue: a TOML file of springs (docs/optimise.md), of which each intruder gets one. `report["springs"]` has
            them, and the optimum with free stiffnesses.
        hosts_at_most: most of the hosts that hold an intruder; the search chooses them.
        radii: beads whose radii may vary too, each by itself, with the least and the greatest in m, such as
            `(range(10, 17), 0.012, 0.022)`. `report["radii"]` has those found.
        spread: deviations common to all intruders that the design must tolerate, such as `stiffness:15%,damping:30%`;
            the worst of their corners counts. `report["robustness"]` has the optimum without them beside it.
        speeds: speeds of the striker, m/s; the scenario's own by default.
        worst: of several speeds the greatest value counts, not the mean.
        alike: all intruders are alike.
        evaluations: most designs to try; as many again for a spread, a catalogue and a choice of hosts.
        callback: is called often with the designs tried, the least share so far and the descents begun. If it returns
            False, the search ends with the best design so far.

    Raises:
        ScenarioError: the search cannot use a value.
        KeyboardInterrupt: Ctrl-C.
    """
    report, native = _hertz_chain.optimise(
        scenario._native,
        list(hosts),
        total_mass,
        objective,
        loss_factor,
        stroke,
        None if catalogue is None else os.fspath(catalogue),
        hosts_at_most,
        None if radii is None else (list(radii[0]), radii[1:]),
        spread,
        list(speeds),
        worst,
        alike,
        evaluations,
        callback,
    )
    found: dict[str, Any] = json.loads(report)
    return Optimum(scenario=Scenario._of(native), share=found["share"], report=found)
