"""Real photographs: a speckled cylinder of known radius, a flat sheet, and somebody else's rendered plate."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import pytest
import pyvista as pv
from matplotlib.tri import LinearTriInterpolator, Triangulation
from scipy.optimize import least_squares

from inspect3d.camera import Camera, View
from inspect3d.files.calibration import CameraSigma, Rig
from inspect3d.files.calibration_json import write_calibration_json
from inspect3d.files.calibration_load import load_calibration
from inspect3d.inspection import run
from inspect3d.outcome import Status
from inspect3d.pose import Pose

pytestmark = [pytest.mark.data, pytest.mark.slow]

# What 0.3 to 0.4 px, the residual of the calibration's own points, mean for a lens of 2600 px and a part 290 mm away.
MULTIDIC = CameraSigma(0.5, 1.0, np.array([3e-3, 1e-2, 2e-4, 2e-4, 1e-2]), rotation=2e-4, translation=0.05)


@dataclass(frozen=True, eq=False)
class Measured:
    """A finished measurement: its part of the record, the mesh, and the measured points (n, 3) mm of observed nodes."""

    part: object
    mesh: object
    points: np.ndarray
    seen: int

    @property
    def sigma(self):
        """Return the uncertainty of the observed nodes, mm."""
        return self.part.deviation.sigma[self.part.deviation.observed]


def measured(folder, name, cad, images, cameras, element, alignment):
    """Run stereocorrelation on a recipe written into a folder."""
    recipe = f"""
