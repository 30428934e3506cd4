"""Rich output for notebook cells: figures, tables with a figure, films."""

from __future__ import annotations

import sys
from base64 import b64encode
from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from taichi_disk.base.errors import TaichiDiskError, pip_install

if TYPE_CHECKING:
    from pandas import DataFrame

KINDS = {
    "mp4": "video/mp4",
    "webm": "video/webm",
    "gif": "image/gif",
    "png": "image/png",
}
FRAME = "width: 100%; height: 640px; border: 0"  # style of an HTML film
# width of a figure beside a table [px], at which its labels are as large as the text
CARD_WIDTH = 560.0


class Plot(Figure):
    """A Matplotlib figure that a notebook shows without pyplot."""

    def savefig(self, *arguments: Any, **options: Any) -> None:
        # publishers refuse fonts of Matplotlib's default type, 3
        with rc_context({"pdf.fonttype": 42, "ps.fonttype": 42}):
            super().savefig(*arguments, **options)

    def _repr_png_(self, dpi: float | str = "figure") -> bytes:
        buffer = BytesIO()
        self.savefig(buffer, format="png", dpi=dpi)
        return buffer.getvalue()


def registered(figure: Any) -> Any:
    """Give a figure to pyplot, if a script has imported it, for `plt.show()` and
    `plt.savefig()`. Notebooks show the figure itself."""
    pyplot = sys.modules.get("matplotlib.pyplot")
    if pyplot and not {"ipykernel", "marimo"} & sys.modules.keys():
        pyplot.figure(FigureClass=lambda **_: figure)
    return figure


@dataclass(frozen=True)
class Film:
    """A film or picture with the bytes of its file, so that a notebook keeps it when it
    moves to another machine."""

    data: bytes
    kind: str

    def __repr__(self) -> str:
        return f"Film({self.kind}, {len(self.data) / 1e3:.0f} kB)"

    def _repr_html_(self) -> str:
        if self.kind == "html":
            return (
                f'<iframe style="{FRAME}"'
                f' srcdoc="{escape(self.data.decode())}"></iframe>'
            )
        source = f'style="max-width: 100%" src="{_inline(self.data, self.kind)}"'
        if self.kind in ("mp4", "webm"):
            return f"<video controls loop {source}></video>"
        return f"<img {source}>"


def dataframe(data: Any, otherwise: str) -> DataFrame:
    """Return `data` as a pandas table. Raises TaichiDiskError without pandas; the
    message recommends `otherwise`."""
    try:
        from pandas import DataFrame
    except ImportError as error:
        raise TaichiDiskError(
            f"no table, because of {error}: {pip_install('pandas')}; or use"
            f" `{otherwise}`"
        ) from None
    return DataFrame(data)


def card(
    title: str,
    rows: Iterable[tuple[str, ...]],
    figure: Plot | None,
    warnings: Iterable[str],
) -> str:
    body = "".join(map(_table_row, rows))
    table = f"<div><b>{escape(title)}</b><table {_LEFT}>{body}</table></div>"
    image = ""
    if figure:
        # sharp on high-density screens
        data = figure._repr_png_(2.0 * CARD_WIDTH / figure.get_figwidth())
        image = (
            f'<img style="width: {CARD_WIDTH:g}px; max-width: 100%"'
            f' src="{_inline(data, "png")}">'
        )
    below = "".join(f"<p>warning: {escape(text)}</p>" for text in warnings)
    style = "display: flex; flex-wrap: wrap; gap: 2em"
    return f'<div style="{style}">{table}{image}</div>{below}'


def _table_row(cells: Iterable[str]) -> str:
    row = "".join(f"<td {_LEFT}>{escape(cell)}</td>" for cell in cells)
    return f"<tr>{row}</tr>"


_LEFT = 'style="text-align: left; padding: 0.1em 0.8em 0.1em 0; white-space: nowrap"'


def _inline(data: bytes, kind: str) -> Any:
    return f"data:{KINDS[kind]};base64,{b64encode(data).decode()}"
