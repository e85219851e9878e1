"""Ways from coarse to fine: shape alone, before known cameras; cameras and shape together; the paper's two steps.

`SHAPE` moves nodes and `SPLINES` control points, so few that the sharp pictures bring them home from the first blur,
by deviations of 1.8 mm as well; `JOINT` is for a calibrated rig and for splines, `PLACED` for nodes beside cameras with
poses of their own.

Of cameras and shape together only the poses are brought near the nominal shape first: lenses that take its true
deviations for errors of their own would run far off their priors. So would those of cameras with poses of their own,
which are less well known, where blur and plate are wrong in ways that they can follow, and beside nodes they wait for
the sharp pictures. Poses that are free run off as well, along the surface, by what is wrong with their lenses: such
slides are held, where the start has them. Before a known rig the nominal shape tells where along itself the part lies;
where that runs off, as of nearly a plane, slides are held too.
"""

from __future__ import annotations

from inspect3d.correlation.state import Level

SHAPE = (Level(6, 1000, 8, "shape"), Level(3, 100, 8, "shape"), Level(1.5, 1, 8, "shape"), Level(0, 0, 20, "shape"))
POSES = (Level(6, 0, 15, "poses"), Level(3, 0, 15, "poses"))
JOINT = (*POSES, Level(6, 100, 8), Level(3, 1, 8), Level(1.5, 0.1, 8), Level(0, 0, 40))
PLACED = (*POSES, Level(6, 100, 8, "placed"), Level(3, 1, 8, "placed"), Level(1.5, 0.1, 8, "placed"), JOINT[-1])
TWO_STEPS = (*POSES, *(Level(blur, 0, 20, "cameras") for blur in (3.0, 1.5, 0.0)), *SHAPE)
SPLINES = (SHAPE[0], SHAPE[3])
