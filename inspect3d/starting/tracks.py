"""Which features of the pictures are one place of the part."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from inspect3d.arrays import Floats, Integers
from inspect3d.starting.epipolar import epipolar
from inspect3d.starting.features import Features

RATIO = 0.85  # of the distances to the most and the second most alike feature, above which a match is a guess
FEWEST = 30  # matches of two pictures, below which they are taken to have nothing in common
STRAY = 3.0  # px of the reduced pictures, off the epipolar line, within which a match may be right


def tracks(found: Sequence[Features], rays: Sequence[Floats], focals: Sequence[float]) -> Floats:
    """Return where places of the part appear, (n, v, 2) px, NaN in pictures in which they were not found again.

    Features of two pictures match if each is the most alike of its picture to the other, clearly before the second, and
    if they obey the epipolar geometry that most matches of the two pictures share. Matches of several pictures join to
    tracks; a track with two features in one picture is dropped.

    Parameters
    ----------
    rays : of each picture, (n, 2), where the lines of sight of its features cross z = 1, with the rough lens
    focals : px, of the rough lenses
    """
    starts = np.cumsum([0, *(len(each) for each in found)])
    pairs = [np.zeros((0, 2), np.int64)]
    for one, other in combinations(range(len(found)), 2):
        match = matches(found[one], found[other])
        if len(match) >= FEWEST:
            reach = STRAY * max(found[one].step / focals[one], found[other].step / focals[other])
            common = epipolar(rays[one][match[:, 0]], rays[other][match[:, 1]], reach)
            match = match[common.good] if common else match[:0]
        if len(match) >= FEWEST:
            pairs.append(match + starts[[one, other]])
    return _joined(np.concatenate(pairs), found, starts)


def matches(one: Features, other: Features) -> Integers:
    """Return pairs (k, 2) of features that are each other's most alike, clearly."""
    if min(len(one), len(other)) < FEWEST:
        return np.zeros((0, 2), np.int64)
    alike = one.looks @ other.looks.T
    best, back = alike.argmax(axis=1), alike.argmax(axis=0)
    row = np.arange(len(best))
    first = alike[row, best]
    alike[row, best] = -1.0
    second = alike.max(axis=1)
    clear = 1 - first < RATIO**2 * (1 - second)
    mutual = back[best] == row
    kept = np.flatnonzero(clear & mutual)
    return np.stack([kept, best[kept]], axis=1)


def _joined(pairs: Integers, found: Sequence[Features], starts: Integers) -> Floats:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    total, views = int(starts[-1]), len(found)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(total, total))
    label = connected_components(graph, directed=False)[1]
    used = np.unique(pairs)
    names, track = np.unique(label[used], return_inverse=True)
    view = np.searchsorted(starts, used, side="right") - 1
    count = np.zeros((len(names), views), np.int64)
    np.add.at(count, (track, view), 1)
    pixels = np.full((len(names), views, 2), np.nan)
    pixels[track, view] = np.concatenate([each.pixels for each in found])[used]
    return pixels[(count <= 1).all(axis=1) & ((count > 0).sum(axis=1) >= 2)]
