"""Scenarios: a chain, its striker, and the intruders in its beads."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np

from . import _hertz_chain


def _plain(value: Any) -> Any:
    """A NumPy scalar or array as Python's own numbers, for `json`."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not a value of a scenario; give numbers, texts, lists or dictionaries")


def as_json(tables: dict[str, Any]) -> str:
    """Tables as JSON.

    Raises:
        ScenarioError: a value is not a finite number.
    """
    try:
        return json.dumps(tables, default=_plain, allow_nan=False)
    except ValueError:
        raise _hertz_chain.ScenarioError("a value is infinite or not a number; give finite numbers") from None


class Scenario:
    """A chain of spheres, its striker and its intruders: the tables of a scenario's TOML file.

    >>> import hertz_chain as hc
    >>> scenario = hc.Scenario.paper().replace(striker={"velocity": 0.8})
    >>> scenario.to_dict()["striker"]["velocity"]
    0.8

    Keyword arguments are the keys of the file, in SI units, such as ``duration`` (s), ``chain`` and ``striker``
    (dictionaries), ``intruder`` and ``section`` (lists of them). docs/physics.md has them all.

    Raises:
        ScenarioError: an unknown key, a value out of range, or a table that is missing; the line of the command line.
    """

    __slots__ = ("_native",)

    def __init__(self, **tables: Any) -> None:
        self._native = _hertz_chain.Scenario.from_json(as_json(tables))

    @classmethod
    def _of(cls, native: _hertz_chain.Scenario) -> Scenario:
        scenario = cls.__new__(cls)
        scenario._native = native
        return scenario

    @classmethod
    def paper(cls) -> Scenario:
        """The strike of the paper (Vasconcellos et al., Phys. Rev. Applied 18, 014078): an intruder in bead 8 of 16."""
        return cls._of(_hertz_chain.Scenario.paper())

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scenario:
        """The scenario in a TOML file."""
        return cls._of(_hertz_chain.Scenario.load(os.fspath(path)))

    @classmethod
    def from_toml(cls, text: str) -> Scenario:
        """The scenario in a TOML text."""
        return cls._of(_hertz_chain.Scenario.from_toml(text))

    @classmethod
    def from_dict(cls, tables: dict[str, Any]) -> Scenario:
        """The scenario of a dictionary of tables."""
        return cls(**tables)

    def replace(self, **changes: Any) -> Scenario:
        """This scenario with other values.

        A dictionary changes the keys that it has, a list takes the place of the whole list, and None removes a key.

        >>> bare = Scenario.paper().replace(intruder=None)
        """
        return Scenario._of(self._native.replaced(as_json(changes)))

    def to_dict(self) -> dict[str, Any]:
        """The tables, SI units."""
        tables: dict[str, Any] = json.loads(self._native.to_json())
        return tables

    def to_toml(self) -> str:
        """The scenario as a TOML text."""
        return self._native.to_toml()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scenario) and self._native == other._native

    def __hash__(self) -> int:
        return hash(self.to_toml())

    def __reduce__(self) -> tuple[Any, ...]:
        return Scenario.from_toml, (self.to_toml(),)

    def __repr__(self) -> str:
        chain = self.to_dict()["chain"]
        return f"<Scenario of {chain['beads']} beads>"
