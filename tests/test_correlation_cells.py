"""Facets of the inspection mesh, cut along the edges of the CAD."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from inspect3d.correlation.cells import cut_facets, whole_facets
from inspect3d.correlation.correlate import Correlate
from inspect3d.correlation.evaluation import evaluation_points
from inspect3d.correlation.seen import scene
from inspect3d.correlation.visibility import EDGE
from inspect3d.nominal.load import load_nominal
from inspect3d.nominal.sheets import edges_between, sheets
from inspect3d.virtual.milled import milled
from inspect3d.virtual.scene import Scene as VirtualScene
from inspect3d.virtual.stereo_datasets import milled_stereo
from inspect3d.virtual.stereo_rig import StereoRig
from tests.seen_sheets import STEEPEST

SIZE = 7.0


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    """Return the milled block."""
    path = tmp_path_factory.mktemp("block") / "milled.step"
    milled().write_step(path)
    return load_nominal(path, element_size=SIZE)


@pytest.fixture(scope="module")
def cells(block):
    """Return its facets, cut, and its evaluation points."""
    points, feet = evaluation_points(block, np.full(len(block.mesh.triangles), 6))
    return cut_facets(block, points, feet), points


def rod(tmp_path, fillet):
    """Return a box whose edges are rounded."""
    from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    shape = BRepPrimAPI_MakeBox(30.0, 20.0, 10.0).Shape()
    if fillet:
        rounded = BRepFilletAPI_MakeFillet(shape)
        edges = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_EDGE)
        while edges.More():
            rounded.Add(fillet, TopoDS.Edge_s(edges.Current()))
            edges.Next()
        shape = rounded.Shape()
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_AsIs)
    writer.Write(str(tmp_path / "box.step"))
    return load_nominal(tmp_path / "box.step", element_size=4.0)


@pytest.mark.parametrize(("fillet", "count"), [(0.0, 6), (3.0, 1)])
def test_faces_that_run_smoothly_into_each_other_are_one_sheet(tmp_path, fillet, count):
    box = rod(tmp_path, fillet)
    of_face = sheets(box.exact)
    assert len(np.unique(of_face[1:])) == count
    edges = edges_between(box.surface, of_face[box.surface_face], 1.0)
    lengths = np.linalg.norm(np.diff(edges.ends, axis=1)[:, 0], axis=1)
    assert lengths.sum() == pytest.approx(4 * (30 + 20 + 10) if count == 6 else 0.0)
    assert (lengths <= 1.0 + 1e-9).all()


def test_every_point_is_in_one_cell_of_its_own_sheet(block, cells):
    cut, points = cells
    assert len(cut.points) == len(points)
    assert len(cut.triangles) > len(block.mesh.triangles)
    assert np.bincount(cut.facet, cut.part) == pytest.approx(1.0)
    assert (block.mesh.triangles[cut.facet] == cut.node[cut.triangles]).all()
    sheet = cut.sheet[cut.triangles]
    assert (sheet == sheet[:, :1]).all()
    of_face = sheets(block.exact)
    face = block.surface_face[block.surface.closest(cut.points.places).triangle]
    assert (of_face[face] == sheet[cut.points.facet, 0]).all()


def test_a_node_has_one_copy_of_its_own_and_the_others_move_across_their_sheets(block, cells):
    cut, _ = cells
    assert np.array_equal(cut.node[cut.own], np.arange(len(block.mesh)))
    sheet_of_point = cut.sheet[cut.triangles[cut.points.facet, 0]]
    flat = 0
    for number in np.unique(cut.sheet):
        places = cut.points.places[sheet_of_point == number]
        _, sizes, axes = np.linalg.svd(places - places.mean(axis=0), full_matrices=False)
        if sizes[2] < 1e-6:
            flat += 1
            others = (cut.sheet == number) & ~cut.own
            assert np.abs(cut.normals[others] @ axes[2]) == pytest.approx(1.0)
    assert flat == 13


def test_a_mesh_without_a_brep_stays_whole(block):
    bare = replace(block, exact=None, surface_face=None)
    points, feet = evaluation_points(bare, np.full(len(bare.mesh.triangles), 4))
    cut, whole = cut_facets(bare, points, feet), whole_facets(bare.mesh, points)
    assert np.array_equal(cut.triangles, whole.triangles)
    assert cut.own.all()


@pytest.fixture(scope="module")
def pictures():
    """Return small pictures of the milled block with its steps, with noise of 1 %, and the cameras."""
    dataset = milled_stereo(3, StereoRig().halved().halved(), 0.0)
    made = VirtualScene(dataset.part.surface(), dataset.deviation, dataset.speckle)
    random = np.random.default_rng(0)
    grey = [camera.sensor(camera.light(made), random).astype(float) for camera in dataset.cameras]
    return dataset, grey, tuple(camera.view for camera in dataset.cameras)


def test_points_that_count_lie_off_the_edges_in_the_pictures(block, pictures):
    _, _, views = pictures
    seen = scene(block, views, 4.0, STEEPEST, [None, None])
    edges = edges_between(block.surface, sheets(block.exact)[block.surface_face], 0.2).ends.mean(axis=1)
    edges = edges[edges[:, 2] > 18.0]
    near, _ = cKDTree(views[0].project(edges)).query(views[0].project(seen.points.places))
    assert near.min() > EDGE - 1.0
    assert (np.bincount(seen.node[seen.own]) <= 1).all()
    assert len(seen.node) > len(np.unique(seen.node))


def test_steps_at_edges_of_the_cad_are_measured_on_both_sides(block, pictures):
    dataset, grey, views = pictures
    shape = Correlate()(block, grey, views)
    nodes, across = shape.scene.nodes, np.array([0.5, 0.0, 0.0])
    truth = dataset.deviation(nodes)
    judged = shape.sound & (np.abs(dataset.deviation(nodes + across) - dataset.deviation(nodes - across)) < 1e-4)
    z = (shape.values - truth)[judged] / np.sqrt(shape.uncertainty.variances[judged])
    assert judged.sum() > 100
    assert np.ptp(truth[judged]) > 0.03
    assert 0.8 < np.sqrt((z**2).mean()) < 1.2
    assert shape.uncertainty.correlated < 1.1
