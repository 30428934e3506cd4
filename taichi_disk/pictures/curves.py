"""The curves over time that plots, films and pages show, and their colours."""

from __future__ import annotations

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
MOTION = Look("com_vy", ("#00806A", "#2FC79B"), panel=0)
FORCE = Look("wall_force", ("#1A1A1E", "#EDEDE8"), panel=1)
ENERGIES = (
    Look("translation", MOTION.colours),
    Look("rotation", ("#882255", "#E88AB4")),
    Look("vibration", ("#8E5BC0", "#C9A0F0")),
    Look("elastic", ("#C23F00", "#FF7F50")),
    Look("wall", ("#8F6500", "#E0B040"), "--"),
    Look("load", ("#6F7A00", "#C8D050"), ":"),
    Look("dissipated", ("#1F6FB5", "#4FB3F0"), "--"),
    Look("absorbed", ("#B0478A", "#F0A0CF")),
    Look("sliding", ("#6B6B6B", "#ABABAB"), ":"),
    Look("friction", ("#8C5A2B", "#D9A066"), ":"),
)
LOOKS = {look.column: look for look in (MOTION, FORCE, *ENERGIES)}
# Okabe and Ito's colours, which colour-blind readers can tell apart
OKABE_ITO = ("#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7")
