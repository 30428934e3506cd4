"""A blow-up is found within one chunk of steps and told with step, place, likely cause and remedy."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from worlds import disk, disk_and_wall

from taichi_disk.diagnosis import contacts, diagnose, gone_through
from taichi_disk.model.physics import Physics
from taichi_disk.scene_file import load_scene
from taichi_disk.simulate import BlowUp, first_lost
from taichi_disk.study.hard_cases import compute

SMALL = ("lattice.points=80", "material.eta_star=0")


def columns(total: list[float]) -> dict[str, np.ndarray]:
    none = np.zeros(len(total))
    kinetic = np.array(total)
    return {"t": np.arange(len(total)), "kinetic": kinetic, "total": kinetic} | dict.fromkeys(
        ("elastic", "wall", "load", "sliding"), none
    )


def test_a_lost_balance_is_seen_even_where_all_energies_are_infinite() -> None:
    assert first_lost(columns([1.0, 1.05, 1.0]), 1) is None
    assert first_lost(columns([1.0, 1.05, 1.2]), 1) == 2
    assert first_lost(columns([1.0, np.nan]), 1) == 1
    # Infinite lost of infinite: no small part of it.
    assert first_lost(columns([1.0, 1.0, np.inf]), 1) == 2
    slid = columns([1.0, 1.0, 1.0])
    assert first_lost(slid | {"sliding": np.array([5.0, 5.05, 4.8])}, 1) == 2


@pytest.mark.usefixtures("taichi")
def test_a_forced_step_is_told_to_the_step_and_the_state_before_it_is_kept() -> None:
    scene = load_scene("exponential_wall", (*SMALL, "time.dt=0.1", "time.sample_interval=0.9"))
    with pytest.raises(BlowUp) as caught:
        compute(scene, force=True)
    found = re.search(r"blow-up at step (\d+), t = ([0-9.]+) R/c", str(caught.value))
    assert found is not None
    step, good = int(found[1]), caught.value.last_good
    assert float(found[2]) == pytest.approx(0.1 * step)
    assert float(good["t"]) == pytest.approx(0.1 * (step - 1))
    # Up to there little is wrong: the disk falls at its speed.
    assert np.isfinite(good["positions"]).all()
    assert good["velocities"][:, 1].mean() == pytest.approx(-0.02, abs=1e-4)


@pytest.mark.usefixtures("taichi")
@pytest.mark.parametrize("moment", ["before", "after"])
def test_a_number_that_is_none_is_found_in_the_next_chunk(monkeypatch, moment) -> None:
    # In the third launch, before its steps or after them.
    from taichi_disk import simulate
    from taichi_disk.model.world import World

    calls, advance = [], World.advance

    def poisoned(world, samples, stride=1):
        calls.append(world.step_number)
        rows = None
        if len(calls) == 4 and moment == "after":
            rows = advance(world, samples, stride)
        if len(calls) == 4:
            state = world.export_state()
            state.vectors[0, 5, 1, 0] = np.nan
            world.import_state(state)
        return advance(world, samples, stride) if rows is None else rows

    monkeypatch.setattr(simulate, "SPRINGS_PER_LAUNCH", 20_000)
    monkeypatch.setattr(World, "advance", poisoned)
    with pytest.raises(BlowUp) as caught:
        compute(load_scene("exponential_wall", (*SMALL, "time.dt=0.02")))
    message = str(caught.value)
    if moment == "after":
        assert "1 of 80 points have no finite state, among them point 5" in message
    else:
        assert "computed again, it is not: the state was changed" in message
    good = caught.value.last_good
    assert calls[2] < round(float(good["t"]) / 0.02) <= calls[3] + 500
    assert all(np.isfinite(values).all() for values in good.values())


def test_a_disk_in_the_wall_or_past_its_end_is_seen() -> None:
    physics, energy = Physics(wall="elastic"), 2e-4
    for height, lift in ((0.03, 0.0), (0.03, 0.5)):
        lattice = disk_and_wall(height=height)
        x = lattice.positions.copy()
        x[: lattice.disk_points, 1] += lift
        assert gone_through(lattice, physics, x, energy) is None
    # Sunk in by 0.05 R; beside the wall, so that only one of its points is in it; past its end.
    for shift, sunk, told in (([0, 0], 0.08, "0.05 R below"), ([3.0, 0], 2.0, "end of the wall")):
        x = lattice.positions.copy()
        x[: lattice.disk_points] += np.array(shift) - [0, sunk]
        found = gone_through(lattice, physics, x, energy)
        assert found is not None and told in found.cause
    # In a potential too weak to keep a point of this energy out, this depth is allowed.
    x = lattice.positions - [0, 0.05] * (np.arange(len(x)) < lattice.disk_points)[:, None]
    assert gone_through(lattice, physics, x, energy) is not None
    assert gone_through(lattice, replace(physics, a=1.0, V0=1e-5), x, energy) is None


def test_contacts_are_those_of_the_pictures() -> None:
    from taichi_disk.contact import contact_forces

    for wall in ("rigid", "elastic"):
        lattice = disk(60, height=0.02) if wall == "rigid" else disk_and_wall(height=0.02)
        physics = Physics(wall=wall)
        points, forces = contact_forces(lattice, physics, lattice.positions)
        mine = dict(zip(lattice.disk_surface.tolist(), contacts(lattice, physics, lattice.positions)[2], strict=True))
        for i, f in zip(points.tolist(), forces, strict=True):
            if i in mine:
                assert mine[i] == pytest.approx(np.hypot(*f), rel=1e-12)


def test_the_cause_named_is_the_one_there_is() -> None:
    lattice = disk(60, height=0.03)
    x, physics = lattice.positions, Physics(wall="rigid")
    beyond = diagnose(lattice, physics, 0.2, 0.1, x, x, 1.0)
    assert "beyond the stability limit" in beyond.cause and "auto" in beyond.remedy
    pushed = diagnose(lattice, physics, 0.05, 0.06, x - [0, 0.02], x, 1.0)
    assert "the wall pushes point" in pushed.cause
    # From out of reach to deep in the wall in one step.
    jumped = diagnose(lattice, Physics(wall="rigid", a=1e5), 0.05, 0.06, x, x - [0, 0.05], 1.0)
    assert "the wall pushes point" in jumped.cause
    stiffened = diagnose(lattice, Physics(k_b=1e6), 0.05, 0.06, 1.1 * x, x, 1.0)
    assert "by the springs' strain" in stiffened.cause
    assert "auto" not in stiffened.remedy  # that may be what blew up; a run by hand is told of it beside this
    crushed = diagnose(lattice, Physics(), 0.01, 0.06, x * [1.0, 0.1], x, 1.0)
    assert "crushed" in crushed.cause
    assert "none is plain" in diagnose(lattice, Physics(), 0.01, 0.06, x, x, 1.0).cause


@pytest.mark.validate
@pytest.mark.parametrize("settings", [("impact.velocity=2",), ("material.k_a=1e-3", "impact.velocity=0.05")])
def test_a_disk_that_goes_through_the_wall_is_seen_in_a_run_a_sweep_and_the_window(settings) -> None:
    from taichi_disk.model import runtime
    from taichi_disk.study.work import Computer
    from taichi_disk.view.sandbox import Sandbox

    bed = ("lattice.points=150", "wall.points=180", "wall.width=3.4")
    scene = load_scene("absorbing_wall", (*bed, *settings))
    runtime.start("cpu", 1)
    with pytest.raises(BlowUp, match="gone through") as caught:
        compute(scene)
    sandbox = Sandbox(scene)
    for _ in range(1000):
        if sandbox.motion.go(2000, 1.0) == 0:
            break
    assert "gone through" in str(sandbox.motion.blown)
    sandbox.destroy()
    ((_, point),) = Computer().compute([scene])
    assert point.status == "failed" and point.reason == str(caught.value)
