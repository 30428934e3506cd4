"""What this machine can do, and the command that mends what is missing.

Whatever may crash a process (Taichi's start, the Vulkan driver) is tried in a process of its own.
"""

from __future__ import annotations

import os
import platform
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from tempfile import TemporaryDirectory

from taichi_disk.runtime import CACHE, cache_folder, free_memory, prepare_environment, writable

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
_ENCODE = """
import av, io
import numpy as np
with av.open(io.BytesIO(), "w", format="mp4") as film:
    stream = film.add_stream("libx264", rate=30)
    stream.width = stream.height = 64
    stream.pix_fmt = "yuv420p"
    frame = av.VideoFrame.from_ndarray(np.zeros((64, 64, 3), np.uint8), format="rgb24")
    for packet in [*stream.encode(frame), *stream.encode(None)]:
        film.mux(packet)
print(f"PyAV {av.__version__} encodes H.264")
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
    computes, draws, encodes = probe(_COMPUTE), probe(_DRAW), probe(_ENCODE)
    taichi = f"{APT} libx11-6" if "libX11" in computes[1] else "pip install taichi==1.7.4"
    cache, free = cache_folder(), free_memory()
    kept = "HOME" in os.environ and writable(cache)
    elsewhere = f"kernels are kept in the temporary directory instead; set {CACHE} (and HOME) to keep them for good"
    memory = "a run takes up to 1 GB: stop other programs, or take fewer points"
    display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY") or ""
    return [
        Finding("Python", True, platform.python_version(), needed=False),
        Finding("Taichi on the CPU", *computes, taichi),
        Finding("Vulkan, for the film", *draws, f"{APT} libx11-6 mesa-vulkan-drivers"),
        Finding("encoder, for the film", *encodes, "pip install --force-reinstall 'imageio[pyav]'"),
        Finding("processor cores", True, str(len(os.sched_getaffinity(0))), needed=False),
        Finding("free memory", free >= 1e9, f"{free / 1e9:.1f} GB", memory, needed=False),
        Finding("cache of kernels", kept, f"{cache}{'' if kept else ' cannot be written'}", elsewhere, needed=False),
        Finding("display, for windows", display != "", display or "none (films need none)", needed=False),
    ]


def print_findings(findings: Sequence[Finding]) -> bool:
    """Print a table and what to do; whether everything needed is there."""
    for one in findings:
        word = "ok" if one.ok else "missing" if one.needed else "no"
        print(f"{word:<8} {one.name:<22} {one.found}")
    for one in findings:
        if not one.ok and one.mend:
            print(f"\n{one.name}:\n    {one.mend}")
    missing = [one.name for one in findings if one.needed and not one.ok]
    print("\n" + (f"Not ready: {', '.join(missing)}" if missing else "Ready: scenes can be run and filmed here."))
    return not missing


def probe(code: str) -> tuple[bool, str]:
    """Run Python code in a process of its own: whether it succeeded, and the last line that it said."""
    prepare_environment()
    command = [sys.executable, "-c", code]
    try:
        with TemporaryDirectory() as folder:  # GGUI leaves its imgui.ini wherever it is started
            done = subprocess.run(
                command, capture_output=True, text=True, errors="replace", cwd=folder, timeout=PROBE_SECONDS
            )
    except subprocess.TimeoutExpired:
        return False, f"no answer within {PROBE_SECONDS} s"
    if done.returncode < 0:
        return False, f"crashed ({signal.Signals(-done.returncode).name})"
    text = done.stdout if done.returncode == 0 else done.stderr
    return done.returncode == 0, (text.strip().splitlines() or ["failed without a message"])[-1]
