"""What the pictures show, each by itself: features, texture, outline, and grey levels to be compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from inspect3d.arrays import Booleans, Floats
from inspect3d.camera import Camera
from inspect3d.correlation.freedom import Lens
from inspect3d.correlation.picture import Pictures, Stack
from inspect3d.register.symmetry import surface_points
from inspect3d.starting.contour import Contours
from inspect3d.starting.features import Features
from inspect3d.starting.outlined import Outline
from inspect3d.starting.texture import Texture

BLUR = 1.5  # px of the reduced pictures, in which patches are compared
OUTLINE = 1500  # points over the part by which its outline is judged


@dataclass(frozen=True, eq=False)
class Pictured:
    """A picture and what is known of its camera.

    Parameters
    ----------
    grey : (rows, columns) grey levels
    mask : (rows, columns), where the picture may be used, or None
    camera : the lens, perhaps a rough one
    lens : how well it is known
    """

    grey: Floats
    mask: Booleans | None
    camera: Camera
    lens: Lens


@dataclass(frozen=True, eq=False)
class Shown:
    """What pictures show.

    Parameters
    ----------
    pictured : the pictures and what is known of their cameras
    features : of each
    texture, outline : of all
    stack : the pictures, blurred a little
    """

    pictured: tuple[Pictured, ...]
    features: tuple[Features, ...]
    texture: Texture
    outline: Outline
    stack: Stack

    @classmethod
    def of(cls, pictured: Sequence[Pictured], features: Sequence[Features], contours: Contours) -> Shown:
        """Return what pictures of a part show whose features were found."""
        sizes = [each.camera.size for each in pictured]
        step = max(each.step for each in features)
        return cls(
            tuple(pictured),
            tuple(features),
            Texture.of(features, sizes),
            Outline.of(features, sizes, surface_points(contours.surface, OUTLINE)[0], contours),
            Pictures([each.grey for each in pictured]).blurred(BLUR * step),
        )

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """Return the lenses."""
        return tuple(each.camera for each in self.pictured)

    @property
    def lenses(self) -> tuple[Lens, ...]:
        """Return how well these are known."""
        return tuple(each.lens for each in self.pictured)

    @property
    def masks(self) -> tuple[Booleans | None, ...]:
        """Return where the pictures may be used."""
        return tuple(each.mask for each in self.pictured)
