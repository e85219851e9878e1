"""Stage 6: everything a run leaves behind."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from inspect3d.deviate.errors_file import write_errors
from inspect3d.nominal.nurbs_face import write_step
from inspect3d.progress import Progress
from inspect3d.record import Record
from inspect3d.report.comparisons import draw_comparisons
from inspect3d.report.document import document
from inspect3d.report.layout import Layout
from inspect3d.report.maps import cloud_polydata, map_polydata
from inspect3d.report.page import page
from inspect3d.report.pdf import pdf
from inspect3d.report.pictures import SIZE, draw_pictures, start
from inspect3d.report.qif import qif
from inspect3d.report.results import as_json, results
from inspect3d.report.sections import draw_sections
from inspect3d.report.tables import write_tables
from inspect3d.report.viewer import viewer_data
from inspect3d.report.views import Views


def write_report(
    record: Record, folder: Path, progress: Progress | None = None, moment: datetime | None = None
) -> None:
    """Write results.json and .qif, the maps (.vtp, .csv, .parquet) and clouds (.vtp), errors (.npz), pictures, report.

    Parameters
    ----------
    record : the finished inspection
    folder : where everything goes; exists, and is put in its final place by the caller
    progress : told how far the report is
    moment : the date on the report; default: now
    """
    progress, moment = progress or Progress(), moment or datetime.now().astimezone()
    values = results(record)
    (folder / "results.json").write_text(as_json(values), encoding="utf-8")
    for part in record.parts:
        if not part.status.has_map or part.deviation is None:
            continue
        map_polydata(record.nominal.mesh, part).save(folder / f"{part.name}.vtp")
        write_tables(record, part, folder)
        if part.surfaces:
            write_step(part.surfaces, folder / f"{part.name}.step")
        if part.covariance is not None:
            write_errors(folder / f"{part.name}_errors.npz", part.covariance, part.sources, record.nominal.mesh.face)
        if part.points_cad is not None and part.point_deviation is not None:
            cloud_polydata(part).save(folder / f"{part.name}_points.vtp")
    pictures = folder / "pictures"
    pictures.mkdir(exist_ok=True)
    views = Views.of(record.nominal.mesh)
    shown = draw_pictures(record, pictures, views, progress)
    (folder / "results.qif").write_bytes(qif(record, moment))
    layout = Layout(*SIZE)
    further = (draw_sections(record, pictures, layout), draw_comparisons(record, pictures, views, layout))
    report = document(record, values, shown, moment, [each for each in further if each is not None])
    html = page(report, pictures, viewer_data(record, start(shown)))
    (folder / "report.html").write_text(html, encoding="utf-8")
    if "pdf" in record.recipe.report.formats:
        (folder / "report.pdf").write_bytes(pdf(report, pictures, moment))
