"""What a time integrator is made of: kicks and moves in turn."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Splitting:
    """A step of length h: v += kicks[0] h f/m, x += moves[0] h v, force, v += kicks[1] h f/m ... and a last kick.

    A step ends and the next begins with a kick by the same force: the two are made as one. The force, the only dear
    part, is computed once for each move.

    Attributes:
        order: of the error in h.
        kicks, moves: (s + 1,) and (s,) parts of h, symmetric, so that the step is reversible; each adds up to 1.
        stable: largest h omega at which an oscillator x'' = -omega^2 x stays bounded.
        damped: whether forces may depend on the velocity.
    """

    order: int
    kicks: tuple[float, ...]
    moves: tuple[float, ...]
    stable: float
    damped: bool

    @property
    def forces(self) -> int:
        """Force evaluations in a step."""
        return len(self.moves)

    @property
    def joined_kicks(self) -> tuple[float, ...]:
        """(s,) the kick before each move, the first with the last one of the step before."""
        return (self.kicks[-1] + self.kicks[0], *self.kicks[1:-1])
