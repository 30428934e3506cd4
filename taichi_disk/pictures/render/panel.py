"""What the curves beside the disk in a film show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from taichi_disk.pictures.panel import PanelScene, factored
from taichi_disk.pictures.plot import axis_labels, curves
from taichi_disk.pictures.render.letters import Letters
from taichi_disk.pictures.render.moments import Run, curve_span
from taichi_disk.pictures.render.palette import THEMES

_WIDTH = 7 / 9  # over the height: with one disk, a film is 16 : 9
_COMING = {"light": "#B8B8B7", "dark": "#54575E"}
_LETTER = 20.0  # size of letters in a picture of 720 pixels [px]


def panel_scene(run: Run, letters: Letters) -> PanelScene:
    theme = letters.theme
    size = 2 * round(letters.height * _WIDTH / 2), letters.height
    # Twice as many samples as columns are enough, and quick to send.
    times = np.linspace(*curve_span(run), 2 * size[0])
    shown = []
    labels = []
    for panel, label in enumerate(axis_labels(run.scenario.words)):
        group = [
            one for one in curves(run.scenario, run.series) if one.look.panel == panel
        ]
        largest = max(float(np.abs(one.values).max()) for one in group)
        text, unit = factored(label, largest)
        labels.append(text)
        for one in group:
            # before t = 0 a curve is constant
            values = np.interp(times, run.series["t"], one.values / unit)
            shown.append(replace(one, values=values.astype(np.float32)))
    return PanelScene(
        t=times,
        curves=shown,
        labels=labels,
        time_label=run.scenario.words.time,
        size=size,
        letter=letters.size(_LETTER),
        ground=int(theme == "dark"),
        colours=vars(THEMES[theme]) | {"coming": _COMING[theme]},
    )
