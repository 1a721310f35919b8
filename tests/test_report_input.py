"""What the report makes of bad input: named in a line, skipped or refused, and the rest is still reported."""

from __future__ import annotations

import json
import shutil
import sys

import numpy as np
import pytest
from made_results import edit_summary, make_result, of_own_mazes

from mazebench import cli
from mazebench.errors import InputError
from mazebench.evaluation.trajectories import TRAJECTORIES
from mazebench.records import EPISODES, SUMMARY
from mazebench.report import writing
from mazebench.report.finding import find_results


@pytest.fixture
def run(tmp_path):
    """A folder with one good result; made anew for each test."""
    make_result(tmp_path / "run" / "good", "mah", num_mazes=2)
    return tmp_path / "run"


def read(*paths):
    """(labels, warnings) of the results at `paths`."""
    warnings: list[str] = []
    results = writing.read_results(paths, warnings.append)
    return [result.label for result in results], warnings


def replace_in_line(folder, line, old, new):
    path = folder / EPISODES
    lines = path.read_text().splitlines(keepends=True)
    assert old in lines[line]
    lines[line] = lines[line].replace(old, new)
    path.write_text("".join(lines))


def cut_records(folder):
    path = folder / EPISODES
    path.write_bytes(path.read_bytes()[:-20])


def drop_record(folder):
    path = folder / EPISODES
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))


def swap_records(folder):
    lines = (folder / EPISODES).read_text().splitlines(keepends=True)
    (folder / EPISODES).write_text("".join([lines[1], lines[0], *lines[2:]]))


BREAKS = {
    "cut short in line 4": cut_records,
    "expected the summary's 4 records, found 3": drop_record,
    "line 1: expected episode '0', found '1'": swap_records,
    "expected records, found none": lambda folder: (folder / EPISODES).write_text(""),
    "can't read the records": lambda folder: (folder / EPISODES).unlink(),
    "codec can't decode byte 0xff": lambda folder: (folder / EPISODES).write_bytes(b"\xff\xfe\n"),
    "expected a record in line 1": lambda folder: (folder / EPISODES).write_text("{\n"),
    "found no summary.json; eval --resume goes on": lambda folder: (folder / SUMMARY).unlink(),
    "expected JSON, found": lambda folder: (folder / SUMMARY).write_text("{"),
    "another kind of JSON": lambda folder: (folder / SUMMARY).write_text("[]"),
    "unknown task 'locl'; available: hierarchical, local": lambda folder: edit_summary(folder, task="locl"),
    "unknown split 'dev'": lambda folder: edit_summary(folder, split="dev"),
    "expected a size of 5 to 255 cells, found 3": lambda folder: edit_summary(folder, size=3),
    "expected perturbation with": lambda folder: edit_summary(folder, perturbation={"map_flip": "much"}),
    "line 1: expected agent 'dqn'": lambda folder: edit_summary(folder, agent="dqn"),
    "expected map_warp from 0 to 0.25, found 0.5": lambda folder: edit_summary(
        folder, perturbation={"map_flip": 0.0, "map_warp": 0.5, "position_noise": 0.5}
    ),
    "with agent as str": lambda folder: edit_summary(folder, agent="half a character: \ud800"),
    "with size as int": lambda folder: edit_summary(folder, size=True),
    "expected steps as int": lambda folder: replace_in_line(folder, 1, '"steps":', '"steps":"1","x":'),
    "found the number NaN": lambda folder: replace_in_line(folder, 1, '"spl":', '"spl":NaN,"x":'),
    "in a maze of 13 cells a side": lambda folder: replace_in_line(folder, 0, '"goal":[', '"goal":[13,0],"x":['),
    "expected spl 0": lambda folder: replace_in_line(folder, 0, '"success":true', '"success":false'),
}


class TestSkipped:
    @pytest.mark.parametrize("expected", BREAKS)
    def test_result_when_broken(self, run, expected):
        BREAKS[expected](make_result(run / "other", "mah", distances=(2, 4), num_mazes=2, position_noise=0.5))
        labels, warnings = read(run)
        assert labels == ["mah"]
        assert len(warnings) == 1
        assert str(run / "other") in warnings[0]
        assert expected in warnings[0]
        assert warnings[0].endswith("; skipped")

    def test_paths_when_no_results(self, run, tmp_path):
        (tmp_path / "empty").mkdir()
        (tmp_path / "file").touch()
        (tmp_path / "other").mkdir()
        (tmp_path / "other" / "notes.txt").touch()
        labels, warnings = read(tmp_path / "empty", tmp_path / "file", tmp_path / "other", tmp_path / "none", run)
        assert labels == ["mah"]
        found = [line.partition("found ")[2] for line in warnings]
        assert found == ["it empty; skipped", "a file; skipped", "none in it; skipped", "nothing there; skipped"]

    def test_result_when_named_twice(self, run):
        assert read(run, run / "good", run.parent) == (["mah"], [])

    def test_result_when_copied(self, run):
        shutil.copytree(run / "good", run / "later")
        labels, [warning] = read(run)
        assert labels == ["mah"]
        assert warning == f"{run / 'later'}: mah, local, 13 × 13 again, as in {run / 'good'}; skipped"

    def test_folders_when_too_deep(self, run, tmp_path):
        deep = tmp_path / "deep" / "1" / "2" / "3" / "4" / "5" / "6"
        shutil.copytree(run / "good", deep)
        warnings: list[str] = []
        assert find_results([tmp_path / "deep"], warnings.append) == []
        assert len(warnings) == 1


