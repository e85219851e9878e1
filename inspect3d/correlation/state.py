"""Where the solver stands, and the stages of its way."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from inspect3d.arrays import Floats
from inspect3d.camera import View

Moves = Literal["poses", "cameras", "shape", "placed", "both"]
ON_NOMINAL = ("poses", "cameras")


@dataclass(frozen=True)
class Level:
    """One stage of the way from coarse to fine.

    Parameters
    ----------
    blur : px, standard deviation of the Gaussian over the pictures
    stiffness : of the plate that smooths the shape, in median stiffnesses of a node; 0: none
    steps : at most
    moves : the cameras with the shape held (paper, eq. 4), or only their poses; the shape with the cameras held
        (eq. 8), or with their lenses held only, "placed"; or both at once
    """

    blur: float
    stiffness: float
    steps: int
    moves: Moves = "both"


@dataclass(frozen=True)
class Step:
    """How far a step went.

    Parameters
    ----------
    level : that it belongs to
    change : largest motion of a node that is not one of slivers, or of the part before a camera, mm
    noise : root mean squared residual before it, grey levels
    """

    level: Level
    change: float
    noise: float


@dataclass(frozen=True, eq=False)
class State:
    """Where the solver stands.

    Parameters
    ----------
    motion : (k,) unknowns of the scene's space
    deviation : (n,) mm, by which they move the nodes of the scene
    views : the cameras
    weights : (f,) of the facets
    steps : how it came there
    settled : the last step was shorter than the tolerance
    shift : (q,) of a smooth shift of the pictures found beside the cameras, see `ShiftBlocks`; else none
    """

    motion: Floats
    deviation: Floats
    views: tuple[View, ...]
    weights: Floats
    steps: tuple[Step, ...] = ()
    settled: bool = False
    shift: Floats = field(default_factory=lambda: np.zeros(0))
