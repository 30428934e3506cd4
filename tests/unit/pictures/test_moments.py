"""The moments of a film of several bounces."""

import numpy as np
from bodies import computed

from taichi_disk.experiments.computation.contact import contacts_of
from taichi_disk.pictures.plot import plot_scene
from taichi_disk.pictures.render.moments import WHOLE, captions, cues, curve_span
from taichi_disk.pictures.render.recording import Flight
from taichi_disk.pictures.web.throws import throwable

BOUNCES = ("bouncing_disk", "lattice.points=60", "impact.bounces=3")


def test_a_film_of_bounces_slows_down_in_contacts_and_names_each_result(kernels):
    scenario, run = computed(kernels, *BOUNCES)
    whole = curve_span(run)
    assert whole == (0.0, run.series["t"][-1])
    shots = captions(run, cues([run], whole, 240, 30.0, WHOLE, False))
    e = [run.summary[f"restitution{n}"] for n in ("", "_2", "_3")]
    texts = [f"e{n} = {value:.3f}" for n, value in zip("₁₂₃", e, strict=True)]
    assert list(dict.fromkeys(shot.result for shot in shots)) == ["", *texts]
    contacts = contacts_of(run.series)
    assert len(contacts) == 3
    times = np.unique([shot.t for shot in shots])
    inside = sum(((times > one.start) & (times < one.end)).sum() for one in contacts)
    duration = sum(one.end - one.start for one in contacts)
    assert duration < 0.15 * whole[1]
    assert 0.35 < inside / len(times) < 0.7
    # the velocity stays on display, and the curve shows the height above the wall
    assert all(shot.lines[-1].endswith(" v") for shot in shots)
    height = plot_scene(scenario, run.series).curves[0].values
    assert 0.4 < height.max() < scenario.scene.impact.rise
    # The states end with the run, and a page does not throw the disk again.
    flight = Flight.of(run, 0.33)
    assert (flight.start, flight.end) == whole
    assert not throwable(flight)
