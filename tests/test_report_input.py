"""Bad input of reports: one line names it, it is skipped or refused, and the rest is reported."""

from __future__ import annotations

import json
import shutil
import warnings

import pytest
from made_results import edit_summary, make_result, of_own_mazes, read_summary

from mazebench.errors import Remark
from mazebench.report.episodes import read_results
from mazebench.report.write_report import write_report
from mazebench.results.reading import EPISODES, SUMMARY
from mazebench.results.trajectories import TRAJECTORIES


@pytest.fixture
def run(tmp_path):
    """A folder with one good result; made anew for each test."""
    make_result(tmp_path / "run" / "good", "mah", num_mazes=2)
    return tmp_path / "run"


def read(*paths):
    """(labels, warnings) of the results at `paths`."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", Remark)
        results = read_results(paths)
    return [result.label for result in results], [str(warning.message) for warning in caught]


FAULTS = {
    "line 4": lambda folder: (folder / EPISODES).write_bytes((folder / EPISODES).read_bytes()[:-20]),
    "expected a finished evaluation": lambda folder: (folder / SUMMARY).unlink(),
    "of benchmark 'paper', manifest 2fd24efc, found manifest 00": lambda folder: edit_summary(
        folder, provenance=read_summary(folder)["provenance"] | {"benchmark_manifest_sha256": "00"}
    ),
}


class TestSkipped:
    @pytest.mark.parametrize("expected", FAULTS)
    def test_a_damaged_or_edited_result_is_skipped_by_name(self, run, expected):
        FAULTS[expected](make_result(run / "other", "mah", num_mazes=2, position_noise=0.5))
        labels, [warning] = read(run)
        assert labels == ["mah"]
        assert str(run / "other") in warning
        assert expected in warning
        assert warning.endswith("; skipped")

    def test_a_copied_result_is_reported_once(self, run):
        shutil.copytree(run / "good", run / "later")
        labels, [warning] = read(run)
        assert labels == ["mah"]
        assert warning == f"{run / 'later'}: mah, local, 13 × 13 again, as in {run / 'good'}; skipped"

    def test_a_result_with_trajectories_of_another_run_is_reported_without_paths(self, run):
        make_result(run / "other", "mah", num_mazes=2, position_noise=0.5, skill=0.1)
        shutil.copy(run / "other" / TRAJECTORIES, run / "good" / TRAJECTORIES)
        [warning] = read(run)[1]
        assert "expected a pose for the start and for each step" in warning
        assert warning.endswith("reported without paths")


def test_checkpoints_and_seeds_tell_agents_of_one_name_apart(tmp_path):
    make_result(tmp_path / "a", "mah", num_mazes=1, checkpoint="aa11bb22")
    make_result(tmp_path / "b", "mah", num_mazes=1, checkpoint="cc33dd44")
    make_result(tmp_path / "c", "random", num_mazes=1, seed=0)
    make_result(tmp_path / "d", "random", num_mazes=1, seed=1)
    make_result(tmp_path / "e", "dqn", num_mazes=1)
    assert read(tmp_path) == (["mah aa11bb22", "mah cc33dd44", "random seed 0", "random seed 1", "dqn"], [])


def test_the_command_prints_one_line_for_each_fault(run, tmp_path, command):
    status, output, errors = command("report", tmp_path / "none", "--out", tmp_path / "out")
    assert (status, output, len(errors.splitlines())) == (2, "", 2)
    assert "found none to report" in errors
    assert not (tmp_path / "out").exists()
    status, output, errors = command("report", run, tmp_path / "none", "--out", tmp_path / "out")
    assert (status, output) == (0, f"1 result of mah: {tmp_path / 'out' / 'report.html'}\n")
    assert errors == f"mazebench: {tmp_path / 'none'}: expected results of `mazebench eval`, found none; skipped\n"


def test_results_on_mazes_of_ones_own_are_reported_with_their_walls(tmp_path):
    folder = of_own_mazes(make_result(tmp_path / "own", "mah", num_mazes=2), "office")
    [result] = write_report([folder], tmp_path / "out")
    assert result.setting.mazes == "office-00, office-01"
    assert (tmp_path / "out" / "tables" / "local-13-mazes-1.md").exists()
    data = (tmp_path / "out" / "report.html").read_text().split('id="data">')[1].split("</script>")[0]
    mazes = json.loads(data)["mazes"]
    assert [maze["name"] for maze in mazes] == ["office-00", "office-01"]
    assert all(maze["walls"] for maze in mazes)
