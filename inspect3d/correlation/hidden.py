"""What the pictures cannot tell, or hardly: motions of cameras and shape together, in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.scene import Scene
from inspect3d.correlation.system import System
from inspect3d.register.mobility import named, spread

LOUD = 0.5
CHIEF = 0.5
ALIKE = 0.1


@dataclass(frozen=True, eq=False)
class HiddenMotion:
    """A change of the shape that a change of the cameras makes up for.

    Parameters
    ----------
    words : what it is
    pattern : (n,) the change of the deviation at the nodes of the scene, of rms 1 over those that are seen well; zero
        if the shape stays as it is
    sigma : mm, standard uncertainty of its size in the map; infinite if the pictures do not show it at all
    prior : share of what is known about it that comes from the priors, 0 to 1
    """

    words: str
    pattern: Floats
    sigma: float
    prior: float


def hidden_motions(scene: Scene, system: System, freedom: Freedom, local: float) -> tuple[HiddenMotion, ...]:
    """Return what the pictures do not show or show weakly, from the spectrum of the reduced camera matrix.

    Parameters
    ----------
    local : mm, median uncertainty of a node with the cameras known; a motion whose uncertainty in the map stays below
        half of that is not named

    Notes
    -----
    That the part may move as a whole is left to the alignment and not repeated here.
    """
    found: list[HiddenMotion] = []
    whole = scene.whole
    if not whole.any():
        return ()
    if freedom.poses == "free":
        growth = ((scene.nodes - scene.centre) * scene.normals).sum(axis=1)
        size = np.sqrt((growth[whole] ** 2).mean())
        words = "growth of the whole part: the scale is not known"
        found.append(HiddenMotion(words, growth / size if size > 0 else growth, np.inf, 0.0))
    found += _unseen(scene, system, freedom)
    factor = system.factor_by_cameras
    if not factor.size:
        return tuple(found)
    response = scene.space.rows(scene) @ system.following @ factor
    _, sizes, mixes = np.linalg.svd(response[whole], full_matrices=False)
    sizes = sizes / np.sqrt(np.count_nonzero(whole))
    _, sigmas = freedom.spread(freedom.columns)
    scale = np.sqrt((factor[: len(sigmas)] ** 2).sum(axis=1))
    for size, mix in zip(sizes, mixes, strict=True):
        if size > LOUD * local:
            cameras = factor[: len(sigmas)] @ mix
            prior = float(((cameras / sigmas) ** 2).sum())
            words = _words(cameras / np.where(scale > 0, scale, 1.0), freedom)
            words = f"{words}: {1000 * size:.2g} µm rms of the map, {100 * prior:.0f} % of what is known from the prior"
            found.append(HiddenMotion(words, response @ mix / size, float(size), prior))
    return tuple(found)


def _unseen(scene: Scene, system: System, freedom: Freedom) -> list[HiddenMotion]:
    """Return the motions that change no picture: of the part in itself, by name, or of cameras and shape."""
    unseen = system.unseen
    if not len(unseen) or freedom.poses == "known":
        return []
    length = spread(scene.nodes, np.ones(len(scene.nodes)), scene.centre)
    bodies = 1 if freedom.poses == "common" else len(freedom.lenses)
    poses = unseen[:, : 6 * bodies].reshape(len(unseen), bodies, 6) * np.array([length] * 3 + [1.0] * 3)
    together = poses.mean(axis=1)
    apart = np.linalg.norm(poses - together[:, None], axis=(1, 2))
    as_one = apart < ALIKE * np.linalg.norm(poses, axis=(1, 2))
    basis = np.linalg.qr(together[as_one].T)[0].T
    motions = basis / np.array([length] * 3 + [1.0] * 3)
    flat = np.zeros(len(scene.nodes))
    words = [f"{motion.words}: the surface stays in itself" for motion in named(motions, freedom.origin, length)]
    found = [HiddenMotion(w, flat, np.inf, 0.0) for w in words]
    apart_words = "a change of the cameras against each other that the pictures do not show"
    for pattern in (scene.space.rows(scene) @ system.following @ unseen[~as_one].T).T:
        size = np.sqrt((pattern**2).mean())
        found.append(HiddenMotion(apart_words, pattern / size if size > 0 else flat, np.inf, 0.0))
    return found


def _words(cameras: Floats, freedom: Freedom) -> str:
    """Return the chief unknowns of a motion of the cameras, given in their standard uncertainties."""
    lens = [k for k, name in enumerate(freedom.names) if not name.startswith(("turn", "shift"))]
    chief = [freedom.names[k] for k in lens if abs(cameras[k]) > CHIEF]
    if not chief and freedom.poses == "common" and not freedom.stands:
        return "the place of the part before the cameras"
    if not chief:
        return "the poses of the cameras against each other"
    return "the " + ", the ".join(chief) + ", with the poses"
