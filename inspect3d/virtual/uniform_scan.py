"""The plainest scanner: points uniformly at random, all around the part."""

from __future__ import annotations

import numpy as np

from inspect3d.pose import Pose
from inspect3d.virtual.deviation_field import DeviationField
from inspect3d.virtual.part_surface import PartSurface
from inspect3d.virtual.scan import ScanResult


def uniform_scan(
    surface: PartSurface,
    field: DeviationField,
    density: float,
    noise: float,
    seed: int,
    scan_from_cad: Pose | None = None,
) -> ScanResult:
    """Return points spread over the whole surface, hidden places included: x + (d(x) + noise) n(x).

    Parameters
    ----------
    surface : as designed
    field : d, how the part differs from it, mm
    density : points per mm²
    noise : mm, standard deviation of independent normal noise, along the nominal normal
    seed : the same seed gives the same cloud
    scan_from_cad : the pose of the part before the instrument; by default the CAD frame
    """
    random = np.random.default_rng(seed)
    nominal, normals = surface.sample(round(density * surface.area), random)
    noise_true = random.normal(0.0, noise, len(nominal))
    pose = scan_from_cad or Pose.identity()
    return ScanResult(
        points_scan=pose(nominal + (field(nominal) + noise_true)[:, None] * normals),
        normals_scan=pose.turned(normals),
        scan_from_cad=pose,
        foreign=np.zeros(len(nominal), bool),
        noise_true=noise_true,
        noise=noise,
    )
