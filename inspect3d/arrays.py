"""Checks of shape and finiteness, made once where a value is made."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Integers = NDArray[np.int64]
Indices = NDArray[np.int32]
Booleans = NDArray[np.bool_]


def floats(values: ArrayLike, name: str, *shape: int | None, finite: bool = True) -> Floats:
    """Return a read-only, C-contiguous float64 array of the asked shape.

    Parameters
    ----------
    values : array_like
    name : what the array is called in the error
    shape : the expected lengths; None admits any
    finite : refuse NaN and infinity

    Raises
    ------
    ValueError
        The shape differs, or a value is not finite.
    """
    array = np.array(values, dtype=np.float64, order="C", copy=None)
    _require_shape(array, name, shape)
    if finite and not np.isfinite(array).all():
        raise ValueError(f"{name} has {np.count_nonzero(~np.isfinite(array))} values that are not finite")
    return _frozen(array)


def integers(values: ArrayLike, name: str, *shape: int | None) -> Integers:
    """Return a read-only int64 array of the asked shape."""
    array = np.array(values, dtype=np.int64, order="C", copy=None)
    _require_shape(array, name, shape)
    return _frozen(array)


def booleans(values: ArrayLike, name: str, *shape: int | None) -> Booleans:
    """Return a read-only array of truth values of the asked shape."""
    array = np.array(values, dtype=np.bool_, order="C", copy=None)
    _require_shape(array, name, shape)
    return _frozen(array)


def unit(vectors: Floats) -> Floats:
    """Return the vectors, (..., 3), at length one; a vector of length zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)


def _require_shape(array: NDArray, name: str, shape: tuple[int | None, ...]) -> None:
    fits = array.ndim == len(shape) and all(want in (None, have) for want, have in zip(shape, array.shape, strict=True))
    if not fits:
        wanted = ", ".join("n" if length is None else str(length) for length in shape)
        raise ValueError(f"{name} has the shape {array.shape} where ({wanted}) is wanted")


def _frozen(array: Any) -> Any:
    view = array.view()
    view.flags.writeable = False
    return view
