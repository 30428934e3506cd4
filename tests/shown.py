"""What pictures show, as text that is compared with a recording in tests/looks.

Colours have the names that colours.txt explains, words of pictures their place relative
to the line above, and marks and meshes are measured in R: so a meant change rewrites
few lines. `pytest --record FILE` writes the recordings of the tests in a file anew;
CONTRIBUTING.md names these files. Then read the differences (`git diff tests/looks`),
and look at the pictures.
"""

import base64
import re
from collections import defaultdict
from difflib import unified_diff
from itertools import groupby
from pathlib import Path

import numpy as np
from matplotlib.colors import to_hex, to_rgb
from matplotlib.text import Text

from taichi_disk.pictures.curves import ENERGIES, FORCE
from taichi_disk.pictures.render.palette import THEMES

LOOKS = Path(__file__).with_name("looks")
DIGITS = str.maketrans("123456789", "000000000")
NUMBER = re.compile(r"-?\d+\.?\d*(?:e[-+]\d+)?")
COLOUR = re.compile(r"#[0-9a-fA-F]{6}|rgb\(\d+, \d+, \d+\)|\((?:[\d.]+, ){2}[\d.]+\)")
PARTS = ("ground", "ink", "faint", "wall", "arrow", "velocity", "rule")


def colours():
    """Yield the name of each colour, and its values on light and dark ground."""
    light, dark = THEMES.values()
    for name in PARTS:
        yield name, to_hex(getattr(light, name)), to_hex(getattr(dark, name))
    for look in (FORCE, *ENERGIES):
        yield f"curve of {look.name or 'force'}", *map(str.lower, look.colours)


NAMES = {}
for part, *values in colours():
    for ground, value in zip(THEMES, values, strict=True):
        NAMES.setdefault(value, f"{part} on {ground}")


def with_names(text):
    """Return a text with the names of the colours in it."""
    return COLOUR.sub(_named, text)


def _named(found):
    """Return the name of a colour in a text, or the colour as it stands there."""
    text = found[0]
    if text.startswith("#"):
        return NAMES.get(text.lower(), text)
    parts = np.array([float(one) for one in re.findall(r"[\d.]+", text)])
    if "." not in text:
        parts /= 255.0
    if parts.max() > 1.0:
        return text
    return NAMES.get(to_hex(to_rgb(parts)), text)


def differences(found, known):
    """Return the lines of `found` that say something else than those of `known`. As
    processors round, the last digit of a number with a point may differ by two."""
    lines = [found.splitlines(), known.splitlines()]
    if len(lines[0]) != len(lines[1]):
        return [*unified_diff(*reversed(lines), "known", "found", n=0, lineterm="")]
    return [
        f"{new}\ninstead of\n{old}"
        for new, old in zip(*lines, strict=True)
        if not _is_close(new, old)
    ]


def _is_close(new, old):
    if NUMBER.sub(_form, new) != NUMBER.sub(_form, old):
        return False
    pairs = zip(NUMBER.findall(new), NUMBER.findall(old), strict=True)
    return all(
        abs(float(a) - float(b)) <= min(_allowed(a), _allowed(b)) for a, b in pairs
    )


def _form(number):
    """Return how a number is written, without its digits."""
    return re.sub(r"-?\d+(?=\.|$|e)|(?<=e).*", "#", number[0]).translate(DIGITS)


def _allowed(text):
    mantissa, _, exponent = text.partition("e")
    _, point, decimals = mantissa.partition(".")
    if not point:
        return 0.0
    return 2.01 * 10.0 ** (int(exponent or 0) - len(decimals))


def check(name, lines, is_recording):
    """Compare `lines` with a recording, or write it."""
    path = LOOKS / f"{name}.txt"
    lines = [with_names(line) for line in lines]
    known = ""
    if path.exists():
        known = with_names(path.read_text(encoding="utf-8"))
    if is_recording:
        known = "\n".join(_keep(lines, known)) + "\n"
        path.write_text(known, encoding="utf-8")
    found = differences("\n".join(lines), known)
    assert not found, "\n".join(found)


