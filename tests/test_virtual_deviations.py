"""Truths about deviation fields."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inspect3d.outcome import InputError
from inspect3d.virtual.deviation_field import (
    Bump,
    FacetErrors,
    Scallops,
    Step,
    Sum,
    Uniform,
    Wave,
    Within,
    described,
    field_of,
)

POINTS = np.random.default_rng(0).uniform(-50.0, 50.0, (2000, 3))
FIELDS = [
    Uniform(0.1),
    Bump((1.0, 2.0, 3.0), 0.3, 8.0),
    Wave(0.02, (0.01, 0.0, -0.02), 0.4),
    Step(0.04, (10.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
    FacetErrors((-20.0, 0.0, 30.0), (0.015, -0.01), (0.0, 1.0, 0.0)),
    Scallops(0.012, 1.6, (1.0, 1.0, 0.0)),
    Within(Uniform(0.2), (-10.0, -10.0, -10.0), (10.0, 10.0, 10.0)),
]
fields = st.sampled_from(FIELDS)


@given(fields, fields)
def test_fields_add_up(first, second):
    np.testing.assert_allclose((first + second)(POINTS), first(POINTS) + second(POINTS), atol=1e-15)


@given(fields, fields)
def test_a_field_survives_json(first, second):
    field = first + second
    assert field_of(json.loads(json.dumps(described(field)))) == field


def test_an_empty_sum_is_the_part_as_designed():
    assert not Sum()(POINTS).any()


def test_a_bump_has_its_height_at_the_centre_and_half_of_it_half_a_width_away():
    bump = Bump((1.0, 2.0, 3.0), height=0.3, width=8.0)
    at = np.array([[1.0, 2.0, 3.0], [5.0, 2.0, 3.0], [1.0, -2.0, 3.0]])
    np.testing.assert_allclose(bump(at), [0.3, 0.15, 0.15], rtol=1e-14)


def test_a_step_is_high_on_the_side_its_normal_points_to():
    step = Step(0.04, (10.0, 0.0, 0.0), (2.0, 0.0, 0.0))
    assert step(np.array([[9.99, 5.0, 0.0], [10.01, -5.0, 0.0]])).tolist() == [0.0, 0.04]


def test_each_facet_has_its_own_error_and_none_lies_beyond():
    facets = FacetErrors((0.0, 8.0, 16.0), heights=(0.015, -0.01), direction=(2.0, 0.0, 0.0))
    at = np.array([[x, 7.0, -3.0] for x in (-1.0, 4.0, 12.0, 17.0)])
    assert facets(at).tolist() == [0.0, 0.015, -0.01, 0.0]


def test_facet_errors_need_one_height_per_facet():
    with pytest.raises(ValueError, match="3 borders enclose 2 facets"):
        FacetErrors((0.0, 8.0, 16.0), (0.1,), (1.0, 0.0, 0.0))


def test_scallops_touch_zero_in_the_passes_and_their_height_between_them():
    scallops = Scallops(0.012, pitch=1.6, direction=(1.0, 0.0, 0.0))
    at = np.column_stack([np.linspace(0.0, 160.0, 100_001), np.zeros((100_001, 2))])
    np.testing.assert_allclose(scallops(at[::1000]), 0.0, atol=1e-15)
    assert scallops(at).max() == pytest.approx(0.012)
    assert scallops(at).mean() == pytest.approx(0.012 / 3, rel=1e-4)


def test_a_wave_has_its_period_and_amplitude():
    wave = Wave(0.02, (0.01, 0.0, 0.0), 0.4)
    shifted = POINTS + np.array([100.0, 3.0, -8.0])
    np.testing.assert_allclose(wave(shifted), wave(POINTS), atol=1e-14)
    assert np.sqrt(np.mean(wave(np.linspace([0, 0, 0], [100, 0, 0], 1000, endpoint=False)) ** 2)) == pytest.approx(
        0.02 / np.sqrt(2)
    )


def test_an_unknown_kind_of_field_is_an_error():
    with pytest.raises(InputError, match="'Dent' is no deviation field"):
        field_of({"kind": "Dent"})
