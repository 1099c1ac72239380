"""The bead's own fixed-point arithmetic, on samples of one's own."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _hertz_chain


class Estimator:
    """A bead without hardware: the same integers as on the STM32, bit for bit.

    >>> force, acceleration = run["force"][:, 7], run["intruder_acceleration"][:, 0]  # doctest: +SKIP
    >>> codes = Estimator.digitise(force, acceleration, rate=1e6)  # doctest: +SKIP
    >>> Estimator().process(codes)["strikes"]["absorbed_measured_j"]  # doctest: +SKIP

    Args:
        settings: a bead's settings in TOML (docs/calibration.md); by default the paper's bead behind the reference front
            end.

    Raises:
        ScenarioError: the settings cannot be used.
    """

    __slots__ = ("_native",)

    def __init__(self, settings: str | os.PathLike[str] | None = None) -> None:
        self._native = _hertz_chain.Estimator(None if settings is None else os.fspath(settings))

    def process(self, codes: ArrayLike) -> dict[str, dict[str, Any]]:
        """Take further scans, and measure the strikes in them.

        Args:
            codes: 12-bit codes, integers of shape (n, 4): force, wide force, acceleration, wide acceleration, 100 000
                scans a second. The results do not depend on how a stream is cut into calls.

        Returns:
            The tables `strikes` and `samples` of the windows that ended, with the columns of `bead export`.

        Raises:
            ScenarioError: another shape, or codes outside 0 to 4095.
            TypeError: codes that are not integers.
        """
        array = np.asarray(codes)
        if not np.issubdtype(array.dtype, np.integer):
            raise TypeError(f"codes are {array.dtype}; give integers, as a converter does")
        if array.ndim != 2 or array.shape[1] != 4:
            raise _hertz_chain.ScenarioError(
                f"codes have the shape {array.shape}; give (n, 4): force, wide force, acceleration, wide acceleration"
            )
        if array.size and (array.min() < 0 or array.max() > 4095):
            raise _hertz_chain.ScenarioError("a code is outside 0 to 4095, the 12 bits of the bead's converter")
        return self._native.process(np.ascontiguousarray(array, dtype=np.uint16))

    @staticmethod
    def digitise(
        force: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        *,
        rate: float,
        seed: int | None = None,
    ) -> NDArray[np.uint16]:
        """The codes of signals behind the reference front end, with quiet before and after them.

        Args:
            force: N, shape (n,), from rest on.
            acceleration: m/s², shape (n,).
            rate: samples a second of both, Hz.
            seed: of the front end's noise; without one there is no noise.

        Returns:
            Codes for `process`, shape (scans, 4).

        Raises:
            ScenarioError: no signal, values that are not numbers, or another shape.
        """
        signals = [None if signal is None else np.asarray(signal, dtype=np.float64) for signal in (force, acceleration)]
        if all(signal is None for signal in signals):
            raise _hertz_chain.ScenarioError("give a force, an acceleration, or both")
        for signal in signals:
            if signal is not None and signal.ndim != 1:
                raise _hertz_chain.ScenarioError(f"a signal has the shape {signal.shape}; give (n,)")
        return _hertz_chain.Estimator.digitise(signals[0], signals[1], float(rate), seed)
