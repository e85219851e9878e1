"""The cloud of a measurement while points are picked: how it lies to the CAD by the pairs so far."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.measure import Measurement
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import InputError
from inspect3d.pose import Pose
from inspect3d.recipe import MeasurementTable, Recipe
from inspect3d.register.landmarks import pose_from_landmarks
from inspect3d.registry import build_for
from inspect3d.system import import_open3d
from inspect3d.web.page import Answer
from inspect3d.web.pairs import Pairs
from inspect3d.web.standout import standing_out

FEWEST = 3
MOST_POINTS = 300_000
"""Points that are drawn and can be clicked on; of more, a random choice."""
FAIR = 0.005
"""Of the part's size: largest error of a pair at which no other fit is tried."""
NEIGHBOURS = 12


@dataclass(frozen=True, eq=False)
class Clouded:
    """Measured points, thinned for the page.

    Parameters
    ----------
    nominal : the part as designed
    points : (n, 3) mm, in the frame of the instrument
    normals : (n, 3), for the light on them
    """

    nominal: Nominal
    points: Floats
    normals: Floats

    @classmethod
    def of(cls, recipe: Recipe, table: MeasurementTable, nominal: Nominal) -> Clouded:
        """Return the points that a table of the recipe names.

        Raises
        ------
        InputError
            A file is missing or broken, or the method measures no points.
        """
        method = build_for(table)
        measurement = method(method.open(recipe.files(table)), nominal)
        if not isinstance(measurement, Measurement):
            raise InputError(f"{table.name!r} measures no points that could be picked.")
        points = measurement.points
        if len(points) > MOST_POINTS:
            points = points[np.sort(np.random.default_rng(0).choice(len(points), MOST_POINTS, replace=False))]
        return cls(nominal, points, _normals(points))

    def described(self) -> dict[str, Any]:
        """Return what the page needs to know."""
        return {"kind": "cloud", "fewest": FEWEST, "centre": self._centre.tolist()}

    def arrays(self) -> Answer:
        """Return the points about their centre."""
        return Answer.arrays(
            nodes=(self.points - self._centre).astype(np.float32),
            normals=np.round(127 * self.normals).astype(np.int8),
        )

    def answer(self, pairs: Pairs) -> dict[str, Any]:
        """Return the pose by pairs and what each is off, mm; which pair stands out.

        Raises
        ------
        InspectionError
            The pairs are too few or lie on one line.
        """
        measured = pairs.shown[:, 0]
        fit = standing_out(
            len(pairs),
            FEWEST,
            lambda kept: pose_from_landmarks(measured[kept], pairs.cad[kept]),
            lambda pose: np.linalg.norm(pose(measured) - pairs.cad, axis=1)[:, None],
            FAIR * self.nominal.diagonal,
        )
        return {
            "errors": fit.errors.tolist(),
            "outlier": fit.outlier,
            "rms": fit.rms,
            "unit": "mm",
            "words": fit.words,
            **self.shown_at(fit.answer),
        }

    def shown_at(self, cad_from_measured: Pose) -> dict[str, Any]:
        """Return where a cloud that lies so has the CAD."""
        return {"measured_from_cad": cad_from_measured.inverse().matrix.tolist()}

    def rows(self, pairs: Pairs) -> list[dict[str, Any]]:
        """Return the pairs as a recipe holds them."""
        return [
            {"name": name, "cad": cad.round(4).tolist(), "measured": shown[0].round(4).tolist()}
            for name, cad, shown in zip(pairs.names, pairs.cad, pairs.shown, strict=True)
        ]

    @property
    def _centre(self) -> Floats:
        return np.asarray((self.points.min(axis=0) + self.points.max(axis=0)) / 2, dtype=np.float64)


def _normals(points: Floats) -> Floats:
    """Return unit normals (n, 3) of either sign, from the nearest points."""
    open3d = import_open3d()
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    return np.asarray(cloud.normals)
