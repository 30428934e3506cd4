"""The time integrators, by their names in scene files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:  # scene files are checked without Taichi
    from taichi_disk.mechanics.physics import Model

# lattices with more points solve for implicit dashpots by conjugate gradients
LARGEST_FACTORISED = 4_000


@dataclass(frozen=True)
class Integrator:
    """A step of length h: v += kicks[0] h f/m, x += moves[0] h v, force, v += kicks[1]
    h f/m ... and a last kick.

    The last kick of a step and the first kick of the next have the same force and are
    made together. The force, the only expensive part, is computed once for each move.
    With a `correction` c it is computed twice: f at x, and at x + c h^2 f/m the force
    for the kick.
    """

    name: str  # value of the key `time.integrator`
    order: int  # order of the error in h
    # (s + 1,) fractions of h, symmetric so that the step is reversible; their sum is 1
    kicks: tuple[float, ...]
    moves: tuple[float, ...]  # (s,) fractions of h, symmetric; their sum is 1
    # largest h omega at which an oscillator x'' = -omega^2 x stays bounded
    stable: float
    # Treatment of velocity-dependent forces: from a predicted velocity, implicit
    # (vector dashpots only), or not at all.
    dashpots: Literal["explicit", "implicit", "none"]
    # c of a force at x + c h^2 f/m, or 0. With it the stepped velocities are not the
    # observed ones, so a reset of the wall's boundary, which sets observed velocities
    # to zero, is impossible.
    correction: float = 0.0

    @property
    def forces(self) -> int:
        return len(self.stages)

    def takes(self, model: Model) -> bool:
        """Whether the integrator can treat all forces of `model`; implicit dashpots
        must also be useful."""
        if self.order > 2 and model.has_jumps:
            return False
        if self.correction and model.reset_interval:
            return False
        return {
            "explicit": True,
            "implicit": model.solvable,
            "none": not model.velocity_dependent,
        }[self.dashpots]

    def cost(self, points: int) -> float:
        """Estimate the cost of a step with `points` points in units of the force
        evaluation of an explicit step."""
        # The factor of implicit dashpots has some 2.5 n^(1/4) entries per point; large
        # lattices use conjugate gradients instead. Measured on one core: 2.8 at n =
        # 1,099, and 2.2 to 3.5 for conjugate gradients.
        if self.dashpots != "implicit":
            return float(self.forces)
        if points > LARGEST_FACTORISED:
            return 3.5
        return max(2.8, 0.9 + 1.9 * (points / 1000.0) ** 0.25)

    @property
    def observed_kick(self) -> float:
        """Kick [h] with the force at a step's end that turns the stepped into the
        observed velocities."""
        return self.kicks[-1] - self.correction

    @property
    def stages(self) -> tuple[tuple[float, float, float], ...]:
        """(kick [h], move [h], c) before each force; c is the factor of a shift by c
        h^2 f/m."""
        # The first kick includes the last kick of the step before.
        kicks = (self.kicks[-1] + self.kicks[0], *self.kicks[1:-1])
        stages = []
        for kick, move in zip(kicks, self.moves, strict=True):
            stages.append((kick, move, 0.0))
            if self.correction:
                stages.append((0.0, 0.0, self.correction))
        return tuple(stages)


# Leapfrog form (Hairer, Lubich & Wanner, Acta Numerica 12, 2003), the cheapest for
# errors of e above 1e-7, because then the highest lattice frequency limits the step.
# Dashpots use the predicted velocity u_k = v_{k-1/2} + h/2 f_{k-1}/m, with an error
# O(h^2), and shorten the stable step (`stability.explicit_limit`).
VELOCITY_VERLET = Integrator(
    "velocity_verlet", 2, (0.5, 0.5), (1.0,), 2.0, dashpots="explicit"
)

# Velocity Verlet with implicit dashpots: see `trapezoidal`.
TRAPEZOIDAL = replace(VELOCITY_VERLET, name="trapezoidal", dashpots="implicit")

# M. Takahashi and M. Imada, J. Phys. Soc. Jpn. 53, 3765 (1984): velocity Verlet with
# the potential
# U - h^2/24 sum(F^2/m), here without the gradient of F. To order 4 it steps X = x -
# h^2/12 a and V = v + h^2/12 da/dt of an orbit x(t). So the start sets X, and the force
# is computed at x = X + h^2/12 a(X).
TAKAHASHI_IMADA = Integrator(
    "takahashi_imada",
    4,
    (0.5, 0.5),
    (1.0,),
    sqrt(12.0),
    dashpots="none",
    correction=1.0 / 12.0,
)

INTEGRATORS = {
    each.name: each for each in (VELOCITY_VERLET, TRAPEZOIDAL, TAKAHASHI_IMADA)
}
