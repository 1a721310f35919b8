"""The report's tables and files: values worked by hand, forms of tables, what the folder holds."""

from __future__ import annotations

import csv
import io
import re

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from made_results import edit_records, edit_summary, make_result, of_own_mazes, read_summary

from mazebench.errors import InputError
from mazebench.report.document import PROVENANCE_HEAD, provenance_rows
from mazebench.report.frame import (
    at_common_distances,
    format_distances,
    join_episodes,
    rows_by,
    rows_by_distance,
    rows_by_level,
)
from mazebench.report.measures import make_table, paper_columns
from mazebench.report.pooling import pool_columns, training_runs
from mazebench.report.report import write_report
from mazebench.report.results import read_results
from mazebench.report.table import Cell, Column, Table, escape_latex, escape_markdown, to_csv, to_latex, to_markdown
from mazebench.report.tables import build_tables, maze_sets
from mazebench.storage.json_files import write_json

AGENTS = ("mah", "random")


pytestmark = pytest.mark.filterwarnings("error::mazebench.errors.Remark")


def episodes_of(*folders):
    """The episodes of the results in some folders, in one table."""
    results = read_results(folders)
    return join_episodes(results, list(dict.fromkeys(result.label for result in results)))


def tables_of(*folders):
    """All tables of the results in some folders, by name."""
    return {table.name: table for table in build_tables(episodes_of(*folders))}


def set_outcomes(folder, outcomes):
    """Makes each episode a drive of 4 m that ends so: SPL 1 / 4 by the body's path, distance / 4 by the grid."""
    left = iter(outcomes)

    def edit(record):
        success = next(left)
        outcome = {"success": bool(success), "path_length": 4.0, "shortest_path": 1.0}
        return record | outcome | {"spl": success * 0.25, "spl_grid": success * min(record["distance"] / 4, 1.0)}

    return edit_records(folder, edit)


