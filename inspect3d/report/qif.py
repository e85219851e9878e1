"""The results as QIF 3.0 (ISO 23952), for quality systems: values with their uncertainty and status."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from uuid import NAMESPACE_OID, uuid5
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from inspect3d import __version__
from inspect3d.arrays import Floats
from inspect3d.compare.tolerances import tolerances
from inspect3d.record import MeasuredPart, Record
from inspect3d.report.reading import readings
from inspect3d.report.verdict_words import verdict_words
from inspect3d.report.worst import worst_places

NAMESPACE = "http://qifstandards.org/xsd/qif3"
STATUS = ("NOT_ANALYZED", "PASS", "INDETERMINATE", "FAIL")
"""Of a characteristic, for the verdicts none, conform, undecided, nonconform."""
OVERALL = {"conform": "PASS", "undecided": "UNKNOWN", "nonconform": "FAIL", "none": "NOT_CALCULATED"}
WHOLE = {"conform": "PASS", "undecided": "INDETERMINATE", "nonconform": "FAIL", "none": "NOT_ANALYZED"}
SCALE = "combinedUncertainty is the combined standard uncertainty (k = 1), mm; meanError 0: known biases are corrected"


def qif(record: Record, moment: datetime) -> bytes:
    """Return named points and worst places, and the whole surface, as an inspection result in XML.

    A point is a PointFeature on the CAD model whose profile characteristic has the signed deviation along the normal;
    the surface has the largest and the smallest deviation. All nodes would make a document nobody reads: they are in
    the tables beside it. Characteristics need a tolerance in QIF; without one only the measured points are there.

    Parameters
    ----------
    record : the inspection
    moment : of the report
    """
    writer = _Writer(record)
    root = Element("QIFDocument", {"xmlns": NAMESPACE, "versionQIF": "3.0.0", "idMax": "0"})
    identity = "|".join((*(f"{file.path} {file.sha256}" for file in record.inputs), moment.isoformat()))
    _leaf(root, "QPId", str(uuid5(NAMESPACE_OID, identity)))
    _attributes(root, {"part": record.recipe.part.name, "CAD model": record.recipe.part.cad, "uncertainty": SCALE})
    _leaf(_branch(root, "Version"), "TimeCreated", moment.isoformat())
    application = _branch(root, "Header", "Application")
    _leaf(application, "Name", f"inspect3d {__version__}")
    writer.write_standard(root)
    unit = _branch(root, "FileUnits", "PrimaryUnits", "LinearUnit")
    _leaf(unit, "SIUnitName", "meter")
    _leaf(unit, "UnitName", "mm")
    _leaf(_branch(unit, "UnitConversion"), "Factor", "0.001")
    writer.write_features(root)
    writer.write_characteristics(root)
    measured = _branch(root, "Results", "MeasurementResultsSet")
    for part in record.parts:
        writer.write_results(measured, part)
    _count(measured)
    root.set("idMax", str(writer.last))
    indent(root)
    return tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


@dataclass(frozen=True, eq=False)
class _Point:
    """A node that the document speaks of; `item` and `profile` are the ids of its feature and characteristic."""

    name: str
    node: int
    item: int
    profile: int | None


@dataclass(eq=False)
class _Writer:
    """Writes the parts of the document that refer to each other by number."""

    record: Record
    last: int = 0
    points: list[_Point] = field(default_factory=list)
    surface: tuple[int, int] | None = None
    standard: int = 0

    def number(self) -> int:
        self.last += 1
        return self.last

    @property
    def limits(self) -> Floats | None:
        return tolerances(self.record.recipe.part, self.record.nominal.mesh)

    def write_standard(self, root: Element) -> None:
        """Write after which standard the tolerances are meant."""
        self.standard = self.number()
        definitions = SubElement(root, "StandardsDefinitions", {"n": "1"})
        standard = SubElement(definitions, "Standard", {"id": str(self.standard)})
        _leaf(_branch(standard, "Organization"), "StandardsOrganizationEnum", "ISO")
        _leaf(standard, "Designator", "1101")
        _leaf(standard, "Year", "2017")

    def write_features(self, root: Element) -> None:
        """Write each point and the surface: its definition, where it should be, and that it was to be checked."""
        mesh, features = self.record.nominal.mesh, _branch(root, "Features")
        lists = [_branch(features, f"Feature{kind}") for kind in ("Definitions", "Nominals", "Items")]
        definitions, nominals, items = lists
        of_points = self.number()
        SubElement(definitions, "PointFeatureDefinition", {"id": str(of_points)})
        for name, node in _named(self.record):
            nominal, item = self.number(), self.number()
            point = SubElement(nominals, "PointFeatureNominal", {"id": str(nominal)})
            _leaf(point, "FeatureDefinitionId", of_points)
            _leaf(point, "Location", _decimals(mesh.nodes[node]))
            _leaf(point, "Normal", _decimals(mesh.normals[node]))
            self._write_item(items, "PointFeatureItem", item, nominal, name)
            judged = self.limits is not None and np.isfinite(self.limits[node]).all()
            self.points.append(_Point(name, node, item, self.number() if judged else None))
        of_surface, nominal, item = self.number(), self.number(), self.number()
        SubElement(definitions, "OtherSurfaceFeatureDefinition", {"id": str(of_surface)})
        surface = SubElement(nominals, "OtherSurfaceFeatureNominal", {"id": str(nominal)})
        _leaf(surface, "FeatureDefinitionId", of_surface)
        self._write_item(items, "OtherSurfaceFeatureItem", item, nominal, "the whole surface")
        self.surface = (item, self.number()) if self.record.recipe.part.tolerance else None
        for each in lists:
            _count(each)

    def _write_item(self, items: Element, kind: str, item: int, nominal: int, name: str) -> None:
        element = SubElement(items, kind, {"id": str(item)})
        _leaf(element, "FeatureNominalId", nominal)
        _leaf(element, "FeatureName", name)
        _branch(element, "DeterminationMode", "Checked", "CheckDetails", "Measured")

    def write_characteristics(self, root: Element) -> None:
        """Write the tolerance of each point and of the surface."""
        asked = [("PointProfile", each.name, each.item, each.profile, self.limits[each.node])
                 for each in self.points if each.profile is not None and self.limits is not None]  # fmt: skip
        if self.surface is not None:
            tolerance = np.array(self.record.recipe.part.tolerance)
            asked.append(("SurfaceProfile", "the whole surface", *self.surface, tolerance))
        if not asked:
            return
        characteristics = _branch(root, "Characteristics")
        _leaf(characteristics, "FormalStandardId", self.standard)
        lists = [_branch(characteristics, f"Characteristic{kind}") for kind in ("Definitions", "Nominals", "Items")]
        definitions, nominals, items = lists
        for kind, name, feature, item, (low, high) in asked:
            definition, nominal = self.number(), self.number()
            defined = SubElement(definitions, f"{kind}CharacteristicDefinition", {"id": str(definition)})
            _leaf(defined, "ToleranceValue", _decimal(high - low))
            _leaf(defined, "OuterDisposition", _decimal(high))
            element = SubElement(nominals, f"{kind}CharacteristicNominal", {"id": str(nominal)})
            _leaf(element, "CharacteristicDefinitionId", definition)
            element = SubElement(items, f"{kind}CharacteristicItem", {"id": str(item)})
            _leaf(element, "Name", name)
            _refer(element, "FeatureItemIds", feature)
            _leaf(element, "CharacteristicNominalId", nominal)
        for each in lists:
            _count(each)

    def write_results(self, into: Element, part: MeasuredPart) -> None:
        """Write what one measurement found: the points, their deviations, and the verdict on the whole."""
        result = SubElement(into, "MeasurementResults", {"id": str(self.number())})
        has_map = part.status.has_map and part.deviation is not None
        words = part.reason or part.status.words
        _attributes(result, {"measurement": part.name, "method": part.provenance, "status": words})
        if has_map:
            self._write_measured(result, part)
        overall = OVERALL[verdict_words(self.record, part).kind] if has_map else "NOT_MEASURED"
        _leaf(_branch(result, "InspectionStatus"), "InspectionStatusEnum", overall)

    def _write_measured(self, result: Element, part: MeasuredPart) -> None:
        mesh, deviation = self.record.nominal.mesh, part.deviation
        if deviation is None or not deviation.observed.any():
            return
        features = _branch(result, "MeasuredFeatures")
        found = []
        for point in self.points:
            if not deviation.observed[point.node]:
                continue
            measured = self.number()
            value, sigma = float(deviation.value[point.node]), float(deviation.sigma[point.node])
            element = SubElement(features, "PointFeatureMeasurement", {"id": str(measured)})
            _leaf(element, "FeatureItemId", point.item)
            place = mesh.nodes[point.node] + value * mesh.normals[point.node]
            along = {
                f"{axis}CombinedUncertainty": _decimal(abs(float(share)) * sigma)
                for axis, share in zip("xyz", mesh.normals[point.node], strict=True)
            }
            _leaf(element, "Location", _decimals(place), along)
            if point.profile is not None and part.verdict is not None:
                found.append((point, measured, STATUS[int(part.verdict[point.node])], value, sigma))
        if len(features):
            _count(features)
        else:
            result.remove(features)
        if not (found or self.surface):
            return
        characteristics = _branch(result, "MeasuredCharacteristics", "CharacteristicMeasurements")
        for point, measured, status, value, sigma in found:
            element = self._write_characteristic(characteristics, "PointProfile", status, point.profile)
            _refer(element, "FeatureMeasurementIds", measured)
            _value(element, "Value", value, sigma)
        if self.surface is not None:
            status = WHOLE[verdict_words(self.record, part).kind]
            element = self._write_characteristic(characteristics, "SurfaceProfile", status, self.surface[1])
            for name, node in (
                ("MaxValue", np.nanargmax(deviation.value)),
                ("MinValue", np.nanargmin(deviation.value)),
            ):
                _value(element, name, float(deviation.value[node]), float(deviation.sigma[node]))
        _count(characteristics)

    def _write_characteristic(self, into: Element, kind: str, status: str, item: int | None) -> Element:
        element = SubElement(into, f"{kind}CharacteristicMeasurement", {"id": str(self.number())})
        _leaf(_branch(element, "Status"), "CharacteristicStatusEnum", status)
        _leaf(element, "CharacteristicItemId", item)
        return element


def _named(record: Record) -> list[tuple[str, int]]:
    """Return the nodes to speak of: those of the labels, as the first measurement reads them, and the worst places."""
    found: dict[str, int] = {}
    for part in record.parts:
        if part.status.has_map:
            for reading in readings(record.nominal.mesh, part, record.recipe.report.labels):
                if reading.node is not None:
                    found.setdefault(reading.name, reading.node)
    worst = [(f"worst place {k}", place.node) for k, place in enumerate(worst_places(record), start=1)]
    return [*found.items(), *worst]


def _branch(parent: Element, *names: str) -> Element:
    for name in names:
        parent = SubElement(parent, name)
    return parent


def _leaf(parent: Element, name: str, value: object, attributes: dict[str, str] | None = None) -> None:
    SubElement(parent, name, attributes or {}).text = _allowed(str(value))


def _value(parent: Element, name: str, value: float, sigma: float) -> None:
    _leaf(parent, name, _decimal(value), {"combinedUncertainty": _decimal(sigma), "meanError": "0"})


def _refer(parent: Element, name: str, number: int) -> None:
    _leaf(SubElement(parent, name, {"n": "1"}), "Id", number)


def _count(parent: Element) -> None:
    parent.set("n", str(len(parent)))


def _attributes(parent: Element, values: dict[str, str]) -> None:
    holder = SubElement(parent, "Attributes", {"n": str(len(values))})
    for name, value in values.items():
        SubElement(holder, "AttributeStr", {"name": name, "value": _allowed(value)})


def _allowed(words: str) -> str:
    """Return a text without the characters that XML 1.0 has not."""
    return re.sub("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "\ufffd", words)


def _decimal(value: float) -> str:
    return f"{float(value):.9f}"


def _decimals(values: Sequence[float] | Floats) -> str:
    return " ".join(_decimal(value) for value in values)
