"""What has been measured since the sandbox last started, across changes by hand: rows, history, energy balance."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from taichi_disk.model.observables import COLUMNS
from taichi_disk.scenes.setup import Columns
from taichi_disk.simulate import as_columns

_DISSIPATED, _ABSORBED, _SLIDING = (COLUMNS.index(name) for name in ("dissipated", "absorbed", "sliding"))
_MECHANICAL = [COLUMNS.index(name) for name in ("kinetic", "elastic", "wall", "load")]
_LOAD = COLUMNS.index("load")
_ENERGIES = [*_MECHANICAL, _DISSIPATED, _ABSORBED, _SLIDING]
_HISTORY = 4000  # rows that the running graph can look back


class Ledger:
    """A stretch is the time between two changes by hand; the rows of a stretch are those of a run from its start.

    A change gives or takes energy at once, which is no error: `imbalance` adds up what each stretch lost.
    """

    def __init__(self, first: NDArray[np.float64], dt: float, stride: int) -> None:
        """`first`: (columns,) at the start; a row follows every `stride` steps of `dt` [R/c]."""
        self._t = self._lost = self._dissipated = self._absorbed = self._slid = self._given = 0.0
        self.history: deque[tuple[float, dict[str, float]]] = deque(maxlen=_HISTORY)
        self._begin(first, dt, stride)

    def _begin(self, first: NDArray[np.float64], dt: float, stride: int) -> None:
        self.dt, self.stride = dt, stride
        self._rows, self._off = [first.copy()], [0.0]
        self.last, self._steps, self._stretch_given = first.copy(), 0, 0.0
        self._note()

    def new_stretch(self, first: NDArray[np.float64], dt: float, stride: int) -> None:
        """Something was changed by hand: `first` is the state's row after it, its sums zero again."""
        self._lost += self.stretch_imbalance()
        self._t = self.t
        self._given += self._stretch_given + float(first[_MECHANICAL].sum() - self.last[_MECHANICAL].sum())
        self._dissipated += self.last[_DISSIPATED]
        self._absorbed += self.last[_ABSORBED] + self._stretch_given
        self._slid += self.last[_SLIDING]
        self._begin(first, dt, stride)

    def again(self, first: NDArray[np.float64], dt: float, stride: int) -> None:
        """The present stretch is made once more, with another step."""
        while self.history and self.history[-1][0] >= self._t:
            self.history.pop()
        self._begin(first, dt, stride)

    def add(self, row: NDArray[np.float64], steps: int) -> None:
        """The state after `steps` steps of this stretch."""
        row = row.copy()
        # What came in by hand is a negative loss, so that the sum of all energies stays what it was.
        row[_ABSORBED] -= self._stretch_given
        self.last, self._steps = row, steps
        if steps % self.stride == 0:
            self._rows.append(row)
            self._off.append(max(self._off[-1], abs(self.stretch_imbalance())))
            self._note()

    def pulled(self, given: float) -> None:
        """The potential of the mouse's pull has jumped by `given` [M c^2]."""
        self._stretch_given += given
        self.last = self.last.copy()
        self.last[_LOAD] += given
        self.last[_ABSORBED] -= given

    def back_to(self, rows: int) -> None:
        """Forget all but the first `rows` rows of this stretch."""
        del self._rows[rows:], self._off[rows:]
        self.last, self._steps = self._rows[-1], (rows - 1) * self.stride
        while self.history and self.history[-1][0] > self.t:
            self.history.pop()

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def t(self) -> float:
        return self._t + self.stretch_time

    @property
    def stretch_time(self) -> float:
        """Since the last change by hand [R/c]."""
        return self._steps * self.dt

    def columns(self, last: int | None = None) -> Columns:
        """The rows of this stretch as a run's time series, or the last few of them (t then begins at 0)."""
        return as_columns(np.array(self._rows[-last:] if last else self._rows), self.dt, self.stride)

    def now(self) -> dict[str, float]:
        """All observables at this moment; what was lost is counted since the start."""
        row = dict(zip(COLUMNS, map(float, self.last), strict=True))
        row["dissipated"] += self._dissipated
        row["absorbed"] += self._absorbed + self._stretch_given
        row["sliding"] += self._slid
        return row

    def imbalance(self) -> float:
        """Energy that has appeared from nowhere since the start [M c^2]."""
        return self._lost + self.stretch_imbalance()

    def given(self) -> float:
        """Energy given by hand since the start, by the mouse's pull and at once by changes [M c^2]."""
        return self._given + self._stretch_given

    def stretch_imbalance(self) -> float:
        """Energy that has appeared from nowhere since the last change by hand [M c^2]."""
        return float(self.last[_ENERGIES].sum() - self._rows[0][_ENERGIES].sum())

    def worst(self, until: float = np.inf) -> float:
        """Largest deviation of the energy in this stretch, up to the time `until` in it [M c^2]."""
        return self._off[int(min(until / (self.stride * self.dt), len(self._off) - 1))]

    def _note(self) -> None:
        self.history.append((self.t, self.now()))
