"""Stereocorrelation finds the shape of a speckled sheet whose pictures are computed exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from inspect3d.camera import View
from inspect3d.correlation.correlate import Correlate
from inspect3d.correlation.freedom import Freedom, Lens
from inspect3d.correlation.systematic import Systematic
from inspect3d.correlation.ways import JOINT, SHAPE, TWO_STEPS
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose
from tests.sheets import plane, plane_normals, sheet
from tests.speckled import Speckle, photographed, picture, rig

EXACT = Lens()


def bump(x, y, height=0.03):
    """Return a deviation in the middle of the sheet, mm."""
    return height * np.exp(-((x - 25) ** 2 + (y - 20) ** 2) / 2 / 8**2)


def pictures(views, deviation=bump, seed=0, speckle=0, noise=2.4, **form):
    """Return noisy pictures of the sheet in all views, of different gain and offset."""
    random = np.random.default_rng(seed)
    pattern = Speckle.drawn(np.random.default_rng(speckle), 0.7)
    exact = [picture(view, pattern, deviation, **form) for view in views]
    return [photographed(random, e, noise, random.uniform(0.8, 1.05), random.uniform(0, 8)) for e in exact]


def freedom(poses, lens, views, nominal):
    """Return the same freedom for every view."""
    return Freedom(poses, (lens,) * len(views), views, nominal.mesh.nodes.mean(axis=0))


def errors(shape, deviation=bump):
    """Return error and uncertainty of the observed nodes in the common gauge, mm."""
    found = shape.deviation(shape.gauge)
    seen = found.observed
    true = shape.gauge(deviation(shape.mesh.nodes[seen, 0], shape.mesh.nodes[seen, 1]))
    return found.value[seen] - true, found.sigma[seen]


def without_weak(shape, other, error):
    """Return an error of a shape without what another one lists as hidden or weak, and without rigid motions."""
    weak = np.stack([motion.pattern for motion in other.hidden], axis=1)[shape.sound]
    modes = np.column_stack([weak, shape.gauge.jacobian])
    return error - modes @ np.linalg.lstsq(modes, error, rcond=None)[0]


def rms(values):
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.fixture(scope="module")
def nominal():
    """Return the wavy sheet with elements of 4 mm."""
    return sheet(edge=4.0)


@pytest.fixture(scope="module")
def views():
    """Return two cameras 27 degrees apart."""
    return rig()


@pytest.fixture(scope="module")
def known(nominal, views):
    """Return the shape measured with known cameras."""
    return Correlate()(nominal, pictures(views), views)


def test_with_known_cameras_the_bump_is_found_within_three_micrometres(known):
    error, sigma = errors(known)
    assert known.settled
    assert known.observed.all()
    assert rms(error) < 0.003
    assert np.abs(error).max() < 0.025
    assert 0.8 < rms(error / sigma) < 1.2


def test_known_cameras_hide_nothing_and_give_the_part_its_place(known, views, nominal):
    assert known.hidden == ()
    lifted = Correlate()(nominal, pictures(views, lambda x, y: 0.05 + 0 * x), views)
    assert lifted.deviation().value == pytest.approx(0.05, abs=0.012)
    assert np.mean(lifted.deviation().value) == pytest.approx(0.05, abs=0.001)


def test_noiseless_pictures_of_the_nominal_shape_deviate_nowhere(nominal, views):
    flat = Correlate()(nominal, pictures(views, lambda x, y: 0 * x, noise=0.0), views)
    assert rms(flat.deviation().value) < 0.0015


def test_two_more_cameras_make_the_shape_surer(nominal, known):
    four = rig(angles=(-0.24, -0.2, 0.2, 0.24))
    shape = Correlate()(nominal, pictures(four), four)
    error, sigma = errors(shape)
    assert 0.8 < rms(error / sigma) < 1.2
    assert np.median(sigma) < 0.85 * np.median(errors(known)[1])


def test_gain_and_offset_of_a_picture_change_nothing(nominal, views):
    grey = pictures(views)
    plain = Correlate(levels=SHAPE)(nominal, grey, views).deviation().value
    brighter = Correlate(levels=SHAPE)(nominal, [grey[0], 0.5 * grey[1] + 30], views).deviation().value
    assert rms(plain - brighter) < 2e-4


def test_free_poses_hide_the_scale_and_nothing_of_a_bump(nominal, views):
    start = tuple(
        View(
            view.camera,
            view.camera_from_cad @ Pose.small(np.array([1e-3, -5e-4, 1e-3, 0.05, -0.1, 0.2]) * k, np.zeros(3)),
        )
        for k, view in enumerate(views, start=-1)
    )
    shape = Correlate()(nominal, pictures(views), start, freedom("free", EXACT, views, nominal))
    error, sigma = errors(shape)
    assert shape.settled
    assert [motion.words for motion in shape.hidden] == ["growth of the whole part: the scale is not known"]
    assert rms(error) < 0.004
    assert 0.75 < rms(error / sigma) < 1.25


def test_a_known_rig_finds_the_place_of_the_part(nominal, views):
    moved = Pose.small(np.array([1e-3, 2e-3, -1e-3, 0.1, -0.1, 0.2]), nominal.mesh.nodes.mean(axis=0))
    start = tuple(View(view.camera, view.camera_from_cad @ moved) for view in views)
    shape = Correlate()(nominal, pictures(views), start, freedom("common", EXACT, views, nominal))
    error, sigma = errors(shape)
    assert shape.hidden == ()
    assert rms(error) < 0.003
    assert 0.8 < rms(error / sigma) < 1.2
    between = shape.views[1].camera_from_cad @ shape.views[0].camera_from_cad.inverse()
    truth = views[1].camera_from_cad @ views[0].camera_from_cad.inverse()
    assert between.matrix == pytest.approx(truth.matrix, abs=1e-9)


@pytest.fixture(scope="module")
def misjudged(views):
    """Return views whose focal lengths are 1 % off and whose poses make up for it."""
    found = []
    for view, error in zip(views, (1.01, 0.992), strict=True):
        matrix = view.camera.matrix.copy()
        matrix[0, 0] *= error
        matrix[1, 1] *= error
        back = (error - 1) * view.depth(np.array([[30.0, 22.5, 0.0]]))[0] * view.camera_from_cad.rotation[2]
        pose = view.camera_from_cad @ Pose(np.eye(3), back)
        found.append(View(replace(view.camera, matrix=matrix), pose))
    return tuple(found)


def test_self_calibrated_the_error_stays_within_the_claim(nominal, views, misjudged):
    free = freedom("free", Lens(focal=48.0, centre=5.0), misjudged, nominal)
    shape = Correlate()(nominal, pictures(views), misjudged, free)
    error, sigma = errors(shape)
    assert shape.settled
    assert rms(error / sigma) < 2.0
    assert rms(error) < 0.02
    assert len(shape.hidden) >= 2
    for view, truth in zip(shape.views, views, strict=True):
        assert abs(view.camera.matrix[0, 0] - truth.camera.matrix[0, 0]) < 24


def test_without_the_weak_motions_a_self_calibrated_map_is_as_good_as_a_calibrated_one(nominal, views, misjudged):
    free = freedom("free", Lens(focal=48.0, centre=5.0), misjudged, nominal)
    shape = Correlate()(nominal, pictures(views), misjudged, free)
    error, _ = errors(shape)
    assert rms(without_weak(shape, shape, error)) < 0.0035


def test_the_papers_two_steps_let_the_cameras_swallow_part_of_a_bump(nominal, views):
    def tall(x, y):
        return bump(x, y, 0.2)

    grey, free = pictures(views, tall), freedom("free", Lens(focal=48.0), views, nominal)
    joint = Correlate(levels=JOINT)(nominal, grey, views, free)
    steps = Correlate(levels=TWO_STEPS)(nominal, grey, views, free)
    assert rms(without_weak(joint, joint, errors(joint, tall)[0])) < 0.003
    assert rms(without_weak(steps, joint, errors(steps, tall)[0])) > 0.01


def test_flat_facets_miss_the_surface_by_the_chord(nominal, views, known):
    flat = Correlate(lifted=False)(nominal, pictures(views), views)
    assert rms(errors(flat)[0]) > 4 * rms(errors(known)[0])


def test_linear_interpolation_as_in_the_paper_finds_the_bump_too(nominal, views):
    shape = Correlate(interpolation="linear", per_edge=6)(nominal, pictures(views), views)
    assert rms(errors(shape)[0]) < 0.012


def test_nodes_under_a_stain_are_not_observed_and_the_others_are_right(nominal, views):
    grey = pictures(views)
    grey[1][200:280, 250:330] = np.random.default_rng(5).uniform(0, 255, (80, 80))
    shape = Correlate()(nominal, grey, views)
    error, sigma = errors(shape)
    pixels = views[1].project(nominal.mesh.nodes)
    middle = (np.abs(pixels - [289.5, 239.5]) < 25).all(axis=1)
    assert middle.any()
    assert not shape.observed[middle].any()
    assert shape.observed.mean() > 0.8
    assert rms(error / sigma) < 1.25
    assert np.abs(error).max() < 0.025


def test_a_node_of_an_edge_that_belongs_to_a_face_out_of_sight_is_not_observed(nominal, views, known):
    seen = np.flatnonzero(known.observed)
    node = seen[np.argmin(nominal.mesh.nodes[seen, 1])]
    normals = nominal.mesh.normals.copy()
    normals[node] = [0.0, -1.0, 0.0]
    shape = Correlate()(replace(nominal, mesh=replace(nominal.mesh, normals=normals)), pictures(views), views)
    assert not shape.observed[node]
    assert shape.observed[seen].sum() == len(seen) - 1


def test_a_smooth_shift_of_the_pictures_is_in_the_claim_that_states_it(nominal, views):
    grey, stated = pictures(views), Systematic(size=0.035, length=15.0)
    rows, columns = np.mgrid[: grey[0].shape[0], : grey[0].shape[1]]
    from scipy.ndimage import map_coordinates

    shift = 0.07 * np.sin(columns / 130 + 0.4)
    grey[1] = map_coordinates(grey[1], [rows, columns + shift], order=3, mode="nearest")
    plain, wide = Correlate()(nominal, grey, views), Correlate(systematic=stated)(nominal, grey, views)
    assert rms(np.divide(*errors(plain))) > 1.5
    assert 0.4 < rms(np.divide(*errors(wide))) < 1.2


def test_the_cameras_may_slide_over_a_flat_part_and_the_motions_are_named(views):
    nominal = sheet(plane, plane_normals, edge=6.0)
    grey = pictures(views, lambda x, y: 0 * x, height=plane, normals=plane_normals)
    shape = Correlate()(nominal, grey, views, freedom("common", EXACT, views, nominal))
    words = [motion.words for motion in shape.hidden]
    assert len(words) == 3
    assert sum("shift along" in word for word in words) == 2
    assert sum("turn about the axis along (0, 0, 1)" in word for word in words) == 1
    assert rms(errors(shape, lambda x, y: 0 * x)[0]) < 0.003


@pytest.mark.parametrize("fault", ["blank", "another part", "swapped", "identical"])
def test_pictures_that_do_not_belong_together_are_refused(nominal, views, fault):
    grey = pictures(views)
    spoiled = {
        "blank": [grey[0], np.full_like(grey[1], 255.0)],
        "another part": [grey[0], pictures(views, speckle=1)[1]],
        "swapped": grey[::-1],
        "identical": [grey[0], grey[0]],
    }[fault]
    with pytest.raises(MeasurementError, match=r"^The pictures"):
        Correlate()(nominal, spoiled, views)


def test_a_part_seen_from_behind_is_refused_with_the_reason(nominal):
    behind = rig(angles=(np.pi - 0.2, np.pi + 0.2))
    grey = [np.zeros((480, 620)), np.ones((480, 620))]
    with pytest.raises(MeasurementError, match="normals of the part point out"):
        Correlate()(nominal, grey, behind)


def test_a_picture_of_another_size_than_its_camera_is_refused(nominal, views):
    with pytest.raises(MeasurementError, match="Picture 2 has 600 x 480 pixels"):
        Correlate()(nominal, [np.zeros((480, 620)), np.zeros((480, 600))], views)
