"""The photographs of a measurement while points are picked: where the cameras stand by the pairs so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.camera import View
from inspect3d.correlation.outline import outline
from inspect3d.correlation.picks import FEWEST, FEWEST_DLT, Picks, ideal_camera
from inspect3d.correlation.start import StereoStart
from inspect3d.files.calibration import Rig
from inspect3d.files.calibration_load import load_calibration
from inspect3d.files.photograph import Photograph, read_photograph
from inspect3d.nominal.nominal import Nominal
from inspect3d.outcome import InputError, MeasurementError
from inspect3d.pose import Pose
from inspect3d.recipe import MeasurementTable, Recipe
from inspect3d.web.page import Answer
from inspect3d.web.pairs import Pairs
from inspect3d.web.standout import Fit, standing_out

FAIR = 1.5
"""Largest error of a pair, px, at which no other fit is tried."""
GUESSES = (1.0, 1.6, 2.5, 4.0, 6.5)
"""Focal lengths to try, in widths of the picture, where nothing tells it yet."""
GUESSED = (
    "The focal length is a guess so far: give a rough `focal` in the recipe, or pick {more} more pair{s}, "
    "at different depths."
)


@dataclass(frozen=True, eq=False)
class Pictured:
    """Photographs and what the recipe says about their cameras.

    Parameters
    ----------
    nominal : the part as designed
    photographs : in the recipe's order
    rig : the calibration, or None
    focals : px, the recipe's rough focal lengths; None where it gives none
    cad_from_measured : where the recipe puts the part before the rig or the first camera; None: unknown
    refine : whether its place there is refined
    """

    nominal: Nominal
    photographs: tuple[Photograph, ...]
    rig: Rig | None
    focals: tuple[float | None, ...]
    cad_from_measured: Pose | None
    refine: bool

    @classmethod
    def of(cls, recipe: Recipe, table: MeasurementTable, nominal: Nominal) -> Pictured:
        """Return the photographs that a table of the recipe names.

        Raises
        ------
        InputError
            A file is missing, broken or does not fit the others.
        """
        files = recipe.files(table)
        photographs = tuple(read_photograph(path) for path in files["images"])
        count = len(photographs)
        calibration = files.paths.get("cameras", ())
        names, sizes = tuple(p.name for p in photographs), tuple(p.size for p in photographs)
        rig = load_calibration(calibration, names, sizes) if calibration else None
        focal = table.settings.get("focal")
        focals = tuple(focal) if isinstance(focal, list | tuple) else (focal,) * count
        if len(focals) != count:
            raise InputError(f"`focal` has {len(focals)} values for {count} pictures: give one, or one for each.")
        matrix = table.alignment.matrix
        place = None if matrix is None else Pose.from_matrix(np.array(matrix))
        return cls(nominal, photographs, rig, focals, place, table.alignment.refine)

    def described(self) -> dict[str, Any]:
        """Return what the page needs to know."""
        images = [{"name": p.name, "width": p.size[0], "height": p.size[1]} for p in self.photographs]
        return {"kind": "pictures", "fewest": FEWEST, "images": images}

    def picture(self, index: int) -> Answer:
        """Return a photograph as PNG, its greys stretched to 8 bits."""
        import cv2

        grey = self.photographs[index].grey
        low, high = np.percentile(grey[::4, ::4], [0.1, 99.9])
        shown = np.clip(255 * (grey - low) / max(high - low, 1e-9), 0, 255).astype(np.uint8)
        return Answer(cv2.imencode(".png", shown, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes(), "image/png")

    def answer(self, pairs: Pairs) -> dict[str, Any]:
        """Return what pairs say: what each is off, px; which stands out; and the part's outline in each picture.

        Raises
        ------
        InspectionError
            The pairs are too few, or fit nowhere.
        """
        fit = self.fit(pairs.cad, pairs.shown)
        return {
            "errors": fit.errors.tolist(),
            "outlier": fit.outlier,
            "rms": fit.rms,
            "unit": "px",
            "words": fit.words,
            "outlines": [self._outline(view) for view in fit.answer],
            "seen": [view.project(pairs.cad).round(2).tolist() for view in fit.answer],
        }

    def shown_at(self, cad_from_measured: Pose) -> dict[str, Any]:
        """Return the outline in each picture of a part that lies so before the rig, or before the first camera.

        The places of other cameras without a rig, and of a camera of unknown focal length, are not known: no outline.
        """
        measured_from_cad = cad_from_measured.inverse()
        views: list[View | None] = [None] * len(self.photographs)
        places = self.rig and (self.rig.camera_from_rig or self.rig.camera_from_cad)
        if self.rig and places:
            views = [View(c, p @ measured_from_cad) for c, p in zip(self.rig.cameras, places, strict=True)]
        elif self.rig:
            views[0] = View(self.rig.cameras[0], measured_from_cad)
        elif focal := self.focals[0] or self.photographs[0].focal:
            views[0] = View(ideal_camera(focal, self.photographs[0].size), measured_from_cad)
        return {"outlines": [self._outline(view) if view else [] for view in views]}

    def rows(self, pairs: Pairs) -> list[dict[str, Any]]:
        """Return the pairs as a recipe holds them."""
        return [
            {"name": name, "cad": cad.round(4).tolist(), "pixels": shown.round(2).tolist()}
            for name, cad, shown in zip(pairs.names, pairs.cad, pairs.shown, strict=True)
        ]

    def fit(self, points_cad: Floats, pixels: Floats) -> Fit[tuple[View, ...]]:
        """Return where the cameras stand by pairs of points, and which pair does not belong to the others.

        Parameters
        ----------
        points_cad : (n, 3) mm
        pixels : (n, v, 2) px

        Raises
        ------
        MeasurementError
            The pairs are too few, or fit nowhere.
        """
        focals = self._known_focals(len(points_cad))
        if focals is not None:
            return self._fit(points_cad, pixels, focals)
        fits, failure = [], MeasurementError("")
        width = max(max(photograph.size) for photograph in self.photographs)
        for guess in GUESSES:
            try:
                fits.append(self._fit(points_cad, pixels, tuple(focal or guess * width for focal in self.focals)))
            except MeasurementError as error:
                failure = error
        if not fits:
            raise failure
        more = max(FEWEST_DLT - len(points_cad), 1)
        return min(fits, key=lambda fit: fit.rms).saying(GUESSED.format(more=more, s="s" * (more > 1)))

    def _outline(self, view: View) -> list[float]:
        return outline(self.nominal, view).round(2).ravel().tolist()

    def _known_focals(self, count: int) -> tuple[float | None, ...] | None:
        """Return the focal lengths to begin with, None each where photographs or pairs tell; None for nothing."""
        told = all(f or p.focal for f, p in zip(self.focals, self.photographs, strict=True))
        return self.focals if self.rig is not None or told or count >= FEWEST_DLT else None

    def _fit(self, points_cad: Floats, pixels: Floats, focals: Sequence[float | None]) -> Fit[tuple[View, ...]]:
        def placed(kept: np.ndarray) -> tuple[View, ...]:
            return self._placed(points_cad[kept], pixels[kept], focals)

        def errors(views: tuple[View, ...]) -> Floats:
            seen = np.stack([view.project(points_cad) for view in views], axis=1)
            return np.linalg.norm(seen - pixels, axis=2)

        return standing_out(len(points_cad), FEWEST, placed, errors, FAIR)

    def _placed(self, points_cad: Floats, pixels: Floats, focals: Sequence[float | None]) -> tuple[View, ...]:
        start = StereoStart(Picks(points_cad, pixels), self.cad_from_measured, self.refine)
        return start(self.photographs, (None,) * len(self.photographs), self.rig, focals, self.nominal).views
