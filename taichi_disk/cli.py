"""The command line: arguments in, exit status out. Each command is one function that imports what it needs.

Exit status: 0 done; 1 the computation or the film failed; 2 bad input or usage; 130 interrupted.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, NoReturn

from taichi_disk import BEGAN, __version__
from taichi_disk.config.sections import VideoSection
from taichi_disk.config.tree import shipped_scenes
from taichi_disk.errors import InputError, TaichiDiskError
from taichi_disk.machine import cores
from taichi_disk.progress import print_result, terminal
from taichi_disk.signals import INTERRUPTED, raise_if_interrupted

_TRAJECTORIES = ("xyz", "gsd", "vtu", "npz")


def main(argv: Sequence[str] | None = None) -> int:
    """Carry out one command. Raises SystemExit, as argparse does, on --help, --version and usage errors."""
    # Libraries' warnings are for their developers; as errors (PYTHONWARNINGS=error) they would end a run.
    warnings.simplefilter("ignore")
    try:
        parser = _parser()
        given = list(sys.argv[1:] if argv is None else argv)
        if not given:
            parser.print_help()
            return 0
        arguments = parser.parse_args(given)
        raise_if_interrupted()
        status: int = arguments.command(arguments)
        if sys.stdout is not None:  # it may be closed
            sys.stdout.flush()
        return status
    except TaichiDiskError as error:
        _print_error(f"error: {error}")
        return error.exit_status
    except KeyboardInterrupt:
        _print_error("interrupted")
        return INTERRUPTED
    except (MemoryError, RuntimeError) as error:
        if not isinstance(error, MemoryError) and "memory" not in str(error):
            raise
        _print_error("error: not enough memory; take fewer points (lattice.points), or stop other programs")
        return 1
    except OSError as error:
        if not isinstance(error, BrokenPipeError):  # the reader has gone (| head)
            _print_error(f"error: {error.strerror or error}")
        return 1


def _print_error(text: str) -> None:
    """On stderr, if there is one; the library speaks of arguments, which are options here."""
    text = text.replace("as `out`", "with --out").replace("overwrite=True", "--overwrite")
    text = text.replace("lattices=", "--lattices ")
    with suppress(OSError, ValueError, AttributeError):
        print(text, file=sys.stderr, flush=True)


def _note(text: str) -> None:
    _print_error(f"note: {text}")


def _load(arguments: argparse.Namespace, what: str = "scene") -> Any:
    """The scene or sweep that was asked for."""
    from taichi_disk import scenes

    load = {"scene": scenes.load_scene, "sweep": scenes.load_sweep, "any": scenes.load_any}[what]
    return load(arguments.scene, arguments.overrides)


def _out(arguments: argparse.Namespace, suffix: str = "") -> Path:
    """The folder that was asked for, else out/NAME, after the scene file's name."""
    scene = Path(arguments.scene)
    named = scene.suffix in (".yaml", ".yml") and scene.stem.strip(".")  # ...yaml: out/.. would be no folder in out
    return arguments.out or Path("out", (scene.stem if named else scene.name) + suffix)


# ---- commands: each imports what it needs, once its scene is known to be right


def _run(arguments: argparse.Namespace) -> int:
    scene = _load(arguments)

    from taichi_disk.api import run

    with terminal(sys.stderr) as progress:
        result = run(
            scene,
            _out(arguments),
            video=arguments.video,
            export=arguments.export,
            overwrite=arguments.overwrite,
            count_on=arguments.out is None,
            force=arguments.force,
            threads=arguments.threads,
            lattices=arguments.lattices,
            progress=progress,
            say=_note,
            started=perf_counter() - BEGAN,
        )
    assert result.out is not None
    print_result(result.summary, result.scenario.labels, result.out)
    for text in result.summary.get("notes", ()):
        _note(text)
    if "video_error" in result.summary:
        _print_error(f"error: {result.summary['video_error']}")
        return 1
    return 0


def _sweep(arguments: argparse.Namespace) -> int:
    sweep = _load(arguments, "sweep")

    from taichi_disk.sweep.sweep import print_sweep, run_sweep

    names = ("jobs", "scheduler", "part", "estimate")
    with terminal(sys.stderr) as progress:
        options = {name: getattr(arguments, name) for name in names}
        result = run_sweep(sweep, _out(arguments), progress=progress, say=_note, **options)
    print_sweep(result)
    return 1 if result.failed else 0


