"""The comparison of methods in the report: figures, plots, and what is not known, said."""

import re
from dataclasses import replace

import numpy as np
import pytest
from reported import three_methods
from test_report import MOMENT

from inspect3d.report.agreement_plot import draw_agreement
from inspect3d.report.blocks import Table
from inspect3d.report.colours import en_classes, en_scale
from inspect3d.report.comparisons import agreement
from inspect3d.report.layout import Layout
from inspect3d.report.write import write_report


@pytest.fixture(scope="module")
def record():
    return three_methods()


@pytest.fixture(scope="module")
def out(record, tmp_path_factory):
    folder = tmp_path_factory.mktemp("out")
    write_report(record, folder, moment=MOMENT)
    return folder


def test_the_first_page_has_a_row_for_every_pair_and_says_which_are_not_known(record):
    (table,) = agreement(record)
    assert isinstance(table, Table)
    found = {row[0].words: row[-1] for row in table.rows}
    assert list(found) == ["laser − wrong", "laser − peg 2% ß", "wrong − peg 2% ß"]
    assert found["laser − wrong"] == "agree within U"
    assert found["laser − peg 2% ß"].startswith("differ beyond doubt in")
    assert found["wrong − peg 2% ß"] == "E_n not known"
    assert [row[3] for row in table.rows][2] == "–"


def test_a_record_of_one_map_has_nothing_to_compare(record):

    assert agreement(replace(record, comparisons=())) == []


def test_every_pair_has_its_maps_its_plot_and_its_sentences(record, out):
    names = {path.name for path in (out / "pictures").glob("comparison_*")}
    assert {
        f"comparison_{k}_{kind}" for k in (1, 2) for kind in ("difference_1.png", "en_1.png", "agreement.png")
    } <= names
    assert "comparison_3_difference_1.png" in names
    assert "comparison_3_en_1.png" not in names
    html = (out / "report.html").read_text("utf-8")
    assert "left &lt;1&gt;.png" in html
    assert "Limits of agreement" in html
    for comparison in record.comparisons:
        assert comparison.gauge in html


def test_three_methods_have_a_matrix(out):
    from PIL import Image

    picture = np.asarray(Image.open(out / "pictures" / "matrix.png").convert("RGB")).astype(int)
    strong = picture[:, :1200][(np.ptp(picture[:, :1200], axis=2) > 120)]
    assert len(strong) > 500
    html = (out / "report.html").read_text("utf-8")
    assert len(re.findall(r"All methods: their deviation maps", html)) >= 1


def test_what_another_alignment_would_change_is_shown(out):
    html = (out / "report.html").read_text("utf-8")
    assert "The map is aligned by a best fit." in html
    row = re.search(r"the datums A, B and C</td>(.*?)</tr>", html)[1]
    assert re.findall(r">([^<]+)</td>", row) == ["30 µm", "0°", "30 µm"]
    assert (out / "pictures" / "laser_alignment_1.png").exists()
    assert not (out / "pictures" / "wrong_alignment_1.png").exists()


def test_it_is_told_which_method_resolved_which_feature_and_which_regions_stand_out(out):
    html = (out / "report.html").read_text("utf-8")
    (row,) = re.findall(
        r'<tr><td class="name">Kante</td><td class="text">step</td>((?:<td class="number">.*?</td>){3})</tr>', html
    )
    assert re.findall(r">([^<]+)</td>", row) == ["+40.0 ± 6.0 µm", "+40.0 ± 6.0 µm", "not resolved (+40.0 ± 6.0 µm)"]
    assert "too coarse &lt;here&gt;" in html
    assert html.count("Regions that stand out") == 1
    assert '<td class="text">5.0, 0.0, 5.0</td><td class="number">12.5</td><td class="number">+150.0</td>' in html


def test_coverage_adds_up(out):
    html = (out / "report.html").read_text("utf-8")
    rows = dict(
        re.findall(r'<td class="name">(all of them|at least one|none|laser)</td><td class="number">([\d.]+) %', html)
    )
    assert float(rows["at least one"]) + float(rows["none"]) == pytest.approx(100, abs=0.11)
    assert rows["laser"] == rows["at least one"]
    assert float(rows["all of them"]) < float(rows["laser"])


def test_the_classes_of_en_part_at_one():
    classes = en_classes(np.array([0.0, 0.49, 0.99, 1.01, 1.6, np.nan]))
    assert classes[:-1].tolist() == [1, 1, 2, 3, 4]
    assert np.isnan(classes[-1])
    assert len(en_scale().classes) == len(en_scale().colours) == 4


def test_the_mean_is_drawn_midway_between_the_limits_of_agreement(record, tmp_path):
    from PIL import Image

    draw_agreement(tmp_path / "plot.png", record.comparisons[0], "part", Layout(1600, 1200))
    picture = np.asarray(Image.open(tmp_path / "plot.png").convert("RGB")).astype(int)
    rows = 240 + np.flatnonzero((picture[240:1085, 200:1100].sum(axis=2) < 250).mean(axis=1) > 0.4)
    assert rows.max() - rows.min() > 300
    assert np.abs(rows - (rows.min() + rows.max()) / 2).min() <= 2