def _keep(lines, known):
    """Return `lines`, where they say the same as a line of `known` as it stands there,
    so that a recording that is made anew does not follow rounding errors."""
    known_lines = defaultdict(list)
    for line in known.splitlines():
        known_lines[NUMBER.sub(_form, line)].append(line)
    kept = []
    for line in lines:
        alike = known_lines[NUMBER.sub(_form, line)]
        kept.append(next((old for old in alike if _is_close(line, old)), line))
    return kept


def digest(values):
    """Return shape and largest of numbers; over it bounds, mean, and an ordered sum."""
    values = np.asarray(values, dtype=float)
    flat = values[np.isfinite(values)]
    shape = "x".join(map(str, values.shape))
    largest = np.abs(flat).max(initial=0.0)
    if largest == 0.0:
        return f"{shape} of 0"
    flat = flat / largest
    order = np.cos(np.arange(flat.size)) @ flat
    parts = (flat.min(), flat.max(), flat.mean(), order)
    return f"{shape} of {number(largest)}: {' '.join(f'{z:.4f}' for z in parts)}"


def number(value):
    """Return a number with four digits; what is smaller than 1e-9 is 0."""
    value = float(f"{value:.6g}")  # rounding errors decide about no digit and no form
    if abs(value) < 1e-9:
        return "0"
    text = f"{value:.3e}"
    if 0.01 <= abs(value) < 1e4:
        digits = 3 - int(np.floor(np.log10(abs(value))))
        text = f"{value:#.{max(digits, 0)}f}"
    return text


def numbers(values):
    return " ".join(number(one) for one in np.ravel(values))


def of_lines(lines, letters, larger=0.0):
    """Yield the words of a picture: their text, face and colour, the column to which
    they are aligned [px] and by which part of them, and how far below the line before
    they stand, over the size of the larger letters. `larger`: letters to which the
    first line makes room."""
    faces = {}
    for name in ("heading", "motion", "text", "small"):
        faces.setdefault(getattr(letters, name).size, name)
    above = letters.margin
    for line in lines:
        size = line.face.size
        face = faces.get(size) or f"{size / letters.heading.size:.2f} headings"
        if line.face.bold:
            face += " bold"
        below = (line.baseline - above) / max(size, larger)
        place = f"{line.x:.1f} ({line.part:.1f}), {below:.2f} below"
        yield f"{line.text!r} {face} {line.face.ink} at {place}"
        above = line.baseline
        larger = size


# ---- messages


def short(value, name=""):
    """Return a message with digests in the place of numbers and bytes."""
    if isinstance(value, dict):
        return {key: short(each, key) for key, each in value.items()}
    if isinstance(value, list) and {type(one) for one in value} <= {int, float}:
        return digest(np.where(np.abs(value) < 1e-9, 0.0, value))  # no rounding errors
    if isinstance(value, list):
        return [short(one) for one in value]
    if isinstance(value, str) and len(value) > 80 and " " not in value:
        kind = {"rest": "<f4"}.get(name, "<u4")
        kind = "u1" if " " in name else kind  # of a map of colours
        return digest(np.frombuffer(base64.b64decode(value), kind))
    return number(value) if isinstance(value, float) else value


# ---- figures of Matplotlib


def of_figure(figure):
    """Yield what a figure shows, and where [pt]: within two points, because versions
    of Matplotlib measure letters otherwise."""
    yield f"figure {numbers(figure.get_size_inches())} {figure.dpi:g} dpi"
    for text in filter(None, (figure._suptitle, figure._supxlabel)):
        yield _of_text("title", text)
    for ax in figure.axes:
        yield from _of_axes(ax)
    for legend in figure.legends:
        yield from _of_legend(legend)