class TestMended:
    def test_summary_when_it_disagrees(self, run):
        summary = json.loads((run / "good" / SUMMARY).read_text())
        summary["by_distance"]["2"]["spl"] = 0.999
        edit_summary(run / "good", **summary)
        labels, [warning] = read(run)
        assert labels == ["mah"]
        assert "spl of distance 2 is 0.999, by the records 0." in warning
        assert warning.endswith("recomputed from the records")

    @pytest.mark.parametrize("content", [b"", b"PK\x03\x04 no archive"])
    def test_trajectories_when_damaged(self, run, content):
        (run / "good" / TRAJECTORIES).write_bytes(content)
        [result] = writing.read_results([run], lambda line: None)
        assert result.trajectories is None
        assert read(run)[1][0].endswith("reported without paths")

    def test_trajectories_when_of_another_run(self, run):
        make_result(run / "other", "mah", num_mazes=2, position_noise=0.5, skill=0.1)
        shutil.copy(run / "other" / TRAJECTORIES, run / "good" / TRAJECTORIES)
        assert "expected the start and each step of the records" in read(run / "good")[1][0]

    def test_agent_when_not_installed(self, tmp_path):
        make_result(tmp_path / "a", "their-agent", num_mazes=1)
        assert read(tmp_path) == (
            ["their-agent"],
            ["agent 'their-agent' is not installed here; reported by its name"],
        )

    def test_labels_when_checkpoints_and_seeds_differ(self, tmp_path):
        make_result(tmp_path / "a", "mah", num_mazes=1, checkpoint="aa11bb22")
        make_result(tmp_path / "b", "mah", num_mazes=1, checkpoint="cc33dd44")
        make_result(tmp_path / "c", "random", num_mazes=1, seed=0)
        make_result(tmp_path / "d", "random", num_mazes=1, seed=1)
        make_result(tmp_path / "e", "dqn", num_mazes=1)
        assert read(tmp_path) == (["mah aa11bb", "mah cc33dd", "random seed 0", "random seed 1", "dqn"], [])


class TestRefused:
    def test_results_when_there_are_none(self, tmp_path):
        with pytest.raises(InputError, match="found none to report"):
            read(tmp_path)

    def test_benchmarks_when_mixed(self, run):
        edit_summary(make_result(run / "old", "dqn", num_mazes=2), benchmark="v0")
        with pytest.raises(InputError) as caught:
            read(run)
        message = str(caught.value)
        assert "can't be reported together" in message
        assert f"'v0' (manifest b2b2e5a6): {run / 'old'}; 'v1' (manifest b2b2e5a6): {run / 'good'}" in message

    def test_benchmark_when_older(self, run):
        edit_summary(run / "good", benchmark="v0")
        with pytest.raises(InputError, match=r"another benchmark: expected 'v1' .*, found 'v0'"):
            read(run)

    def test_manifest_when_another(self, run):
        provenance = json.loads((run / "good" / SUMMARY).read_text())["provenance"]
        edit_summary(run / "good", provenance=provenance | {"benchmark_manifest_sha256": "ab" * 32})
        with pytest.raises(InputError, match="manifest abababab"):
            read(run)

    def test_command_when_refused_and_when_warned(self, run, tmp_path, monkeypatch, capsys):
        def command(*arguments):
            monkeypatch.setattr(sys, "argv", ["mazebench", "report", *map(str, arguments)])
            with pytest.raises(SystemExit) as caught:
                cli.main()
            return caught.value.code, *capsys.readouterr()

        status, output, errors = command(tmp_path / "none", "--out", tmp_path / "out")
        assert (status, output) == (2, "")
        assert len(errors.splitlines()) == 2
        assert not (tmp_path / "out").exists()
        status, output, errors = command(run, tmp_path / "none", "--out", tmp_path / "out")
        assert status == 0
        assert output == f"1 results of mah: {tmp_path / 'out' / 'report.html'}, {tmp_path / 'out' / 'report.md'}\n"
        assert errors == f"mazebench: {tmp_path / 'none'}: expected a folder of results, found nothing there; skipped\n"


def test_result_when_of_own_mazes(tmp_path):
    folder = of_own_mazes(make_result(tmp_path / "own", "mah", num_mazes=2), "office")
    [result] = writing.write_report([folder], tmp_path / "out", lambda line: None)
    assert result.setting.mazes == ("office-00", "office-01")
    assert (tmp_path / "out" / "tables" / "custom-1-local-13.md").exists()
    walls = json.loads((tmp_path / "out" / "report.html").read_text().split('id="data">')[1].split("</script>")[0])[
        "mazes"
    ]
    assert [maze["name"] for maze in walls] == ["office-00", "office-01"]
    assert all(maze["walls"] for maze in walls)
    assert np.isfinite(result.episodes.spl).all()
