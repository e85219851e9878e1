"""A laser-plane scanner that looks at a virtual part."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, radians, sin

import numpy as np

from inspect3d.arrays import Booleans, Floats, unit
from inspect3d.pose import Pose
from inspect3d.virtual.correlated_noise import correlated_noise
from inspect3d.virtual.deviation_field import DeviationField, Vector
from inspect3d.virtual.foreign_points import foreign_points
from inspect3d.virtual.part_surface import PartSurface
from inspect3d.virtual.scan import ScanResult

LIFT = 0.02  # mm; a line of sight starts this far above the surface, clear of the triangle it leaves


@dataclass(frozen=True)
class LaserScanner:
    """A laser plane that sweeps over the part, watched by a camera beside it.

    Beams of one view are parallel. A point is measured where a beam meets the part first, where the camera sees it
    too, and where neither looks along the surface. The measured point is x + (d(x) + coating + noise) n(x), with x on
    the exact nominal surface and d the deviation of the part: a scan without noise and coating lies on the true
    surface to rounding (and to the chord along curved edges, see `PartSurface`). What hides what is decided on the
    nominal part: the deviation is too small to cast shadows.

    Parameters
    ----------
    noise : mm, standard deviation of independent normal noise, along the nominal normal
    drift, drift_length : mm, standard deviation and correlation length of a smooth error, along the normal, one for
        each view
    views : directions from the part toward the scanner, CAD frame, one sweep each
    line_spacing, point_spacing : mm, from line to line and along a line, across the view
    triangulation : rad, between the laser plane and the camera
    grazing : rad, largest angle between the normal and the beam, and between the normal and the camera
    foreign : share of points that are not of the part (table, clamp, flying points)
    up : direction away from the table that the part lies on, CAD frame
    holes, hole_width : how many round patches are lost, and their diameter, mm
    coating : mm, thickness of paint on the part while it was scanned
    scan_from_cad : pose of the part before the instrument
    """

    noise: float = 0.02
    drift: float = 0.0
    drift_length: float = 20.0
    views: tuple[Vector, ...] = ((0.0, 0.0, 1.0),)
    line_spacing: float = 0.4
    point_spacing: float = 0.2
    triangulation: float = radians(25.0)
    grazing: float = radians(75.0)
    foreign: float = 0.0
    up: Vector = (0.0, 0.0, 1.0)
    holes: int = 0
    hole_width: float = 8.0
    coating: float = 0.0
    scan_from_cad: Pose = field(default_factory=Pose.identity)

    def __post_init__(self) -> None:
        if not 0.0 <= self.foreign < 1.0:
            raise ValueError(f"the share of foreign points lies between 0 and 1, not at {self.foreign}")
        if min(self.line_spacing, self.point_spacing) <= 0.0:
            raise ValueError("the spacing of lines and points is positive")

    def __call__(self, surface: PartSurface, deviation: DeviationField, seed: int) -> ScanResult:
        """Scan a part.

        Parameters
        ----------
        surface : as designed
        deviation : how the part differs from it
        seed : the same seed gives the same cloud

        Returns
        -------
        The cloud in the order of the lines, foreign points strewn in.
        """
        random = np.random.default_rng(seed)
        seen = [self._swept(surface, unit(np.array(view)), random) for view in self.views]
        nominal, normals = (np.concatenate(parts) for parts in zip(*seen, strict=True))
        noise = np.concatenate([self._smooth_error(points, random) for points, _ in seen])
        noise += random.normal(0.0, self.noise, len(nominal))
        kept = self._outside_holes(nominal, random)
        nominal, normals, noise = nominal[kept], normals[kept], noise[kept]
        measured = nominal + (deviation(nominal) + self.coating + noise)[:, None] * normals

        count = round(len(measured) * self.foreign / (1.0 - self.foreign))
        alien = foreign_points(measured, np.array(self.up), count, random)
        order = np.argsort(np.concatenate([np.arange(len(measured)), random.uniform(0, len(measured), count)]))
        toward = np.broadcast_to(unit(np.array(self.views[0])), alien.shape)
        return ScanResult(
            points_scan=self.scan_from_cad(np.concatenate([measured, alien])[order]),
            normals_scan=self.scan_from_cad.turned(np.concatenate([normals, toward])[order]),
            scan_from_cad=self.scan_from_cad,
            foreign=order >= len(measured),
            noise_true=np.concatenate([noise, np.zeros(count)])[order],
            noise=self.noise,
        )

    def _swept(self, surface: PartSurface, view: Floats, random: np.random.Generator) -> tuple[Floats, Floats]:
        """Return the points and normals that one view sees."""
        along = unit(np.cross(view, np.eye(3)[np.argmin(np.abs(view))]))
        across = np.cross(along, view)
        camera = cos(self.triangulation) * view + sin(self.triangulation) * across

        start, extent = surface.vertices.min(axis=0), np.ptp(surface.vertices, axis=0)
        reach = float(np.linalg.norm(extent))
        lines = np.arange(-reach / 2, reach / 2, self.line_spacing)
        steps = np.arange(-reach / 2, reach / 2, self.point_spacing)
        u = lines[:, None] + random.uniform(0.0, self.line_spacing) + np.zeros(len(steps))
        v = steps + random.uniform(0.0, self.point_spacing, (len(lines), 1))
        origins = start + extent / 2 + reach * view + u.reshape(-1, 1) * across + v.reshape(-1, 1) * along

        points, normals = surface.seen_from(origins, -view, 2 * reach)
        seen = np.minimum(normals @ view, normals @ camera) > cos(self.grazing)
        points, normals = points[seen], normals[seen]
        watched = surface.triangulation.first_hit(points + LIFT * normals, camera, 2 * reach).triangle < 0
        return points[watched], normals[watched]

    def _smooth_error(self, points: Floats, random: np.random.Generator) -> Floats:
        if self.drift == 0.0:
            return np.zeros(len(points))
        return self.drift * correlated_noise(points, self.drift_length, random)

    def _outside_holes(self, points: Floats, random: np.random.Generator) -> Booleans:
        kept = np.ones(len(points), bool)
        for centre in points[random.integers(len(points), size=self.holes)]:
            kept &= np.sum((points - centre) ** 2, axis=1) > (self.hole_width / 2) ** 2
        return kept
