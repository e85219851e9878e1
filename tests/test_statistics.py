"""Area-weighted statistics against exact truths."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from inspect3d.deviate.statistics import Statistics, percentiles

VALUES = hnp.arrays(np.float64, st.integers(1, 40), elements=st.floats(-1e3, 1e3))


def test_a_constant_map_has_that_mean_and_no_spread():
    figures = Statistics.of(np.full(7, 0.25), np.arange(1.0, 8.0))
    assert (figures.mean, figures.rms, figures.min, figures.max) == pytest.approx((0.25,) * 4)
    assert (figures.p05, figures.p50, figures.p95) == pytest.approx((0.25,) * 3)
    assert figures.std == pytest.approx(0.0, abs=1e-15)


def test_two_values_of_unequal_area_have_the_mean_and_spread_of_two_masses():
    figures = Statistics.of([0.0, 1.0], [1.0, 3.0])
    assert figures.mean == pytest.approx(0.75)
    assert figures.std == pytest.approx(np.sqrt(0.75 * 0.25))
    assert figures.rms == pytest.approx(np.sqrt(0.75))
    assert figures.count == 2


def test_with_equal_areas_the_percentiles_are_hazens():
    values = np.random.default_rng(0).normal(size=101)
    asked = (1.0, 5.0, 50.0, 95.0, 99.0)
    expected = np.percentile(values, asked, method="hazen")
    assert percentiles(values, np.ones(101), asked) == pytest.approx(expected, abs=1e-12)


def test_a_finely_sampled_ramp_has_the_percentiles_of_a_uniform_distribution_whatever_the_mesh():
    edges = np.linspace(0.0, 1.0, 2001) ** 2
    middle, width = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    figures = Statistics.of(middle, width)
    assert (figures.p05, figures.p50, figures.p95) == pytest.approx((0.05, 0.5, 0.95), abs=1e-3)
    assert figures.mean == pytest.approx(0.5, abs=1e-6)
    assert figures.std == pytest.approx(np.sqrt(1 / 12), abs=1e-6)


def test_a_value_without_area_counts_for_nothing_but_the_extremes():
    with_it = Statistics.of([1.0, 2.0, 3.0, 99.0], [1.0, 1.0, 2.0, 0.0])
    without = Statistics.of([1.0, 2.0, 3.0], [1.0, 1.0, 2.0])
    assert (with_it.mean, with_it.std, with_it.p95) == pytest.approx((without.mean, without.std, without.p95))
    assert with_it.max == 99.0


@given(VALUES, st.floats(1e-3, 1e3), st.randoms(use_true_random=False))
def test_neither_the_unit_of_area_nor_the_order_of_the_nodes_matters(values, unit, random):
    weights = np.linspace(1.0, 2.0, len(values))
    order = np.array(random.sample(range(len(values)), len(values)))
    one, other = Statistics.of(values, weights), Statistics.of(values[order], unit * weights[order])
    assert (one.mean, one.std, one.p50) == pytest.approx((other.mean, other.std, other.p50), rel=1e-9, abs=1e-9)


@given(VALUES)
def test_rms_squared_is_mean_squared_plus_variance_and_percentiles_lie_in_order(values):
    figures = Statistics.of(values, np.linspace(0.5, 3.0, len(values)))
    assert figures.rms**2 == pytest.approx(figures.mean**2 + figures.std**2, rel=1e-9, abs=1e-9)
    assert figures.min <= figures.p05 <= figures.p50 <= figures.p95 <= figures.max


@pytest.mark.parametrize(
    ("values", "weights"),
    [([], []), ([np.nan], [1.0]), ([1.0], [-1.0]), ([1.0, 2.0], [0.0, 0.0]), ([1.0, 2.0], [1.0])],
)
def test_figures_of_nothing_are_refused(values, weights):
    with pytest.raises(ValueError, match=r"values|weights"):
        Statistics.of(values, weights)
