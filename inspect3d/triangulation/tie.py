"""Tie points: features matched between photographs, and the cameras where they are unknown, by COLMAP."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from inspect3d.arrays import Floats, Integers, unit
from inspect3d.camera import Camera, View
from inspect3d.outcome import MeasurementError
from inspect3d.pose import Pose
from inspect3d.triangulation.features import Features
from inspect3d.triangulation.ideal import found_camera, ideal_camera, ideal_pixels, rigid, rough_camera

if TYPE_CHECKING:
    import pycolmap

SEED = 1
LEAST_POINTS = 30
FEWEST = 15  # known points that a photograph shows, to be placed
NEAR_ENOUGH = 4.0  # px off the epipolar line, of a match that is looked at further
LENS_TERM = 1e6  # of a radial distortion at the most: in a long lens, which they hardly bend, the terms are large
MAD = 1.4826
CAUCHY = 2.385  # scales; keeps 95 % of the efficiency for normal errors (P. J. Huber, Robust Statistics, 1981)
STEPS = 200


@dataclass(frozen=True, eq=False)
class TiePoints:
    """Points seen in several photographs, and the cameras that took these.

    Parameters
    ----------
    views : by photograph; None where COLMAP could not place one
    points : (n, 3), in the frame and unit of the views
    point, view : (m,), which point each observation is of, and which photograph it is in
    pixels : (m, 2) px, of the observations
    error : px, root mean square distance of the observations from the projected points
    """

    views: tuple[View | None, ...]
    points: Floats
    point: Integers
    view: Integers
    pixels: Floats
    error: float

    @property
    def towards(self) -> Floats:
        """Return the mean direction from each point to the cameras that see it, (n, 3), unit."""
        centres = np.array([np.zeros(3) if view is None else view.centre for view in self.views])
        sights = unit(centres[self.view] - self.points[self.point])
        sums = [np.bincount(self.point, sights[:, k], minlength=len(self.points)) for k in range(3)]
        return unit(np.stack(sums, axis=1))


@dataclass(frozen=True)
class Tie:
    """Match features and place them in space.

    Parameters
    ----------
    error : px, of an observation at the most
    angle : degrees, between two lines of sight to a point at the least
    """

    error: float = 2.0
    angle: float = 3.0

    def placed(self, names: Sequence[str], features: Sequence[Features], views: Sequence[View]) -> TiePoints:
        """Return the tie points of photographs whose cameras and places are known.

        Raises
        ------
        MeasurementError
            The features of the photographs do not fit together.
        """
        import pycolmap

        cameras = [view.camera for view in views]
        pixels = [ideal_pixels(camera, each.pixels) for camera, each in zip(cameras, features, strict=True)]
        lenses = [ideal_camera(camera, k + 1) for k, camera in enumerate(cameras)]
        with _database(names, features, pixels, lenses) as (path, folder):
            _match(path)
            model = pycolmap.Reconstruction()
            for k, (name, view) in enumerate(zip(names, views, strict=True)):
                model.add_camera_with_trivial_rig(lenses[k])
                image = pycolmap.Image(name=name, keypoints=pixels[k], camera_id=k + 1, image_id=k + 1)
                model.add_image_with_trivial_frame(image, rigid(view.camera_from_cad))
            pycolmap.guided_geometric_verification(model, path, two_view_geometry_options=_verification())
            model = pycolmap.triangulate_points(model, path, folder, folder, options=self._options(known=True))
        return _tie_points(model, names, features, tuple(views))

    def free(
        self,
        names: Sequence[str],
        features: Sequence[Features],
        lenses: Sequence[Camera | float],
        sizes: Sequence[tuple[int, int]],
    ) -> TiePoints:
        """Return the tie points of photographs whose cameras' places are unknown, in a frame and unit of their own.

        Parameters
        ----------
        lenses : of each photograph, known; or its focal length, roughly, px
        sizes : of the photographs, px

        Raises
        ------
        MeasurementError
            The features of the photographs do not fit together.
        """
        import pycolmap

        known = all(isinstance(lens, Camera) for lens in lenses)
        pixels = [
            ideal_pixels(lens, each.pixels) if isinstance(lens, Camera) else each.pixels + 0.5
            for lens, each in zip(lenses, features, strict=True)
        ]
        cameras = [
            ideal_camera(lens, k) if isinstance(lens, Camera) else rough_camera(lens, size, k)
            for k, (lens, size) in enumerate(zip(lenses, sizes, strict=True), start=1)
        ]
        with _database(names, features, pixels, cameras) as (path, folder):
            _match(path)
            pycolmap.geometric_verification(path, two_view_geometry_options=_verification())
            models = pycolmap.incremental_mapping(path, folder, folder, options=self._options(known))
        if not models:
            raise MeasurementError(_apart(names, "in no two of them enough features agree on how the cameras stood"))
        model = max(models.values(), key=lambda each: (each.num_reg_images(), each.num_points3D()))
        _adjust(model, known)
        views: list[View | None] = [None] * len(names)
        for number, image in model.images.items():
            if image.has_pose:
                lens = lenses[number - 1]
                camera = lens if isinstance(lens, Camera) else found_camera(model.cameras[image.camera_id])
                matrix = image.cam_from_world().matrix()
                views[number - 1] = View(camera, Pose(matrix[:, :3], matrix[:, 3]))
        return _tie_points(model, names, features, tuple(views))

    def _options(self, known: bool) -> pycolmap.IncrementalPipelineOptions:
        import pycolmap

        options = pycolmap.IncrementalPipelineOptions()
        options.random_seed = options.mapper.random_seed = options.triangulation.random_seed = SEED
        options.extract_colors = False
        options.min_model_size = 2
        options.ba_refine_focal_length = not known
        options.ba_refine_extra_params = not known
        options.triangulation.ignore_two_view_tracks = False
        options.triangulation.min_angle = self.angle
        options.triangulation.complete_max_reproj_error = options.triangulation.merge_max_reproj_error = self.error
        options.mapper.filter_max_reproj_error = self.error
        options.mapper.filter_min_tri_angle = self.angle
        options.mapper.abs_pose_min_num_inliers = FEWEST
        options.mapper.abs_pose_refine_focal_length = not known
        options.mapper.abs_pose_refine_extra_params = not known
        for part in (options, options.mapper, options.triangulation):
            part.max_extra_param = LENS_TERM
        return options


@contextmanager
def _database(
    names: Sequence[str], features: Sequence[Features], pixels: Sequence[Floats], lenses: Sequence[pycolmap.Camera]
) -> Iterator[tuple[Path, Path]]:
    """Give a database of COLMAP with the features in it, pixels (n, 2) in its convention, and a folder for more."""
    import pycolmap

    pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
    pycolmap.set_random_seed(SEED)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "features.db"
        database = pycolmap.Database.open(path)
        for k, lens in enumerate(lenses):
            number = k + 1
            database.write_camera(lens, use_camera_id=True)
            rig = pycolmap.Rig(rig_id=number)
            rig.add_ref_sensor(lens.sensor_id)
            database.write_rig(rig, use_rig_id=True)
            image = pycolmap.Image(name=names[k], camera_id=number, image_id=number)
            database.write_image(image, use_image_id=True)
            frame = pycolmap.Frame(frame_id=number, rig_id=number)
            frame.add_data_id(image.data_id)
            database.write_frame(frame, use_frame_id=True)
            descriptors = pycolmap.FeatureDescriptors(pycolmap.FeatureExtractorType.SIFT, features[k].descriptors)
            database.write_keypoints(number, np.ascontiguousarray(pixels[k], dtype=np.float32))
            database.write_descriptors(number, descriptors)
        database.close()
        yield path, folder


def _verification() -> pycolmap.TwoViewGeometryOptions:
    """Return how pairs are verified; each has a seed of its own, so that it does not matter which thread does it."""
    import pycolmap

    options = pycolmap.TwoViewGeometryOptions()
    options.ransac.max_error = NEAR_ENOUGH
    options.ransac.random_seed = SEED
    return options


def _match(path: Path) -> None:
    import pycolmap

    options = pycolmap.FeatureMatchingOptions()
    options.use_gpu = False
    options.skip_geometric_verification = True
    pycolmap.match_exhaustive(path, matching_options=options, device=pycolmap.Device.cpu)


def loss_scale(misses: Floats) -> float:
    """Return the scale of Cauchy's loss, px, for misses (n, 2) of features."""
    return CAUCHY * MAD * float(np.median(np.abs(misses)))


