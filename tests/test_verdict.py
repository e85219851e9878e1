"""The verdict keeps the risk it states, over many virtual parts at the limit of their tolerance."""

import numpy as np
import pytest

from inspect3d.compare.verdict import CONFORM, NONCONFORM, NONE, UNDECIDED, verdict
from inspect3d.deviate.deviate import Deviate
from inspect3d.deviate.deviation import Deviation
from inspect3d.measure import Cloud
from inspect3d.pose import Pose
from inspect3d.register.alignment import Alignment
from inspect3d.register.gauge import best_fit
from tests.sheets import DEPTH, WIDTH, scanned, sheet

LIMIT, PROBABILITY = 0.05, 0.95


@pytest.fixture(scope="module")
def judged():
    """Verdict, true deviation and sigma of every observed node of 200 parts whose form error reaches the limits."""
    nominal = sheet(edge=5.0, fine=0.4)
    mesh = nominal.mesh
    found = []
    for seed in range(200):
        random = np.random.default_rng(seed)
        size, phase = random.uniform(0.06, 0.1), random.uniform(0, 2 * np.pi, 2)

        def form(x, y, size=size, phase=phase):
            return size * np.sin(2 * np.pi * x / WIDTH + phase[0]) * np.cos(2 * np.pi * y / DEPTH + phase[1])

        points, _ = scanned(random, 2500, deviation=form, noise=0.015)
        placed = Alignment(Pose.identity(), 1.0, 0.02, np.zeros((6, 6)), np.zeros(3), np.ones(len(points), bool))
        cloud = Cloud("scan", points)
        deviation = Deviate()((cloud,), (placed,), nominal, np.ones(len(mesh), bool)).deviation
        seen = deviation.observed
        gauge = best_fit(mesh.nodes[seen], mesh.normals[seen], mesh.areas[seen], deviation.value[seen])
        truth = gauge(form(mesh.nodes[seen, 0], mesh.nodes[seen, 1]))
        kinds = verdict(deviation, np.tile([-LIMIT, LIMIT], (len(mesh), 1)), PROBABILITY)
        found.append((kinds[seen], truth, deviation.sigma[seen]))
    return tuple(np.concatenate(column) for column in zip(*found, strict=True))


def test_false_acceptances_are_no_more_frequent_than_stated(judged):
    kinds, truth, _ = judged
    outside = np.abs(truth) > LIMIT
    assert outside.sum() > 2000
    assert np.mean(kinds[outside] == CONFORM) <= 1 - PROBABILITY
    at_the_limit = outside & (np.abs(truth) < LIMIT + 1e-3)
    assert np.mean(kinds[at_the_limit] == CONFORM) <= 1 - PROBABILITY + 3 * np.sqrt(0.05 * 0.95 / at_the_limit.sum())


def test_false_rejections_are_no_more_frequent_than_stated(judged):
    kinds, truth, _ = judged
    assert np.mean(kinds[np.abs(truth) < LIMIT] == NONCONFORM) <= 1 - PROBABILITY


def test_nodes_that_are_clearly_inside_conform(judged):
    kinds, truth, sigma = judged
    clear = LIMIT - np.abs(truth) >= 4 * sigma
    assert clear.sum() > 2000
    assert np.mean(kinds[clear] == CONFORM) >= 0.95


def test_the_verdict_near_the_limit_is_undecided(judged):
    kinds, truth, sigma = judged
    near = np.abs(np.abs(truth) - LIMIT) < 0.2 * sigma
    assert np.mean(kinds[near] == UNDECIDED) > 0.8


def test_what_nobody_measured_is_not_shown_to_conform():
    deviation = Deviation(np.array([0.0, np.nan]), np.array([0.001, np.nan]), np.array([True, False]))
    assert list(verdict(deviation, np.tile([-LIMIT, LIMIT], (2, 1)), PROBABILITY)) == [CONFORM, NONE]
