"""Draw states and curves into finished pictures, off screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taichi_disk.computation.outcome import Outcome
from taichi_disk.lattice import Array
from taichi_disk.output.plot import (
    LINE,
    MARK,
    PANEL_HEIGHTS,
    STYLE,
    draw_curves,
    matplotlib_style,
)
from taichi_disk.render import kernels
from taichi_disk.render.geometry import Camera, View
from taichi_disk.render.legend import LEAST, Legend
from taichi_disk.render.offscreen import elsewhere, open_window
from taichi_disk.render.palette import Theme
from taichi_disk.render.video import Picture

_MARGIN = 8.0  # margin around the view, in a picture of 720 pixels [px]
_LETTER = 13.2  # size of letters in a picture of 720 pixels [px]
_FAINT = 0.2  # contrast of curves at times still to come
# line style of each run
_LINES: tuple[Any, ...] = ("solid", (0, (3, 1.5)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)))


class Pictures:
    """Pictures of one disk or of several side by side, optionally with a panel of
    curves at the right.

    An instance holds the process's only window until it is closed. Call `draw` in the
    thread that made the instance; `finish` may run in another thread. `width`: of a
    picture [px].
    """

    def __init__(
        self,
        legends: Sequence[Legend],
        size: int,
        view: View,
        supersample: float,
        panel: Panel | None = None,
    ) -> None:
        """`size`: of the picture of one disk [px], even; `supersample`: samples across
        a pixel, 1, 1.5 or 2."""
        self._legends, self._size, self._samples, self._panel = (
            legends,
            size,
            round(2 * supersample),
            panel,
        )
        # Compared disks lie at the same height, below the longest title.
        header, self._bottom = (
            max(legend.header for legend in legends),
            size - legends[0].footer,
        )
        self._unit = legends[0].unit * supersample
        width, height = (
            round(size * supersample),
            round((self._bottom - header) * supersample),
        )
        margin = _MARGIN * self._unit
        # Columns beside the view show only background and rigid wall, so they repeat
        # the last drawn column.
        seen = 2.0 * margin + Camera.fit(view, width, height, margin).scale * (
            view[1] - view[0]
        )
        self._beside = int((width - seen) / (2.0 * supersample))
        drawn = round((size - 2 * self._beside) * supersample), height
        self._camera = Camera.fit(view, *drawn, margin)
        scale = self._camera.scale / supersample
        parts = [legend.still(scale) for legend in legends]
        if len(legends) > 1:  # the disks share one row of scales
            scales = np.hsplit(
                legends[0].below(len(legends) * size, scale), len(legends)
            )
            for part, below in zip(parts, scales, strict=True):
                part[self._bottom :] = below
        self._blank = np.concatenate([*parts, panel.full] if panel else parts, axis=1)
        self.width = self._blank.shape[1]
        self._window = open_window("taichi-disk", drawn, show_window=False)

    def draw(self, states: Sequence[tuple[float, Array, Array]]) -> Picture:
        picture = self._blank.copy()
        for k, (legend, (_, x, v)) in enumerate(
            zip(self._legends, states, strict=True)
        ):
            legend.painter.paint(
                self._window.get_canvas(), self._camera, x, v, self._unit
            )
            left, drawn = (
                k * self._size + self._beside,
                self._window.get_image_buffer_as_numpy(),
            )
            kernels.shrink(
                drawn, picture, left, self._bottom, self._beside, self._samples
            )
        return picture

    def finish(
        self, picture: Picture, lines: Sequence[Sequence[str]], t: float
    ) -> Picture:
        """Draw the changing `lines` of each disk, and the panel's curves up to `t`
        [R/c], into `picture`."""
        for k, legend in enumerate(self._legends):
            legend.write(picture[:, k * self._size : (k + 1) * self._size], lines[k])
        if self._panel:
            self._panel.draw(picture[:, len(self._legends) * self._size :], t)
        return picture

    def close(self) -> None:
        with elsewhere():
            self._window.destroy()


# ---- the curves


@dataclass(frozen=True)
class Panel:
    """Curves that are drawn once; those of later times are shown faded."""

    full: Picture  # (rows, columns, 3) the complete curves
    faint: Picture  # the same, faded
    end: float  # end of the time axis, which begins at 0 [R/c]
    # first and last column, first and last row of each pair of axes
    boxes: tuple[tuple[int, int, int, int], ...]
    ink: tuple[int, ...]  # colour of the line that marks the time

    def draw(self, picture: Picture, t: float) -> None:
        for left, right, top, bottom in self.boxes:
            now = round(float(np.interp(t, (0.0, self.end), (left, right))))
            picture[top:bottom, now:] = self.faint[top:bottom, now:]
            picture[top:bottom, now] = self.ink


def side_panel(
    runs: Sequence[Outcome], names: Sequence[str], size: int, theme: Theme
) -> Panel:
    """Return the panel of curves of `runs`, `size` pixels high. With one disk the film
    has the ratio 16 : 9."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    width, dpi, letter = (
        2 * round(size * 7 / 18),
        size / 7.2,
        max(_LETTER * size / 720, LEAST),
    )
    with matplotlib_style(_style(theme, 72.0 * letter / dpi)):
        # Slightly larger, because Matplotlib rounds down.
        figure = Figure(figsize=((width + 0.1) / dpi, (size + 0.1) / dpi), dpi=dpi)
        canvas = FigureCanvasAgg(figure)
        axes = list(figure.subplots(3, 1, sharex=True, height_ratios=PANEL_HEIGHTS))
        lines = []
        for run, style in zip(runs, _LINES, strict=False):
            lines += draw_curves(axes, run.scenario, run.columns, linestyle=style)
            result = run.scenario.motion(run.columns)[0][-1]
            # below the curve
            axes[0].axhline(
                result, color=MARK, linewidth=1.0, linestyle=(0, (5, 4)), zorder=1
            )
        end = max(run.scenario.last_motion(run.columns) for run in runs)
        axes[-1].set_xlim(0.0, end)
        for ax in axes:
            ax.margins(y=0.06)
            # There is no room above an axis for its power of ten, so the label of the
            # axis contains it.
            numbers = ax.yaxis.get_major_formatter()
            numbers.format_ticks(ax.get_yticks())
            ax.yaxis.get_offset_text().set_visible(False)
            ax.set_title(
                f"{ax.get_ylabel()} {numbers.get_offset()}".replace("\n", " "),
                loc="left",
            )
            ax.set_ylabel("")
        for line in lines:
            if len(runs) > 1 and line.get_label().startswith("vibration left"):
                # without the number, which differs from run to run
                line.set_label("vibration left")
        # those of the first run
        energies = {
            line.get_label(): line for line in lines[::-1] if line.axes is axes[2]
        }
        handles = list(energies.values())[::-1]
        if len(runs) > 1:
            named = zip(names, _LINES, strict=False)
            handles += [
                Line2D([], [], color=LINE, linestyle=style, label=name)
                for name, style in named
            ]
        across, down, rows = letter / width, letter / size, (len(handles) + 1) // 2
        figure.subplots_adjust(
            5.0 * across,
            (4.2 + 1.7 * rows) * down,
            1.0 - across,
            1.0 - 2.0 * down,
            hspace=9.0 * down,
        )
        figure.legend(
            handles=handles,
            loc="lower center",
            ncols=2,
            handlelength=1.4,
            columnspacing=1.2,
        )
        canvas.draw()
        full = np.asarray(canvas.buffer_rgba())[..., :3].copy()
    extents = [ax.get_window_extent() for ax in axes]
    boxes = [(box.x0, box.x1, size - box.y1, size - box.y0) for box in extents]
    ground, ink = (
        255.0 * np.asarray(theme.ground),
        tuple(round(255 * part) for part in theme.faint),
    )
    faint = np.rint(ground + _FAINT * (full - ground)).astype(np.uint8)
    return Panel(full, faint, end, tuple(tuple(map(round, box)) for box in boxes), ink)


def _style(theme: Theme, points: float) -> dict[Any, Any]:
    sizes = {
        "font.size": points,
        "axes.titlesize": "medium",
        "legend.fontsize": "medium",
    }
    inks = dict.fromkeys(
        ("text.color", "axes.labelcolor", "xtick.color", "ytick.color"), theme.ink
    )
    grounds = {"figure.facecolor": theme.ground, "axes.facecolor": theme.ground}
    return (
        STYLE
        | sizes
        | inks
        | grounds
        | {
            "axes.edgecolor": theme.faint,
            "grid.color": theme.rule,
        }
    )