schema = 1
[part]
name = "{name}"
cad = {json.dumps(str(cad))}
element_size = {element}
[[measurements]]
name = "stereo"
method = "stereocorrelation"
images = {json.dumps([str(image) for image in images])}
cameras = {json.dumps(str(cameras))}
alignment = {alignment}
"""
    (folder / f"{name}.toml").write_text(recipe, encoding="utf-8")
    record = run(folder / f"{name}.toml", folder / name)
    (part,) = record.parts
    assert part.status.has_map, part.reason
    mesh, seen = record.nominal.mesh, part.deviation.observed
    points = mesh.nodes[seen] + part.deviation.value[seen, None] * mesh.normals[seen]
    return Measured(part, mesh, points, int(np.isfinite(part.residual).sum()))


def written(path, points, shape):
    """Write a grid of points as a mesh file."""
    n, m = shape
    i = (np.arange(n - 1)[:, None] * m + np.arange(m - 1)).ravel()
    triangles = np.concatenate([np.stack([i, i + m, i + m + 1], 1), np.stack([i, i + m + 1, i + 1], 1)])
    pv.PolyData.from_regular_faces(points, triangles).save(path)
    return path


def cylinder(path, radius):
    """Write the part of a cylinder about z that the cameras may see."""
    angle, z = np.meshgrid(np.radians(np.linspace(40, 140, 401)), np.linspace(15, 235, 111), indexing="ij")
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)
    return written(path, points.reshape(-1, 3), angle.shape)


def rectangle(path, centre, u, v, count=45):
    """Write a plane patch whose normal is u x v."""
    a, b = np.meshgrid(*(np.linspace(-1, 1, count),) * 2, indexing="ij")
    points = np.asarray(centre) + a.ravel()[:, None] * np.asarray(u) + b.ravel()[:, None] * np.asarray(v)
    return written(path, points, (count, count))


def fitted_camera(matrix, distortion, projection, size):
    """Return the view that agrees with undistorted pixels P X followed by the distortion of a lens."""
    ring = [
        [r * np.cos(a), r * np.sin(a), z]
        for r in (48, 57, 66)
        for a in np.radians(range(20, 160, 6))
        for z in range(5, 245, 12)
    ]
    points = np.array(ring, float)
    ideal = np.column_stack([points, np.ones(len(points))]) @ (np.linalg.inv(matrix) @ projection).T
    lens = Camera(matrix, distortion, size)
    pixels = lens.project(ideal / ideal[:, 2:])
    inside = ((pixels > 0) & (pixels < size)).all(axis=1)
    points, pixels = points[inside], pixels[inside]
    turned = np.linalg.inv(matrix) @ projection
    turned /= np.cbrt(np.linalg.det(turned[:, :3]))
    u, _, vt = np.linalg.svd(turned[:, :3])
    start = Pose(u @ vt, turned[:, 3])
    steps = np.array([1e-3] * 3 + [1.0] * 3 + [10.0, 10.0, 10.0, 10.0, 1.0] + [0.01] * 5)

    def view(x):
        x = x * steps
        change = np.array([[x[6], x[10], x[8]], [0, x[7], x[9]], [0, 0, 0]])
        camera = Camera(matrix + change, distortion + x[11:], size)
        return View(camera, start @ Pose.small(x[:6], np.array([0.0, 57.0, 125.0])))

    found = least_squares(lambda x: (view(x).project(points) - pixels).ravel(), np.zeros(16))
    assert np.sqrt(np.mean(found.fun**2)) < 0.02
    return view(found.x)


@pytest.fixture(scope="module")
def multidic(data, tmp_path_factory):
    """Return what measures a frame of the cylinder against a nominal radius."""
    source, folder = data / "multidic_cylinder", tmp_path_factory.mktemp("cylinder")
    derived = json.loads((source / "calibration_derived_opencv.json").read_text(encoding="utf-8"))
    arrays = {key: np.array(value, float) for key, value in derived.items() if key != "note"}
    views = [fitted_camera(arrays[f"K{k}"], arrays[f"d{k}"][0], arrays[f"P{k}"], (2464, 3280)) for k in (1, 2)]
    lenses, poses = zip(*((view.camera, view.camera_from_cad) for view in views), strict=True)
    write_calibration_json(folder / "calibration.json", Rig(lenses, camera_from_rig=poses, sigmas=(MULTIDIC,) * 2))

    def measure(frame, radius, picked=True):
        axis = np.array([0.53, -7.35, 0.0]) + (frame - 1) * np.array([-0.3, -0.35, 0.0])
        matrix = np.eye(4)
        matrix[:3, 3] = -axis
        images = [source / "speckledObjectImages" / str(k) / f"{k}_{frame}.jpg" for k in (201, 202)]
        cad = cylinder(folder / f"{radius}.ply", radius)
        alignment = f'{{ start = "pose", matrix = {matrix.tolist()} }}' if picked else "{}"
        name = f"frame{frame}_{radius}_{'picked' if picked else 'found'}"
        return measured(folder, name, cad, images, folder / "calibration.json", 6.0, alignment)

    return measure


@pytest.fixture(scope="module")
def frames(multidic):
    """Return frames 1 to 3 against the nominal radius."""
    return [multidic(frame, 57.0) for frame in (1, 2, 3)]


def fitted_radius(points):
    """Return the radius of the best-fit cylinder and the distances of the points from it, mm."""

    def miss(x):
        along = np.array([x[2], x[3], 1.0]) / np.linalg.norm([x[2], x[3], 1.0])
        away = points - np.array([x[0], x[1], points[:, 2].mean()])
        return np.linalg.norm(away - np.outer(away @ along, along), axis=1) - x[4]

    found = least_squares(miss, [0, 0, 0, 0, 57.0])
    return found.x[4], found.fun


def radius_sigma(frame):
    """Return the standard uncertainty of the best-fit radius that the covariance of a map claims, mm."""
    covariance = frame.part.covariance
    normals, height = frame.mesh.normals[covariance.node], frame.mesh.nodes[covariance.node, 2:] - 125.0
    across = normals[:, :2]
    fit = np.linalg.pinv(np.column_stack([np.ones(len(height)), across, height * across]))[0]
    return np.sqrt(fit @ covariance.own.covariance(fit[:, None])[:, 0])


def test_the_cylinder_has_its_radius_and_little_shape_beside(frames):
    for frame in frames:
        radius, residual = fitted_radius(frame.points)
        assert radius == pytest.approx(57.0, abs=0.1)
        assert np.sqrt(np.mean(residual**2)) < 0.020
        assert len(frame.points) > 0.9 * frame.seen


def test_a_cylinder_may_turn_and_slide(frames):
    for frame in frames:
        assert frame.part.status is Status.FREE_MOTIONS
        words = " ".join(motion.words for motion in frame.part.alignments[0].free)
        assert "shift along (0, 0, 1)" in words
        assert "turn about the axis along (0, 0, 1)" in words


@pytest.fixture(scope="module")
def found(multidic):
    """Return frame 1 from a start that the pictures gave by themselves."""
    return multidic(1, 57.0, picked=False)


def test_the_cylinder_is_found_and_measured_without_a_click(found, frames):
    assert found.part.status is Status.FREE_MOTIONS
    assert "found from the pictures alone" in " ".join(found.part.remarks)
    radius, residual = fitted_radius(found.points)
    assert radius == pytest.approx(57.0, abs=0.1)
    claimed = np.hypot(radius_sigma(found), radius_sigma(frames[0]))
    assert claimed < 0.06
    assert radius == pytest.approx(fitted_radius(frames[0].points)[0], abs=1.96 * claimed)
    assert np.sqrt(np.mean(residual**2)) < 0.020


def test_nearly_every_node_is_observed_that_both_cameras_see_wherever_the_cylinder_was_turned_to(found):
    nodes, normals, observed = found.mesh.nodes, found.mesh.normals, found.part.deviation.observed
    seen = np.ones(len(nodes), dtype=bool)  # the node itself, not only a corner of a facet beside it
    for view in found.part.views:
        sight, at = view.centre - nodes, view.project(nodes)
        seen &= (sight * normals).sum(axis=1) > np.cos(np.radians(65)) * np.linalg.norm(sight, axis=1)
        seen &= ((at > 3) & (at < np.array(view.camera.size) - 4)).all(axis=1)
    assert (observed & seen).sum() > 0.95 * seen.sum()
    assert (observed & ~seen).sum() < 0.02 * seen.sum()  # at the limits of the angle, which the first poses decide


def test_frames_repeat_within_what_is_claimed(frames):
    for one, other in ((0, 1), (0, 2), (1, 2)):
        a, b = frames[one].part.deviation, frames[other].part.deviation
        both = a.observed & b.observed
        ratio = (a.value - b.value)[both] / np.hypot(a.sigma, b.sigma)[both]
        assert np.sqrt(np.mean(ratio**2)) < 1.0
        assert np.mean(np.abs(ratio) < 1.96) > 0.95


def radii(frame, nominal, angle, z):
    """Return the measured radius, mm, about the axis of a nominal radius, at angles and heights; masked where unseen.

    Nodes move along the radius, and elements are linear in between.
    """
    mesh, deviation = frame.mesh, frame.part.deviation
    kept = mesh.triangles[deviation.observed[mesh.triangles].all(axis=1)]
    along = nominal * np.arctan2(mesh.nodes[:, 1], mesh.nodes[:, 0])
    values = nominal + np.where(deviation.observed, deviation.value, 0.0)
    return LinearTriInterpolator(Triangulation(along, mesh.nodes[:, 2], kept), values)(nominal * angle, z)


def test_nominal_radii_three_tenths_off_lead_to_the_same_surface(multidic, frames):
    angle, z = np.meshgrid(np.radians(np.arange(45.0, 135.0, 0.5)), np.arange(15.0, 235.0, 0.5), indexing="ij")
    radius, _ = fitted_radius(frames[0].points)
    expected = radii(frames[0], 57.0, angle, z)
    for off in (56.7, 57.3):
        frame = multidic(1, off)
        assert fitted_radius(frame.points)[0] == pytest.approx(radius, abs=0.1)
        apart = radii(frame, off, angle, z) - expected
        both = ~np.ma.getmaskarray(apart)
        assert both.mean() > 0.6
        c, s, height = np.cos(angle[both]), np.sin(angle[both]), z[both] - 125.0
        shifts_and_tilts = np.stack([c, s, height * c, height * s], axis=1)
        apart = np.asarray(apart[both])
        apart -= shifts_and_tilts @ np.linalg.lstsq(shifts_and_tilts, apart, rcond=None)[0]
        assert np.sqrt(np.mean(apart**2)) < 0.005


def flatness(points):
    """Return the rms distance of points from their best plane, mm."""
    return float(np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[2] / np.sqrt(len(points)))


@pytest.mark.parametrize("calibration", ["cal_vic3d.xml", "cal_pyaldic_dice_format.xml"])
def test_the_sheet_is_flat_by_either_calibration(data, tmp_path, calibration):
    source = data / "dice_dspecimen"
    names, sizes = ("left", "right"), ((1920, 1200),) * 2
    normal, centre = np.array([-0.012, -0.008, 1.0]), np.array([-0.72, 3.48, -367.36])
    u = np.cross([0.0, 1.0, 0.0], normal)
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    if "vic3d" not in calibration:  # its frame is that of the left camera
        left = load_calibration((source / "cal_vic3d.xml",), names, sizes).camera_from_rig[0]
        centre, u, v = left(centre[None])[0], left.turned(u[None])[0], left.turned(v[None])[0]
    cad = rectangle(tmp_path / "sheet.ply", centre, 44 * u, 27 * v)
    images = [source / "images" / f"GT4-0000_{k}.tif" for k in (0, 1)]
    found = measured(tmp_path, "sheet", cad, images, source / calibration, 2.5, '{ start = "identity" }')
    assert len(found.points) > 600
    assert flatness(found.points) < 0.015
    assert len(found.part.alignments[0].free) == 3


@pytest.mark.parametrize("kind", ["undist", "dist"])
def test_the_rendered_plate_stands_where_it_was_put(data, tmp_path, kind):
    source = data / "dice_epipolar_plane_synthetic"
    calibration = (source / "cal.xml").read_text(encoding="utf-8")
    if kind == "undist":
        calibration = calibration.replace("OPENCV_LENS_DISTORTION", "NO_LENS_DISTORTION")
    (tmp_path / "cal.xml").write_text(calibration, encoding="utf-8")
    x = (np.array([555, 1352]) - 959.5) / 2666.6667 * 15
    y = (np.array([140, 938]) - 539.5) / 2666.6667 * 15
    centre, half_x, half_y = (x.mean(), y.mean(), 15.0), [np.ptp(x) / 2, 0, 0], [0, np.ptp(y) / 2, 0]
    cad = rectangle(tmp_path / "plate.ply", centre, half_y, half_x, 21)
    images = [source / f"{side}_{kind}.png" for side in ("left", "right")]
    alignment = '{ start = "identity", refine = false }'
    found = measured(tmp_path, "plate", cad, images, tmp_path / "cal.xml", 0.25, alignment)
    assert found.part.deviation.observed.all()
    assert found.points[:, 2].mean() == pytest.approx(15.0, abs=0.001)
    assert np.sqrt(np.mean((found.points[:, 2] - 15.0) ** 2)) < 0.001
