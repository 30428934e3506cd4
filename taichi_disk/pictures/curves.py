"""The curves over time that plots, films and pages show, and their colours."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import NamedTuple

from taichi_disk.mechanics.simulation.observables import BY_NAME


class Look(NamedTuple):
    """How the curve of a column is drawn: its colours on a light and on a dark ground,
    Matplotlib's style of its line, and its panel (0: motion, 1: force, 2: energies)."""

    column: str
    colours: tuple[str, str]
    style: str = "-"
    panel: int = 2

    @property
    def name(self) -> str:
        """Name among the energies."""
        return BY_NAME[self.column].label


# The contrast of a colour to its ground is at least 4.5. Lines whose colours
# colour-blind readers confuse with those of solid lines are not solid.
_TABLE = json.loads(files(__package__).joinpath("curves.json").read_bytes())
LOOKS = {column: Look(column, *others) for column, *others in _TABLE}
MOTION = LOOKS["com_vy"]
FORCE = LOOKS["wall_force"]
ENERGIES = [look for look in LOOKS.values() if look.panel == 2]
# Okabe and Ito's colours, which colour-blind readers can tell apart
OKABE_ITO = ("#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7")