def points(figure, pixels):
    """Return places on a figure [pt], of which letters change no digit."""
    unit = 72.0 / figure.dpi
    if figure.figure.get_layout_engine():
        unit /= 6.0
    return " ".join(f"{unit * one:.0f}." for one in np.ravel(pixels))


def _of_axes(ax):
    figure = ax.figure
    box = points(figure, ax.get_window_extent().extents)
    parts = [f"axes {box} {to_hex(ax.get_facecolor())}"]
    for name, axis in (("x", ax.xaxis), ("y", ax.yaxis)):
        low, high = sorted(axis.get_view_interval())
        shown = [one for one in axis.get_ticklabels() if one.get_visible()]
        places = axis.get_majorticklocs()
        ticks = [
            one.get_text()
            for one, place in zip(shown, places, strict=False)
            if low <= place <= high and "$" not in one.get_text()
        ]
        scale = f"{axis.get_scale()} {numbers([low, high])}"
        parts.append(f"{name} {scale} ticks {ticks}")
        grid = [line for line in axis.get_gridlines() if line.get_visible()]
        for line in grid[:1]:
            parts[-1] += f" grid {to_hex(line.get_color())} {line.get_linewidth():.3g}"
        if axis.label.get_text():
            parts.append(_of_text(f"{name} label", axis.label))
    yield "; ".join(parts)
    titles = [ax.get_title(where) for where in ("left", "center", "right")]
    for text in ax.findobj(Text):
        if text.get_text() in filter(None, titles):
            yield "  " + _of_text("title", text)
    for label, styles in groupby(ax.lines, _style):
        data = [line.get_xydata() for line in styles]
        x, y = np.vstack(data).T
        yield f"  {label} {digest(x)}; {digest(y)}"
    yield from dict.fromkeys(f"  {_of_collection(one)}" for one in ax.collections)
    for patch in ax.patches:
        colour = to_hex(patch.get_facecolor())
        bounds = points(figure, patch.get_window_extent().extents)
        yield f"  patch {colour} {bounds} above {patch.get_zorder():g}"
    for text in ax.texts:
        yield "  " + _of_text("text", text)
    if ax.get_legend():
        yield from _of_legend(ax.get_legend())


def _style(line):
    name = line.get_label()
    if name.startswith("_"):  # by Matplotlib
        name = ""
    colour = to_hex(line.get_color())
    style = f"{line.get_linestyle()} {line.get_linewidth():.3g}"
    marker = f"{line.get_marker()} {line.get_markersize():.3g}"
    return f"curve {name!r} {colour} {style} {marker} {line.get_clip_on()}"


def _of_collection(one):
    name = type(one).__name__
    data = ""
    if one.get_array() is not None:
        colours = one.cmap(np.linspace(0.0, 1.0, 50))
        data = f"{digest(one.get_array())} from {numbers(one.get_clim())}"
        data += f" in {digest(colours)}"
    paths = [path.vertices for path in one.get_paths()]
    place = digest(np.concatenate([np.zeros((0, 2)), *paths]))
    return f"{name} {numbers(one.get_linewidths())} {data} {place}"


def _of_text(name, text):
    colour = to_hex(text.get_color())
    pixels = text.get_transform().transform(text.get_position())
    place = points(text.figure, pixels)
    aligned = f"{text.get_ha()} {text.get_va()} {text.get_fontweight()}"
    return (
        f"{name} {text.get_text()!r} {colour} {text.get_size():.3g} {aligned} {place}"
    )


def _of_legend(legend):
    texts = legend.get_texts()
    places = np.array([text.get_window_extent().min for text in texts])
    columns = len(np.unique(places[:, 0].round()))
    first = points(legend.figure, places[0])
    words = [f"{text.get_text()!r} {to_hex(text.get_color())}" for text in texts]
    letter = f"{texts[0].get_size():.3g}"
    yield f"  legend {columns} columns from {first} letter {letter}: {', '.join(words)}"