def _view(arguments: argparse.Namespace) -> int:
    from taichi_disk.scenes import shipped_scenes
    from taichi_disk.window.app import view

    folder = Path(arguments.scene).is_dir() and arguments.scene not in shipped_scenes()
    if folder and arguments.overrides:
        raise InputError("--set: a folder's scenes are viewed as they are; name one of them")
    scene = Path(arguments.scene) if folder else _load(arguments)
    out, host = arguments.out or Path("out/view"), arguments.host or "127.0.0.1"
    view(scene, out, arguments.window, host, arguments.port or 0, arguments.open)
    return 0


def _render(arguments: argparse.Namespace) -> int:
    from taichi_disk.api import Result
    from taichi_disk.render.film import check_target

    if arguments.out:
        check_target(arguments.out)
        if arguments.format not in (None, arguments.out.suffix[1:] or "png"):
            text = f"--format {arguments.format}: {arguments.out} is another format; leave one of the two out"
            raise InputError(text)
    given = {name: getattr(arguments, name) for name in VideoSection.schema()}
    overrides = [f"video.{name}={str(value).lower()}" for name, value in given.items() if value is not None]
    with terminal(sys.stderr) as progress:
        load = partial(Result.load, progress=progress, estimate=False, say=_note)
        result, *others = load(arguments.folder, overrides), *map(load, arguments.compare)
        name, form = "comparison" if others else "render", result.scene.video.format
        out = arguments.out or arguments.folder / (name if form == "png" else f"{name}.{form}")
        result.film(out, others, progress, at=arguments.at, start=arguments.start, end=arguments.end)
    print(f"{'picture' if out.suffix == '.png' else 'film'} in {out}")
    return 0


def _export(arguments: argparse.Namespace) -> int:
    from taichi_disk.api import Result

    form = arguments.format or (None if arguments.out else "xyz")
    result = Result.load(arguments.folder, say=_note)
    out = result.export(arguments.out or arguments.folder, form, arguments.frames, arguments.times)
    print(f"trajectory in {out}")
    return 0


def _check(arguments: argparse.Namespace) -> int:
    from taichi_disk.scenes import check_feasible

    scene = _load(arguments, "any")
    check_feasible(scene)
    print(scene.to_yaml(), end="")
    return 0


def _accuracy(arguments: argparse.Namespace) -> int:
    scene = _load(arguments)

    from taichi_disk.accuracy.study import study

    name = " ".join([Path(arguments.scene).stem, *arguments.overrides])
    study(scene, _out(arguments, "_accuracy"), name, _note)
    return 0


def _doctor(arguments: argparse.Namespace) -> int:
    from taichi_disk.doctor import examine

    return 0 if examine() else 1


# ---- arguments


