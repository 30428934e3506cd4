"""`taichi-disk bench`: peers agree before they are timed, targets are judged by what was measured."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from worlds import by_hand, disk

from taichi_disk.benchmark import comparison, peers, report, solution, window
from taichi_disk.benchmark.engine import EngineProcess
from taichi_disk.benchmark.judge import restitution
from taichi_disk.benchmark.ours import Ours
from taichi_disk.benchmark.peers import STEPPERS, Peer
from taichi_disk.benchmark.peers.lammps import between
from taichi_disk.benchmark.stopwatch import Timing, in_turn
from taichi_disk.benchmark.targets import judged
from taichi_disk.benchmark.task import Task
from taichi_disk.cli import main
from taichi_disk.errors import SimulationError
from taichi_disk.model.physics import Physics


def bounce(eta_star: float, lanes: int = 1) -> Task:
    """A disk of 60 points that begins in the wall's reach and leaves it."""
    lattice = disk(60, height=0.05)
    velocities = np.tile([0.0, -0.05], (lanes, 60, 1))
    return Task(lattice, Physics(k_b=1e-3, eta=eta_star / 60, wall="rigid"), velocities, 0.01, 0.03, 500)


@pytest.mark.parametrize("eta_star", [0.0, 5.0])
def test_the_judge_and_this_program_agree_on_e(taichi: None, eta_star: float) -> None:
    task = bounce(eta_star)
    engine = Ours(task)
    engine.run()
    assert engine.restitution() == pytest.approx(restitution(task, 0.5), abs=1e-12)
    assert 0.2 < engine.restitution() < 1.0  # it did come back


@pytest.mark.parametrize("peer", STEPPERS, ids=lambda peer: peer.name)
def test_a_peer_agrees_on_e(peer: Peer) -> None:
    if peer.missing():
        pytest.skip(f"not installed: {', '.join(peer.missing())}")
    with EngineProcess(peer.engine) as process:
        for eta_star in (0.0, 5.0):
            task = bounce(eta_star)
            if not peer.takes(task.physics):
                continue
            number = process.open(task, **peer.options)
            first = process.restitution(number)
            assert first == pytest.approx(restitution(task, peer.lead), abs=1e-11)
            if eta_star:  # which velocities the dashpots take does matter
                assert abs(first - restitution(task, 0.5 - peer.lead)) > 1e-6
            assert process.run(number) > 0.0
            assert process.restitution(number) == first  # every run begins anew


def test_a_peer_that_disagrees_or_is_not_there_is_told_and_not_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = Peer("another step", "taichi_disk.benchmark.ours:Ours", lead=0.0)
    absent = Peer("absent", "nowhere:Nothing", ("no-such-package",))
    broken = Peer("broken", "nowhere:Nothing")
    monkeypatch.setattr(comparison, "STEPPERS", (wrong, absent, broken))
    timings, lines = comparison.compare("case", bounce(5.0), 2)
    assert [(t.name, len(t.seconds), t.ratio) for t in timings] == [("case: taichi_disk", 2, 1.0)]
    assert lines[0].startswith("another step: not timed: its e is off by ")
    assert lines[1] == "absent: not installed: pip install 'taichi-disk[peers]'"
    assert lines[2] == "broken: ModuleNotFoundError: No module named 'nowhere'"


def test_the_solver_takes_the_loosest_tolerance_that_will_do() -> None:
    task = replace(bounce(0.0), steps=60)
    truth = restitution(replace(task, dt=task.dt / 20, steps=20 * task.steps), 0.5)
    with EngineProcess(peers.SCIPY) as process:
        number = process.open(task, truth=truth, error=1e-4)
        assert abs(process.restitution(number) - truth) < 1e-4
        with pytest.raises(SimulationError, match="no tolerance down to"):
            process.open(replace(task, steps=1), truth=truth, error=1e-12)


def test_the_cut_off_of_lammps_tells_springs_from_other_pairs() -> None:
    lattice = disk(300)
    cut = between(lattice)
    i, j = lattice.bonds.T
    assert lattice.rest_lengths.max() < cut
    # Brute force over all pairs within it: their distance in the network is three springs at most.
    joined = np.eye(300, dtype=int)
    joined[i, j] = joined[j, i] = 1
    near = np.linalg.matrix_power(joined, 3) > 0
    x = lattice.positions
    distance = np.hypot(*(x[:, None] - x[None]).T)
    assert near[distance < cut].all()
    chain = by_hand([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.6, 1.0), (0.0, 0.5)], [(0, 1), (1, 2), (2, 3), (3, 4)], 1.0)
    with pytest.raises(SimulationError, match="no cut-off"):
        between(chain)


def timing(part: str, name: str, seconds: list[float], base: list[float], error: float | None = None) -> Timing:
    return Timing(part, name, 2, seconds, base, error=error)


