"""What this machine can do, and the command that mends what is missing.

Whatever may crash a process (Taichi's start, the Vulkan and CUDA drivers) is tried in a process of its own.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

APT = "apt-get update && apt-get install -y --no-install-recommends"
PROBE_SECONDS = 120

_COMPUTE = """
import taichi as ti
ti.init(arch=ti.cpu, default_fp=ti.f64, log_level=ti.ERROR, offline_cache=False)
x = ti.field(ti.f64, 4)
x.fill(0.25)
assert x.to_numpy().sum() == 1.0
print(".".join(map(str, ti.__version__)))
"""
_DRAW = """
import taichi as ti
if not ti._lib.core.with_vulkan():
    raise SystemExit("no Vulkan driver")
ti.init(arch=ti.cpu, log_level=ti.ERROR, offline_cache=False)
window = ti.ui.Window("doctor", (64, 64), show_window=False)
window.get_canvas().set_background_color((1.0, 1.0, 1.0))
assert window.get_image_buffer_as_numpy().min() > 0.99
print("draws off screen")
"""
_CUDA = """
import taichi as ti
if not ti._lib.core.with_cuda():
    raise SystemExit("no CUDA device")
ti.init(arch=ti.cuda, default_fp=ti.f64, log_level=ti.ERROR, offline_cache=False)
x = ti.field(ti.f64, 4)
x.fill(0.25)
assert x.to_numpy().sum() == 1.0
print("computes, with --arch cuda; whether faster than the cores is to be tried")
"""
_ENCODE = """
import subprocess
from imageio_ffmpeg import get_ffmpeg_exe, get_ffmpeg_version
test = "-v error -f lavfi -i color=size=64x64:duration=0.1 -c:v libx264 -pix_fmt yuv420p -f null -"
done = subprocess.run([get_ffmpeg_exe(), *test.split()], capture_output=True, text=True)
if done.returncode:
    raise SystemExit(done.stderr)
print(f"ffmpeg {get_ffmpeg_version()} encodes H.264")
"""


@dataclass(frozen=True)
class Finding:
    """One thing looked at. `needed`: `taichi-disk run` with its film does not work without it."""

    name: str
    ok: bool
    found: str
    mend: str = ""
    needed: bool = True


def examine() -> list[Finding]:
    """Look at all that `run` needs, and at what is good to have. Takes a few seconds; raises nothing."""
    return [_python(), _taichi(), _vulkan(), _ffmpeg(), _cuda(), _cores(), _memory(), _cache(), _display()]


def print_findings(findings: Sequence[Finding]) -> bool:
    """Print a table and what to do; whether everything needed is there."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False)
    for heading in ("", "what", "found"):
        table.add_column(heading, overflow="fold")
    for one in findings:
        word, colour = ("ok", "green") if one.ok else ("missing", "red") if one.needed else ("no", "yellow")
        table.add_row(Text(word, colour), one.name, Text(one.found))
    Console(highlight=False).print(table)
    for one in findings:
        if not one.ok and one.mend:
            print(f"\n{one.name}:\n    {one.mend}")
    missing = [one.name for one in findings if one.needed and not one.ok]
    print("\n" + (f"Not ready: {', '.join(missing)}" if missing else "Ready: scenes can be run and filmed here."))
    return not missing


def _probe(code: str) -> tuple[bool, str]:
    """Run Python code in a process of its own: whether it succeeded, and the last line that it said."""
    environment = {**os.environ, "ENABLE_TAICHI_HEADER_PRINT": "0"}
    try:
        # GGUI leaves its imgui.ini wherever it is started.
        with TemporaryDirectory() as folder:
            done = subprocess.run(
                [sys.executable, "-c", code],
                capture_output=True,
                text=True,
                errors="replace",
                env=environment,
                cwd=folder,
                timeout=PROBE_SECONDS,
            )
    except subprocess.TimeoutExpired:
        return False, f"no answer within {PROBE_SECONDS} s"
    if done.returncode < 0:
        return False, f"crashed ({signal.Signals(-done.returncode).name})"
    text = done.stdout if done.returncode == 0 else done.stderr
    return done.returncode == 0, (text.strip().splitlines() or ["failed without a message"])[-1]


def _python() -> Finding:
    version = sys.version_info
    found = f"{version.major}.{version.minor}.{version.micro}"
    return Finding("Python", (3, 10) <= version < (3, 14), found, "install Python 3.10, 3.11, 3.12 or 3.13")


def _taichi() -> Finding:
    ok, found = _probe(_COMPUTE)
    mend = f"{APT} libx11-6" if "libX11" in found else "pip install taichi==1.7.4"
    return Finding("Taichi on the CPU", ok, found, mend)


def _vulkan() -> Finding:
    ok, found = _probe(_DRAW)
    return Finding("Vulkan, for the film", ok, found, f"{APT} libx11-6 mesa-vulkan-drivers")


def _ffmpeg() -> Finding:
    ok, found = _probe(_ENCODE)
    return Finding("ffmpeg, for the film", ok, found, "pip install --force-reinstall imageio-ffmpeg")


def _cuda() -> Finding:
    ok, found = _probe(_CUDA)
    return Finding("CUDA", ok, found, needed=False)


def _cores() -> Finding:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return Finding("processor cores", True, str(cores), needed=False)


def _memory() -> Finding:
    try:
        total = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return Finding("memory", True, "unknown", needed=False)
    # In a container the limit of its control group counts ("max": none).
    with suppress(OSError, ValueError):
        total = min(total, int(Path("/sys/fs/cgroup/memory.max").read_text()))
    mend = "a run takes up to 1 GB: stop other programs, or take fewer points"
    return Finding("memory", total >= 1e9, f"{total / 1e9:.1f} GB", mend, needed=False)


def _cache() -> Finding:
    folder = Path(os.environ.get("TI_OFFLINE_CACHE_FILE_PATH") or Path.home() / ".cache" / "taichi")
    existing = next((one for one in (folder, *folder.parents) if one.exists()), folder)
    ok = existing.is_dir() and os.access(existing, os.W_OK)
    mend = "set TI_OFFLINE_CACHE_FILE_PATH to a writable folder, else every run compiles anew"
    return Finding("cache of kernels", ok, f"{folder}{'' if ok else ' cannot be written'}", mend, needed=False)


def _display() -> Finding:
    display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return Finding("display, for windows", bool(display), display or "none (films need none)", needed=False)
