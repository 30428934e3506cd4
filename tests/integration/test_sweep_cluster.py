"""Sweeps by processes of which some are killed: the same bytes, and no lost point."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from programs import printed_by, summary_in

from taichi_disk import load_sweep, run_sweep

pytestmark = pytest.mark.validate

SWEEP = """
scene: exponential_wall
lattice: {points: 200}
sweep: {eta_star: [0, 30], seed: [3, 4, 5], velocity: {geom: [3.0e-3, 5.0e-2, 12]}}
"""
POINTS = 72
PATIENCE = 120.0  # seconds


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "s.yaml"
    path.write_text(SWEEP)
    return path


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """Return points.csv of a single process."""
    out = run_sweep(
        load_sweep(SWEEP), tmp_path_factory.mktemp("one") / "out", jobs=1
    ).out
    return (out / "points.csv").read_bytes()


def command(scene, out, *options):
    words = ("sweep", str(scene), "--out", str(out), *options)
    return [sys.executable, "-m", "taichi_disk", *words]


def started(*arguments, **options):
    pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([*map(str, arguments)], **{**pipes, **options})


def finish(scene, out, *options):
    """Run the command to its end, and return the number of computed points."""
    subprocess.run(command(scene, out, *options), capture_output=True, check=True)
    return int(summary_in(out)["computed_now"])


def wait_until(true, what):
    until = time.monotonic() + PATIENCE
    while not true():
        assert time.monotonic() < until, what
        time.sleep(0.01)


def count(out):
    return len(list((out / "points").glob("[!.]*.json")))


def children(process):
    found = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
    return [int(pid) for pid in found.split()]


def lives(pid):
    return Path(f"/proc/{pid}").exists()


def workers(process):
    """Return the child processes that compute."""
    return [
        pid
        for pid in children(process)
        if b"worker.py" in Path(f"/proc/{pid}/cmdline").read_bytes()
    ]


def goes_on(scene, out, expected, *options):
    """Check that the same command computes what is missing, to the same bytes."""
    done = count(out)
    assert 0 < done < POINTS
    assert finish(scene, out, *options) == POINTS - done
    assert (out / "points.csv").read_bytes() == expected


def kill(process):
    process.kill()
    process.wait()


# ---- processes of this machine


def test_a_killed_sweep_goes_on_where_it_was(scene, expected, tmp_path):
    out = tmp_path / "out"
    first = started(*command(scene, out, "--jobs", "2"))
    wait_until(lambda: count(out) > 0, "no point is done")
    descendants = children(first)
    kill(first)
    orphans = "workers outlive their parent"
    wait_until(lambda: not any(map(lives, descendants)), orphans)
    goes_on(scene, out, expected, "--jobs", "2")


# a terminal interrupts the whole group; `timeout` and batch systems terminate it
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("after", [0.0, 0.5])
def test_an_interrupted_sweep_ends_at_once_and_says_so(scene, tmp_path, after, number):
    out = tmp_path / "out"
    # each scene takes minutes
    options = ("--jobs", "2", "--set", "lattice.points=20000")
    process = started(*command(scene, out, *options), start_new_session=True)
    wait_until(lambda: len(workers(process)) == 2, "no worker has begun")
    time.sleep(after)
    computing = workers(process)
    began = time.monotonic()
    os.killpg(process.pid, number)
    last = process.communicate(timeout=PATIENCE)[1].splitlines()[-1]
    assert process.returncode == 130
    assert time.monotonic() - began < 30.0
    assert not any(map(lives, computing))
    assert not (out / "points.csv").exists()
    assert last == "interrupted; finished scenes are kept: repeat the command to go on"


def test_a_killed_worker_ends_the_sweep_and_the_same_command_goes_on(
    scene, expected, tmp_path
):
    out = tmp_path / "out"
    process = started(*command(scene, out, "--jobs", "2"))
    wait_until(lambda: count(out) > 0, "no point is done")
    os.kill(workers(process)[0], signal.SIGKILL)
    error = process.communicate(timeout=PATIENCE)[1]
    assert process.returncode == 1
    assert "Traceback" not in error
    died = "error: the workers failed (one died, perhaps for lack of memory"
    assert error.splitlines()[-1].startswith(died)
    assert error.endswith("repeat the command to go on\n")
    goes_on(scene, out, expected, "--jobs", "2")


def test_workers_leave_their_kernels_to_the_next_sweep(scene, tmp_path):
    cache = tmp_path / "cache"
    cache.mkdir()
    environment = os.environ | {"TI_OFFLINE_CACHE_FILE_PATH": str(cache)}
    options = ("--jobs", "2", "--set", "sweep.seed=[3]")
    sweep = command(scene, tmp_path / "out", *options)
    subprocess.run(sweep, env=environment, capture_output=True, check=True)
    assert sum(path.is_file() for path in cache.rglob("*")) > 3


def test_a_script_needs_no_guard_even_from_standard_input(scene, expected, tmp_path):
    script = (
        "from taichi_disk import load_sweep, run_sweep\n"
        f"run_sweep(load_sweep({str(scene)!r}), {str(tmp_path / 'out')!r}, jobs=2)\n"
    )
    printed_by("-", input=script)
    assert (tmp_path / "out" / "points.csv").read_bytes() == expected


# ---- Dask


class Cluster:
    """A Dask scheduler and two workers on 127.0.0.1, each a process."""

    def __init__(self, folder):
        self.folder = folder
        self.processes = list[subprocess.Popen[str]]()
        file = folder / "scheduler.json"
        at = ("--host", "127.0.0.1", "--port", "0", "--scheduler-file", file)
        self.begin("distributed.cli.dask_scheduler", *at)
        wait_until(
            lambda: file.exists() and file.read_text().strip().endswith("}"),
            "no scheduler",
        )
        self.address: str = json.loads(file.read_text())["address"]
        self.scheduler = self.processes[0]
        self.workers = [self.add_worker() for _ in range(2)]

    def add_worker(self, threads=1, **environment):
        folder = ("--no-nanny", "--local-directory", self.folder)
        worker = (self.address, "--nthreads", threads, *folder)
        return self.begin("distributed.cli.dask_worker", *worker, **environment)

    def begin(self, module, *words, **environment):
        command = (sys.executable, "-m", module, *words, "--no-dashboard")
        options = {"env": os.environ | environment, "stderr": subprocess.DEVNULL}
        self.processes.append(started(*command, **options))
        return self.processes[-1]

    def wait_for_worker(self):
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(1, timeout=PATIENCE)

    def without_workers(self):
        for worker in self.workers:
            kill(worker)
        return self


@pytest.fixture
def cluster(tmp_path):
    pytest.importorskip("distributed")
    cluster = Cluster(tmp_path)
    yield cluster
    for process in cluster.processes:
        kill(process)


def test_a_killed_dask_worker_and_a_killed_client(cluster, scene, expected, tmp_path):
    out = tmp_path / "out"
    first = started(*command(scene, out, "--scheduler", cluster.address))
    wait_until(lambda: count(out) > 0, "no point is done")
    kill(cluster.workers[0])
    before = count(out)
    wait_until(lambda: count(out) > before + 6, "the other worker does not go on")
    kill(first)
    cluster.add_worker()
    goes_on(scene, out, expected, "--scheduler", cluster.address)


def test_a_dask_worker_without_the_package_is_named(cluster, scene, tmp_path):
    broken = "import sys\nsys.modules['taichi_disk'] = None\n"
    (tmp_path / "sitecustomize.py").write_text(broken)
    cluster.without_workers().add_worker(PYTHONPATH=str(tmp_path))
    # a worker that joins later closes itself, and the sweep waits for another
    cluster.wait_for_worker()
    sweep = command(scene, tmp_path / "out", "--scheduler", cluster.address)
    done = subprocess.run(sweep, capture_output=True, text=True, timeout=PATIENCE)
    last = done.stderr.splitlines()[-1]
    assert done.returncode == 2
    assert last.startswith("error: a worker cannot import this package (")
    assert "'taichi_disk' is not a package" in last
    assert last.endswith("): install the same packages everywhere")


def test_a_dask_worker_with_threads_gives_the_bytes(cluster, scene, expected, tmp_path):
    cluster.without_workers().add_worker(threads=4)
    assert finish(scene, tmp_path / "out", "--scheduler", cluster.address) == POINTS
    assert (tmp_path / "out" / "points.csv").read_bytes() == expected


def test_a_sweep_waits_while_there_are_no_workers(cluster, scene, expected, tmp_path):
    out = tmp_path / "out"
    cluster.without_workers()
    process = started(*command(scene, out, "--scheduler", cluster.address))
    assert process.stderr
    for line in process.stderr:
        if "while there are none, the sweep waits" in line:
            break
    assert count(out) == 0
    cluster.add_worker()
    process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    assert (out / "points.csv").read_bytes() == expected


def test_a_scheduler_that_goes_ends_a_sweep_which_says_so(cluster, scene, tmp_path):
    out = tmp_path / "out"
    process = started(*command(scene, out, "--scheduler", cluster.address))
    wait_until(lambda: count(out) > 0, "no point is done")
    kill(cluster.scheduler)
    lines = process.communicate(timeout=PATIENCE)[1].splitlines()
    assert process.returncode == 1
    assert lines[-1] == (
        "error: the workers failed (the scheduler has gone); finished points are kept:"
        " repeat the command to go on"
    )