def _adjust(model: pycolmap.Reconstruction, known: bool) -> None:
    """Adjust cameras and points in place, so that few features far off do not pull at what the others hardly tell.

    One in a hundred features lies ten times as far off as usual, and makes up most of the squares that COLMAP's own
    adjustment minimizes. The scale of Cauchy's loss is that of the residuals.
    """
    import pycolmap

    points = model.points3D
    off = [
        model.images[e.image_id].project_point(each.xyz) - model.images[e.image_id].points2D[e.point2D_idx].xy
        for each in points.values()
        for e in each.track.elements
    ]
    options = pycolmap.BundleAdjustmentOptions()
    options.print_summary = False
    options.refine_focal_length = options.refine_extra_params = not known
    options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.loss_function_scale = loss_scale(np.array(off))
    options.ceres.solver_options.max_num_iterations = STEPS
    pycolmap.bundle_adjustment(model, options)
    model.update_point_3d_errors()


def _tie_points(
    model: pycolmap.Reconstruction,
    names: Sequence[str],
    features: Sequence[Features],
    views: tuple[View | None, ...],
) -> TiePoints:
    """Return the points of a model of COLMAP; a second feature of a point in the same photograph is left out."""
    points: list[Floats] = []
    point, view, pixels, squares = [], [], [], []
    for each in model.points3D.values():
        seen = {element.image_id: element.point2D_idx for element in each.track.elements}
        for image, feature in seen.items():
            point.append(len(points))
            view.append(image - 1)
            pixels.append(features[image - 1].pixels[feature])
        points.append(each.xyz)
        squares.append(each.error**2)
    if len(points) < LEAST_POINTS:
        raise MeasurementError(_apart(names, f"only {len(points)} features are seen in two of them or more"))
    return TiePoints(
        views, np.array(points), np.array(point), np.array(view), np.array(pixels), float(np.sqrt(np.mean(squares)))
    )


def _apart(names: Sequence[str], why: str) -> str:
    return (
        f"The {len(names)} photographs do not fit together: {why}. Take them so that each shows much of what the next "
        "one shows, from directions 10 to 30 degrees apart, and check that the part is speckled and sharp."
    )
