"""Where the scene stands, in lines of text."""

from __future__ import annotations

from collections.abc import Iterator

from taichi_disk.scenes.impact import Impact
from taichi_disk.view.sandbox import Sandbox


def readings(sandbox: Sandbox) -> Iterator[str]:
    """Lines for the panel."""
    motion = sandbox.motion
    row = motion.ledger.now()
    yield f"t = {motion.ledger.t:.4f} R/c   step {motion.step.dt:.2e} R/c"
    yield f"v_cm = {row['com_vy']:+.6f} c"
    xi = motion.unloaded - (row["com_y"] - row["lowest_y"])
    if isinstance(motion.setup, Impact):
        e = f"{sandbox.result['restitution']:.6f}" if sandbox.result else "-"
        yield f"e = {e}   xi = {xi:+.6f} R"
    else:
        yield f"xi = {xi:+.6f} R"
    yield f"contact force = {row['wall_force']:.3e} M c^2/R"
    yield f"energy: kinetic {row['kinetic']:.2e}, elastic {row['elastic']:.2e},"
    yield f"   lost {row['dissipated'] + row['absorbed'] + row['sliding']:.2e} M c^2"
    if given := motion.ledger.given():
        yield f"   given by hand {given:+.2e} M c^2"
    yield f"energy imbalance {motion.ledger.imbalance() / motion.scale:+.1e}"
    if motion.behind:
        yield "made again with a shorter step..."
    else:
        yield "changed by hand: r to restart as saved" if motion.changed else "this is what run computes"
    yield "mouse: turn in flight, pull; Esc lets go"
