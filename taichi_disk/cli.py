"""The command line. Each command is one function, which imports what it needs."""

from __future__ import annotations

import argparse
import logging
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, NoReturn

from taichi_disk import BEGAN, __version__
from taichi_disk.base.errors import (
    NOTICES,
    InputError,
    TaichiDiskError,
    printable,
    reason,
    system_message,
)
from taichi_disk.base.machine import cores, foreign_packages
from taichi_disk.base.progress import terminal
from taichi_disk.base.signals import INTERRUPTED, raise_if_interrupted

DEFAULT_SCENE = "exponential_wall"  # of `view`
_TRAJECTORIES = ("xyz", "vtu", "npz")


def main(argv: Sequence[str]) -> int:
    """Carry out one command and return its exit status: 0 done, 1 failed, 2 bad input,
    130 interrupted.

    Raises SystemExit, as argparse does, for --help, --version and usage errors.
    """
    # Library warnings are meant for developers, and with PYTHONWARNINGS=error they
    # would end a run.
    warnings.simplefilter("ignore")
    NOTICES.handlers = [_Notes()]
    NOTICES.setLevel(logging.INFO)
    try:
        _check_environment()
        status = _carry_out(argv)
        if sys.stdout is not None:  # it may be closed
            sys.stdout.flush()
        return status
    except TaichiDiskError as error:
        _print_error(f"error: {error}")
        return error.exit_status
    except KeyboardInterrupt:
        text = "interrupted"
        if "sweep" in argv[:1]:
            text += "; finished scenes are kept: repeat the command to go on"
        _print_error(text)
        return INTERRUPTED
    except (MemoryError, RuntimeError) as error:
        if not isinstance(error, MemoryError) and "memory" not in str(error):
            raise
        _print_error(
            "error: not enough memory; take fewer points (lattice.points), or stop"
            " other programs"
        )
        return 1
    except OSError as error:
        if not isinstance(error, BrokenPipeError):  # the reader has gone (| head)
            _print_error(f"error: {system_message(error)}")
        if isinstance(error, PermissionError):
            return InputError.exit_status
        return 1


def _carry_out(argv: Sequence[str]) -> int:
    """Return the exit status of a command. Raises TaichiDiskError, with what helps, if
    a package from elsewhere cannot be imported."""
    try:
        arguments = _parser().parse_args(argv or ["--help"])
        raise_if_interrupted()
        return arguments.command(arguments) or 0
    except ImportError as error:
        if not foreign_packages():
            raise
        raise TaichiDiskError(reason(error)) from None


def _check_environment() -> None:
    """Raise InputError if this program was started in a copy of a virtual environment:
    the code beside the first one would run."""
    environment = Path(sys.argv[0]).absolute().parents[1]
    if (environment / "pyvenv.cfg").is_file() and not environment.samefile(sys.prefix):
        raise InputError(
            f"{environment} is a copy of {sys.prefix}, whose program and scenes would"
            f" be used: `sh .ci/setup` in {environment.parent} mends this"
        )


def _print_error(text: str) -> None:
    # Messages of the library name Python arguments; replace them by the command's
    # options.
    options = {
        "as `out`": "with --out",
        "overwrite=True": "--overwrite",
        "lattices=": "--lattices ",
    }
    for argument, option in options.items():
        text = text.replace(argument, option)
    with suppress(OSError, ValueError, AttributeError):
        print(text, file=sys.stderr, flush=True)


class _Notes(logging.Handler):
    """Prints notices, warnings, and errors after which a command goes on."""

    def emit(self, record: logging.LogRecord) -> None:
        kind = "note"
        if record.levelno > logging.INFO:
            kind = record.levelname.lower()
        _print_error(f"{kind}: {record.getMessage()}")


def _load(arguments: argparse.Namespace, what: str = "scene") -> Any:
    from taichi_disk.experiments import scenes

    load = getattr(scenes, f"load_{what}")
    return load(arguments.scene or DEFAULT_SCENE, arguments.overrides)


def _options(arguments: argparse.Namespace, *names: str) -> dict[str, Any]:
    return {name: getattr(arguments, name) for name in names}