def test_costs_and_ratios_are_those_of_the_turns() -> None:
    clock = iter([1.0, 10.0, 2.0, 60.0, 3.0, 30.0])
    seconds = in_turn({"a": lambda: next(clock), "b": lambda: next(clock)}, 3)
    assert seconds == {"a": [1.0, 2.0, 3.0], "b": [10.0, 60.0, 30.0]}
    b = timing("part", "b", seconds["b"], [one / 2 for one in seconds["a"]])
    assert (b.least, b.typical, b.ratio) == (5.0, 15.0, 10.0)  # the median of 10, 30 and 10


def test_targets_are_met_not_met_or_not_measured() -> None:
    seconds = [2.0, 2.0]
    timings = [
        timing("peers", "wall: Numba, serial", seconds, [0.8, 0.8]),
        timing("peers", "wall: LAMMPS, fix addforce", seconds, [0.5, 0.5]),
        timing("solution", "eta* = 0, velocity_verlet, 700 steps", seconds, [1.0, 1.0], 1e-6),
        timing("solution", "eta* = 100, trapezoidal, 700 steps", seconds, [0.1, 0.1], 1e-4),
    ]
    met = {target.text: target.met for target in judged(timings, 0.8)}
    assert met["times Numba's speed, wall"] is True
    assert met["times LAMMPS's speed, fix addforce"] is False
    assert met["times Numba's speed, wall and dashpots"] is None
    assert met["error of e, eta* = 0, automatic step"] is True
    assert met["error of e, eta* = 100, automatic step"] is False
    assert met["times the time of eta* = 0 at eta* = 100"] is False
    assert met["that step, of the limit with the wall's force that was met"] is True
    assert "not met" in "\n".join(report.verdicts(judged(timings, 0.7)))


def test_the_window_is_judged_by_its_slowest_scene() -> None:
    def shown(name: str, frames: float) -> Timing:
        seconds = [1.0 / frames] * 3
        return Timing(window.PART, name, 1, seconds, seconds)

    three = [shown(name, frames) for name, frames in zip(window.SCENES, (60.0, 29.0, 50.0), strict=True)]
    smooth = {target.text: target.value for target in judged([*three, shown(window.name_of(20_000), 31.0)], None)}
    assert smooth["frames/s in the window, slowest of the three scenes"] == pytest.approx(29.0)
    assert smooth["frames/s in the window, 20,000 points"] == pytest.approx(31.0)
    assert not any(target.value for target in judged(three[:2], None))  # a scene is missing


def test_frames_steps_and_pace_are_those_of_the_pictures() -> None:
    seconds = [0.02] * 199 + [0.02 * 51]
    watched = window.Watched(seconds, steps=1000, passed=2.0, speed=0.8)
    assert (watched.frames, watched.slowest) == (pytest.approx(50.0), pytest.approx(50.0))  # one in 200 is no hundredth
    slow = window.Watched([0.02] * 95 + [0.1] * 5, 0, 0.0, 1.0)
    assert (slow.frames, slow.slowest) == (pytest.approx(50.0), pytest.approx(10.0))
    assert watched.steps_per_second == pytest.approx(200.0)
    assert watched.pace == pytest.approx(0.5)
    assert "50.0" in list(window.table({"a scene": watched}))[1]


def test_without_a_display_the_window_is_not_measured_and_the_rest_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("DISPLAY", "")
    assert main(["bench", "--only", window.PART, "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "window: not measured: there is no display" in printed and "not measured\n" in printed
    assert json.loads((tmp_path / "bench.json").read_text())["timings"] == []


def test_the_files_hold_every_run(tmp_path: Path) -> None:
    timings = [timing("peers", "wall: Numba, serial", [2.0, 3.0], [0.8, 0.8])]
    report.write(tmp_path / "out", report.machine(), timings, judged(timings, None), ["a line"])
    with (tmp_path / "out" / "bench.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert (row["name"], row["lanes"], row["precision"], float(row["median"])) == (
        "wall: Numba, serial",
        "1",
        "f64",
        1.25,
    )
    details = json.loads((tmp_path / "out" / "bench.json").read_text())
    assert details["timings"][0]["seconds"] == [2.0, 3.0]
    assert details["targets"][0]["met"] is None and details["machine"]["taichi"]
    assert (tmp_path / "out" / "bench.txt").read_text() == "a line\n"


def test_an_unknown_part_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["bench", "--only", "speed"])
    assert "'speed'" in capsys.readouterr().err


@pytest.mark.validate
def test_the_command_prints_table_and_targets(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--only", solution.PART, "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert solution.SOLVER in printed and "error of e, eta* = 0, automatic step" in printed
    assert (tmp_path / "bench.csv").exists()
