"""A motion with a scale, as a cloud of unknown size needs it to lie on the CAD."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.camera import View
from inspect3d.pose import Pose
from inspect3d.starting.bundle import Bundle


@dataclass(frozen=True, eq=False)
class Similar:
    """X_cad = pose(scale x)."""

    pose: Pose
    scale: float

    def __call__(self, points: Floats) -> Floats:
        """Return points (n, 3) in the CAD frame, mm."""
        return self.pose(self.scale * points)

    def placed(self, bundle: Bundle) -> Bundle:
        """Return cameras and points in the CAD frame, mm."""
        return replace(bundle, views=tuple(self._view(view) for view in bundle.views), points=self(bundle.points))

    def _view(self, view: View) -> View:
        before = view.camera_from_cad
        return replace(
            view, camera_from_cad=Pose(before.rotation, self.scale * before.translation) @ self.pose.inverse()
        )
