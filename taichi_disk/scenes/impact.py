"""What both impacts share: the start out of the wall's reach, the end when the disk has left for good."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_disk.scene import AbsorbingWallScene, ExponentialWallScene
from taichi_disk.scenes.setup import Columns, Headline, Setup, spread
from taichi_disk.tolerance import RESOLVED

START_POTENTIAL = 1e-10  # of the wall at the start, as a fraction of the kinetic energy
# Part of the wall's decay time 1/(a v) between two rows: a point is pushed for a few of these, and on a hard wall the
# force of the whole disk is made of such pushes, whose first and last bound the contact.
BLINK = 0.3
LONGEST = 0.05  # between two rows, of the disk's own time: some 100 rows of contact
HALVINGS = 8  # of that at the most: some 30,000 rows. By halves, so that points of a sweep can be lanes of one world
CONTACT_LEVEL = 0.01  # contact lasts while the wall's force exceeds this fraction of its peak


class Impact(Setup):
    """A disk that flies at the wall with velocity v: restitution e = -v_cm(after)/v_cm(before)."""

    scene: ExponentialWallScene | AbsorbingWallScene
    depends_on_step = True
    less_left_over = "a larger impact.gap ends it farther from the wall"

    def __init__(self, scene: ExponentialWallScene | AbsorbingWallScene) -> None:
        self.scene = scene
        self.velocity = scene.impact.velocity
        self.kinetic = 0.5 * self.velocity**2
        unit = 1.0 / np.sqrt(scene.material.k_a)  # the disk's own time scale [R/c]
        halvings = np.ceil(np.log2(LONGEST * unit * scene.wall.a * self.velocity / BLINK) - 1e-9)
        self.sample_interval = float(LONGEST * unit * 0.5 ** np.clip(halvings, 0, HALVINGS))
        self.resolving_step = RESOLVED / (scene.wall.a * self.velocity)
        self.gap = 0.0

    def default_gap(self, heights: NDArray[np.float64]) -> float:
        """Gap [R] at which the wall's potential, summed over points `heights` above the lowest, is negligible."""
        wall = self.scene.wall
        total = np.log(np.exp(-wall.a * heights).sum()) + np.log(wall.V0)
        return float(max(total - np.log(START_POTENTIAL * self.kinetic), 1.0) / wall.a)

    def default_max_time(self, gap: float) -> float:
        """Time to come, ten contacts after Hertz, pi sqrt(ln(4 c/v)) R/c, and to leave with e = 0.05 [R/c]."""
        unit = 1.0 / np.sqrt(self.scene.material.k_a)
        contact = np.pi * unit * np.sqrt(np.log(4.0 / min(self.velocity * unit, 1.0)))
        return float(22.0 * gap / self.velocity + 10.0 * contact)

    def ended(self, columns: Columns) -> NDArray[np.bool_]:
        # A disk on its way out may still vibrate so much that it touches again: its lowest point has to be
        # higher than at the start by the largest stretch that its internal energy U allows, sqrt(2 U/k_a).
        internal = columns["kinetic"] + columns["elastic"] - 0.5 * columns["com_vy"] ** 2
        stretch = np.sqrt(2.0 * np.maximum(internal, 0.0) / self.scene.material.k_a)
        return (columns["com_vy"] > 0.0) & (columns["lowest_y"] >= self.gap + stretch)

    def unfinished(self, columns: Columns) -> str:
        v, y = columns["com_vy"][-1], columns["lowest_y"][-1]
        lower = ", or lower material.eta_star" if self.scene.material.eta_star else ""
        return (
            f"the disk has not left the wall by t = {columns['t'][-1]:.6g} R/c (v_cm = {v:.3g} c, lowest point at "
            f"{y:.3g} R); set impact.max_time higher{lower}"
        )

    def left_over(self, columns: Columns) -> float:
        # The wall's last potential becomes kinetic energy, at most that of the flight.
        v, potential = columns["com_vy"][-1], max(float(columns["wall"][-1]), 0.0)
        return float(np.sqrt(v**2 + 2.0 * potential) - v) / self.velocity

    def energy_scale(self, columns: Columns) -> float:
        return self.kinetic

    def headline(self, columns: Columns) -> Headline:
        start, end = contact_interval(columns["t"], columns["wall_force"], columns["com_vy"])
        return Headline(
            {"restitution": float(columns["com_vy"][-1] / self.velocity), "contact_time": end - start},
            {
                "restitution": "-v_cm(after)/v_cm(before), after the disk has left for good",
                "contact_time": f"first to last time that the wall's force is {CONTACT_LEVEL:g} of its peak [R/c]",
            },
        )

    def frame_times(self, columns: Columns, frames: int) -> NDArray[np.float64]:
        start, end = contact_interval(columns["t"], columns["wall_force"], columns["com_vy"])
        last = columns["t"][-1]
        margin = 0.1 * (end - start)
        first, second = max(start - margin, 0.1 * start), min(end + margin, 0.9 * last + 0.1 * end)
        # The contact in slow motion: the flights before and after take half the time, and little of the film.
        flights = [min(0.5 * flight, 0.2 * (second - first)) for flight in (first, last - second)]
        return spread([0.0, first, second, last], [flights[0], second - first, flights[1]], frames)

    def title(self) -> tuple[str, ...]:
        scene = self.scene
        return (
            "Impact on a rigid wall",
            f"v = {self.velocity:g} c    η* = {scene.material.eta_star:g}    a = {scene.wall.a:g}/R",
            f"N = {scene.lattice.points:,}    seed {scene.lattice.seed}",
        )

    def caption(self, row: dict[str, float]) -> tuple[str, ...]:
        return (f"t = {row['t']:7.3f} R/c", f"v_cm/v = {row['com_vy'] / self.velocity:+.4f}")


def contact_interval(
    t: NDArray[np.float64], force: NDArray[np.float64], velocity: NDArray[np.float64]
) -> tuple[float, float]:
    """First and last time that `force` crosses CONTACT_LEVEL of its peak; log-linear between samples.

    Where a hit was so short that no sample has seen a force: the samples between which the disk turned.
    """
    if not force.any():
        turned = int(np.argmax(velocity > 0.0))
        return float(t[turned - 1]), float(t[turned])
    level = CONTACT_LEVEL * force.max()
    inside = np.flatnonzero(force >= level)
    log = np.log(np.maximum(force, 1e-300)) - np.log(level)

    def crossing(i: int, j: int) -> float:
        return float(t[i] + (t[j] - t[i]) * log[i] / (log[i] - log[j])) if log[i] != log[j] else float(t[i])

    first, last = int(inside[0]), int(inside[-1])
    start = crossing(first - 1, first) if first > 0 else float(t[0])
    end = crossing(last, last + 1) if last + 1 < len(t) else float(t[-1])
    return start, end
