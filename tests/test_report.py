"""The report's files: figures in tables by hand, forms of tables, what the folder holds, the same bytes again."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import pathlib
import re

import numpy as np
import pytest
from made_results import make_result, of_own_mazes

from mazebench.errors import InputError
from mazebench.evaluation.metrics import summarize, wilson_interval
from mazebench.evaluation.paper import reference
from mazebench.evaluation.trajectories import load_trajectories
from mazebench.records import EPISODES, SUMMARY, FolderLock, to_line
from mazebench.report import writing
from mazebench.report.distributions import GRID, density
from mazebench.report.page import pack_poses
from mazebench.report.provenance import provenance_rows
from mazebench.report.reference import paper_columns
from mazebench.report.table import Cell, Column, Table, escape_latex, escape_markdown, to_csv, to_latex, to_markdown
from mazebench.report.tables import build_tables, format_distances

AGENTS = ("mah", "random")


def silent(line: str) -> None:
    raise AssertionError(line)


def table_of(*labels: str, **changes) -> Table:
    cells = {"success_rate": (Cell(0.5, 0.25, 0.75, 4), None), "spl": (None, None), "spl_grid": (None, None)}
    columns = tuple(Column(label, False, cells) for label in labels)
    table = Table("made", "A title", "A note.", "distance", ("2", "4"), (2.0, 4.0), columns)
    return dataclasses.replace(table, **changes)


def set_outcomes(folder: pathlib.Path, outcomes: tuple[int, ...]) -> None:
    """Makes each episode a drive of 4 m that ends so: SPL l / 4 by the body's path, distance / 4 by the grid."""
    records = [json.loads(line) for line in (folder / EPISODES).read_text().splitlines()]
    for record, success in zip(records, outcomes, strict=True):
        record |= {"success": bool(success), "path_length": 4.0, "shortest_path": 1.0}
        record |= {"spl": success * 0.25, "spl_grid": success * record["distance"] / 4}
    (folder / EPISODES).write_text("".join(map(to_line, records)))
    summary = json.loads((folder / SUMMARY).read_text()) | summarize(records)
    (folder / SUMMARY).write_text(json.dumps(summary))


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A small run of two agents: local, two landmark distances, a flip, a warp, noise."""
    folder = tmp_path_factory.mktemp("results")
    for agent, skill in zip(AGENTS, (0.9, 0.3), strict=True):
        here = folder / agent
        make_result(here / "local-13", agent, skill=skill, num_mazes=3)
        make_result(here / "local-15", agent, skill=skill, num_mazes=2, size=15)
        make_result(here / "k5", agent, "hierarchical", skill=skill, num_mazes=2)
        make_result(here / "k1", agent, "hierarchical", skill=skill, num_mazes=2, landmark_distance=1)
        make_result(here / "flip", agent, "hierarchical", skill=skill, num_mazes=2, map_flip=0.1)
        make_result(here / "warp", agent, skill=skill, num_mazes=2, map_warp=0.1)
        make_result(here / "noise", agent, skill=skill, num_mazes=2, position_noise=0.5)
    return folder


@pytest.fixture(scope="module")
def report(results, tmp_path_factory):
    """The report over them."""
    out = tmp_path_factory.mktemp("report")
    writing.write_report([results], out, silent)
    return out


class TestFigures:
    def test_measures_when_worked_by_hand(self, tmp_path):
        folder = make_result(tmp_path / "made", "planner", num_mazes=4, distances=(2, 4), record=False)
        set_outcomes(folder, (1, 1, 1, 0, 1, 1, 1, 0))
        [table, _] = build_tables(writing.read_results([folder], silent), ["planner"])
        ours = table.columns[0].cells
        assert table.rows == ("2", "4", "2, 4")
        assert [(cell.value, cell.episodes) for cell in ours["success_rate"]] == [(1.0, 4), (0.5, 4), (0.75, 8)]
        assert [cell.value for cell in ours["spl"]] == [0.25, 0.125, 0.1875]
        assert [cell.value for cell in ours["spl_grid"]] == [0.5, 0.5, 0.5]
        low, high = wilson_interval(4, 4)
        assert (ours["success_rate"][0].low, ours["success_rate"][0].high) == (low, high)
        assert (ours["success_rate"][1].low, ours["success_rate"][1].high) == (0.0, 1.0)

    def test_pooled_runs_when_worked_by_hand(self, tmp_path):
        # Two mazes, each at 2 and 4 cells. A second seed of a checkpoint is no further training run.
        outcomes = {("a", 0): (1, 0, 1, 1), ("b", 0): (1, 1, 1, 1), ("b", 1): (0, 0, 0, 0)}
        for (checkpoint, seed), successes in outcomes.items():
            options = {"num_mazes": 2, "record": False, "checkpoint": 64 * checkpoint, "seed": seed}
            set_outcomes(make_result(tmp_path / f"{checkpoint}{seed}", "mah", **options), successes)
        make_result(tmp_path / "random", "random", num_mazes=2, record=False)
        writing.write_report([tmp_path], tmp_path / "report", silent)
        file = (tmp_path / "report" / "tables" / "pooled-local-13.csv").read_text()
        lines = [line for line in csv.DictReader(io.StringIO(file)) if line["metric"] == "success_rate"]
        figures = {(line["column"], line["row"]): (line["value"], line["low95"], line["high95"]) for line in lines}
        # At 4 cells maze a draws twice from 0 and 1, maze b gets 1; of four scores a lowest and a highest go.
        assert figures == {
            ("mah, mean", "2"): ("1", "1", "1"),
            ("mah, IQM", "2"): ("1", "1", "1"),
            ("mah, mean", "4"): ("0.75", "0.5", "1"),
            ("mah, IQM", "4"): ("1", "0.5", "1"),
            ("mah, mean", "2, 4"): ("0.875", "0.75", "1"),
            ("mah, IQM", "2, 4"): ("1", "0.75", "1"),
        }
        assert {(line["episodes"], line["runs"]) for line in lines if line["row"] == "4"} == {("4", "2")}
        document = (tmp_path / "report" / "report.md").read_text()
        assert "| 4 | 0.75 [0.50, 1.00], 2 runs | 1.00 [0.50, 1.00], 2 runs |" in document

    def test_pooled_runs_when_of_several_landmark_distances(self, tmp_path):
        options = {"task": "hierarchical", "num_mazes": 2, "record": False}
        for checkpoint, landmark_distance in (("a", 1), ("b", 1), ("c", 1), ("a", 5), ("b", 5), ("a", 3)):
            folder = tmp_path / f"{checkpoint}{landmark_distance}"
            make_result(folder, "mah", landmark_distance=landmark_distance, checkpoint=64 * checkpoint, **options)
        results = writing.read_results([tmp_path], silent)
        tables = {table.name: table for table in build_tables(results, [result.label for result in results])}
        pooled = tables["pooled-hierarchical-13"]
        assert pooled.title == "Hierarchical navigation, 13 × 13, pooled over training runs"
        assert pooled.rows == ("1", "3", "5")
        assert [cell and cell.runs for cell in pooled.columns[0].cells["spl"]] == [3, None, 2]

    def test_pooled_runs_when_there_is_one(self, tmp_path):
        for seed in (0, 1):
            make_result(tmp_path / str(seed), "mah", num_mazes=2, record=False, checkpoint=64 * "a", seed=seed)
        results = writing.read_results([tmp_path], silent)
        tables = build_tables(results, [result.label for result in results])
        assert [table.name for table in tables if table.name.startswith("pooled")] == []

    def test_printed_figures_when_beside_ours(self):
        [mmn] = paper_columns("local", 13, [1, 2, 10], 4)
        assert mmn.label == "MMN (paper)"
        assert mmn.cells["success_rate"] == (None, Cell(0.91), Cell(0.43), None)
        labels = [column.label for column in paper_columns("hierarchical", 13, [5], 1)]
        assert labels == ["MMN (paper)", "MAH (paper)", "DQN (paper)", "Random (paper)"]
        assert paper_columns("hierarchical", 13, [5], 1)[1].cells["spl_grid"] == (Cell(0.28),)
        assert paper_columns("local", 13, [2], 1, warped=True)[0].cells["success_rate"] == (Cell(0.80),)
        assert paper_columns("local", 15, [2], 1) == []

    def test_reference_when_its_rows_are_counted(self):
        for table in reference()["tables"]:
            assert all(len(values) == len(table["rows"]) for values in table["agents"].values())

    def test_levels_when_agents_have_other_distances(self, tmp_path):
        make_result(tmp_path / "a", "mah", distances=(2, 4), num_mazes=2)
        make_result(tmp_path / "b", "mah", distances=(4, 6), num_mazes=2, position_noise=0.5)
        tables = {table.name: table for table in build_tables(writing.read_results([tmp_path], silent), ["mah"])}
        noise = tables["noise-local-13"]
        assert (noise.rows, noise.note) == (("0", "0.5"), "Distances 4.")
        assert [cell.episodes for cell in noise.columns[0].cells["spl"]] == [2, 2]

    @pytest.mark.parametrize(
        ("distances", "row", "episodes"),
        [
            ((2, 4), "local, 13 × 13", 4),
            ((4, 6), "local, 13 × 13, distances 4", 2),
            ((6, 8), "local, 13 × 13, no distances in common", 4),
        ],
    )
    def test_overview_when_agents_have_other_distances(self, tmp_path, distances, row, episodes):
        make_result(tmp_path / "a", "mah", distances=(2, 4), num_mazes=2, record=False)
        make_result(tmp_path / "b", "random", distances=distances, num_mazes=2, record=False)
        tables = {
            table.name: table for table in build_tables(writing.read_results([tmp_path], silent), ["mah", "random"])
        }
        assert tables["all"].rows == (row,)
        assert [column.cells["spl"][0].episodes for column in tables["all"].columns] == [episodes, episodes]

    def test_overview_when_mazes_are_of_several_sets(self, tmp_path):
        for name in ("office", "flat"):
            of_own_mazes(make_result(tmp_path / name, "mah", num_mazes=2, record=False), name)
        tables = {table.name: table for table in build_tables(writing.read_results([tmp_path], silent), ["mah"])}
        kind = "local, 13 × 13, custom mazes"
        assert tables["all"].rows == (f"{kind}, flat-00 and others", f"{kind}, office-00 and others")

    def test_distances_when_written(self):
        assert format_distances([1, 2, 3, 5, 8, 9]) == "1–3, 5, 8–9"

    def test_density_when_all_values_are_equal(self):
        shape = density(np.ones(20))
        assert (shape.max(), GRID[shape.argmax()]) == (1.0, 1.0)
        assert shape[GRID < 0.8].max() < 1e-3


class TestForms:
    def test_markdown_when_written(self):
        assert to_markdown(table_of("mah")).splitlines()[:4] == [
            "| success rate, by distance | mah |",
            "| --- | --- |",
            "| 2 | 0.50 [0.25, 0.75] |",
            "| 4 |  |",
        ]

    def test_csv_when_read_back(self):
        [row] = csv.DictReader(io.StringIO(to_csv(table_of('a,"b'))))
        assert row["column"] == 'a,"b'
        assert (row["metric"], row["row"], row["source"], row["episodes"]) == ("success_rate", "2", "measured", "4")
        assert (row["value"], row["low95"], row["high95"]) == ("0.5", "0.25", "0.75")

    def test_latex_when_written(self):
        latex = to_latex(table_of("mah_2 & 50%"))
        assert r"distance & mah\_2 \& 50\% \\" in latex
        assert r"2 & 0.50 [0.25, 0.75] \\" in latex
        assert latex.count(r"\begin{tabular}") == latex.count(r"\end{tabular}") == 1

    @pytest.mark.parametrize("text", ["a|b", "<script>", "[x](y)", "`x`", "two\nlines", "*b*"])
    def test_markdown_when_text_has_marks(self, text):
        escaped = escape_markdown(text)
        assert not re.search(r"(?<!\\)[|<>\[\]`*]|\n", escaped)

    def test_latex_when_text_has_marks(self):
        assert escape_latex(r"\a{b}~^$#") == r"\textbackslash{}a\{b\}\textasciitilde{}\textasciicircum{}\$\#"


class TestFiles:
    def test_folder_when_written(self, report):
        tables = {path.stem for path in (report / "tables").iterdir() if path.suffix == ".csv"}
        assert tables >= {"local-13", "local-15", "size-local", "hierarchical-13", "flip-hierarchical-13", "all"}
        assert tables >= {"warp-0.1-local-13", "warp-local-13", "noise-local-13"}
        for folder, suffixes in (("tables", (".md", ".csv", ".tex")), ("figures", (".png", ".pdf"))):
            names = {path.name for path in (report / folder).iterdir()}
            stems = {name.removesuffix(suffixes[0]) for name in names if name.endswith(suffixes[0])}
            assert names == {stem + suffix for stem in stems for suffix in suffixes}
        figures = {path.name for path in (report / "figures").iterdir()}
        assert {"violins-flip-hierarchical-13.png", "violins-noise-local-13.pdf", "local-sizes.pdf"} <= figures
        assert {"trajectories-hierarchical-13.png", "trajectories-local-13-warp-0.1.pdf"} <= figures

    def test_document_when_its_links_are_followed(self, report):
        text = (report / "report.md").read_text()
        links = re.findall(r"\]\(([^)]+)\)", text)
        assert len(links) > 10
        assert [link for link in links if not (report / link).exists()] == []
        assert "MMN (paper)" in text

    def test_files_when_written_again(self, results, report, tmp_path):
        writing.write_report([results], tmp_path / "again", silent)
        files = [path.relative_to(report) for path in report.rglob("*") if path.is_file()]
        differing = [path for path in files if (report / path).read_bytes() != (tmp_path / "again" / path).read_bytes()]
        assert differing == []

    def test_out_when_it_holds_an_older_report(self, tmp_path):
        make_result(tmp_path / "a" / "x", "mah", num_mazes=1, record=False)
        make_result(tmp_path / "b" / "x", "mah", "hierarchical", num_mazes=1, record=False)
        writing.write_report([tmp_path / "a"], tmp_path / "out", silent)
        writing.write_report([tmp_path / "b"], tmp_path / "out", silent)
        names = {path.stem for path in (tmp_path / "out" / "tables").iterdir()}
        assert names == {"hierarchical-13", "all"}

    def test_out_when_a_kill_left_half_of_a_report(self, tmp_path):
        make_result(tmp_path / "a" / "x", "mah", num_mazes=1, record=False)
        left = [tmp_path / "out" / name for name in ("report.html.tmp", "tables/old.csv.tmp", "figures/old.pdf.tmp")]
        for path in left:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
        writing.write_report([tmp_path / "a"], tmp_path / "out", silent)
        assert list((tmp_path / "out").rglob("*.tmp")) == []

    @pytest.mark.parametrize("name", ["tables", "figures"])
    def test_out_when_a_link_leads_elsewhere(self, results, tmp_path, name):
        (tmp_path / "mine").mkdir()
        for suffix in ("csv", "png"):
            (tmp_path / "mine" / f"data.{suffix}").touch()
        (tmp_path / "out").mkdir()
        (tmp_path / "out" / name).symlink_to(tmp_path / "mine")
        with pytest.raises(InputError, match=rf"{name}: can't write there: it is a link"):
            writing.write_report([results], tmp_path / "out", silent)
        assert len(list((tmp_path / "mine").iterdir())) == 2

    def test_out_when_another_process_writes_to_it(self, results, tmp_path):
        with FolderLock(tmp_path), pytest.raises(InputError, match="is in use by another process"):
            writing.write_report([results], tmp_path, silent)

    def test_out_when_it_holds_something_else(self, results, tmp_path):
        (tmp_path / "diary.txt").touch()
        with pytest.raises(InputError, match=r"found 'diary\.txt' in it"):
            writing.write_report([results], tmp_path, silent)
        assert [path.name for path in tmp_path.iterdir()] == ["diary.txt"]

    def test_provenance_when_results_share_it(self, results):
        rows = provenance_rows(writing.read_results([results], silent))
        assert [row[:6] for row in rows] == [
            ("mah", "7", "24", str(results / "mah"), "none", "0"),
            ("random", "7", "24", str(results / "random"), "none", "0"),
        ]
        assert rows[0][-1] == "mazebench eval --agent mah"

    def test_poses_when_unpacked(self, results):
        trajectories = load_trajectories(results / "mah" / "local-13" / "trajectories.npz", 6)
        planes = np.frombuffer(pack_poses(trajectories, 13), np.uint8).reshape(5, -1).astype(np.int64)
        for axis in (0, 1):
            zigzag = planes[2 * axis] + 256 * planes[2 * axis + 1]
            place = np.cumsum((zigzag >> 1) ^ -(zigzag & 1)) / 32
            assert np.abs(place - trajectories.pose[:, axis].astype(float)).max() <= 1 / 64
        turn = np.cumsum(planes[4]) * 2 * np.pi / 256 - trajectories.pose[:, 2].astype(float)
        assert np.abs((turn + np.pi) % (2 * np.pi) - np.pi).max() <= np.pi / 256 + 1e-6
