"""Inspections run separately and compared afterwards say what one inspection of both says."""

import json
import shutil

import numpy as np
import pytest
import pyvista

from inspect3d.comparing import compare_runs, joined
from inspect3d.deviate.errors_file import read_errors, write_errors
from inspect3d.deviate.low_rank import condensed
from inspect3d.deviate.map_covariance import MapCovariance
from inspect3d.inspection import inspect, run
from inspect3d.outcome import InputError
from inspect3d.progress import Progress
from inspect3d.recipe import load_recipe
from tests.notched import recipe_text, write_notched
from tests.test_compare_regions import Neighbourly


def recipe(folder, scans):
    """Write a recipe for scans of the block, by name and file, and return its path."""
    start = 'alignment = { start = "identity" }'
    tables = "".join(
        f'[[measurements]]\nname = "{name}"\nmethod = "scan"\nfiles = ["{file}"]\n{start}\n'
        for name, file in scans.items()
    )
    path = folder / f"{'-'.join(scans)}.toml"
    path.write_text(recipe_text(folder / "part.step", "tolerance = [-0.05, 0.05]", tables), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two scans of one block: inspected together, and each by itself."""
    folder = tmp_path_factory.mktemp("runs")
    write_notched(folder, ("first.txt", "second.txt"))
    together = inspect(load_recipe(recipe(folder, {"a": "first.txt", "b": "second.txt"})), Progress())
    for name, file in (("a", "first.txt"), ("b", "second.txt")):
        run(recipe(folder, {name: file}), folder / f"only-{name}")
    return folder, together


def test_maps_of_separate_runs_compare_like_those_of_one_run(runs):
    folder, together = runs
    apart = joined([folder / "only-a", folder / "only-b"])
    (one,), (other,) = together.comparisons, apart.comparisons
    np.testing.assert_allclose(one.difference, other.difference, atol=1e-9)
    np.testing.assert_allclose(one.sigma, other.sigma, rtol=1e-9)
    assert 0.4 < one.en_rms < 0.6
    assert one.words == other.words
    assert [part.status for part in apart.parts] == [part.status for part in together.parts]
    for part, before in zip(apart.parts, together.parts, strict=True):
        np.testing.assert_allclose(part.deviation.value, before.deviation.value, atol=1e-9)
        np.testing.assert_array_equal(part.verdict, before.verdict)
        np.testing.assert_allclose(part.sensitivity.spread, before.sensitivity.spread, atol=1e-12)
        np.testing.assert_allclose(part.sensitivity.within, before.sensitivity.within, rtol=0.01)
        values = json.loads((folder / f"only-{part.name}" / "results.json").read_text(encoding="utf-8"))
        alignment = values["measurements"][part.name]["alignment"]
        np.testing.assert_array_equal(part.alignments[0].covariance, alignment["covariance"])


def test_the_report_of_a_comparison_holds_both_measurements(runs):
    folder, _ = runs
    compare_runs([folder / "only-a", folder / "only-b"], folder / "compared")
    values = json.loads((folder / "compared" / "results.json").read_text(encoding="utf-8"))
    assert list(values["measurements"]) == ["a", "b"]
    (found,) = values["comparisons"]
    wanted = {"a", "b", "nodes", "mean", "std", "limits_of_agreement", "en_rms", "en_above_1"}
    assert wanted <= found.keys()
    assert found["nodes"] > 100
    assert found["limits_of_agreement"] == pytest.approx(
        [found["mean"] - 1.96 * found["std"], found["mean"] + 1.96 * found["std"]]
    )
    for name in ("a.vtp", "b.vtp", "a_errors.npz", "report.html"):
        assert (folder / "compared" / name).is_file()


def test_a_run_compared_with_itself_shares_its_files_and_has_no_en(runs):
    folder, _ = runs
    found = joined([folder / "only-a", folder / "only-a"])
    assert [part.name for part in found.parts] == ["a only-a", "a only-a 2"]
    assert found.comparisons[0].en_rms is None
    assert "first.txt" in found.comparisons[0].reason
    assert np.nanmax(np.abs(found.comparisons[0].difference)) < 1e-9


def test_runs_on_different_meshes_are_refused_with_the_reason(runs):
    folder, _ = runs
    shutil.copytree(folder / "only-b", folder / "other")
    moved = pyvista.read(folder / "other" / "b.vtp")
    moved.points[0] += 0.01
    moved.save(folder / "other" / "b.vtp")
    with pytest.raises(InputError, match="element_size"):
        compare_runs([folder / "only-a", folder / "other"], folder / "never")
    assert not (folder / "never").exists()


def test_one_map_is_nothing_to_compare(runs, tmp_path):
    with pytest.raises(InputError, match="hold 1 map: a comparison needs two"):
        compare_runs([runs[0] / "only-a"], tmp_path / "never")


def test_a_folder_without_an_inspection_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no inspection"):
        compare_runs([tmp_path], tmp_path / "out")


def test_a_condensed_covariance_keeps_its_variances_and_its_strong_modes(tmp_path):
    random = np.random.default_rng(0)
    factor = random.normal(size=(400, 400)) * 0.9 ** np.arange(400)
    own = Neighbourly(factor)
    kept = condensed(own)
    np.testing.assert_allclose(kept.variances, own.variances, rtol=1e-9)
    columns = random.normal(size=(400, 3))
    np.testing.assert_allclose(kept.covariance(columns), own.covariance(columns), rtol=0.02, atol=0.02)
    covariance = MapCovariance(np.arange(400), own, np.ones((400, 1)), (0.04, 0.005), 0.002, refined=False)
    write_errors(tmp_path / "map_errors.npz", covariance, {"12ab": "scan.ply"}, np.arange(500))
    found = read_errors(tmp_path / "map_errors.npz")
    assert (found.covariance.coating, found.covariance.calibration) == ((0.04, 0.005), 0.002)
    assert (found.covariance.refined, found.covariance.scale_known) == (False, True)
    assert found.sources == {"12ab": "scan.ply"}
    assert len(found.face) == 500
    np.testing.assert_allclose(found.covariance.own.covariance(columns), own.covariance(columns), rtol=0.02, atol=0.02)
