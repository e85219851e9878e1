"""Starts without a click on random virtual scenes: which are found, how near they are, and whether any is wrong.

    python benchmarks/click_free.py [first] [last] [--map]

Of each scene it prints how the search ended and how far the part appears from where it is, rms over the part, px. With
--map the correlation is run from that start and from eight picks that are 1.5 px off, as a recipe with this rough focal
length would have it, and the two maps are compared: see click_free_maps.py.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

import numpy as np
from click_free_maps import compared
from click_free_scenes import RandomScene, nominal, random_scene
from stereo_trial import rms

from inspect3d.camera import View
from inspect3d.correlation.freedom import Lens
from inspect3d.correlation.picks import ideal_camera
from inspect3d.correlation.start import CENTRE, DISTORTION, ROUGH
from inspect3d.outcome import MeasurementError
from inspect3d.register.symmetry import surface_points
from inspect3d.starting.finder import FindStart
from inspect3d.starting.shown import Pictured

NEAR = 6.0  # px, within which a start is in the basin of the correlation, whose first blur is as wide


@dataclass(frozen=True, eq=False)
class Ended:
    """How a search ended: in words, the cameras, and the seconds of processor time it took."""

    words: str
    views: tuple[View, ...]
    seconds: float


def searched(scene: RandomScene, lens: Lens) -> Ended:
    """Return how the search of a scene's start ends."""
    pictured = [Pictured(grey, None, ideal_camera(scene.focal, grey.shape[::-1]), lens) for grey in scene.grey]
    start = time.process_time()
    try:
        said = FindStart(nominal(scene.part, scene.element))(pictured)
    except MeasurementError as error:
        return Ended(f"failed: {error}", (), time.process_time() - start)
    words = {0: "not found", 1: "symmetric" if said.symmetric else "found"}.get(len(said.trials), "ambiguous")
    return Ended(words, said.best.views if not said.trials else said.trials[0].views, time.process_time() - start)


def away(views: tuple[View, ...], scene: RandomScene) -> float:
    """Return how far the part appears from where it is, rms over part and pictures, px."""
    points, _ = surface_points(nominal(scene.part, scene.element).surface, 500)
    errors = [found.project(points) - true.project(points) for found, true in zip(views, scene.views, strict=True)]
    return rms(np.linalg.norm(errors, axis=2))


def main() -> None:
    """Run the scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=int, nargs="?", default=0)
    parser.add_argument("last", type=int, nargs="?", default=40)
    parser.add_argument("--map", action="store_true")
    asked = parser.parse_args()
    near = wrong = same = moved = apart = 0
    for seed in range(asked.first, asked.last):
        scene = random_scene(seed)
        lens = Lens(ROUGH * scene.focal, CENTRE * max(scene.grey[0].shape), DISTORTION)
        ended = searched(scene, lens)
        error = away(ended.views, scene) if ended.views else np.inf
        found = ended.words in ("found", "symmetric")
        near += found and error < NEAR
        wrong += found and error >= NEAR
        more = ""
        if asked.map and found:
            maps = compared(scene, ended.views)
            same, moved = same + (maps.same and not maps.moved), moved + (maps.same and maps.moved)
            apart, more = apart + maps.apart, f"; {maps.words}"
        print(
            f"{seed:3d} {scene.part:9s} {len(scene.views)} cameras, {ended.seconds:5.1f} s: {ended.words}, "
            f"{error:.1f} px off{more}",
            flush=True,
        )
    print(f"{near} of {asked.last - asked.first} found within {NEAR:g} px; {wrong} found elsewhere")
    if asked.map:
        missing = asked.last - asked.first - same - moved - apart
        print(f"maps from start and picks: {same} the same, {moved} more in one place, {apart} not, {missing} missing")


if __name__ == "__main__":
    main()
