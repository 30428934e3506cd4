"""The curves over time that plots, films and pages show, and their colours."""

from __future__ import annotations

from typing import NamedTuple

from taichi_disk.mechanics.simulation.observables import BY_NAME


class Look(NamedTuple):
    """How the curve of a column is drawn: its panel (0: motion, 1: force, 2: energies),
    its colours on a light and on a dark ground, and Matplotlib's style of its line."""

    column: str
    panel: int
    colours: tuple[str, str]
    style: str = "-"

    @property
    def name(self) -> str:
        """Name among the energies."""
        return BY_NAME[self.column].label


# The contrast of a colour to its ground is at least 4.5. Lines whose colours
# colour-blind readers confuse with those of solid lines are not solid.
MOTION = Look("com_vy", 0, ("#00806A", "#2FC79B"))
FORCE = Look("wall_force", 1, ("#1A1A1E", "#EDEDE8"))
ENERGIES = (
    Look("translation", 2, MOTION.colours),
    Look("rotation", 2, ("#882255", "#E88AB4")),
    Look("vibration", 2, ("#8E5BC0", "#C9A0F0")),
    Look("elastic", 2, ("#C23F00", "#FF7F50")),
    Look("wall", 2, ("#8F6500", "#E0B040"), "--"),
    Look("load", 2, ("#6F7A00", "#C8D050"), ":"),
    Look("dissipated", 2, ("#1F6FB5", "#4FB3F0"), "--"),
    Look("absorbed", 2, ("#B0478A", "#F0A0CF")),
    Look("sliding", 2, ("#6B6B6B", "#ABABAB"), ":"),
    Look("friction", 2, ("#8C5A2B", "#D9A066"), ":"),
)
LOOKS = {look.column: look for look in (MOTION, FORCE, *ENERGIES)}
# Okabe and Ito's colours, which colour-blind readers can tell apart
OKABE_ITO = ("#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7")
