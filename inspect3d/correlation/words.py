"""What the report says about a shape that was found by correlation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from inspect3d.correlation.freedom import Freedom
from inspect3d.correlation.model_error import ModelError
from inspect3d.correlation.shape import Shape

LOUD = 0.1  # px, disagreement of the pictures that the reader must hear of
PULLED = 5.0  # standard uncertainties by which a camera may differ from what was known without a word


def contributions(shape: Shape) -> tuple[tuple[str, str, str], ...]:
    """Return what the uncertainty of a shape is made of: source, size with its unit, and how it enters."""
    sure, systematic = shape.uncertainty, shape.systematic
    found = [
        (
            "noise of the pictures",
            f"{np.sqrt(sure.noise):.2g} grey levels",
            f"by what the fit leaves over, propagated to every node; times {sure.correlated:.2f} for being correlated",
        )
    ]
    if systematic is not None:
        words = f"a smooth shift of each picture that no camera model explains, alike over {systematic.length:.3g} mm"
        found.append(("systematic shift of the pictures", f"{systematic.size:.2g} px", words))
    weak = [motion for motion in shape.hidden if np.isfinite(motion.sigma)]
    if weak:
        size = 1000 * float(np.sqrt(sum(motion.sigma**2 for motion in weak)))
        words = "motions that the pictures tell weakly, which the priors of the cameras bound; named below"
        found.append(("cameras", f"{size:.2g} µm rms over the map", words))
    if sure.model is not None and sure.model.missed[shape.sound].any():
        missed = shape.sound & sure.model.missed
        size = 1000 * float(np.sqrt(np.mean(sure.model.variances[missed])))
        words = "shape that the control points do not follow, such as steps; at the nodes flagged as unresolved"
        found.append(("splines", f"{size:.2g} µm rms there", words))
    if sure.smoothing is not None:
        words = "what smoothing took off the map, counted at each node as far as it may be shape"
        found.append(("smoothing", f"{1000 * _taken(shape):.2g} µm rms over the map", words))
    return tuple(found)


def _taken(shape: Shape) -> float:
    """Return the rms of what smoothing took off the observed nodes, mm."""
    measured = replace(shape.uncertainty, smoothing=None).deviation(shape.state.motion)
    return float(np.sqrt(np.mean((measured - shape.values)[shape.sound] ** 2)))


def _pulled(shape: Shape, freedom: Freedom) -> tuple[str, ...]:
    """Return by how much the pictures contradict what was known of the cameras, where that is a lot."""
    _, sigmas = freedom.spread(freedom.columns)
    pulls = np.abs(freedom.offset(shape.views)) / sigmas
    if not len(pulls) or pulls.max() < PULLED:
        return ()
    return (
        f"The pictures move the {freedom.names[int(np.argmax(pulls))]} by {pulls.max():.0f} standard uncertainties "
        "from what was known of it: the cameras are known less well than is stated, or the shape has steps that the "
        "elements miss, which pull at cameras. Then the map is wrong by more than it says: give lenses that are "
        "calibrated, or smaller elements.",
    )


def _unresolved(shape: Shape, model: ModelError) -> list[str]:
    """Return where splines do not follow the part, and what to do."""
    flagged, observed = np.count_nonzero(shape.sound & model.missed), np.count_nonzero(shape.sound)
    found = []
    if flagged:
        found.append(
            f"At {flagged} of the {observed} observed nodes the pictures show shape that the control points do not "
            "follow, such as a step or a narrow bump: the map is smeared there. By how much, as far as the pictures "
            "tell, is in the uncertainty, and the nodes are flagged as unresolved. To see such shape choose a higher "
            '`refine` or method = "stereocorrelation".'
        )
    if model.parted:
        found.append(
            "Neighbouring faces do not meet as the CAD has it: the pictures show steps along their edges, where "
            "`continuity` keeps them together. With continuity = 0 each face moves by itself."
        )
    return found


def remarks(shape: Shape, freedom: Freedom) -> tuple[str, ...]:
    """Return what the reader must know about a shape, a sentence each.

    Parameters
    ----------
    freedom : what was not known about the cameras
    """
    remarks = []
    smoothing = shape.uncertainty.smoothing
    if smoothing is not None:
        remarks.append(
            f"This map is smoothed (smoothing = {smoothing.stiffness:g}), by {1000 * _taken(shape):.2g} µm rms: it "
            "shows narrow defects too low. Without `smoothing` the map is as it was measured."
        )
    if shape.systematic is not None and shape.systematic.size > LOUD:
        remarks.append(
            f"Across the epipolar lines, where no shape can make up for it, the pictures disagree by "
            f"{shape.systematic.size:.2g} px: the calibration is not as good as it is said to be. State its "
            "uncertainty (`sigma`), or calibrate again."
        )
    if shape.uncertainty.model is not None:
        remarks += _unresolved(shape, shape.uncertainty.model)
    if not shape.settled:
        remarks.append(
            f"The solver stopped after {len(shape.state.steps)} steps of its last stage, before the shape had settled: "
            f"the last step moved it by up to {1000 * shape.state.steps[-1].change:.2g} µm."
        )
    if shape.quarterings:
        remarks.append(
            f"Elements of {shape.mesh.edge_length:.2g} mm do not follow the part: its shape was found with elements "
            f"{2**shape.quarterings} times as fine, and is reported at the nodes of the mesh. A finer "
            "element_size shows what lies between them."
        )
    own = shape.scene.own
    left_out = np.count_nonzero(own & ~shape.sound)
    if left_out:
        remarks.append(
            f"{left_out} of the {np.count_nonzero(own)} nodes that two cameras see are not observed: the pictures "
            "agree on too few of the points around them, or they lie on an edge."
        )
    return (*remarks, *_pulled(shape, freedom))
