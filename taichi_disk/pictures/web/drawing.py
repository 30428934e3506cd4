"""Messages for the page's drawing (draw.js): a scene once, then values and forces of
each state.

JSON cannot hold arrays: they are little-endian bytes in base64. `bundle` joins modules
for documents that cannot load any, such as a file opened from disk.
"""

from __future__ import annotations

import re
from base64 import b64encode
from dataclasses import asdict
from importlib.resources import files
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.experiments.computation.scenario import Scenario
from taichi_disk.experiments.config.sections import VideoSection
from taichi_disk.mechanics.fields import QUANTITIES, Triangles, at_points, own_values
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.pictures.render.geometry import edge_height
from taichi_disk.pictures.render.palette import THEMES, Theme, colour_map, ink, map_kind

Message = dict[str, Any]  # a part of what a page is sent, ready for JSON
# colour of what the user can drag
_ACCENT = "rgb(230, 115, 0)"
# Texts of the page for the start, a collected curve and its axes, and the controls that
# have nothing to do.
_IMPACT_LABELS = {
    "drop": "Throw",
    "collect": "Collect e(v)",
    "curve": "restitution e over the speed v [c]",
    "unused": "",
}
_LOAD_LABELS = {
    "drop": "Load",
    "collect": "Collect ξ(P)",
    "curve": "compression ξ [R] over the load P [Mc²/R]",
    "unused": "hit slow arrow",
}


def scene_message(
    scenario: Scenario, video: VideoSection, largest_force: float
) -> Message:
    """Return the argument of `Drawing.setScene`, ready for JSON.

    Args:
        video: the section whose colour, draw, theme and magnify the drawing begins
            with.
        largest_force: largest force of the wall on one point, or its estimate [M
            c^2/R]; it determines the wall's drawn edge.
    """
    lattice = scenario.lattice
    triangles = Triangles(lattice)
    indices = {
        "triangles": triangles.triangles,
        "springs": lattice.bonds,
        "outline": lattice.disk_surface,
        "edges": np.concatenate([triangles.outline, triangles.interfaces]),
        "wall_surface": lattice.wall_surface,
    }
    message = {name: encoded(each, np.uint32) for name, each in indices.items()}
    labels = _IMPACT_LABELS
    if not scenario.is_thrown:
        labels = _LOAD_LABELS
    return message | {
        "points": len(lattice.positions),
        "disk_points": lattice.disk_points,
        "rest": encoded(lattice.positions, np.float32),
        "wall": _wall(lattice, scenario.model.wall, largest_force),
        "spoke": scenario.spoke,
        "view": [float(one) for one in scenario.view],
        "labels": labels,
        "options": _options(video),
        "quantities": [_quantity(name) for name in QUANTITIES],
        "maps": _maps(),
        "themes": {name: _colours(theme) for name, theme in THEMES.items()},
    }


def _options(video: VideoSection) -> Message:
    magnify = video.magnify
    if magnify == "auto":
        magnify = 1.0
    return {
        "draw": video.draw,
        "theme": video.theme,
        "quantity": video.colour,
        "magnify": magnify,
    }


def _quantity(name: str) -> Message:
    words = asdict(QUANTITIES[name])
    del words["full"]
    return words | {"name": name, "map": map_kind(name)}


def _maps() -> dict[str, str]:
    """Return each theme's colour maps, 128 colours in RGB, by theme and kind; "bare"
    for a disk without springs."""
    maps = {}
    kinds = sorted({map_kind(name) for name in QUANTITIES})
    for theme, kind, bare in product(THEMES, kinds, ("", " bare")):
        colours = np.rint(255.0 * colour_map(theme, kind, bool(bare))[::2])
        maps[f"{theme} {kind}{bare}"] = encoded(colours, np.uint8)
    return maps


def _wall(lattice: Lattice, wall: Any, force: float) -> Message:
    kind = "elastic" if len(lattice.wall_surface) else "rigid"
    return {"kind": kind, "edge": edge_height(wall, force), "decay": wall.decay_length}


def _colours(theme: Theme) -> dict[str, str]:
    names = ("ground", "ink", "faint", "wall", "arrow", "velocity", "rule")
    colours = {name: f"rgb{ink(getattr(theme, name))}" for name in names}
    return colours | {"accent": _ACCENT}


def encoded(values: Any, kind: Any) -> str:
    """Encode `values` as little-endian numbers of a NumPy `kind` in base64."""
    return b64encode(
        np.ascontiguousarray(values, np.dtype(kind).newbyteorder("<")).tobytes()
    ).decode()


# ---- states


def colour_values(
    quantity: str,
    triangles: Triangles,
    springs: Any,
    x: Array,
    v: Array,
    of_springs: bool = False,
) -> NDArray[np.float32]:
    """Return the values that films show at the points, (n,) in the quantity's unit; for
    fringes twice the shear stress.

    Args:
        triangles: `fields.Triangles` of the lattice, made once.
        x, v: (n, 2) positions [R] and velocities [c].
        of_springs: whether to return a spring quantity's values (m,) on the springs,
            for a drawing of springs alone.
    """
    values = at_points
    if of_springs and QUANTITIES[quantity].on == "springs":
        values = own_values
    return values(quantity, triangles, springs, x, v).astype(np.float32)


def contact_forces(scenario: Scenario, x: Array, v: Array) -> NDArray[np.float32]:
    """Return the wall's force on every point in its reach, (k, 3): point, fx, fy [M
    c^2/R]."""
    model = scenario.model
    wall: Any = model.wall  # every scene has one
    points, forces = wall.contact_forces(scenario.lattice, x, v, model.springs)
    return np.column_stack([points, forces]).astype(np.float32)


# ---- modules


def source(name: str) -> str:
    """Return the text of one of this folder's files."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def bundle(*names: str) -> str:
    """Join modules of this folder into one without imports. `names`: the modules, each
    after those that it imports."""
    text = "\n".join(source(name) for name in names)
    text = re.sub(r"^import .*?;\n", "", text, flags=re.MULTILINE | re.DOTALL)
    return re.sub(
        r"^export (?=(class|const|function|async|let) )", "", text, flags=re.MULTILINE
    )


DRAWING = ("html.js", "field.js", "legend.js", "draw.js", "gestures.js")
FILM = (
    *DRAWING,
    "controls.js",
    "graphs.js",
    "results.js",
    "stepper.js",
    "colours.js",
    "again.js",
    "throws.js",
    "film.js",
)
