"""Continuum laws for the disk: compression, the quasi-static impact, and the paper's closed forms.

Units: disk mass M = radius R = reference speed c = 1, so the density is 1/pi. E and nu are the lattice's own
two-dimensional (plane stress) moduli. Equation numbers are those of Kuninaka and Hayakawa's paper. Its
E_* = E/(1 - nu^2) is right for plane strain; for a sheet free to thin it is E, and that belongs in `e_star`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def paper_compression(pressure: ArrayLike, young: ArrayLike, poisson: ArrayLike, b: ArrayLike = 1.0) -> Array:
    """Eq. (2): xi = b P/(pi E) {ln(4 pi E R/(b P)) - 1 - nu} [R]."""
    p = np.asarray(b, float) * pressure / (np.pi * np.asarray(young, float))
    return np.asarray(p * (np.log(4.0 / p) - 1.0 - np.asarray(poisson)))


def exact_compression(pressure: ArrayLike, young: ArrayLike, poisson: ArrayLike) -> Array:
    """xi = P/(pi E) {ln(pi E R/P) - (1 + nu)/4} [R]: a disk under a uniform body force P, on one contact.

    xi is measured from the centre of mass. From Michell's series for the disk and Hertz's pressure in the
    contact (Johnson, Contact Mechanics, 1985, section 5.6, treats two contacts); exact to O(P/E) relative.
    """
    p = np.asarray(pressure, float) / (np.pi * np.asarray(young, float))
    return np.asarray(p * (np.log(1.0 / p) - 0.25 * (1.0 + np.asarray(poisson))))


def hertz_contact_time(velocity: ArrayLike, sound_speed: float = 1.0) -> Array:
    """pi (R/c) sqrt(ln(4 c/v)) [R/c], below eq. (4); `sound_speed` is its c, sqrt(E/rho) of the material."""
    return np.asarray(np.pi / sound_speed * np.sqrt(np.log(4.0 * sound_speed / np.asarray(velocity, float))))


def paper_restitution(velocity: ArrayLike, d1: float, d2: float, sound_speed: float = 1.0) -> Array:
    """Eq. (5): e = d1 sqrt(1 - d2/sqrt(ln(4 c/v))), 0 where the root has no real value."""
    inner = 1.0 - d2 / np.sqrt(np.log(4.0 * sound_speed / np.asarray(velocity, float)))
    return np.asarray(d1 * np.sqrt(np.maximum(inner, 0.0)))


def paper_d2(tau0: float, e_star: float, sound_speed: float) -> float:
    """d2 = 2 pi tau0 E_*/(rho R c) below eq. (5), rho = 1/pi with c in it as the unit of velocity.

    For c = sqrt(E_*/rho) it is twice what eq. (4) itself gives to first order in tau0.
    """
    return 2.0 * math.pi**2 * tau0 * e_star / sound_speed


@dataclass(frozen=True)
class QuasistaticImpact:
    """An impact after eq. (4): restitution, contact time [R/c] and largest compression [R]."""

    restitution: float
    contact_time: float
    compression: float


def quasistatic_impact(velocity: float, tau0: float, e_star: float, rtol: float = 1e-9) -> QuasistaticImpact:
    """Integrates eq. (4), xi'' = -pi E_* (xi + tau0 xi')/ln(4/xi), from xi = 0, xi' = v [c] until separation.

    Separation is where the force has fallen to zero, xi + tau0 xi' = 0: contact does not pull. Integrating on
    to xi = 0 would change e by O(tau0^2). `tau0` [R/c], `e_star` [M c^2/R^2].
    Raises ValueError where the disk would be crushed, xi = 4 R/e (there the law's stiffness ends to make sense).
    """
    from scipy.integrate import solve_ivp

    stiffness = math.pi * e_star
    deepest = 4.0 / math.e / velocity

    def rate(_t: float, y: Array) -> list[float]:
        z, w = y  # xi/v and xi'/v: of order one at any speed
        if z <= 0.0:
            return [w, 0.0]
        return [w, -stiffness * (z + tau0 * w) / (math.log(4.0 / velocity) - math.log(min(z, deepest)))]

    def force(_t: float, y: Array) -> float:
        return float(y[0] + tau0 * y[1])

    def turning(_t: float, y: Array) -> float:
        return float(y[1])

    force.terminal, force.direction = True, -1.0  # type: ignore[attr-defined]
    end = 100.0 * math.sqrt(math.log(4.0 / min(velocity, 1.0)) / stiffness) * (1.0 + tau0 * math.sqrt(stiffness))
    motion = solve_ivp(
        rate,
        (0.0, end),
        [0.0, 1.0],
        "DOP853",
        events=(force, turning),
        rtol=rtol,
        atol=1e-3 * rtol,
        max_step=0.02 * end,
    )
    if not motion.t_events[0].size or motion.y_events[1][0][0] >= deepest:
        raise ValueError(
            f"eq. (4) has no impact at v = {velocity:g} c, tau0 = {tau0:g} R/c, E_* = {e_star:g} M c^2/R^2"
        )
    return QuasistaticImpact(
        restitution=float(-motion.y_events[0][0][1]),
        contact_time=float(motion.t_events[0][0]),
        compression=float(velocity * motion.y_events[1][0][0]),
    )


def quasistatic_restitution(velocity: ArrayLike, tau0: float, e_star: float) -> Array:
    """e of eq. (4) for each velocity [c]."""
    return np.array([quasistatic_impact(float(v), tau0, e_star).restitution for v in np.atleast_1d(velocity)])


def first_order_loss(velocity: float, e_star: float) -> float:
    """(1 - e)/tau0 of eq. (4) for tau0 -> 0 [c/R]: the dissipated power summed over the elastic impact.

    (1 - e) = (2 tau0/v^2) int_0^xi_max pi E_*/ln(4/xi) sqrt(v^2 - 2 U) dxi, U' = pi E_* xi/ln(4/xi).
    """
    from scipy.integrate import quad
    from scipy.optimize import brentq

    log = math.log(4.0 / velocity)

    def slope(z: float) -> float:  # of the scaled potential 2 U/v^2 at xi = v z
        return 2.0 * math.pi * e_star * z / (log - math.log(z)) if z > 0.0 else 0.0

    def twice_potential(z: float) -> float:
        return float(quad(slope, 0.0, z, epsabs=1e-13, epsrel=1e-11)[0])

    bound = 1.0
    while twice_potential(bound) < 1.0:
        bound *= 2.0
    deepest = brentq(lambda z: twice_potential(z) - 1.0, 0.0, bound, xtol=1e-13)

    def power(s: float) -> float:  # z = deepest (1 - s^2), so that the root's end is smooth
        z = deepest * (1.0 - s * s)
        if z <= 0.0:
            return 0.0
        return math.sqrt(max(1.0 - twice_potential(z), 0.0)) / (log - math.log(z)) * 2.0 * deepest * s

    return 2.0 * math.pi * e_star * float(quad(power, 0.0, 1.0, epsabs=1e-10, epsrel=1e-8)[0])
