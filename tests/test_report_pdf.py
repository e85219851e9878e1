"""The report on paper: the same document as the page, A4, with every name as text."""

import re
from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest
from test_report import MOMENT, NASTY, a_record

from inspect3d.compare.tolerances import tolerances
from inspect3d.compare.verdict import verdict
from inspect3d.deviate.deviation import Deviation
from inspect3d.report.blocks import Chapter, Document, Folded, Picture, Table, as_data
from inspect3d.report.fonts import unprintable
from inspect3d.report.pdf import pdf
from inspect3d.report.verdict_words import whole_verdict
from inspect3d.report.worst import worst_places
from inspect3d.report.write import write_report


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("out")
    write_report(a_record(formats=["html", "pdf"]), folder, moment=MOMENT)
    return folder


@pytest.fixture(scope="module")
def pages(out):
    """Return the text of each page, its line breaks as blanks, and its size in mm."""
    import pypdfium2

    found = []
    with pypdfium2.PdfDocument(out / "report.pdf") as document:
        for page in document:
            text = page.get_textpage().get_text_range()
            found.append((re.sub(r"\s+", " ", text), np.array(page.get_size()) * 25.4 / 72))
    return found


def test_every_page_is_a4_and_says_which_of_how_many_it_is(pages):
    for number, (text, size) in enumerate(pages, start=1):
        assert size == pytest.approx([210, 297], abs=0.5)
        assert f"Page {number} of {len(pages)}" in text


def test_page_one_has_the_verdict_the_worst_places_and_the_contents(pages):
    text = pages[0][0]
    for words in ("not shown to conform", "Worst places", "+0.050 ± 0.020", "Contents", "Provenance"):
        assert words in text


def test_every_name_is_text_on_paper(pages):
    text = " ".join(words for words, _ in pages)
    without_breaks = text.replace(" ", "").replace("\u200b", "").replace("\ufffe", "")
    for part in ('<script>alert("x")</script>&Größe', "$a$", "Itdoesnot<fit>.", "NoPDF<yet>.", "peg2%ß"):
        assert part in without_breaks
    if not unprintable(NASTY):
        assert "支架" in without_breaks


def test_a_hash_can_be_copied_from_the_paper(pages):
    assert "ab" * 32 in pages[-1][0]


def test_page_and_paper_number_their_figures_alike(out, pages):
    html = (out / "report.html").read_text("utf-8")
    captions = re.findall(r"<figcaption>(Figure \d+)\. ([^<]*)</figcaption>", html)
    assert [int(number.split()[1]) for number, _ in captions] == list(range(1, len(captions) + 1))
    text = " ".join(words for words, _ in pages)
    for number, words in captions:
        assert f"{number}: {words}" in text


def test_the_same_report_gives_the_same_bytes(tmp_path):
    (tmp_path / "pictures").mkdir()
    front = Chapter("summary", "#panic() *b* _c_ <x> @y \\ ", (Table(("a",), (("b",),), ("text",)),))
    document = Document("# = *", "under", front, ())
    assert pdf(document, tmp_path, MOMENT) == pdf(document, tmp_path, MOMENT)


def test_a_moment_between_two_seconds_is_a_moment(tmp_path):
    document = Document("", "", Chapter("summary", "Summary", ()), ())
    assert pdf(document, tmp_path, datetime.now().astimezone().replace(microsecond=5)).startswith(b"%PDF")


def test_pictures_are_numbered_in_reading_order_wherever_they_stand():
    folded = Folded("more", (Picture("b.png", "second"),))
    chapters = (
        Chapter("one", "One", (Picture("a.png", "first"), folded)),
        Chapter("two", "Two", (Picture("c.png", ""),)),
    )
    data = as_data(Document("", "", Chapter("front", "", ()), chapters))
    first, second = data["chapters"][0]["blocks"]
    assert (first["number"], second["blocks"][0]["number"]) == (1, 2)
    assert data["chapters"][1]["blocks"][0]["number"] == 3


def test_a_table_with_an_uneven_row_is_refused():
    with pytest.raises(ValueError, match="as many cells"):
        Table(("a", "b"), (("c",),), ("text", "text"))


def test_a_sign_no_font_has_is_told_from_those_that_are_there():
    assert unprintable("Größe ± µ² \U0010fffd") == ""
    assert unprintable("a\u0378\U0001f9ff") in ("", "\U0001f9ff")


def two_methods(first, second, sigma=0.01):
    """Return a record with two maps of constant deviation over all nodes but the creases."""
    record = a_record()
    mesh = record.nominal.mesh
    seen = ~mesh.crease
    limits = tolerances(record.recipe.part, mesh)
    parts = []
    for name, value in (("laser", first), ("peg 2% ß", second)):
        deviation = Deviation(np.where(seen, value, np.nan), np.where(seen, sigma, np.nan), seen)
        parts.append(replace(record.parts[0], name=name, deviation=deviation, verdict=verdict(deviation, limits, 0.95)))
    return replace(record, parts=tuple(parts))


@pytest.mark.parametrize(
    ("first", "second", "kind"),
    [(0.0, 0.1, "conform"), (0.1, 0.1, "undecided"), (0.1, 0.2, "nonconform"), (0.0, 0.2, "nonconform")],
)
def test_the_whole_verdict_takes_what_one_measurement_shows_and_none_denies(first, second, kind):
    assert whole_verdict(two_methods(first, second)).kind == kind


def test_measurements_that_contradict_each_other_are_named():
    assert "by peg 2% ß" in whole_verdict(two_methods(0.0, 0.2)).words
    assert "one of them is wrong" in whole_verdict(two_methods(0.0, 0.2)).words
    assert "one of them is wrong" not in whole_verdict(two_methods(0.1, 0.2)).words


def test_the_worst_place_is_the_defect_and_not_the_noisiest_node():
    record = a_record()
    part, mesh = record.parts[0], record.nominal.mesh
    seen = np.flatnonzero(part.deviation.observed)
    value, sigma = part.deviation.value.copy(), part.deviation.sigma.copy()
    defect, noisy = seen[3], seen[-4]
    value[defect], value[noisy], sigma[noisy] = -0.3, 1.0, 0.6
    changed = replace(part, deviation=Deviation(value, sigma, part.deviation.observed))
    for tolerance in ([-0.1, 0.1], None):
        found = worst_places(replace(a_record(part={"tolerance": tolerance}), parts=(changed,)))
        assert found[0].node == defect
        assert noisy not in [place.node for place in found]
        apart = np.linalg.norm(mesh.nodes[found[0].node] - mesh.nodes[found[1].node])
        assert apart > 0.08 * np.linalg.norm([30, 20, 10])
