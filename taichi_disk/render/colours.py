"""The picture's colours: a calm light ground and a diverging scale for strain, even in lightness."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Colour = tuple[float, float, float]

GROUND: Colour = (0.980, 0.980, 0.972)
INK: Colour = (0.13, 0.14, 0.16)
FAINT_INK: Colour = (0.42, 0.43, 0.46)
CONTACT: Colour = (0.93, 0.47, 0.0)  # of contact forces: neither blue nor red, and bright

# CIELAB (L*, a*, b*), D65. Both ends have the same lightness and nearly the same chroma, so that equal
# strains of either sign look equally strong; the neutral is darker than the ground, so that springs at rest
# stay visible.
_NEUTRAL = np.array([74.0, 0.0, 0.5])
_COMPRESSED = np.array([36.0, 22.0, -66.0])
_STRETCHED = np.array([36.0, 60.0, 38.0])

_WHITE = np.array([0.95047, 1.0, 1.08883])
_XYZ_TO_RGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)

# For what has no sign: pale at rest, darkening evenly to violet.
_NOTHING = np.array([82.0, 2.0, -4.0])
_MUCH = np.array([26.0, 46.0, -52.0])


def strain_colours(strain: NDArray[np.float64], limit: float) -> NDArray[np.float64]:
    """sRGB colours (..., 3) in 0..1 of strains (...): blue at -limit (compressed), grey at 0, red at +limit.

    Linear in CIELAB on either side of zero; strains beyond the limit take the colour of the limit.
    """
    s = np.clip(np.asarray(strain, dtype=np.float64) / limit, -1.0, 1.0)[..., None]
    end = np.where(s < 0.0, _COMPRESSED, _STRETCHED)
    return _lab_to_srgb(_NEUTRAL + np.abs(s) * (end - _NEUTRAL))


def amount_colours(amount: NDArray[np.float64], limit: float) -> NDArray[np.float64]:
    """sRGB colours (..., 3) in 0..1 of amounts (...) from 0, pale, to `limit`, violet; linear in CIELAB."""
    s = np.clip(np.asarray(amount, dtype=np.float64) / limit, 0.0, 1.0)[..., None]
    return _lab_to_srgb(_NOTHING + s * (_MUCH - _NOTHING))


def _lab_to_srgb(lab: NDArray[np.float64]) -> NDArray[np.float64]:
    """CIELAB to sRGB (IEC 61966-2-1), clipped to the gamut."""
    fy = (lab[..., 0] + 16.0) / 116.0
    f = np.stack([fy + lab[..., 1] / 500.0, fy, fy - lab[..., 2] / 200.0], axis=-1)
    xyz = _WHITE * np.where(f > 6.0 / 29.0, f**3, (f - 4.0 / 29.0) * 3.0 * (6.0 / 29.0) ** 2)
    linear = np.clip(xyz @ _XYZ_TO_RGB.T, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    return np.clip(encoded, 0.0, 1.0)