def _out(arguments: argparse.Namespace, suffix: str = "") -> Path:
    if arguments.out:
        return Path(arguments.out)
    scene = Path(arguments.scene)
    name = scene.name
    # for "...yaml" the folder would be out/..
    if scene.suffix in (".yaml", ".yml") and scene.stem.strip("."):
        name = scene.stem
    return Path("out", name + suffix)


# ---- commands. Each loads its scene before it imports anything else, so that faults
# are reported at once.


def _run(arguments: argparse.Namespace) -> int:
    scene = _load(arguments)

    from taichi_disk.runs.api import run
    from taichi_disk.runs.api.work import ERRORS
    from taichi_disk.runs.output.report import print_result, print_time

    options = _options(
        arguments, "video", "export", "overwrite", "force", "threads", "lattices"
    )
    started = perf_counter() - BEGAN

    def computed(result: Any) -> None:
        progress.rest()
        print_result(result.summary, result.scenario.words.labels, result.out)

    with terminal(sys.stderr) as progress:
        result = run(
            scene,
            _out(arguments),
            count_on=arguments.out is None,
            progress=progress,
            computed=computed,
            started=started,
            **options,
        )
    summary = result.summary
    print_time(summary)
    is_complete = summary["status"] == "done" and not {*summary} & {*ERRORS.values()}
    return int(not is_complete)


def _sweep(arguments: argparse.Namespace) -> int:
    sweep = _load(arguments, "sweep")

    from taichi_disk.studies.sweep.sweep import print_sweep, run_sweep

    options = _options(arguments, "jobs", "part", "estimate")
    options["executor"] = arguments.scheduler
    with terminal(sys.stderr) as progress:
        result = run_sweep(sweep, _out(arguments), progress=progress, **options)
    print_sweep(result)
    error = result.summary.get("figure_error")
    if error:
        _print_error(f"error: {error}")
    return int(bool(result.failed or error))


def _view(arguments: argparse.Namespace) -> None:
    from taichi_disk.experiments.config.tree import shipped_scenes
    from taichi_disk.sandbox.app import view

    name = arguments.scene or DEFAULT_SCENE
    is_folder = Path(name).is_dir() and name not in shipped_scenes()
    if is_folder and arguments.overrides:
        raise InputError(
            "--set cannot change the scenes of a folder: name one scene file instead"
        )
    scene = None
    if is_folder:
        scene = Path(name)
    elif arguments.scene or arguments.overrides:
        scene = _load(arguments)
    view(scene, arguments.host, arguments.port, arguments.open)


def _render(arguments: argparse.Namespace) -> None:
    from taichi_disk.experiments.config.sections import VideoSection
    from taichi_disk.pictures.render.film import check_target, size_text
    from taichi_disk.runs.api import Result

    if arguments.out:
        check_target(arguments.out)
        if arguments.format not in (None, arguments.out.suffix[1:] or "png"):
            raise InputError(
                f"--format {arguments.format} contradicts --out {arguments.out}: leave"
                " one of the two out"
            )
    given = _options(arguments, *VideoSection.schema())
    overrides = [
        f"video.{name}={str(value).lower()}"
        for name, value in given.items()
        if value is not None
    ]
    with terminal(sys.stderr) as progress:
        load = partial(Result.load, progress=progress, estimate=False)
        result = load(arguments.folder, overrides)
        compared = [load(folder) for folder in arguments.compare]
        out = arguments.out
        if not out:
            name = _film_name(result.scene.video.format, bool(compared))
            out = arguments.folder / name
        options = _options(arguments, "at", "start", "end")
        result.film(out, compared, progress, labels=arguments.label, **options)
    print(f"written: {out}, {size_text(out)}")


def _film_name(form: str, is_comparison: bool) -> str:
    name = "render"
    if is_comparison:
        name = "comparison"
    if form == "png":  # a folder of pictures
        return name
    return f"{name}.{form}"


def _export(arguments: argparse.Namespace) -> None:
    from taichi_disk.runs.api import Result

    form = arguments.format
    if not form and not arguments.out:
        form = "xyz"
    result = Result.load(arguments.folder)
    target = arguments.out or arguments.folder
    out = result.export(target, form, arguments.frames, arguments.times)
    print(f"trajectory in {out}")


