"""Features of photographs: many small ones, as a speckled part has them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inspect3d.arrays import Booleans, Floats
from inspect3d.files.photograph import Photograph

BRIGHT = 99.8  # percentile of the grey levels that is made white: dark pictures have features too


@dataclass(frozen=True, eq=False)
class Features:
    """The features of one photograph.

    Parameters
    ----------
    pixels : (n, 2) px, as everywhere: (0, 0) is the centre of the top-left pixel
    descriptors : (n, 128)
    """

    pixels: Floats
    descriptors: NDArray[np.uint8]

    def __len__(self) -> int:
        """Return the number of features."""
        return len(self.pixels)


@dataclass(frozen=True)
class FindFeatures:
    """Find features with COLMAP's SIFT on the processor.

    Speckles are small and weak beside the corners that photographs of towns have: the search begins at twice the
    picture's size, goes down to faint extrema, and takes one orientation each.

    Parameters
    ----------
    most : of the features of a picture, the largest ones first
    contrast : of an extremum at the least, share of full scale
    octaves : of sizes
    """

    most: int = 16_000
    contrast: float = 0.002
    octaves: int = 4

    def __call__(self, photograph: Photograph, mask: Booleans | None = None) -> Features:
        """Return the features of a photograph, only where the mask (rows, columns) is True."""
        import pycolmap

        pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
        options = pycolmap.FeatureExtractionOptions()
        options.use_gpu = False
        options.sift.max_num_features = self.most
        options.sift.peak_threshold = self.contrast
        options.sift.num_octaves = self.octaves
        options.sift.first_octave = -1
        options.sift.max_num_orientations = 1
        grey = photograph.grey
        dark, bright = np.percentile(grey, [0.0, BRIGHT])
        levels = np.clip((grey - dark) / max(bright - dark, 1e-12), 0.0, 1.0).astype(np.float32)
        extractor = pycolmap.FeatureExtractor.create(options, pycolmap.Device.cpu)
        keypoints, descriptors = extractor.extract_from_float32_array(levels)
        pixels = pycolmap.keypoints_to_matrix(keypoints)[:, :2].astype(np.float64) - 0.5
        kept = np.ones(len(pixels), dtype=bool)
        if mask is not None:
            column, row = np.round(pixels).astype(np.int64).T
            kept = mask[np.clip(row, 0, mask.shape[0] - 1), np.clip(column, 0, mask.shape[1] - 1)]
        return Features(pixels[kept], np.ascontiguousarray(descriptors.data[kept]))
