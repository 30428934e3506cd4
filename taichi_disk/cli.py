"""The command line: arguments in, exit status out. Each command is one function that imports what it needs.

Exit status: 0 done; 1 the computation or the film failed; 2 bad input or usage; 130 interrupted.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from taichi_disk import __version__
from taichi_disk.errors import TaichiDiskError

_SCENES = "compression, exponential_wall, absorbing_wall"
# Keys of a scene's `video` section that `render` takes on the command line: value, meaning. The schema checks them.
_VIDEO = {
    "size": ("N", "pixels of width and height, up to 2160"),
    "fps": ("N", "frames a second"),
    "seconds": ("N", "length of the film"),
    "colour": ("WHAT", "strain, force, speed or kinetic"),
    "draw": ("WHAT", "both, springs or points"),
    "supersample": ("N", "samples across a pixel: 1, 1.5 or 2"),
    "format": ("WHAT", "mp4, webm, gif, or png for a folder of pictures"),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Carry out one command. Raises SystemExit, as argparse does, on --help, --version and usage errors."""
    arguments = _parser().parse_args(argv)
    try:
        status: int = arguments.command(arguments)
        sys.stdout.flush()
        return status
    except TaichiDiskError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_status
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader has gone (| head). Python would complain once more when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def _run(arguments: argparse.Namespace) -> int:
    from taichi_disk.progress import progress_for
    from taichi_disk.scene_file import load_scene

    scene = load_scene(arguments.scene, arguments.overrides)

    from taichi_disk.report import print_result
    from taichi_disk.runner import run

    progress = progress_for(sys.stderr)
    try:
        result = run(
            scene,
            arguments.out or Path("out") / Path(arguments.scene).stem,
            video=arguments.video,
            arch=arguments.arch,
            threads=arguments.threads,
            force=arguments.force,
            progress=progress,
        )
    finally:
        progress.stop()
    print_result(result)
    if result.video_error:
        print(f"error: {result.video_error}", file=sys.stderr)
        return 1
    return 0


def _sweep(arguments: argparse.Namespace) -> int:
    from taichi_disk.progress import progress_for
    from taichi_disk.scene_file import load_sweep

    sweep = load_sweep(arguments.scene, arguments.overrides)

    from taichi_disk.study.sweep import run_sweep
    from taichi_disk.study.tell import print_sweep

    progress = progress_for(sys.stderr)
    try:
        out = arguments.out or Path("out") / Path(arguments.scene).stem
        result = run_sweep(sweep, out, jobs=arguments.jobs, progress=progress)
    finally:
        progress.stop()
    print_sweep(result)
    return 1 if result.failed else 0


def _view(arguments: argparse.Namespace) -> int:
    from taichi_disk.scene_file import load_scene

    scene = load_scene(arguments.scene, arguments.overrides)

    from taichi_disk.view.app import view

    view(scene, arguments.out)
    return 0


def _render(arguments: argparse.Namespace) -> int:
    from taichi_disk.progress import progress_for
    from taichi_disk.refilm import film_again

    folders = [arguments.folder, *([arguments.compare] if arguments.compare else [])]
    options = {name: getattr(arguments, name) for name in _VIDEO if getattr(arguments, name) is not None}
    if arguments.panel is not None:
        options["panel"] = "true" if arguments.panel else "false"
    progress = progress_for(sys.stderr)
    try:
        out = film_again(folders, arguments.out, options, progress)
    finally:
        progress.stop()
    print(f"film in {out}")
    return 0


def _check(arguments: argparse.Namespace) -> int:
    from taichi_disk.scene_file import load_any

    print(load_any(arguments.scene, arguments.overrides).to_yaml(), end="")
    return 0


def _accuracy(arguments: argparse.Namespace) -> int:
    from taichi_disk.progress import progress_for
    from taichi_disk.scene_file import load_scene

    scene = load_scene(arguments.scene, arguments.overrides)

    from taichi_disk.study.accuracy import measure
    from taichi_disk.study.accuracy_report import write
    from taichi_disk.study.error_sources import other_errors

    progress = progress_for(sys.stderr)
    try:
        points = measure(scene, progress)
        sources = other_errors(scene, points, progress)
    finally:
        progress.stop()
    out = arguments.out or Path("out") / f"{Path(arguments.scene).stem}_accuracy"
    print(write(points, sources, out, " ".join([Path(arguments.scene).stem, *arguments.overrides])))
    print(f"files in {out}")
    return 0


