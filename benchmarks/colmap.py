"""What the method `colmap` reaches on virtual and on real photographs.

    python benchmarks/colmap.py FOLDER [DATA]

    python benchmarks/colmap.py FOLDER --small 6

FOLDER keeps the virtual photographs, which are made if they are not there: `milled` (dataset milled-photographs),
`smooth` (the same views of the block with a smooth deviation, as benchmarks/sigma_of_clouds.py has it) and `steps`
(with the steps of the milled block but without its scallops, which are finer than the elements), the last two for the
test of the map's sigma. With --small it is made for so many seeds on five photographs of 612 x 512 px each, and so is
the test of the centres of cameras whose places are unknown; nothing else is done. DATA is the folder of the real
photographs: robovision_stone and middlebury_temple_sparse_ring.

The truth is brought into the gauge of the map before it is compared. Seconds are of the processor.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from math import radians
from pathlib import Path
from time import process_time

import numpy as np
from scipy.spatial import cKDTree

from inspect3d.arrays import Floats
from inspect3d.camera import Camera, View
from inspect3d.deviate.deviate import Deviate
from inspect3d.files.calibration import Rig
from inspect3d.files.calibration_json import write_calibration_json
from inspect3d.files.cloud import read_cloud
from inspect3d.files.photograph import read_photograph
from inspect3d.measure import Files, Measurement
from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.nominal import Nominal
from inspect3d.pose import Pose
from inspect3d.register.gauge import best_fit
from inspect3d.register.landmarks import similarity_from_landmarks
from inspect3d.register.register import Register
from inspect3d.register.similarity import Similarity
from inspect3d.triangulation.centre_sigma import centre_sigma
from inspect3d.triangulation.features import FindFeatures
from inspect3d.triangulation.tie import Tie
from inspect3d.virtual.deviation_field import Bump, Wave
from inspect3d.virtual.milled import MilledSizes, machining
from inspect3d.virtual.picture_truth import PictureTruth
from inspect3d.virtual.stereo_datasets import milled_photographs
from inspect3d.virtual.stereo_rig import StereoRig
from inspect3d_plugins.colmap import Colmap


def main(folder: Path, data: Path | None) -> None:
    """Print the figures."""
    for name, seed in (("milled", 0), ("smooth", 1), ("steps", 1)):
        made(folder / name, name, seed, None)
        placed(folder / name)
    lenses_given(folder / "milled", 0.0)
    lenses_given(folder / "milled", None)
    for free in (False, True):
        centres(folder / "milled", free)
    if data is not None:
        stone(data / "robovision_stone")
        temple(data / "middlebury_temple_sparse_ring")


def small(folder: Path, seeds: int) -> None:
    """Print whether the map's sigma is true over several sets of small photographs."""
    rig = StereoRig(cameras=5, angle=radians(40.0)).halved().halved()
    for name in ("smooth", "steps"):
        pairs = []
        for seed in range(1, seeds + 1):
            made(folder / f"{name}{seed}", name, seed, rig)
            pairs.append(placed(folder / f"{name}{seed}", 4.0))
        for k, where in enumerate(("apart from steps", "beside steps")):
            z = np.concatenate([pair[k] for pair in pairs])
            if len(z):
                print(f"{name}, {seeds} sets, {where}: {spread(z)}")
    for free in (False, True):
        z = np.concatenate([centres(folder / f"smooth{seed}", free) for seed in range(1, seeds + 1)])
        print(f"centres, {seeds} sets, lenses {'free' if free else 'given'}: rms of error/sigma {rms(z):.2f}")


def made(folder: Path, name: str, seed: int, rig: StereoRig | None) -> None:
    """Write a set of photographs, if it is not there."""
    fields = {
        "smooth": Wave(0.02, (0.010, 0.013, 0.005), 1.0) + Bump((60.0, 40.0, 33.0), 0.15, 14.0),
        "steps": machining(pitch=4.0, scallop=0.0),
    }
    if (folder / "truth.json").exists():
        return
    dataset = milled_photographs(seed, rig)
    replace(dataset, deviation=fields.get(name, dataset.deviation)).write(folder, seed)


def measured(folder: Path, images: list[str], rig: Rig | None, method: Colmap) -> Measurement:
    """Return the measurement, and say what it says about itself."""
    begun = process_time()
    with tempfile.TemporaryDirectory() as name:
        paths = {"images": tuple(folder / image for image in images)}
        if rig is not None:
            write_calibration_json(Path(name) / "rig.json", rig)
            paths["cameras"] = (Path(name) / "rig.json",)
        found = method(method.open(Files(folder, paths)), load_nothing())
    print(f"  {process_time() - begun:.0f} s;", " ".join(found.remarks))
    return found


def load_nothing() -> Nominal:
    """Return a part for a method that measures without one."""
    return None  # type: ignore[return-value]


