"""Recordings of beads, as `bead record` and `bead emulate` make them."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

from . import _hertz_chain
from .scenario import Scenario

if TYPE_CHECKING:
    import pandas
    import polars


class Recording:
    """An .mcap file of beads: strikes, samples, clocks, and the checks of the command line.

    >>> recording = Recording("run/bead-8.mcap")  # doctest: +SKIP
    >>> recording.strikes_pandas()[["absorbed_measured_j", "uncertainty_measured_j"]]  # doctest: +SKIP

    Raises:
        RecordingError: the file cannot be read, or is no recording.
    """

    __slots__ = ("_native",)

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._native = _hertz_chain.Recording(os.fspath(path))

    @property
    def warning(self) -> str | None:
        """A line about a file that is cut short or damaged."""
        return self._native.warning()

    def strikes(self) -> dict[str, Any]:
        """A row for each strike: columns by name, as `bead export` writes them; names end with their units.

        Whole numbers and numbers are arrays, NaN where a value is unknown; texts are lists.
        """
        return self._native.strikes()

    def samples(self, strike: int | None = None) -> dict[str, Any]:
        """A row for each sample of a strike (by its `id`), or of all: forces, accelerations and codes."""
        return self._native.samples(strike)

    def strikes_pandas(self) -> pandas.DataFrame:
        """`strikes` as a frame of pandas."""
        import pandas

        return pandas.DataFrame(self.strikes())

    def strikes_polars(self) -> polars.DataFrame:
        """`strikes` as a frame of polars."""
        import polars

        return polars.DataFrame(self.strikes())

    def replay(self) -> dict[str, Any]:
        """Each strike through the bead's own code: `replay` is `identical`, `incomplete` or `differs`, `why` says why."""
        return self._native.replay()

    def budget(self, strike: int = 0) -> dict[str, Any]:
        """The uncertainty of the energies of a strike, by its `id`, as `bead budget --format json` prints it.

        Raises:
            RecordingError: there is no such strike, or samples or settings are missing.
        """
        budget: dict[str, Any] = json.loads(self._native.budget(strike))
        return budget

    def compare(self, scenario: Scenario | None = None, *, bead: int | None = None) -> dict[str, Any]:
        """The strikes of one bead beside the simulated chain.

        Args:
            scenario: what was struck; by default the scenario in the recording.
            bead: its number in the chain, needed for a recording of several.

        Returns:
            `bead`, `strikes` (device, replay, f64 and truth of each), `pass` and `failure`, as
            `bead compare --format json` prints them.

        Raises:
            RecordingError: there is no scenario, no such bead, or the chain cannot be simulated.
        """
        native = None if scenario is None else scenario._native
        compared: dict[str, Any] = json.loads(self._native.compare(native, bead))
        return compared

    def clocks(self) -> dict[str, Any]:
        """The clocks of the beads, as `bead clock --format json` prints them."""
        clocks: dict[str, Any] = json.loads(self._native.clocks())
        return clocks
