"""Where the part may be: places, with a scale, of the points that the pictures gave on the CAD."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from inspect3d.arrays import Floats
from inspect3d.camera import View
from inspect3d.nominal.surface import Surface
from inspect3d.pose import Pose
from inspect3d.register.field import Field
from inspect3d.register.search import PoseSearch, distinct
from inspect3d.register.similarity import Similarity
from inspect3d.register.symmetry import surface_points
from inspect3d.register.thinned import Thinned
from inspect3d.starting.texture import Texture, stacked

SCALES = (0.3, 1.1)  # diagonal of what the pictures show, as a share of the CAD's
GUESSES, GUESSES_SCALED = 240_000, 80_000
DESCEND = 500
NEAR = 0.017  # share of the diagonal within which a point lies on the CAD
SPREAD = 500  # points over the CAD by which its outline is judged
SHAKEN, SHAKES = 16, 60  # places that are shaken, and how often each, in every round
ROUNDS = (0.04, 0.02, 0.01, 0.005)  # share of the diagonal by which the shaking moves the points
MOST_GROWTH = 0.2
APART = 0.03  # share of the diagonal below which two places are the same


@dataclass(frozen=True, eq=False)
class Candidates:
    """Find the places of a cloud on a CAD.

    `PoseSearch` proposes them. They are judged by the points that lie off the CAD and by the share of the CAD that
    would appear where the pictures show nothing, and shaken a little to lower both: a flat face lets the points slide
    and shrink, and only its outline tells where it ends.

    Parameters
    ----------
    surface : nominal
    field : of it
    kept : how many are returned at most
    """

    surface: Surface
    field: Field
    kept: int = 6

    def __call__(self, cloud: Thinned, rig: Sequence[View], texture: Texture, scaled: bool) -> list[Similarity]:
        """Return places cad_from_cloud, best first.

        Parameters
        ----------
        cloud : with normals towards the cameras; in the size of the CAD, roughly, where it is not scaled
        rig : the views, in the frame of the cloud
        texture : of their pictures
        scaled : whether the scale is known already
        """
        size = self.surface.diagonal
        guesses, scales = (GUESSES_SCALED, None) if scaled else (GUESSES, SCALES)
        over, _ = surface_points(self.surface, SPREAD)
        random = np.random.default_rng(0)

        def bare(rotations: Floats, translations: Floats, sizes: Floats) -> Floats:
            return texture.bareness(rig, (rotations, translations, sizes), over[::5])

        def ranked(places: Sequence[Similarity]) -> list[Similarity]:
            cost = self._costs(cloud, places) + texture.bareness(rig, stacked(places), over)
            return [places[k] for k in np.argsort(cost, kind="stable")]

        search = PoseSearch(guesses=guesses, scales=scales, kept=DESCEND)
        places = search(cloud, self.surface, self.field, bare)
        places = distinct(ranked(places), cloud.points, APART * size)
        for share in ROUNDS:
            top = places[:SHAKEN]
            shaken = [moved for each in top for moved in _shaken(each, cloud.points, share * size, random, scaled)]
            places = distinct(ranked([*top, *shaken]), cloud.points, share * size)
        return distinct(places, cloud.points, APART * size)[: self.kept]

    def _costs(self, cloud: Thinned, places: Sequence[Similarity]) -> Floats:
        """Return the share of the cloud that lies off the CAD, in each place, (k,)."""
        from inspect3d.register.search_kernel import costs

        return costs(
            *stacked(places), cloud.points, cloud.normals, cloud.oriented, NEAR * self.surface.diagonal,
            self.field.origin, self.field.step, self.field.feet, self.field.normals,
        )  # fmt: skip


def _shaken(
    place: Similarity, points: Floats, size: float, random: np.random.Generator, scaled: bool
) -> list[Similarity]:
    """Return the place moved by about `size` mm at random, `SHAKES` times."""
    middle = points.mean(axis=0)
    centre = place(middle[None])[0]
    length = place.scale * float(np.sqrt(((points - middle) ** 2).sum(axis=1).mean()))
    motions = size * random.normal(size=(SHAKES, 7)) / np.array([length, length, length, 1.0, 1.0, 1.0, length])
    growths = 1.0 + np.zeros(SHAKES) if scaled else 1.0 + np.clip(motions[:, 6], -MOST_GROWTH, MOST_GROWTH)
    turns = Rotation.from_rotvec(motions[:, :3]).as_matrix() @ place.pose.rotation
    shifts = centre + motions[:, 3:6] - (growths * place.scale)[:, None] * (turns @ middle)
    return [
        Similarity(Pose(turn, shift), place.scale * growth)
        for turn, shift, growth in zip(turns, shifts, growths.tolist(), strict=True)
    ]
