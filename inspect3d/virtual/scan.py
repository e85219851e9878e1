"""What a virtual scanner hands back: the cloud, and the truth about it."""

from __future__ import annotations

from dataclasses import dataclass

from inspect3d.arrays import Booleans, Floats, booleans, floats
from inspect3d.pose import Pose


@dataclass(frozen=True, eq=False)
class ScanResult:
    """A virtual scan.

    Parameters
    ----------
    points_scan : (n, 3) mm, instrument frame
    normals_scan : (n, 3), unit, toward the side the scanner looked from
    scan_from_cad : the true pose
    foreign : (n,), the points that are not of the part
    noise_true : (n,) mm, by how much a point was moved off the true surface, along the outward normal; zero if foreign
    noise : mm, standard noise of a point
    """

    points_scan: Floats
    normals_scan: Floats
    scan_from_cad: Pose
    foreign: Booleans
    noise_true: Floats
    noise: float

    def __post_init__(self) -> None:
        count = len(self.points_scan)
        object.__setattr__(self, "points_scan", floats(self.points_scan, "points_scan", None, 3))
        object.__setattr__(self, "normals_scan", floats(self.normals_scan, "normals_scan", count, 3))
        object.__setattr__(self, "foreign", booleans(self.foreign, "foreign", count))
        object.__setattr__(self, "noise_true", floats(self.noise_true, "noise_true", count))

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.points_scan)

    @property
    def points_cad(self) -> Floats:
        """Return the points (n, 3) mm where they truly are in the CAD frame."""
        return self.scan_from_cad.inverse()(self.points_scan)