def _bench(arguments: argparse.Namespace) -> int:
    from taichi_disk.benchmark.bench import PARTS, run_benchmark

    run_benchmark(arguments.only or PARTS, arguments.out)
    return 0


def _doctor(arguments: argparse.Namespace) -> int:
    from taichi_disk.doctor import examine, print_findings

    return 0 if print_findings(examine()) else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="taichi-disk",
        description="Simulate, measure and film a two-dimensional elastic disk of mass points and springs.",
    )
    parser.add_argument("--version", action="version", version=f"taichi-disk {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)

    run = _command(commands, "run", _run, "simulate a scene, write results and film, print the headline result")
    _add_scene(run)
    run.add_argument("--out", type=Path, metavar="DIR", help="where the results go (default: out/SCENE)")
    run.add_argument("--no-video", dest="video", action="store_false", help="make no film")
    run.add_argument(
        "--arch", choices=("cpu", "cuda", "vulkan"), default="cpu", help="cpu (default) or cuda; vulkan is refused"
    )
    run.add_argument("--threads", type=_count, metavar="N", help="CPU threads (default: all cores)")
    run.add_argument("--force", action="store_true", help="take a time step even beyond the stable limit")

    sweep = _command(commands, "sweep", _sweep, "compute every scene of a sweep: table, fits and figure; resumable")
    _add_scene(sweep, "figure2, figure3, figure6")
    sweep.add_argument("--out", type=Path, metavar="DIR", help="where the results go (default: out/SCENE)")
    sweep.add_argument("--jobs", type=_count, metavar="N", help="processes (default: one for each core)")

    view = _command(commands, "view", _view, "play with a scene in a window")
    _add_scene(view, default="exponential_wall")
    view.add_argument(
        "--out", type=Path, default=Path("out/view"), metavar="DIR", help="for saved scenes, films, pictures"
    )

    render = _command(commands, "render", _render, "film a finished run again, or two of them side by side")
    render.add_argument("folder", type=Path, metavar="DIR", help="what `run` wrote")
    render.add_argument("--compare", type=Path, metavar="DIR", help="another run, to be shown at the right")
    render.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help=".mp4, .webm, .gif, .png for one picture, or a folder for many (default: render or comparison in DIR)",
    )
    for name, (value, what) in _VIDEO.items():
        render.add_argument(f"--{name}", metavar=value, help=what)
    render.add_argument("--panel", action=argparse.BooleanOptionalAction, help="curves at the right, or none")

    _add_scene(_command(commands, "check", _check, "say what is wrong with a scene, or print it resolved"))
    summary = "speed against error: integrators, precisions and steps, beside lattices, N and walls"
    accuracy = _command(commands, "accuracy", _accuracy, summary)
    _add_scene(accuracy)
    accuracy.add_argument("--out", type=Path, metavar="DIR", help="where the files go (default: out/SCENE_accuracy)")
    bench = _command(commands, "bench", _bench, "speed and error on this machine, beside other programs")
    parts = ("kernel", "size", "sweep", "peers", "solution", "film", "window")
    bench.add_argument("--only", nargs="+", choices=parts, metavar="PART", help=f"of {', '.join(parts)} (default: all)")
    bench.add_argument("--out", type=Path, metavar="DIR", help="write bench.csv, bench.json, bench.txt there")
    _command(commands, "doctor", _doctor, "what this machine can do, and how to mend what is missing")
    return parser


def _command(
    commands: argparse._SubParsersAction[argparse.ArgumentParser],
    name: str,
    command: Callable[[argparse.Namespace], int],
    summary: str,
) -> argparse.ArgumentParser:
    parser = commands.add_parser(name, help=summary, description=summary[0].upper() + summary[1:] + ".")
    parser.set_defaults(command=command)
    return parser


def _add_scene(parser: argparse.ArgumentParser, shipped: str = _SCENES, default: str | None = None) -> None:
    parser.add_argument(
        "scene",
        metavar="SCENE",
        nargs="?" if default else None,
        default=default,
        help=f"a YAML file, or a shipped one: {shipped}",
    )
    parser.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="SECTION.KEY=VALUE",
        help="change one key of the scene, e.g. material.eta_star=100 (repeatable)",
    )


def _count(text: str) -> int:
    value = int(text) if text.isdecimal() else 0
    if not 1 <= value <= 4096:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 to 4096")
    return value
