"""Arrows, dots and lines above a picture, drawn by Pillow with smooth edges and a rim
in the colour of the ground."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from PIL import Image, ImageDraw

from taichi_disk.mechanics.lattice import Array
from taichi_disk.mechanics.lattice.triangles import quarter_turned
from taichi_disk.pictures.render.palette import Ink

_SAMPLES = 4  # across a pixel
_TURNS = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
_CIRCLE = np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=1)
# length of an arrow's head over half its width; most of it over the arrow's length
_HEAD_LENGTH = 1.56
_MAX_HEAD = 0.65


class Mark(NamedTuple):
    """Polygons of one kind, which do not touch each other."""

    corners: Array  # (k, c, 2) [px], clockwise in the picture
    ink: Ink
    rim: float  # width of the line around each polygon [px]


def arrows(feet: Array, vectors: Array, shaft: float, head: float) -> Array:
    """Return the corners (k, 7, 2) of arrows from `feet` along `vectors` (k, 2) [px].

    `shaft`: width of the shaft, `head`: half the width of the head [px]. Short arrows
    are thinner.
    """
    length = np.hypot(*vectors.T)[:, None]
    along = vectors / length
    wing = np.minimum(head, _MAX_HEAD / _HEAD_LENGTH * length)
    aside = wing * _right(along)
    half = 0.5 * shaft / head * aside
    tip = feet + vectors
    neck = tip - _HEAD_LENGTH * wing * along
    left = [feet - half, neck - half, neck - aside]
    right = [neck + aside, neck + half, feet + half]
    return np.stack([*left, tip, *right], axis=1)


def dot(centre: Array, radius: float) -> Array:
    """Return the corners (1, c, 2) of a circle [px]."""
    return centre + radius * _CIRCLE[None]


def line(start: Array, end: Array, half: float) -> Array:
    """Return the corners (1, 4, 2) of a line that is 2 `half` wide [px]."""
    aside = half * _right(end - start)
    return np.array([[start - aside, end - aside, end + aside, start + aside]])


def _right(along: Array) -> Array:
    """Return unit vectors (..., 2) at the right of others; rows count downwards."""
    # counter-clockwise, if rows counted upwards
    across = quarter_turned(along)
    return across / np.maximum(np.hypot(*along.T), 1e-9).T[..., None]


def _grown(corners: Array, distance: float) -> Array:
    """Return polygons whose sides have moved outwards."""
    normal = -_right(np.roll(corners, -1, axis=1) - corners)
    before = np.roll(normal, 1, axis=1)
    cosine = (normal * before).sum(axis=-1, keepdims=True)
    return corners + distance * (normal + before) / (1.0 + cosine)


def stamp(image: Any, mark: Mark, ground: Ink, columns: slice) -> None:
    """Draw a mark into `columns` of Pillow's `image`."""
    outer = _grown(mark.corners, mark.rim)
    first = np.floor(outer.min(axis=(0, 1))).astype(int)
    last = np.ceil(outer.max(axis=(0, 1))).astype(int)
    left, top = first.tolist()
    width, height = (last - first).tolist()
    start = max(left, columns.start)
    end = min(left + width, columns.stop)
    if start >= end:
        return
    for corners, ink in ((outer, ground), (mark.corners, mark.ink)):
        mask = Image.new("L", (_SAMPLES * width, _SAMPLES * height))
        draw = ImageDraw.Draw(mask)
        for polygon in _SAMPLES * (corners - first):
            draw.polygon(polygon.ravel().tolist(), fill=255)
        part = mask.reduce(_SAMPLES).crop((start - left, 0, end - left, height))
        image.paste(ink, (start, top), part)
