"""A part without symmetry that takes a moment to read, and scans of it: for what is true of every part."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from inspect3d.virtual.deviation_field import Wave
from inspect3d.virtual.part import Part
from inspect3d.virtual.uniform_scan import uniform_scan

FORM = Wave(0.02, (0.010, 0.013, 0.005), 1.0)


def notched():
    """Return a block of 60 x 40 x 20 mm with a corner cut out of it."""

    def shape():
        from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
        from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
        from OCP.gp import gp_Pnt

        corner = BRepPrimAPI_MakeBox(gp_Pnt(40.0, 25.0, 9.0), gp_Pnt(70.0, 50.0, 30.0)).Shape()
        return BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(60.0, 40.0, 20.0).Shape(), corner).Shape()

    return Part("Notched block", shape)


def write_notched(folder: Path, scans=("scan.txt",), scan_from_cad=None):
    """Write the block as part.step and scans of it, 1 point per mm² with a noise of 0.02 mm; seeds count from 0."""
    notched().write_step(folder / "part.step")
    surface = notched().surface()
    for seed, name in enumerate(scans):
        scan = uniform_scan(surface, FORM, 1.0, 0.02, seed, scan_from_cad)
        np.savetxt(folder / name, scan.points_scan, fmt="%.5f")


def recipe_text(cad: Path, part="", rest=""):
    """Return the text of a recipe for the block with elements of 4 mm."""
    head = f'schema = 1\n[part]\nname = "Notched block"\ncad = {json.dumps(str(cad))}\nelement_size = 4.0\n'
    return f"{head}{part}\n{rest}\n"