def _check(arguments: argparse.Namespace) -> None:
    from taichi_disk.experiments.scenes import check_feasible

    scene = _load(arguments, "any")
    check_feasible(scene)
    print(f"{scene.to_yaml()}# no fault found: this scene can be run")


def _accuracy(arguments: argparse.Namespace) -> None:
    scene = _load(arguments)

    from taichi_disk.studies.accuracy.study import study

    name = " ".join([Path(arguments.scene).stem, *arguments.overrides])
    study(scene, _out(arguments, "_accuracy"), name)


def _doctor(arguments: argparse.Namespace) -> int:
    from taichi_disk.doctor import examine

    return int(not examine())


# ---- arguments


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        if re.search(r"unrecognized arguments: .*\.ya?ml", message):
            message += "; a command takes one scene: write a command for each"
        elif "unrecognized arguments" in message:
            message += (
                "; run, sweep, view, check and accuracy change a key of the scene with"
                " --set SECTION.KEY=VALUE, e.g. --set material.eta_star=30; render has"
                " options such as --size 480"
            )
        super().error(message)


def _parser() -> argparse.ArgumentParser:
    from taichi_disk.experiments.config.sections import VideoSection

    parser = _Parser(
        prog="taichi-disk",
        description=(
            "Simulate, measure and film a two-dimensional elastic disk of mass points"
            " and springs."
        ),
    )
    parser.add_argument(
        "--version", action="version", version=f"taichi-disk {__version__}"
    )
    commands = parser.add_subparsers(
        metavar="COMMAND", required=True, parser_class=_Parser
    )

    def command(
        name: str, act: Callable[[argparse.Namespace], int | None], summary: str
    ) -> Callable[..., Any]:
        added = commands.add_parser(
            name, help=summary, description=summary[0].upper() + summary[1:] + "."
        )
        added.set_defaults(command=act)
        return added.add_argument

    add = command(
        "run", _run, "simulate a scene, print the result, and write files and a film"
    )
    _add_scene(add, out="out/SCENE")
    add("--overwrite", action="store_true", help="replace another run in DIR")
    add("--no-video", dest="video", action="store_false", help="make no film")
    add("--export", choices=_TRAJECTORIES, help="also write a trajectory")
    add(
        "--threads",
        type=partial(_count, most=cores()),
        metavar="N",
        help="threads for 50,000 points or more (default: TAICHI_DISK_THREADS, or all"
        " cores)",
    )
    add(
        "--force", action="store_true", help="keep a time.dt beyond the stability limit"
    )
    add(
        "--lattices",
        type=partial(_count, most=10_000),
        metavar="K",
        help="random lattices for mean and scatter of the result; 1: only the scene's"
        " own (default: 8 up to 5,000 points, 3 for a relaxation or with a tolerance,"
        " else 1)",
    )

    add = command(
        "sweep",
        _sweep,
        "compute all scenes of a sweep for a table, fits and a figure; can be resumed",
    )
    _add_scene(add, _shipped(has_sweep=True), out="out/SCENE")
    add(
        "--jobs",
        type=_count,
        metavar="N",
        help="number of processes (default: one per core)",
    )
    add(
        "--scheduler",
        metavar="ADDRESS",
        help="compute on a Dask cluster: address of its scheduler, tcp://HOST:8786",
    )
    add(
        "--part",
        metavar="K/N",
        help="compute only the K-th of N parts, and write no table",
    )
    add(
        "--estimate",
        action="store_true",
        help="estimate the time-step error of each result; doubles the work",
    )

    add = command("view", _view, "play with a scene on a page in the browser")
    scenes = f"{_shipped()}; or a folder of scenes"
    _add_scene(add, scenes, nargs="?")
    add(
        "--no-open",
        dest="open",
        action="store_false",
        help="print the address of the page, but do not open a browser",
    )
    add(
        "--host",
        default="127.0.0.1",
        help="address of the server (default: 127.0.0.1, this machine only)",
    )
    add(
        "--port",
        type=partial(_count, most=65_535),
        default=0,
        metavar="P",
        help="port (default: a free one)",
    )
    add = command(
        "render", _render, "film a finished run again, or up to four runs side by side"
    )
    add("folder", type=_path, metavar="DIR", help="folder of the run")
    several = {"nargs": "+", "action": "extend", "default": []}  # words, or repeated
    add(
        "--compare",
        type=_path,
        metavar="DIR",
        help="up to three more runs, shown at the right; titles name the keys that"
        " differ",
        **several,
    )
    add(
        "--label",
        metavar="TEXT",
        help="titles of the runs, in place of the keys that differ: one for each run",
        **several,
    )
    add(
        "--out",
        type=_path,
        metavar="FILE",
        help=".mp4, .webm or .gif; .html: page that plays the film without internet;"
        " .png: one picture; no suffix: folder of numbered pictures (default: render or"
        " comparison in DIR)",
    )
    add(
        "--at",
        default="greatest",
        metavar="T",
        help="moment of a picture: a time in R/c, contact (the first), greatest"
        " (compression) or end (default: greatest)",
    )
    add(
        "--from",
        dest="start",
        metavar="T",
        help="first moment of the film (default: start of the run)",
    )
    add(
        "--to",
        dest="end",
        metavar="T",
        help="last moment of the film (default: end of the run)",
    )
    for name, key in VideoSection.schema().items():
        if key.kind is bool:
            add(f"--{name}", action=argparse.BooleanOptionalAction, help=key.meaning)
        elif key.kind is str:
            add(f"--{name}", metavar="|".join(key.words), help=key.meaning)
        else:
            form = "|".join([*key.words, "N"])
            add(f"--{name}", metavar=form, help=f"{key.meaning} ({key.allowed()})")

    add = command(
        "export", _export, "write the trajectory of a finished run for another program"
    )
    add("folder", type=_path, metavar="DIR", help="folder of the run")
    add(
        "--format",
        choices=_TRAJECTORIES,
        help="format (default: the suffix of FILE, or xyz)",
    )
    when = commands.choices["export"].add_mutually_exclusive_group().add_argument
    when(
        "--frames",
        type=_count,
        default=200,
        metavar="N",
        help="number of states at equal intervals (default: 200)",
    )
    when(
        "--times",
        nargs="+",
        metavar="T",
        help="times of the states, ascending [R/c], or words as for render --at",
    )
    add(
        "--out",
        type=_path,
        metavar="FILE",
        help="file to write (default: trajectory.FORMAT in DIR)",
    )

    _add_scene(
        command("check", _check, "check a scene, and print it with every default")
    )
    add = command(
        "accuracy",
        _accuracy,
        "compare integrators and time steps, then the effects of lattice, N and wall",
    )
    _add_scene(add, out="out/SCENE_accuracy")
    command("doctor", _doctor, "check whether this machine can run and film scenes")
    return parser