class _Parser(argparse.ArgumentParser):
    """Says how keys are set where somebody tries it as an option."""

    def error(self, message: str) -> NoReturn:
        if "unrecognized arguments" in message:
            message += "; a key of the scene is changed by --set SECTION.KEY=VALUE, as --set material.eta_star=30"
        super().error(message)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="taichi-disk",
        description="Simulate, measure and film a two-dimensional elastic disk of mass points and springs.",
    )
    parser.add_argument("--version", action="version", version=f"taichi-disk {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=_Parser)

    def command(name: str, act: Callable[[argparse.Namespace], int], summary: str) -> argparse.ArgumentParser:
        one: argparse.ArgumentParser = commands.add_parser(
            name, help=summary, description=summary[0].upper() + summary[1:] + "."
        )
        one.set_defaults(command=act)
        return one

    add = command("run", _run, "simulate a scene, write results and film, print the result").add_argument
    _add_scene(add)
    add("--out", type=_path, metavar="DIR", help="where the results go (default: out/SCENE)")
    add("--overwrite", action="store_true", help="replace another run in DIR")
    add("--no-video", dest="video", action="store_false", help="make no film")
    add("--export", choices=_TRAJECTORIES, help="also write a trajectory")
    what = "CPU threads, of 50,000 points and more (default: TAICHI_DISK_THREADS, else all cores)"
    add("--threads", type=partial(_count, most=cores()), metavar="N", help=what)
    add("--force", action="store_true", help="take a time step even beyond the stable limit")
    what = "random lattices for the result's mean and scatter; 1: the scene's alone (default: 8 if quick)"
    add("--lattices", type=partial(_count, most=10_000), metavar="K", help=what)

    add = command("sweep", _sweep, "compute every scene of a sweep: table, fits and figure; resumable").add_argument
    _add_scene(add, _shipped(swept=True))
    add("--out", type=_path, metavar="DIR", help="where the results go (default: out/SCENE)")
    add("--jobs", type=_count, metavar="N", help="processes (default: one for each core)")
    add("--scheduler", metavar="ADDRESS", help="of a Dask cluster that computes instead, tcp://HOST:8786")
    add("--part", metavar="K/N", help="compute the K-th of N shares only, and no table")
    add("--estimate", action="store_true", help="estimate each result's time-step error: twice the work")

    add = command("view", _view, "play with a scene on a page in the browser, or in a window").add_argument
    _add_scene(add, f"{_shipped()}; or a folder of scenes", nargs="?", default="exponential_wall")
    add("--no-open", dest="open", action="store_false", help="print the address of the page only")
    add("--host", help="where to serve the page (default: 127.0.0.1, for this machine alone)")
    add("--port", type=partial(_count, most=65_535), metavar="P", help="of the server (default: one that is free)")
    where = commands.choices["view"].add_mutually_exclusive_group()
    where.add_argument("--browser", action="store_true", help="serve the page, as is the default")
    where.add_argument("--window", action="store_true", help="open a window of the desktop instead; needs Vulkan")
    add("--out", type=_path, metavar="DIR", help="for files that the window saves (default: out/view)")

    add = command("render", _render, "film a finished run again, or up to four of them side by side").add_argument
    add("folder", type=_path, metavar="DIR", help="what `run` wrote")
    compare = "other runs, at most three, to be shown at the right; what sets them apart is written above each"
    add("--compare", type=_path, nargs="+", default=[], metavar="DIR", help=compare)
    what = ".mp4, .webm, .gif; .html for a page that plays the film, and needs no internet; .png for one picture; or a "
    add("--out", type=_path, metavar="FILE", help=what + "folder for many (default: render or comparison in DIR)")
    at = "moment of a picture: a time in R/c, contact (the first), end, or greatest (compression; the default)"
    add("--at", default="greatest", metavar="T", help=at)
    add("--from", dest="start", metavar="T", help="where a film begins, a moment as for --at (default: the start)")
    add("--to", dest="end", metavar="T", help="where a film ends (default: the end of the run)")
    for name, key in VideoSection.schema().items():  # which also checks what is given
        if key.kind is bool:
            add(f"--{name}", action=argparse.BooleanOptionalAction, help=key.meaning)
        else:
            listed = f"{key.meaning}: {', '.join(key.words)}" if key.words else key.meaning
            add(f"--{name}", metavar="WHAT" if key.words else "N", help=listed)

    export = command("export", _export, "write the trajectory of a finished run for another program")
    add, when = export.add_argument, export.add_mutually_exclusive_group().add_argument
    add("folder", type=_path, metavar="DIR", help="what `run` wrote")
    add("--format", choices=_TRAJECTORIES, help="default: as FILE's suffix says; xyz")
    when("--frames", type=_count, default=200, metavar="N", help="evenly spaced in time (default: 200)")
    when("--times", type=float, nargs="+", metavar="T", help="ascending, in R/c")
    add("--out", type=_path, metavar="FILE", help="default: trajectory.FORMAT in DIR")

    _add_scene(command("check", _check, "say what is wrong with a scene, or print it resolved").add_argument)

    what = "speed against error: integrators and steps, beside lattices, N and walls"
    add = command("accuracy", _accuracy, what).add_argument
    _add_scene(add)
    add("--out", type=_path, metavar="DIR", help="where the files go (default: out/SCENE_accuracy)")

    command("doctor", _doctor, "what this machine can do, and how to mend what is missing")
    return parser


def _shipped(swept: bool = False) -> str:
    """The names of the shipped scenes, with a sweep or without."""
    texts = {name: path.read_text(encoding="utf-8") for name, path in shipped_scenes().items()}
    return ", ".join(name for name, text in texts.items() if ("\nsweep:" in text) == swept)


def _add_scene(add: Callable[..., Any], shipped: str = "", **options: Any) -> None:
    shipped = shipped or _shipped()
    add("scene", metavar="SCENE", help=f"a YAML file, or a shipped one: {shipped}", **options)
    what = "change one key of the scene, e.g. material.eta_star=100 (repeatable)"
    add("--set", dest="overrides", action="append", default=[], metavar="SECTION.KEY=VALUE", help=what)


def _path(text: str) -> Path:
    return Path(text).expanduser()


def _count(text: str, most: int = 100_000) -> int:
    value = int(text) if text.isdecimal() and len(text) < 10 else 0
    if not 1 <= value <= most:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 to {most:,}")
    return value
