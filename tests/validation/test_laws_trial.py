"""Fits' intervals hold, and laws are refuted, as often as docs/numerics.md says."""

import pytest

from . import laws_trial as trial

pytestmark = pytest.mark.validate


@pytest.mark.parametrize("source", trial.SYNTHETIC, ids=lambda source: source.name)
def test_intervals_cover_and_a_true_law_is_seldom_refuted_whatever_points_share(source):
    for lattices in (5, 8):
        found = trial.fits(source, lattices, draws=1000)
        for covered in trial.coverage(source, found):
            assert 0.925 < covered < 0.985
        assert trial.refused(found) < 0.022


def test_a_law_is_refuted_by_real_lattices_if_it_does_not_hold(kernels):
    e = trial.population(100)
    true = trial.sampled("true", trial.with_law(e))
    false = trial.sampled("false", e)
    for lattices, few, many in ((8, 0.03, 0.08), (32, 0.03, 0.5)):
        found = trial.fits(true, lattices, draws=500)
        for covered in trial.coverage(true, found):
            assert covered > 0.92
        assert trial.refused(found) < few
        assert trial.refused(trial.fits(false, lattices, draws=500)) > many
