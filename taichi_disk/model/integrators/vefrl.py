"""Velocity-extended Forest-Ruth-like composition: order 4, symplectic, four force evaluations a step, no dashpots.

I. P. Omelyan, I. M. Mryglod and R. Folk, Comput. Phys. Commun. 146, 188 (2002). For errors of e below 1e-7, where it
needs fewer forces than velocity Verlet: at 0.95 of the stability limit the error of e is 4e-9 for 2.3 times the cost of
velocity Verlet at its own limit. Among compositions of order 4 it has the widest stable step per force, 0.87/omega
(PEFRL 0.75, Suzuki 0.54, Forest-Ruth 0.52, the Runge-Kutta-Nystroem method of Blanes and Moan 0.53), and here
stability, not accuracy, sets the step.
"""

from __future__ import annotations

from taichi_disk.model.integrators.splitting import Splitting

_XI, _LAMBDA, _CHI = 0.1644986515575760, -0.02094333910398989, 1.235692651138917
_OUTER = 0.5 * (1.0 - 2.0 * _LAMBDA)

VEFRL = Splitting(
    order=4,
    kicks=(_XI, _CHI, 1.0 - 2.0 * (_CHI + _XI), _CHI, _XI),
    moves=(_OUTER, _LAMBDA, _LAMBDA, _OUTER),
    stable=3.4696,
    damped=False,
)
