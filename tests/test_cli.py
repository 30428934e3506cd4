"""The command line without a simulation: arguments, exit status, where messages go, what is loaded."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from taichi_disk import __version__
from taichi_disk.cli import main
from taichi_disk.errors import InputError, SimulationError
from taichi_disk.scene import SCENES


@dataclass(frozen=True)
class Result:
    """Stands in for what run() returns."""

    out: Path
    headline: dict[str, float] = field(default_factory=lambda: {"restitution": 0.875, "contact_time": 12.5})
    summary: dict[str, Any] = field(
        default_factory=lambda: {
            "steps": 12345,
            "dt": 0.0173,
            "integrator": "trapezoidal",
            "energy": {"closing_imbalance": -1.5e-6},
            "wall_clock": {"build": 0.25, "simulate": 1.5},
        }
    )
    status: str = "done"
    video_error: str | None = None


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, Path, dict[str, Any]]]:
    """Replaces the computation by one that notes how it was called."""
    noted: list[tuple[Any, Path, dict[str, Any]]] = []

    def run(scene: Any, out: Path, **options: Any) -> Result:
        noted.append((scene, out, options))
        return Result(out)

    replace_run(monkeypatch, run)
    return noted


def replace_run(monkeypatch: pytest.MonkeyPatch, run: Any) -> None:
    module = ModuleType("taichi_disk.runner")
    module.run = run  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "taichi_disk.runner", module)


def test_run_hands_every_option_on(calls: list[Any]) -> None:
    options = ["--out", "x", "--no-video", "--arch", "cuda", "--threads", "3", "--force"]
    assert main(["run", "compression", "--set", "lattice.points=9", "--set", "lattice.seed=2", *options]) == 0
    ((scene, out, given),) = calls
    assert scene == SCENES["compression"].model_validate({"lattice": {"points": 9, "seed": 2}})
    assert out == Path("x")
    assert given.pop("progress") is not None
    assert given == {"video": False, "arch": "cuda", "threads": 3, "force": True}


def test_without_options_run_films_on_the_cpu_into_out_and_the_name_of_the_scene(calls: list[Any]) -> None:
    scene = Path(__file__).parent.parent / "scenes" / "exponential_wall.yaml"
    assert main(["run", str(scene)]) == 0
    ((_, out, given),) = calls
    assert out == Path("out") / "exponential_wall"
    del given["progress"]
    assert given == {"video": True, "arch": "cpu", "threads": None, "force": False}


def test_the_headline_is_printed_with_units(calls: list[Any], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "exponential_wall", "--out", "a folder [1]"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["restitution", "e", "0.875"] in lines
    assert ["contact", "time", "12.5", "R/c"] in lines
    assert ["time", "step", "0.0173", "R/c"] in lines
    assert ["steps", "12,345", "(trapezoidal)"] in lines
    assert ["energy", "imbalance", "at", "the", "end", "-1.50e-06"] in lines
    assert ["wall", "clock", "1.8", "s", "(build", "0.2,", "simulate", "1.5)"] in lines
    assert ["files", "in", "a", "folder", "[1]"] in lines


def test_the_headline_of_a_solved_equilibrium_has_no_time_step(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    headline = {"xi": 0.0125, "xi_nominal": 0.0175}
    summary = {"steps": 8, "integrator": "newton", "wall_clock": {"build": 0.1}}
    replace_run(monkeypatch, lambda scene, out, **options: Result(out, headline, summary))
    assert main(["run", "compression"]) == 0
    assert [line.split()[-2:] for line in capsys.readouterr().out.splitlines()[:3]] == [
        ["0.0125", "R"],
        ["0.0175", "R"],
        ["8", "(newton)"],
    ]


def test_a_missing_film_is_told_after_the_numbers_and_exits_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    replace_run(monkeypatch, lambda scene, out, **options: Result(out, video_error="no film: no Vulkan"))
    assert main(["run", "exponential_wall"]) == 1
    captured = capsys.readouterr()
    assert "0.875" in captured.out
    assert captured.err == "error: no film: no Vulkan\n"


@pytest.mark.parametrize(
    ("failure", "status", "message"),
    [
        (InputError("no such step"), 2, "error: no such step\n"),
        (SimulationError("blown up"), 1, "error: blown up\n"),
        (KeyboardInterrupt(), 130, "interrupted\n"),
    ],
)
def test_each_kind_of_failure_has_its_exit_status_and_one_message(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    failure: BaseException,
    status: int,
    message: str,
) -> None:
    def run(*arguments: Any, **options: Any) -> None:
        raise failure

    replace_run(monkeypatch, run)
    assert main(["run", "exponential_wall"]) == status
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", message)


def test_check_prints_a_scene_that_checks_as_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "absorbing_wall", "--set", "wall.boundary=pinned"]) == 0
    first = capsys.readouterr().out
    (tmp_path / "again.yaml").write_text(first)
    assert "boundary: pinned" in first
    assert main(["check", str(tmp_path / "again.yaml")]) == 0
    assert capsys.readouterr().out == first


def test_a_faulty_scene_exits_2_with_all_faults_on_stderr(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], calls: list[Any]
) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text("scene: compression\nlattice: {points: -1}\nmateriel: {}\n")
    for command in ("check", "run"):
        assert main([command, str(path), "--set", "video.fps=0"]) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        lines = captured.err.splitlines()
        assert lines[0] == "error: 3 faults in the scene:"
        assert [line.split(": ")[1] for line in lines[1:]] == ["lattice.points", "materiel", "video.fps"]
    assert not calls


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["jump"],
        ["run"],
        ["check"],
        ["run", "a", "b"],
        ["run", "compression", "--arch", "gpu"],
        ["run", "compression", "--threads", "0"],
        ["run", "compression", "--threads", "two"],
        ["run", "compression", "--nonsense"],
        ["run", "compression", "--set"],
    ],
)
def test_wrong_usage_exits_2_with_the_usage(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as leaving:
        main(arguments)
    assert leaving.value.code == 2
    assert "usage: taichi-disk" in capsys.readouterr().err


def test_version_and_help_exit_0(capsys: pytest.CaptureFixture[str]) -> None:
    for argument, text in (("--version", f"taichi-disk {__version__}\n"), ("--help", "usage: taichi-disk")):
        with pytest.raises(SystemExit) as leaving:
            main([argument])
        assert leaving.value.code == 0
        assert capsys.readouterr().out.startswith(text)


def python(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)


def test_check_and_help_load_nothing_that_is_slow() -> None:
    # Start-up is a matter of imports; a test by the clock would fail on a busy machine.
    for arguments in (["check", "exponential_wall"], ["check", "no-such-scene"], ["--help"]):
        done = python(f"""
import sys
from taichi_disk.cli import main
try:
    main({arguments})
except SystemExit:
    pass
slow = {{"taichi", "numpy", "scipy", "matplotlib", "rich", "imageio"}} & set(sys.modules)
sys.exit(f"loaded {{slow}}" if slow else 0)
""")
        assert done.returncode == 0, done.stderr


def test_a_reader_that_leaves_early_is_no_error() -> None:
    # `taichi-disk check ... | head -1`, with the reading end closed before anything is written.
    done = python("""
import os, subprocess, sys
read, write = os.pipe()
os.close(read)
command = [sys.executable, "-m", "taichi_disk", "check", "exponential_wall"]
done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True)
print(done.returncode, repr(done.stderr))
""")
    assert done.stdout == "1 ''\n"


def test_the_module_runs_as_a_command() -> None:
    done = subprocess.run([sys.executable, "-m", "taichi_disk", "--version"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, f"taichi-disk {__version__}\n")
