"""Recordings of beads, as `bead record` and `bead emulate` make them."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Literal

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
        RecordingError: the file cannot be read, or is not a recording.
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
        """The strikes beside the simulated chain, of one bead or of a row of beads.

        Args:
            scenario: what was struck; by default the scenario in the recording.
            bead: the number of one bead in the chain; by default all beads of a recording of several.

        Returns:
            Of one bead `bead`, `strikes` (device, replay, f64 and truth of each), `pass` and `failure`; of a row
            `beads`, `arrivals` and speeds of the wave, `energy` along the row, `notes`, `pass` and `failure`. As
            `bead compare --format json` prints them.

        Raises:
            RecordingError: there is no scenario, no such bead, or the chain cannot be simulated.
        """
        native = None if scenario is None else scenario._native
        compared: dict[str, Any] = json.loads(self._native.compare(native, bead))
        return compared

    def identify(
        self,
        scenario: Scenario | None = None,
        *,
        place: int | None = None,
        method: Literal["ring_down", "pairs", "chain"] | None = None,
        mounting: Literal["free", "held"] = "free",
        fit: Iterable[str] = (),
        bead: int | None = None,
        strikes: Iterable[int] = (),
        doubtful: bool = False,
    ) -> dict[str, Any]:
        """Spring, damper, gains and contacts of each bead, fitted to the samples of its strikes.

        Args:
            scenario: the chain in which the beads were struck; without one they were tapped outside of a chain.
            place: place of the bead in the chain, by default its address, or the only bead with an intruder.
            method: `ring_down` (the default), `pairs` (force and acceleration of a tap), or `chain` (the default
                with a scenario).
            mounting: `free` (hung on threads, on foam) or `held` (clamped), while it rings.
            fit: quantities by letter or name: k, c, m, M, Y, tau, gF, ga.
            bead: the address of the only bead that is wanted.
            strikes: numbers of the strikes of each bead that have a part, from 0; by default all.
            doubtful: take strikes too that are railed, cut, or met by another wave.

        Returns:
            `method` and `beads`, as `bead identify --format json` prints them: of each bead the `quantities` with
            value (SI), standard error and interval of 95 %, correlations, agreement with the noise, doubts.

        Raises:
            RecordingError: no strike has signals, or the scenario has no such bead.
            ValueError: a method, a mounting or a quantity that does not exist.
        """
        arguments = {
            "scenario": None if scenario is None else scenario._native,
            "place": place,
            "method": method,
            "mounting": mounting,
            "fit": list(fit),
            "bead": bead,
            "strikes": list(strikes),
            "doubtful": doubtful,
        }
        identified: dict[str, Any] = json.loads(self._native.identify(arguments))
        return identified

    def clocks(self) -> dict[str, Any]:
        """The clocks of the beads, as `bead clock --format json` prints them."""
        clocks: dict[str, Any] = json.loads(self._native.clocks())
        return clocks