def placed(folder: Path, element: float = 2.0) -> tuple[Floats, Floats]:
    """Print how far points and map are off, all cameras known; return error over sigma apart from steps and beside."""
    print(f"{folder.name}, cameras given")
    truth = PictureTruth.read(folder / "truth.json")
    nominal = load_nominal(folder / "part.step", element_size=element)
    rig = Rig(tuple(v.camera for v in truth.views), camera_from_cad=tuple(v.camera_from_cad for v in truth.views))
    found = measured(folder, names(truth), rig, Colmap())
    off_the_surface(found.clouds[0].points, nominal, truth)
    return map_against_truth(found, nominal, truth, Pose.identity(), element * ("smooth" not in folder.name))


def lenses_given(folder: Path, focal_error: float | None) -> None:
    """Print where the cameras end, the lenses given or (None) free from a focal length 3 % off."""
    truth = PictureTruth.read(folder / "truth.json")
    nominal = load_nominal(folder / "part.step", element_size=2.0)
    free = focal_error is None
    print(f"{folder.name}, lenses {'free' if free else 'given'}")
    rig = None if free else Rig(tuple(v.camera for v in truth.views))
    focal = 1.03 * float(np.mean([v.camera.matrix[0, 0] for v in truth.views]))
    found = measured(folder, names(truth), rig, Colmap(focal=focal if free else None))
    centres, true = (np.array([view.centre for view in views]) for views in (found.views, truth.views))
    fit = similarity_from_landmarks(centres, true, grows=True)
    print(f"  centres after a similarity to the true ones: {gaps(fit(centres), true)}")
    alignment = Register(nominal, scale_known=False)(found.clouds[0])
    print(
        f"  in the CAD frame, by registration: {gaps(np.array([v.centre for v in alignment.views(found.views)]), true)}"
    )
    print(f"  scale against that of the true cameras: {1e6 * (alignment.scale / fit.scale - 1):.0f} ppm")
    off_the_surface(alignment(found.clouds[0].points), nominal, truth)
    map_against_truth(found, nominal, truth, None, 2.0 * ("smooth" not in folder.name))


def centres(folder: Path, free: bool) -> Floats:
    """Print whether the uncertainty of the centres is true, lenses given or free from 3 % off; return error over it."""
    truth = PictureTruth.read(folder / "truth.json")
    lenses = [view.camera for view in truth.views]
    focal = 1.03 * float(np.mean([lens.matrix[0, 0] for lens in lenses]))
    features = [FindFeatures()(read_photograph(folder / name)) for name in names(truth)]
    begun: Sequence[Camera | float] = [focal] * len(lenses) if free else lenses
    tied = Tie().free(names(truth), features, begun, [lens.size for lens in lenses])
    pairs = [(one, true) for one, true in zip(tied.views, truth.views, strict=True) if one is not None]
    found, true = (np.array([view.centre for view in views]) for views in zip(*pairs, strict=True))
    fit = similarity_from_landmarks(found, true, grows=True)
    sigma = centre_sigma(tied, free, Colmap().systematic)
    sigma = fit.scale * sigma[np.isfinite(sigma)]
    z = (fit(found) - true) / sigma[:, None]
    print(
        f"{folder.name}, lenses {'free' if free else 'given'}: {len(found)} of {len(lenses)} placed, centres "
        f"{gaps(fit(found), true)}, sigma {np.median(sigma):.4f} mm along each axis; rms of error/sigma {rms(z):.2f}"
    )
    return z


def rms(z: Floats) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(z**2)))


def names(truth: PictureTruth) -> list[str]:
    """Return the file names of virtual photographs."""
    return [f"view{k}.png" for k in range(1, len(truth.views) + 1)]


def gaps(found: Floats, true: Floats) -> str:
    """Return how far places are off, in words."""
    off = np.linalg.norm(found - true, axis=1)
    return f"{off.mean():.4f} mm on average, {off.max():.4f} mm at the most"


def off_the_surface(points: Floats, nominal: Nominal, truth: PictureTruth) -> None:
    """Print how far points are off the true surface."""
    feet = nominal.surface.closest(points)
    off = np.abs(feet.distance - truth.deviation(feet.points))
    print(
        f"  {len(points)} points, {1e3 * np.median(off):.2f} um off the true surface (median), "
        f"{100 * np.mean(off > 0.03):.2f} % over 30 um"
    )


