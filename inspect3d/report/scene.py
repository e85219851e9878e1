"""The part in three dimensions, drawn without a screen."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from inspect3d.arrays import Booleans, Floats, Integers
from inspect3d.report.colours import BACK, UNMEASURED, ColourScale
from inspect3d.report.sight import Sight
from inspect3d.report.triangulated import triangulated
from inspect3d.report.viewpoint import Viewpoint

if TYPE_CHECKING:
    from pyvista import Plotter, PolyData

LINES = "#3a3f47"
FILL = 0.96
"""Share of the window that the part takes."""
SHARP = 30.0
"""Degrees between facets from which an edge is drawn."""


@dataclass(frozen=True, eq=False)
class Scene:
    """An open window nobody sees; draws the same part from many sides.

    Parameters
    ----------
    plotter : the window
    nodes : (n, 3) mm, of the part
    """

    plotter: Plotter
    nodes: Floats

    def draw(self, viewpoint: Viewpoint) -> tuple[NDArray[np.uint8], Sight]:
        """Return the picture from a viewpoint, (height, width, 3), and where points of the part lie in it."""
        sight = self.sight(viewpoint)
        image = np.asarray(self.plotter.screenshot(return_img=True))
        return np.ascontiguousarray(image[..., :3]), sight

    def sight(self, viewpoint: Viewpoint) -> Sight:
        """Return what is seen from a viewpoint, the part filling the window."""
        width, height = self.plotter.window_size
        axes = viewpoint.axes
        spans = axes @ self.nodes.T
        low, high = spans.min(axis=1), spans.max(axis=1)
        centre = (low + high) / 2 @ axes
        pixel = float(max((high - low)[:2] / (width, height)) / FILL) or 1.0
        far = float(np.linalg.norm(high - low)) * 2 or 1.0
        camera = self.plotter.camera
        camera.parallel_projection = True
        camera.focal_point = tuple(centre)
        camera.position = tuple(centre + far * axes[2])
        camera.up = tuple(axes[1])
        camera.parallel_scale = pixel * height / 2
        self.plotter.renderer.ResetCameraClippingRange()
        depth = self.plotter.get_image_depth(fill_value=np.nan, reset_camera_clipping_range=False)
        return Sight(far + np.asarray(depth, dtype=np.float64), axes, centre, pixel)


@contextmanager
def scene(
    nodes: Floats, triangles: Integers, values: Floats, scale: ColourScale | None, size: tuple[int, int]
) -> Iterator[Scene]:
    """Open a window on a coloured surface; it is closed when the block ends.

    Parameters
    ----------
    nodes : (n, 3) mm
    triangles : (m, 3)
    values : (n,), NaN where there is nothing to show; those nodes are grey, as far as half-way to the next one
    scale : how values become colours; None draws the part in grey
    size : width and height, px
    """
    _silence()
    from pyvista import Plotter

    surface = triangulated(nodes, triangles)
    plotter = Plotter(off_screen=True, window_size=list(size), lighting="none")
    try:
        plotter.renderer.SetBackground(1.0, 1.0, 1.0)
        _light(plotter)
        shown = np.isfinite(values)
        if scale is None or not shown.any():
            _add(plotter, _shaded(surface), color=_share(UNMEASURED))
        elif scale.classes:
            _add_classes(plotter, surface, values, scale)
        else:
            _add_field(plotter, surface, values, scale)
        edges = surface.extract_feature_edges(SHARP, non_manifold_edges=False, manifold_edges=False)
        if edges.n_cells:
            plotter.add_mesh(edges, color=LINES, line_width=1.2, lighting=False)
        plotter.show(auto_close=False)
        yield Scene(plotter, np.asarray(nodes))
    finally:
        plotter.close()


def _add_field(plotter: Plotter, surface: PolyData, values: Floats, scale: ColourScale) -> None:
    from matplotlib.colors import ListedColormap

    shaded = _shaded(surface, value=values)
    value, shown = np.array(shaded.point_data["value"]), np.isfinite(shaded.point_data["value"])
    shaded.point_data["shown"] = shown.astype(np.float64)
    shaded.point_data["value"] = _filled(value, shown, np.asarray(shaded.regular_faces, dtype=np.int64))
    measured, rest = shaded.clip_scalar(scalars="shown", invert=False, value=0.5, both=True)
    if measured.n_cells:
        colours = ListedColormap(scale.colours / 255.0)
        _add(plotter, measured, scalars="value", cmap=colours, clim=scale.limits)
    if rest.n_cells:
        _add(plotter, rest, color=_share(UNMEASURED))


def _add_classes(plotter: Plotter, surface: PolyData, values: Floats, scale: ColourScale) -> None:
    triangles = np.asarray(surface.regular_faces, dtype=np.int64)
    points, pieces, owner = _cells_of_nodes(np.asarray(surface.points), triangles)
    shaded = _shaded(triangulated(points, pieces), node=owner.astype(np.float64), on="cell")
    index = np.nan_to_num(values[np.asarray(shaded.cell_data["node"]).astype(np.int64)]).astype(np.int64)
    palette = np.vstack([np.array(UNMEASURED, dtype=np.uint8), scale.colours])
    shaded.cell_data["colour"] = palette[index]
    _add(plotter, shaded, scalars="colour", rgb=True, preference="cell")


def _add(plotter: Plotter, surface: PolyData, **colours: Any) -> None:
    """Add a surface whose normals are set; bright enough that its colours are those of the colour bar."""
    back: Any = {"color": _share(BACK), "ambient": 0.4, "diffuse": 0.5}
    actor = plotter.add_mesh(
        surface, ambient=0.72, diffuse=0.34, show_scalar_bar=False, backface_params=back, **colours
    )
    actor.prop.interpolation = "phong"


def _cells_of_nodes(nodes: Floats, triangles: Integers) -> tuple[Floats, Integers, Integers]:
    """Return the surface in smaller triangles, six to one, and the node each belongs to."""
    n, m = len(nodes), len(triangles)
    edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    first, edge = np.unique(edges[:, 0] * n + edges[:, 1], return_index=True, return_inverse=True)[1:]
    points = np.concatenate([nodes, nodes[edges[first]].mean(axis=1), nodes[triangles].mean(axis=1)])
    middle = n + edge.reshape(m, 3)
    centre = n + len(first) + np.arange(m)
    pieces, owner = [], []
    for k in range(3):
        pieces.append(np.column_stack([triangles[:, k], middle[:, k], centre]))
        pieces.append(np.column_stack([triangles[:, k], centre, middle[:, k - 1]]))
        owner += [triangles[:, k], triangles[:, k]]
    return points, np.concatenate(pieces), np.concatenate(owner)


def _filled(values: Floats, shown: Booleans, triangles: Integers) -> Floats:
    """Return the values with the mean of the shown neighbours where a node has none."""
    pairs = np.concatenate([triangles[:, [a, b]] for a in range(3) for b in range(3) if a != b])
    pairs = pairs[~shown[pairs[:, 0]] & shown[pairs[:, 1]]]
    total = np.bincount(pairs[:, 0], values[pairs[:, 1]], minlength=len(values))
    count = np.bincount(pairs[:, 0], minlength=len(values))
    return np.where(shown, values, total / np.maximum(count, 1))


def _shaded(surface: PolyData, on: str = "point", **fields: Floats) -> PolyData:
    """Return the surface with a normal at every point, split along sharp edges, and the fields carried over."""
    data = surface.point_data if on == "point" else surface.cell_data
    for name, field in fields.items():
        data[name] = field
    return surface.compute_normals(
        cell_normals=False,
        split_vertices=True,
        feature_angle=SHARP,
        consistent_normals=False,
        auto_orient_normals=False,
    )


def _light(plotter: Plotter) -> None:
    from pyvista import Light

    for position, intensity in (((0.0, 0.0, 1.0), 0.75), ((-0.4, 0.8, 0.9), 0.35)):
        light = Light(light_type="camera light", intensity=intensity)
        light.position = position
        light.focal_point = (0.0, 0.0, 0.0)
        plotter.add_light(light)


def _share(colour: tuple[int, int, int]) -> tuple[float, float, float]:
    red, green, blue = colour
    return (red / 255, green / 255, blue / 255)


def _silence() -> None:
    """Keep VTK from writing to standard error that there is no X server: it then draws through EGL."""
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
