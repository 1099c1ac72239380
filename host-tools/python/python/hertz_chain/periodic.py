"""Motions of a shaken chain that repeat with each period of the drive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import _hertz_chain
from .scenario import Scenario


@dataclass(frozen=True)
class Periodic:
    """Motions that repeat: one, or n along a branch."""

    #: Amplitude of the drive, m or N, and its frequency, Hz: shape (n,).
    amplitude: NDArray[np.float64]
    frequency: NDArray[np.float64]
    #: True where no small disturbance grows, shape (n,).
    stable: NDArray[np.bool_]
    #: Floquet multipliers, the greatest magnitude first, shape (n, 2 bodies + 2 intruders).
    multipliers: NDArray[np.complex128]
    #: Distance between start and end of a period, as a part of the motion, shape (n,).
    residual: NDArray[np.float64]
    #: `fold` at a point, `period-doubling`, `torus` or `crossing` between the point before and this, or None.
    bifurcation: list[str | None]
    #: Least and greatest force of each contact in a period, N, shape (n, contacts).
    force_min: NDArray[np.float64]
    force_max: NDArray[np.float64]
    #: Greatest speed of each bead, m/s, shape (n, beads), and greatest displacement of each intruder from its host,
    #: m, shape (n, intruders).
    speed_max: NDArray[np.float64]
    stroke_max: NDArray[np.float64]
    #: Why a branch ends: `range`, `points`, `lost` or `stopped`; None of a single motion.
    end: str | None


def periodic(
    scenario: Scenario,
    *,
    along: str | None = None,
    to: float | None = None,
    back: float | None = None,
    points: int = 400,
    callback: Callable[[float], object] | None = None,
) -> Periodic:
    """Find a motion that repeats with the drive, stable or not, and follow it around folds.

    Args:
        scenario: a chain that a sine drives. Its motion at rest, or its starts, are where Newton's method begins.
        along: `amplitude` or `frequency`: what of the drive changes along the branch.
        to: the value that the branch ends at, m, N or Hz.
        back: the value that a branch which turned back ends at; the scenario's own by default.
        points: most points of the branch.
        callback: is called with the value of each point. If it returns False, the branch ends there.

    Raises:
        ScenarioError: the scenario has no such motion near, or a value cannot be used.
        KeyboardInterrupt: Ctrl-C.
    """
    return Periodic(**_hertz_chain.periodic(scenario._native, along, to, back, points, callback))