def map_against_truth(
    found: Measurement, nominal: Nominal, truth: PictureTruth, start: Pose | None, reach: float
) -> tuple[Floats, Floats]:
    """Print how far the map is off, and whether its sigma says so; return error over sigma apart from steps, beside.

    Nodes within `reach` mm, an element, of a step of the milled block are beside it; what they ought to show is open.
    """
    mesh, scale_known = nominal.mesh, found.scale_known
    alignment = Register(nominal, start, scale_known=scale_known)(found.clouds[0])
    deviate = Deviate(scale_known=scale_known)
    deviation = deviate(found.clouds, (alignment,), nominal, np.ones(len(mesh), bool)).deviation
    seen = deviation.observed
    value = deviation.value[seen]
    gauge = best_fit(mesh.nodes[seen], mesh.normals[seen], mesh.areas[seen], value, not scale_known)
    off = value - gauge(truth.deviation(mesh.nodes[seen]))
    z = off / deviation.sigma[seen]
    sizes = MilledSizes()
    jumps = np.array([*sizes.facet_borders, sizes.section_start])
    beside = (np.abs(mesh.nodes[seen][:, :1] - jumps) < reach).any(axis=1)
    print(
        f"  map: {np.count_nonzero(seen)} nodes, {1e3 * np.median(np.abs(off)):.2f} um off (median), sigma "
        f"{1e3 * np.median(deviation.sigma[seen]):.2f} um; apart from steps {spread(z[~beside])}"
        + (f"; beside them {spread(z[beside])}" if beside.any() else "")
    )
    return z[~beside], z[beside]


def spread(z: Floats) -> str:
    """Return how errors over their sigma spread, in words."""
    inside = 100 * np.mean(np.abs(z) < 1.96)
    return f"rms of error/sigma {rms(z):.3f}, {inside:.1f} % in the 95 % interval ({len(z)} nodes)"


def stone(folder: Path) -> None:
    """Print how far points lie from those of the reference reconstruction, cameras given."""
    print("robovision_stone, cameras given")
    cameras, poses = [], []
    for k in range(1, 13):
        words = (folder / f"intrinsics_camera{k:02d}.txt").read_text(encoding="utf-8")
        number = {key: float(value) for key, value in re.findall(r"^(\w+):\w+:\s*([-+.\de]+);", words, re.MULTILINE)}
        fx, fy = number["Focus"] / number["Sx"], number["Focus"] / number["Sy"]
        matrix = np.array([[fx, 0, number["Cx"]], [0, fy, number["Cy"]], [0, 0, 1]])
        cameras.append(Camera(matrix, np.zeros(5), (1280, 1024)))
        rows = np.loadtxt(folder / f"extrinsics_camera{k:02d}.txt").reshape(3, 4)
        poses.append(Pose(rows[:, :3], 1e3 * rows[:, 3]).inverse())
    images = [f"image_camera{k:02d}.png" for k in range(1, 13)]
    found = measured(folder, images, Rig(tuple(cameras), camera_from_rig=tuple(poses)), Colmap())
    reference = read_cloud(folder / "reference.ply")
    tree = cKDTree(1e3 * reference.points)
    points = found.clouds[0].points
    apart, near = tree.query(points)
    on = apart < 1.0
    along = np.einsum("ni,ni->n", points - 1e3 * reference.points[near], reference.normals[near])[on]
    there = np.mean(cKDTree(points).query(1e3 * reference.points)[0] < 1.0)
    print(
        f"  {len(points)} points, {100 * on.mean():.0f} % within 1 mm of a reference point; along its normal "
        f"{1e3 * np.median(np.abs(along)):.0f} um off (median), {1e3 * np.median(along):.0f} um on average; "
        f"{100 * there:.0f} % of the reference has a point within 1 mm"
    )


def temple(folder: Path) -> None:
    """Print how far the poses are from the given ones, the lenses given."""
    print("middlebury_temple_sparse_ring, lenses given")
    lines = (folder / "templeSR_par.txt").read_text(encoding="utf-8").splitlines()[1:]
    rows = [(line.split()[0], np.array(line.split()[1:], dtype=float)) for line in lines if line.strip()]
    cameras = tuple(Camera(row[:9].reshape(3, 3), np.zeros(5), (640, 480)) for _, row in rows)
    given = [View(c, Pose(r[9:18].reshape(3, 3), 1e3 * r[18:])) for c, (_, r) in zip(cameras, rows, strict=True)]
    method = Colmap(features=8000, spacing=4.0)
    found = measured(folder, [name for name, _ in rows], Rig(cameras), method)
    print(f"  {len(found.views)} of {len(given)} placed, {len(found.clouds[0])} points")
    if len(found.views) < len(given):
        return
    fit = similarity_from_landmarks(
        np.array([view.centre for view in found.views]), np.array([view.centre for view in given]), grows=True
    )
    turned = [
        np.degrees((_moved(mine, fit).camera_from_cad @ theirs.camera_from_cad.inverse()).angle)
        for mine, theirs in zip(found.views, given, strict=True)
    ]
    print(
        f"  rotations after a similarity: {np.mean(turned):.3f} degrees off on average, {max(turned):.3f} at the most"
    )
    centres = fit(np.array([view.centre for view in found.views]))
    print(f"  centres: {gaps(centres, np.array([view.centre for view in given]))}")


def _moved(view: View, fit: Similarity) -> View:
    pose = Pose(view.camera_from_cad.rotation, fit.scale * view.camera_from_cad.translation)
    return replace(view, camera_from_cad=pose @ fit.pose.inverse())


if __name__ == "__main__":
    if "--small" in sys.argv:
        small(Path(sys.argv[1]), int(sys.argv[3]))
    else:
        main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