def table_of(*labels):
    cells = {"success_rate": (Cell(0.5, 0.25, 0.75, 4), None)}
    columns = tuple(Column(label, False, cells) for label in labels)
    return Table("made", "A title", "A note.", "distance", ("2", "4"), (2.0, 4.0), columns)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A small run of two agents: local, two landmark distances, a flip, a warp, noise, training mazes."""
    folder = tmp_path_factory.mktemp("results")
    for agent, skill in zip(AGENTS, (0.9, 0.3), strict=True):
        here = folder / agent
        make_result(here / "local-13", agent, skill=skill, num_mazes=3)
        make_result(here / "local-15", agent, skill=skill, num_mazes=2, size=15)
        make_result(here / "train", agent, skill=skill, num_mazes=2, split="train")
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
    write_report([results], out)
    return out


class TestValues:
    def test_means_are_over_the_episodes_of_a_row(self, tmp_path):
        folder = make_result(tmp_path / "made", "planner", num_mazes=4, distances=(2, 4), record=False)
        table = tables_of(set_outcomes(folder, (1, 1, 1, 0, 1, 1, 1, 0)))["local-13"]
        cells = table.columns[0].cells
        assert table.rows == ("2", "4", "2, 4")
        assert [(cell.value, cell.episodes) for cell in cells["success_rate"]] == [(1.0, 4), (0.5, 4), (0.75, 8)]
        assert [cell.value for cell in cells["spl"]] == [0.25, 0.125, 0.1875]
        assert [cell.value for cell in cells["spl_grid"]] == [0.5, 0.5, 0.5]
        assert all(cell.low < cell.value <= cell.high for cell in cells["success_rate"])

    def test_results_with_the_oracles_steps_tell_what_is_on_time(self, tmp_path):
        folder = make_result(tmp_path / "a", "mah", num_mazes=4, record=False)
        set_outcomes(folder, (1, 1, 1, 0, 1, 1, 1, 0))
        edit_records(folder, lambda record: record | {"steps": 10})
        write_json(folder / "oracle.json", {"steps": [8, 8, 5, 8, 4, 8, None, 8]})
        make_result(tmp_path / "b", "random", num_mazes=4, record=False)  # as earlier versions wrote it
        table = tables_of(tmp_path)["local-13"]
        ours, others, *_ = table.columns
        assert [cell.value for cell in ours.cells["on_time_1.25"]] == [0.5, 0.5, 0.5]
        assert [cell.value for cell in ours.cells["on_time_2"]] == [0.75, 0.5, 0.625]
        assert others.cells["on_time_2"] == (None, None, None)
        assert "| on time (1.25), by distance | mah |" in to_markdown(table)
        assert "| success rate, by distance | mah | random |" in to_markdown(table)

    def test_the_papers_values_stand_in_columns_of_their_own(self):
        [mmn] = paper_columns("local", 13, [1, 2, 10], 4)
        assert mmn.label == "MMN (paper)"
        assert mmn.cells["success_rate"] == (None, Cell(0.91), Cell(0.43), None)
        labels = [column.label for column in paper_columns("hierarchical", 13, [5], 1)]
        assert labels == ["MMN (paper)", "MAH (paper)", "DQN (paper)", "Random (paper)"]
        assert paper_columns("local", 13, [2], 1, warped=True)[0].cells["success_rate"] == (Cell(0.80),)
        assert paper_columns("local", 15, [2], 1) == []

    def test_levels_are_compared_at_common_distances(self, tmp_path):
        make_result(tmp_path / "a", "mah", distances=(2, 4), num_mazes=2)
        make_result(tmp_path / "b", "mah", distances=(4, 6), num_mazes=2, position_noise=0.5)
        noise = tables_of(tmp_path)["noise-local-13"]
        assert noise.rows == ("0", "0.5")
        assert noise.note.endswith("in metres. Distances 4.")
        assert [cell.episodes for cell in noise.columns[0].cells["spl"]] == [2, 2]

    def test_a_perturbation_that_this_version_does_not_have_gets_a_table(self, tmp_path):
        make_result(tmp_path / "a", "mah", num_mazes=2, record=False)
        folder = make_result(tmp_path / "b", "mah", num_mazes=2)
        edit_records(folder, lambda record: record | {"glare": 3.0})
        edit_summary(folder, perturbation=read_summary(folder)["perturbation"] | {"glare": 3.0})
        write_report([tmp_path], tmp_path / "report")
        assert "| success rate, by glare | mah |" in (tmp_path / "report" / "tables" / "glare-local-13.md").read_text()

    def test_training_and_eval_mazes_are_compared_where_an_agent_has_both(self, tmp_path):
        make_result(tmp_path / "a", "mah", distances=(2, 4), num_mazes=2, record=False)
        make_result(tmp_path / "b", "mah", distances=(4, 6), num_mazes=3, record=False, split="train")
        make_result(tmp_path / "c", "random", num_mazes=2, record=False)
        table = tables_of(tmp_path)["splits-local-13"]
        assert (table.rows, [column.label for column in table.columns]) == (("train", "eval"), ["mah"])
        assert [cell.episodes for cell in table.columns[0].cells["spl"]] == [3, 2]

    @pytest.mark.parametrize(
        ("distances", "row", "episodes"),
        [
            ((2, 4), "local, 13 × 13", 4),
            ((4, 6), "local, 13 × 13, distances 4", 2),
            ((6, 8), "local, 13 × 13, no distances in common", 4),
        ],
    )
    def test_the_overview_names_the_distances_that_count(self, tmp_path, distances, row, episodes):
        make_result(tmp_path / "a", "mah", distances=(2, 4), num_mazes=2, record=False)
        make_result(tmp_path / "b", "random", distances=distances, num_mazes=2, record=False)
        table = tables_of(tmp_path)["all"]
        assert table.rows == (row,)
        assert [column.cells["spl"][0].episodes for column in table.columns] == [episodes, episodes]

    def test_the_overview_tells_sets_of_mazes_apart(self, tmp_path):
        for name in ("office", "flat"):
            of_own_mazes(make_result(tmp_path / name, "mah", num_mazes=2, record=False), name)
        kind = "local, 13 × 13, custom mazes"
        assert tables_of(tmp_path)["all"].rows == (f"{kind}, flat-00 and 1 more", f"{kind}, office-00 and 1 more")

    def test_distances_are_written_as_ranges(self):
        assert format_distances([1, 2, 3, 5, 8, 9]) == "1–3, 5, 8–9"


@pytest.fixture(scope="module")
def joined(results, tmp_path_factory):
    """The episodes of `results`, of tracks, and of three training runs of one agent, in one table."""
    folder = tmp_path_factory.mktemp("joined")
    for level in (1, 2):
        make_result(folder / f"building-{level}", "mah", track="building", level=level, num_mazes=1, record=False)
    for checkpoint in "abc":
        make_result(folder / checkpoint, "dqn", num_mazes=3, record=False, checkpoint=64 * checkpoint)
    return episodes_of(results, folder)


def assert_partition(rows, episodes):
    """Each episode is in exactly one of the rows."""
    assert sorted(index for row in rows for index in row.index) == sorted(episodes.index)


class TestRows:
    """Rows of tables, over episodes of which any are missing, the same ones for all agents."""

    @settings(max_examples=20, deadline=None)
    @given(draws=st.data())
    def test_each_episode_is_in_one_row_of_each_grouping(self, joined, draws):
        missing = draws.draw(st.sets(st.sampled_from(sorted(joined.seed.unique()))))
        episodes = joined[~joined.seed.isin(missing)]
        assume(len(episodes))
        assert_partition([here for here, _, _ in maze_sets(episodes)], episodes)
        for setting, group in episodes.groupby("setting", observed=True):
            rows = rows_by_distance(group)
            assert_partition([rows[str(distance)] for distance in group.distance.unique()], group)
            assert_partition(rows_by(group, "landmark_distance").values(), at_common_distances(group))
            if setting.track:
                assert_partition(rows_by_level(group).values(), at_common_distances(group))

    @settings(max_examples=20, deadline=None)
    @given(draws=st.data())
    def test_the_counts_of_rows_and_of_pooled_runs_add_up(self, joined, draws):
        local = joined[joined.is_exact & (joined.task == "local") & (joined["size"] == 13) & (joined.split == "eval")]
        missing = draws.draw(st.sets(st.sampled_from(sorted(local.seed.unique()))))
        episodes = local[~local.seed.isin(missing)]
        assume(len(episodes))
        rows = rows_by_distance(episodes)
        of_distances = {str(distance): rows[str(distance)] for distance in episodes.distance.unique()}

        def count(column):
            return sum(cell.episodes for cell in column.cells["spl"] if cell)

        for column in make_table("made", "", "", "distance", of_distances).columns:
            assert count(column) == (episodes.label == column.label).sum()
        for column in pool_columns(["dqn"], {name: training_runs(row) for name, row in of_distances.items()}):
            assert count(column) == (episodes.agent == "dqn").sum()


class TestTracks:
    def test_a_row_for_each_track_and_level_and_a_column_for_each_agent(self, tmp_path):
        for agent in ("mah", "random"):
            make_result(tmp_path / agent / "adrift-1", agent, track="adrift", level=1, num_mazes=2, record=False)
            make_result(tmp_path / agent / "v1", agent, num_mazes=2, record=False)
        for level in (1, 2):
            make_result(tmp_path / f"rebuilt-{level}", "mah", track="rebuilt", level=level, num_mazes=2, record=False)
        tables = tables_of(tmp_path)
        assert tables["tracks"].rows == ("rebuilt 1", "rebuilt 2", "adrift 1")
        columns = tables["tracks"].columns
        episodes = {column.label: [cell and cell.episodes for cell in column.cells["spl"]] for column in columns}
        assert episodes == {"mah": [10, 10, 10], "random": [None, None, 10]}
        assert tables["track-rebuilt"].x == (1.0, 2.0)
        rows = [f"{name}, 31 × 31" for name in ("adrift, level 1", "rebuilt, level 1", "rebuilt, level 2")]
        assert set(tables["all"].rows) == {"local, 13 × 13", *rows}
        assert tables["local-13"].columns[0].cells["spl"][0].episodes == 2

    def test_episodes_with_a_blocked_path_and_others_have_rows(self, tmp_path):
        folder = make_result(tmp_path / "a", "mah", track="rebuilt", level=2, num_mazes=4, record=False)
        edit_records(folder, lambda record: record | {"blocked": record["episode"] % 4 == 0})
        set_outcomes(folder, [index % 4 > 0 for index in range(20)])
        table = tables_of(folder)["track-rebuilt"]
        assert table.rows == ("2", "2, blocked", "2, not blocked")
        cells = table.columns[0].cells
        assert [(cell.value, cell.episodes) for cell in cells["success_rate"]] == [(0.75, 20), (0.0, 5), (1.0, 15)]

    def test_a_map_scale_that_an_agent_was_never_trained_on_is_marked(self, tmp_path):
        folder = make_result(tmp_path / "a", "mah", track="adrift", num_mazes=2, record=False)
        edit_summary(folder, untrained_scale=True)
        make_result(tmp_path / "b", "random", track="adrift", num_mazes=2, record=False)
        table = tables_of(tmp_path)["tracks"]
        assert re.search(r"\| adrift 1 \| \d\.\d\d\* \[.*\] \| \d\.\d\d \[", to_markdown(table))
        assert table.note.endswith("* The agent was never trained on maps of this scale.")
        assert [line["mark"] for line in csv.DictReader(io.StringIO(to_csv(table)))][:2] == ["*", ""]

    def test_they_have_a_figure_and_trajectories(self, tmp_path):
        for track in ("adrift", "rough"):
            make_result(tmp_path / "results" / track, "mah", track=track, num_mazes=1, record=track == "rough")
        write_report([tmp_path / "results"], tmp_path / "report")
        figures = {path.name for path in (tmp_path / "report" / "figures").iterdir()}
        assert {"tracks.png", "track-adrift.pdf", "trajectories-rough-1.png"} <= figures
        assert "![Tracks: success rate by level](figures/tracks.png)" in (tmp_path / "report" / "report.md").read_text()

    def test_training_runs_are_pooled_by_level(self, tmp_path):
        for checkpoint in "ab":
            options = {"track": "adrift", "num_mazes": 2, "record": False, "checkpoint": 64 * checkpoint}
            make_result(tmp_path / checkpoint, "mah", **options)
        pooled = tables_of(tmp_path)["pooled-adrift"]
        assert (pooled.row_name, pooled.rows, pooled.title) == (
            "level",
            ("1",),
            "Track adrift, pooled over training runs",
        )


class TestPooledRuns:
    def test_runs_are_checkpoints_and_their_scores_are_pooled(self, tmp_path):
        # Two mazes, each at 2 and 4 cells. A second seed of a checkpoint is no further training run.
        outcomes = {("a", 0): (1, 0, 1, 1), ("b", 0): (1, 1, 1, 1), ("b", 1): (0, 0, 0, 0)}
        for (checkpoint, seed), successes in outcomes.items():
            options = {"num_mazes": 2, "record": False, "checkpoint": 64 * checkpoint, "seed": seed}
            set_outcomes(make_result(tmp_path / f"{checkpoint}{seed}", "mah", **options), successes)
        make_result(tmp_path / "random", "random", num_mazes=2, record=False)
        write_report([tmp_path], tmp_path / "report")
        file = (tmp_path / "report" / "tables" / "pooled-local-13.csv").read_text()
        lines = [line for line in csv.DictReader(io.StringIO(file)) if line["metric"] == "success_rate"]
        # At 4 cells maze a draws from 0 and 1, maze b gets 1; of four scores a lowest and a highest go.
        assert {(line["column"], line["row"]): line["value"] for line in lines} == {
            ("mah, mean", "2"): "1",
            ("mah, IQM", "2"): "1",
            ("mah, mean", "4"): "0.75",
            ("mah, IQM", "4"): "1",
            ("mah, mean", "2, 4"): "0.875",
            ("mah, IQM", "2, 4"): "1",
        }
        assert {(line["episodes"], line["runs"]) for line in lines if line["row"] == "4"} == {("4", "2")}
        assert re.search(r"\| 4 \| 0\.75 \[[\d., ]+\], 2 runs \|", (tmp_path / "report" / "report.md").read_text())

    def test_rows_of_the_hierarchical_task_are_landmark_distances(self, tmp_path):
        options = {"task": "hierarchical", "num_mazes": 2, "record": False}
        for checkpoint, landmark_distance in (("a", 1), ("b", 1), ("c", 1), ("a", 5), ("b", 5), ("a", 3)):
            folder = tmp_path / f"{checkpoint}{landmark_distance}"
            make_result(folder, "mah", landmark_distance=landmark_distance, checkpoint=64 * checkpoint, **options)
        pooled = tables_of(tmp_path)["pooled-hierarchical-13"]
        assert pooled.rows == ("1", "3", "5")
        assert [cell and cell.runs for cell in pooled.columns[0].cells["spl"]] == [3, None, 2]

    def test_the_runs_of_two_agents_are_held_against_each_other(self, tmp_path):
        # One maze at 2 cells: mah's runs score 1 and 0, dqn's 0 and 0. Two pairs of four are won, two are ties.
        outcomes = {("mah", "a"): 1, ("mah", "b"): 0, ("dqn", "c"): 0, ("dqn", "d"): 0}
        for (agent, checkpoint), success in outcomes.items():
            options = {"num_mazes": 1, "distances": (2,), "record": False, "checkpoint": 64 * checkpoint}
            set_outcomes(make_result(tmp_path / checkpoint, agent, **options), (success,))
        columns = {column.label: column for column in tables_of(tmp_path)["pooled-local-13"].columns}
        assert list(columns) == ["mah, mean", "mah, IQM", "dqn, mean", "dqn, IQM", "P(mah > dqn)"]
        assert columns["P(mah > dqn)"].cells["success_rate"] == (Cell(0.75, 0.5, 1.0, 4, 4),)


class TestForms:
    def test_markdown(self):
        assert to_markdown(table_of("mah")).splitlines() == [
            "| success rate, by distance | mah |",
            "| --- | --- |",
            "| 2 | 0.50 [0.25, 0.75] |",
            "| 4 |  |",
        ]

    def test_markdown_of_many_long_names_has_a_row_for_each_agent(self):
        names = [f"mylab.agents.planners.variant-{number}:PlannerWithMemory" for number in range(10)]
        head, _, *lines = to_markdown(table_of(*names)).splitlines()
        assert head == "| success rate, by distance | 2 | 4 |"
        assert lines == [f"| {name} | 0.50 [0.25, 0.75] |  |" for name in names]

    def test_csv(self):
        [row] = csv.DictReader(io.StringIO(to_csv(table_of('a,"b'))))
        assert row["column"] == 'a,"b'
        assert (row["metric"], row["row"], row["source"], row["episodes"]) == ("success_rate", "2", "measured", "4")
        assert (row["value"], row["low95"], row["high95"]) == ("0.5", "0.25", "0.75")

    def test_latex_of_many_long_names_stands_in_blocks_with_names_in_lines(self):
        names = [f"mylab.planners.variant-{number}:Planner" for number in range(13)]
        latex = to_latex(table_of(*names), "success_rate")
        assert latex.count(r"\begin{table}") == latex.count(r"\caption") == 1
        assert [line for line in latex.splitlines() if line.startswith(r"\begin{tabular}")] == [
            r"\begin{tabular}{lrrrr}",
            r"\begin{tabular}{lrrrr}",
            r"\begin{tabular}{lrrrrr}",
        ]
        assert r"\begin{tabular}[b]{@{}r@{}}mylab.planners. \\{} variant-7:Planner\end{tabular}" in latex

    def test_latex(self):
        latex = to_latex(table_of("mah_2 & 50%"), "success_rate")
        assert r"distance & mah\_2 \& 50\% \\" in latex
        assert r"2 & 0.50 [0.25, 0.75] \\" in latex
        assert latex.count(r"\begin{tabular}") == latex.count(r"\end{tabular}") == 1
        assert r"\caption{A title: success rate. A note. The brackets are 95 \% intervals.}" in latex
        assert r"\label{tab:made-success-rate}" in latex

    @pytest.mark.parametrize("text", ["a|b", "<script>", "[x](y)", "`x`", "two\nlines", "*b*"])
    def test_markdown_shows_marks_as_text(self, text):
        assert not re.search(r"(?<!\\)[|<>\[\]`*]|\n", escape_markdown(text))

    def test_latex_shows_marks_as_text(self):
        assert escape_latex(r"\a{b}~^$#") == r"\textbackslash{}a\{b\}\textasciitilde{}\textasciicircum{}\$\#"


class TestFiles:
    def test_every_table_and_figure_has_all_its_forms(self, report):
        tables = {path.stem for path in (report / "tables").iterdir() if path.suffix == ".csv"}
        assert tables >= {"local-13", "local-15", "size-local", "hierarchical-13", "flip-hierarchical-13", "all"}
        assert tables >= {"warp-0.1-local-13", "warp-local-13", "noise-local-13", "train-local-13", "splits-local-13"}
        metrics = {f"{table}-{metric}.tex" for table in tables for metric in ("success-rate", "spl", "spl-grid")}
        assert {path.name for path in (report / "tables").glob("*.tex")} == metrics
        for folder, suffixes in (("tables", (".md", ".csv")), ("figures", (".png", ".pdf"))):
            names = {path.name for path in (report / folder).iterdir() if path.suffix != ".tex"}
            stems = {name.removesuffix(suffixes[0]) for name in names if name.endswith(suffixes[0])}
            assert names == {stem + suffix for stem in stems for suffix in suffixes}
        figures = {path.name for path in (report / "figures").iterdir()}
        assert {"violins-flip-hierarchical-13.png", "violins-noise-local-13.pdf", "local-sizes.pdf"} <= figures
        assert {"trajectories-hierarchical-13.png", "trajectories-local-13-warp-0.1.pdf"} <= figures

    def test_links_of_the_document_lead_somewhere(self, report):
        links = re.findall(r"\]\(([^)]+)\)", (report / "report.md").read_text())
        assert len(links) > 10
        assert [link for link in links if not (report / link).exists()] == []

    def test_the_same_results_give_the_same_bytes(self, results, report, tmp_path):
        write_report([results], tmp_path / "again")
        files = [path.relative_to(report) for path in report.rglob("*") if path.is_file()]
        differing = [path for path in files if (report / path).read_bytes() != (tmp_path / "again" / path).read_bytes()]
        assert differing == []

    def test_a_later_report_replaces_an_earlier_one_and_what_a_kill_left_of_it(self, tmp_path):
        make_result(tmp_path / "a", "mah", num_mazes=1, record=False)
        make_result(tmp_path / "b", "mah", "hierarchical", num_mazes=1, record=False)
        write_report([tmp_path / "a"], tmp_path / "out")
        for name in ("report.html.tmp", "tables/old.csv.tmp", "figures/old.pdf.tmp"):
            (tmp_path / "out" / name).touch()
        write_report([tmp_path / "b"], tmp_path / "out")
        assert {path.stem for path in (tmp_path / "out" / "tables").glob("*.md")} == {"hierarchical-13", "all"}
        assert list((tmp_path / "out").rglob("*.tmp")) == []

    def test_a_folder_with_something_else_is_refused_and_left_as_it_is(self, results, tmp_path):
        (tmp_path / "diary.txt").touch()
        with pytest.raises(InputError, match=r"found 'diary\.txt' in it"):
            write_report([results], tmp_path)
        assert [path.name for path in tmp_path.iterdir()] == ["diary.txt"]

    def test_results_that_differ_only_in_what_was_played_share_a_row_of_provenance(self, results):
        rows = provenance_rows(read_results([results]))
        assert [row[:6] for row in rows] == [(agent, "8", "28", str(results / agent), "none", "0") for agent in AGENTS]
        assert rows[0][-1] == "mazebench eval --agent mah"

    def test_provenance_names_the_versions_of_the_packages(self, results):
        for row in provenance_rows(read_results([results])):
            assert row[PROVENANCE_HEAD.index("versions")] == f"mazebench-mujoco 0.1.0, numpy {np.__version__}"