def _shipped(has_sweep: bool = False) -> str:
    from taichi_disk.experiments.config.tree import shipped_scenes

    # by their names, because a file that a user has put there may be anything
    names = [
        printable(name).replace("%", "%%")
        for name in shipped_scenes()
        if name.startswith("figure") == has_sweep
    ]
    return ", ".join(names)


def _add_scene(
    add: Callable[..., Any], shipped: str = "", out: str = "", **options: Any
) -> None:
    add(
        "scene",
        metavar="SCENE",
        help=f"a YAML file, or a shipped scene: {shipped or _shipped()}",
        **options,
    )
    add(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="SECTION.KEY=VALUE",
        help="change a key of the scene, e.g. material.eta_star=100; repeatable",
    )
    if out:
        add(
            "--out",
            type=_path,
            metavar="DIR",
            help=f"folder of the results (default: {out})",
        )


def _path(text: str) -> Path:
    try:
        return Path(text).expanduser()
    except RuntimeError:
        raise argparse.ArgumentTypeError(
            f"{text!r}: there is no user of this name"
        ) from None


def _count(text: str, most: int = 100_000) -> int:
    is_number = text.isdecimal() and len(text) < 10
    if not (is_number and 1 <= int(text) <= most):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a whole number from 1 to {most:,}"
        )
    return int(text)
