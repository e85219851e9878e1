"""What the last chapter of a report says: by which rule it decides, how sure it is, and where everything comes from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from scipy.special import ndtri

from inspect3d.record import Record
from inspect3d.report.blocks import Block, Chapter, Heading, Note, Paragraph, Table, table_of
from inspect3d.report.digits import number

UNCERTAINTY = (
    "Every sigma is a standard uncertainty (k = 1), every U an expanded one (k = 2, about 95 %), after JCGM 100. The "
    "uncertainty of a node holds the noise of the measurement, the alignment, and what the recipe states of coating "
    "and calibration; each measurement lists its contributions. A best fit determines the pose from the same points as "
    "the map, so a map is known up to a rigid motion of the whole. What shifts all nodes alike does not average out "
    "over an area. Uncertainties the recipe does not state, such as of the fixture or a drift, are not in the figures."
)
RULE = (
    "After ISO 14253-1 and JCGM 106, with a guard band of {factor} standard uncertainties (probability {probability}, "
    "one-sided): a node conforms where its deviation lies inside its tolerance by at least the guard band, is "
    "nonconform where it lies outside by as much, and is undecided in between. One nonconform node decides against the "
    "part. The part conforms only where every node apart from edges was measured and conforms: what nobody measured "
    "has not been shown to conform. By several measurements, a node is nonconform if one of them finds it so, and "
    "conforms if one of them shows it and none denies it."
)


def rule_chapter(record: Record, anchor: str) -> Chapter:
    """Return the decision rule and the statement of uncertainty."""
    blocks: list[Block] = [Heading("Decision rule"), *_rule(record), Heading("Statement of uncertainty")]
    return Chapter(anchor, "Decision rule and uncertainty", (*blocks, Paragraph(UNCERTAINTY)))


def provenance_chapter(record: Record, anchor: str) -> Chapter:
    """Return the files read with their hashes, the settings, the software and how chance was kept out."""
    files = tuple((file.path, file.sha256) for file in record.inputs)
    settings = tuple(_settings(record.recipe.model_dump(by_alias=True)))
    versions = " · ".join(f"{name} {version}" for name, version in record.versions.items())
    random = "Random numbers start from fixed seeds: the same files and settings give the same results. Seeds that are "
    random += "settings of a method stand in its settings."
    blocks: list[Block] = [Heading("Files read"), Table(("File", "SHA-256"), files, ("code", "hash"))]
    blocks += [Heading("Settings of the recipe"), Table((), settings, ("code", "code"))]
    blocks += [Heading("Software"), Paragraph(versions), Heading("Seeds"), Paragraph(random)]
    return Chapter(anchor, "Provenance", tuple(blocks))


def part_chapter(record: Record, rows: list[tuple[str, str]], picture: Block, anchor: str) -> Chapter:
    """Return the part as designed."""
    remarks: list[Block] = [Note("About the model", record.nominal.remarks)] if record.nominal.remarks else []
    return Chapter(anchor, "The part as designed", (table_of(rows), *remarks, picture))


def _rule(record: Record) -> list[Block]:
    part = record.recipe.part
    if part.tolerance is None and not any(region.tolerance for region in part.regions):
        return [Paragraph("The recipe states no tolerance, so nothing is decided.")]
    factor = number(float(ndtri(part.probability)), 3)
    places = [("the part", part.tolerance), *((region.name or "–", region.tolerance) for region in part.regions)]
    rows = tuple(
        (name, f"{limits[0]:+g} to {limits[1]:+g}".replace("-", "−")) for name, limits in places if limits is not None
    )
    rule = Paragraph(RULE.format(factor=factor, probability=f"{part.probability:g}"))
    return [rule, Table(("Where", "Tolerance, mm"), rows, ("name", "number"))]


def _settings(value: Any, name: str = "") -> Iterator[tuple[str, str]]:
    """Yield the settings of a recipe by their dotted names; what was not set and has no default is left out."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _settings(inner, f"{name}.{key}" if name else str(key))
    elif isinstance(value, tuple | list) and value and isinstance(value[0], Mapping):
        for position, inner in enumerate(value):
            yield from _settings(inner, f"{name}[{inner.get('name') or position}]")
    elif value not in (None, (), [], ""):
        yield name, _written(value)


def _written(value: Any) -> str:
    if isinstance(value, tuple | list):
        return f"[{', '.join(_written(each) for each in value)}]"
    if isinstance(value, bool):
        return str(value).lower()
    return str(value)
