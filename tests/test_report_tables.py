"""The maps as tables, and the results as QIF: the same figures for other programs."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_report import MOMENT, NASTY, a_record

from inspect3d.report.qif import NAMESPACE, qif
from inspect3d.report.tables import node_table, write_tables

QIF = Path(__file__).parents[1].parent / "shared" / "data" / "qif" / "schema" / "QIFDocument.xsd"
NAMES = {"q": NAMESPACE}


@pytest.fixture(scope="module")
def record():
    return a_record()


def test_both_tables_hold_every_node_with_what_was_measured_there(record, tmp_path):
    from pyarrow import parquet

    part, mesh = record.parts[0], record.nominal.mesh
    write_tables(record, part, tmp_path)
    table = parquet.read_table(tmp_path / "laser.parquet")
    assert np.array_equal(np.column_stack([table[axis] for axis in "xyz"]), mesh.nodes)
    for name, values in (("deviation", part.deviation.value), ("sigma", part.deviation.sigma)):
        assert np.array_equal(table[name].to_numpy(), values, equal_nan=True)
        assert table[name].null_count == np.count_nonzero(~part.deviation.observed)
    with (tmp_path / "laser.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == table.column_names
    assert [row["deviation"] for row in rows] == ["0.05" if seen else "" for seen in part.deviation.observed]
    assert {row["verdict"] for row in rows} == {"none", "conform"}
    assert sum(float(row["area"]) for row in rows) == pytest.approx(2 * (30 * 20 + 30 * 10 + 20 * 10))


def test_a_table_tells_of_which_part_and_measurement_it_is(record):
    notes = node_table(record, record.parts[0]).schema.metadata
    assert notes[b"part"].decode() == NASTY
    assert notes[b"measurement"] == b"laser"


def test_a_map_without_tolerance_has_no_verdict_and_one_of_pictures_has_its_residual(record):
    free = a_record(part={"tolerance": None})
    part = replace(free.parts[0], residual=np.where(free.parts[0].deviation.observed, 0.3, np.nan))
    table = node_table(free, part)
    assert "verdict" not in table.column_names
    assert table["residual"].null_count == np.count_nonzero(~part.deviation.observed)
    assert "unresolved" not in table.column_names
    flagged = node_table(free, replace(part, unresolved=np.ones(len(part.residual), dtype=bool)))["unresolved"]
    assert np.array_equal(flagged.to_numpy(), part.deviation.observed)
    with pytest.raises(ValueError, match="no map"):
        node_table(record, record.parts[1])


@pytest.mark.data
@pytest.mark.skipif(not QIF.is_file(), reason="the QIF schema is not in the folder of real data")
@pytest.mark.parametrize("what", ["judged", "without tolerance", "failed only", "a tolerance of a region only"])
def test_the_document_is_valid_qif(what):
    from lxml import etree

    schema = etree.XMLSchema(etree.parse(QIF))
    region = {"tolerance": None, "regions": ({"box": ((-1, -1, 4), (1, 1, 6)), "tolerance": (-0.1, 0.2)},)}
    record = {
        "judged": a_record,
        "without tolerance": lambda: a_record(part={"tolerance": None}),
        "failed only": lambda: replace(a_record(), parts=a_record().parts[1:]),
        "a tolerance of a region only": lambda: a_record(part=region),
    }[what]()
    schema.assertValid(etree.fromstring(qif(record, MOMENT)))


def test_a_named_point_has_its_deviation_its_uncertainty_and_its_verdict():
    from lxml import etree

    root = etree.fromstring(qif(a_record(0.3, 0.02), MOMENT))
    (item,) = root.xpath("//q:PointProfileCharacteristicItem[q:Name='P1']/@id", namespaces=NAMES)
    (found,) = root.xpath(f"//q:PointProfileCharacteristicMeasurement[q:CharacteristicItemId={item}]", namespaces=NAMES)
    value = found.find("q:Value", NAMES)
    assert float(value.text) == pytest.approx(0.3)
    assert float(value.get("combinedUncertainty")) == pytest.approx(0.02)
    assert found.findtext("q:Status/q:CharacteristicStatusEnum", namespaces=NAMES) == "FAIL"
    location = root.xpath("//q:PointFeatureMeasurement/q:Location", namespaces=NAMES)[0].text
    assert [float(x) for x in location.split()] == pytest.approx([0, 0, 5.3])


def test_each_measurement_has_a_result_and_every_name_is_text():
    from lxml import etree

    root = etree.fromstring(qif(a_record(), MOMENT))
    assert root.xpath("//q:MeasurementResults/q:InspectionStatus/*/text()", namespaces=NAMES) == [
        "UNKNOWN", "NOT_MEASURED", "NOT_MEASURED",
    ]  # fmt: skip
    names = root.xpath("//q:AttributeStr[@name='measurement']/@value", namespaces=NAMES)
    assert names == ["laser", "wrong", "peg 2% ß"]
    assert root.xpath("/q:QIFDocument/q:Attributes/q:AttributeStr/@value", namespaces=NAMES)[0] == NASTY
    assert qif(a_record(), MOMENT) == qif(a_record(), MOMENT)
