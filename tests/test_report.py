"""The report's tables and files: values worked by hand, forms of tables, what the folder holds."""

from __future__ import annotations

import os
import re

import numpy as np
import pytest
from made_results import MADE_AGENTS, edit_records, edit_summary, make_result, of_own_mazes, read_summary

from mazebench.errors import InputError
from mazebench.report.episodes import join_episodes, read_results
from mazebench.report.table import Table, escape_markdown, make_values, to_markdown
from mazebench.report.tables import build_tables
from mazebench.report.write_report import provenance_of, write_report
from mazebench.results.intervals import runs_interval

AGENTS = ("mah", "random")

pytestmark = pytest.mark.filterwarnings("error::mazebench.errors.Remark")


def tables_of(*folders):
    """All tables of the results in some folders, by name."""
    return {table.name: table for table in build_tables(join_episodes(read_results(folders)))}


def column(table, metric, name, field="value"):
    """A field of the values of one column of a table, by row."""
    values = table.values[(table.values.metric == metric) & (table.values.column == name)]
    return dict(zip(values.row, values[field], strict=True))


def columns_of(table):
    return list(table.values.column.cat.categories)


def set_outcomes(folder, outcomes):
    """Makes each episode a quick drive of 4 m that ends so: SPL 1 / 4 by the body's path, distance / 4 by the grid."""
    left = iter(outcomes)

    def edit(record):
        success = next(left)
        outcome = {"success": bool(success), "steps": 1, "path_length": 4.0, "shortest_path": 1.0}
        return record | outcome | {"spl": success * 0.25, "spl_grid": success * min(record["distance"] / 4, 1.0)}

    return edit_records(folder, edit)


def table_of(label):
    line = {"metric": "success_rate", "row": "2", "column": label, "source": "measured", "episodes": 4}
    values = make_values([line | {"value": 0.5, "low95": 0.25, "high95": 0.75}], ["2", "4"])
    return Table("made", "A title", "A note.", "distance", values)


class TestValues:
    def test_means_are_over_the_episodes_of_a_row(self, tmp_path):
        folder = make_result(tmp_path / "made", "planner", num_mazes=4, distances=(2, 4), record=False)
        table = tables_of(set_outcomes(folder, (1, 1, 1, 0, 1, 1, 1, 0)))["local-13"]
        assert column(table, "success_rate", "planner") == {"2": 1.0, "4": 0.5, "2, 4": 0.75}
        assert column(table, "success_rate", "planner", "episodes") == {"2": 4, "4": 4, "2, 4": 8}
        assert column(table, "spl", "planner") == {"2": 0.25, "4": 0.125, "2, 4": 0.1875}
        assert column(table, "spl_grid", "planner") == {"2": 0.5, "4": 0.5, "2, 4": 0.5}
        ours = table.values[table.values.source == "measured"]
        assert ((ours.low95 < ours.value) & (ours.value <= ours.high95)).all()

    def test_the_oracles_steps_tell_what_is_on_time(self, tmp_path):
        folder = make_result(tmp_path / "a", "mah", num_mazes=4, record=False)
        set_outcomes(folder, (1, 1, 1, 0, 1, 1, 1, 0))
        oracle_steps = (8, 8, 5, 8, 4, 8, None, 8)
        edit_records(folder, lambda record: record | {"steps": 10, "oracle_steps": oracle_steps[record["episode"]]})
        make_result(tmp_path / "b", "random", num_mazes=4, record=False)
        table = tables_of(tmp_path)["local-13"]
        assert column(table, "on_time_1.25", "mah") == {"2": 0.5, "4": 0.5, "2, 4": 0.5}
        assert column(table, "on_time_2", "mah") == {"2": 0.75, "4": 0.5, "2, 4": 0.625}
        assert "| on time (1.25), by distance | mah |" in to_markdown(table.wide("on_time_1.25"))
        assert list(table.wide("success_rate"))[:2] == ["mah", "random"]

    def test_the_papers_values_stand_in_columns_of_their_own(self, tmp_path):
        make_result(tmp_path / "local", "mah", num_mazes=1, distances=(1, 2, 10), record=False)
        make_result(tmp_path / "large", "mah", num_mazes=1, size=15, record=False)
        make_result(tmp_path / "routes", "mah", "hierarchical", num_mazes=1, record=False)
        make_result(tmp_path / "warp", "mah", num_mazes=1, distances=(2,), map_warp=0.1, record=False)
        tables = tables_of(tmp_path)
        assert column(tables["local-13"], "success_rate", "MMN (paper)") == {"2": 0.91, "10": 0.43}
        agents = ["mah", "MMN (paper)", "MAH (paper)", "DQN (paper)", "Random (paper)"]
        assert columns_of(tables["hierarchical-13"]) == agents
        assert column(tables["warp-0.1-local-13"], "success_rate", "MMN (paper)") == {"2": 0.80}
        assert columns_of(tables["local-15"]) == ["mah"]
        of_all = {"local, 13 × 13: distance 2": 0.91, "local, 13 × 13: distance 10": 0.43}
        of_all |= {"local, 13 × 13, map warp 0.1: distance 2": 0.80}
        routes = column(tables["hierarchical-13"], "success_rate", "MMN (paper)")
        of_all |= {"hierarchical, 13 × 13, landmarks every 5": routes["5"]}
        assert column(tables["all"], "success_rate", "MMN (paper)") == of_all

    def test_rows_are_compared_at_common_distances(self, tmp_path):
        make_result(tmp_path / "a", "mah", distances=(2, 4), num_mazes=2, record=False)
        make_result(tmp_path / "b", "mah", distances=(4, 6), num_mazes=2, position_noise=0.5, record=False)
        tables = tables_of(tmp_path)
        assert tables["noise-local-13"].note.endswith("in metres. Distances 4.")
        assert column(tables["noise-local-13"], "spl", "mah", "episodes") == {"0": 2, "0.5": 2}
        of_all = column(tables["all"], "spl", "mah", "episodes")
        assert [of_all[row] for row in of_all if "distance" not in row] == [4, 4]

    def test_each_set_of_own_mazes_has_tables_of_its_own(self, tmp_path):
        for name in ("office", "flat"):
            of_own_mazes(make_result(tmp_path / name, "mah", num_mazes=2, record=False), name)
        make_result(tmp_path / "eval", "mah", num_mazes=2, record=False)
        tables = tables_of(tmp_path)
        assert list(tables) == ["local-13", "local-13-mazes-1", "local-13-mazes-2", "all"]
        assert tables["local-13-mazes-1"].title == "Local navigation, 13 × 13, mazes flat-00, flat-01"
        own = "local, 13 × 13, custom mazes, mazes"
        settings = (f"{own} flat-00, flat-01", f"{own} office-00, office-01", "local, 13 × 13")
        rows = [f"{setting}{finer}" for setting in settings for finer in ("", ": distance 2", ": distance 4")]
        assert list(tables["all"].values.row.cat.categories) == rows


class TestTracks:
    def test_a_row_for_each_track_and_level_and_a_column_for_each_agent(self, tmp_path):
        for agent in AGENTS:
            make_result(tmp_path / agent / "adrift-1", agent, task="adrift", level=1, num_mazes=2, record=False)
            make_result(tmp_path / agent / "paper", agent, num_mazes=2, record=False)
        for level in (1, 2):
            make_result(tmp_path / f"rebuilt-{level}", "mah", task="rebuilt", level=level, num_mazes=2, record=False)
        tables = tables_of(tmp_path)
        assert list(column(tables["tracks"], "spl", "mah")) == ["rebuilt 1", "rebuilt 2", "adrift 1"]
        assert list(column(tables["tracks"], "spl", "random")) == ["adrift 1"]
        assert tables["track-rebuilt"].x == {"1": 1.0, "2": 2.0}
        assert column(tables["local-13"], "spl", "mah", "episodes")["2"] == 2

    def test_episodes_with_a_blocked_path_and_others_have_rows(self, tmp_path):
        folder = make_result(tmp_path / "a", "mah", task="rebuilt", level=2, num_mazes=2, record=False)
        edit_records(folder, lambda record: record | {"blocked": record["episode"] % 4 == 0})
        count = read_summary(folder)["episodes"]
        set_outcomes(folder, [index % 4 > 0 for index in range(count)])
        table = tables_of(folder)["track-rebuilt"]
        rates = column(table, "success_rate", "mah")
        assert (rates["2, blocked"], rates["2, not blocked"]) == (0.0, 1.0)
        assert rates["2"] == pytest.approx(1 - -(-count // 4) / count)

    def test_a_map_scale_that_an_agent_was_never_trained_on_is_marked(self, tmp_path):
        folder = make_result(tmp_path / "a", "mah", task="adrift", num_mazes=2, record=False)
        edit_summary(folder, untrained_scale=True)
        make_result(tmp_path / "b", "random", task="adrift", num_mazes=2, record=False)
        table = tables_of(tmp_path)["tracks"]
        assert re.search(r"\| adrift 1 \| \d\.\d\d\* \[.*\] \| \d\.\d\d \[", to_markdown(table.wide("success_rate")))
        assert table.note.endswith("* The agent was never trained on maps of this scale.")


class TestTrainingRuns:
    def test_each_checkpoint_has_a_column_and_all_together_one_of_means(self, tmp_path):
        for checkpoint, successes in {"a": (1, 0, 1, 1), "b": (1, 1, 1, 1)}.items():
            options = {"num_mazes": 2, "record": False, "checkpoint": 64 * checkpoint}
            set_outcomes(make_result(tmp_path / checkpoint, "mah", **options), successes)
        make_result(tmp_path / "random", "random", num_mazes=2, record=False)
        table = tables_of(tmp_path)["local-13"]
        assert columns_of(table) == ["mah aaaaaaaa", "mah bbbbbbbb", "random", "mah, mean", "MMN (paper)"]
        assert column(table, "success_rate", "mah, mean") == {"2": 1.0, "4": 0.75, "2, 4": 0.875}
        values = np.array([[1, 0], [1, 1]], dtype=float)
        expected = runs_interval(values, np.array([0, 1]))
        of_four = table.values[(table.values.row == "4") & (table.values.column == "mah, mean")].iloc[0]
        assert (of_four.low95, of_four.high95, of_four.episodes, of_four.runs) == (expected.low, expected.high, 4, 2)
        assert re.search(r"\| 0\.75 \[[\d., ]+\], 2 runs \|", to_markdown(table.wide("success_rate")))

    def test_runs_of_different_episodes_have_no_mean(self, tmp_path):
        for seed, distances in enumerate(((2,), (2, 4))):
            make_result(tmp_path / str(seed), "mah", num_mazes=2, record=False, seed=seed, distances=distances)
        table = tables_of(tmp_path)["local-13"]
        assert list(column(table, "spl", "mah, mean")) == ["2"]
        assert columns_of(table)[:2] == ["mah seed 0", "mah seed 1"]


class TestForms:
    def test_a_table_is_markdown_csv_and_latex(self):
        files = table_of("mah_2 & 50%").to_files()
        assert files[".csv"].splitlines() == [
            "metric,row,column,source,episodes,value,low95,high95,runs,mark",
            "success_rate,2,mah_2 & 50%,measured,4,0.5,0.25,0.75,,",
        ]
        assert r"success rate, by distance & mah\_2 \& 50\% \\" in files[".tex"]
        assert r"2 & 0.50 [0.25, 0.75] \\" in files[".tex"]
        assert to_markdown(table_of("mah").wide("success_rate")).splitlines() == [
            "| success rate, by distance | mah |",
            "| --- | --- |",
            "| 2 | 0.50 [0.25, 0.75] |",
            "| 4 |  |",
        ]

    def test_markdown_shows_marks_as_text(self):
        assert escape_markdown("a|b <c> [x](y) `x`\ntwo *b*") == r"a\|b \<c\> \[x\](y) \`x\` two \*b\*"


OF_PAPER = {f"{name}.csv" for name in ("violins-flip-hierarchical-13", "violins-noise-local-13", "paths-hierarchical")}


class TestFiles:
    def test_every_table_and_figure_has_all_its_forms(self, report):
        tables = {path.stem for path in (report / "tables").iterdir() if path.suffix == ".md"}
        assert tables >= {"local-13", "local-15", "size-local", "hierarchical-13", "flip-hierarchical-13", "all"}
        assert "noise-local-13" in tables
        for folder, suffixes in (("tables", (".md", ".csv", ".tex")), ("figures", (".png", ".pdf"))):
            names = {path.name for path in (report / folder).iterdir()}
            stems = {name.removesuffix(suffixes[0]) for name in names if name.endswith(suffixes[0])}
            assert names - OF_PAPER == {stem + suffix for stem in stems for suffix in suffixes}
        figures = {path.stem for path in (report / "figures").iterdir()}
        assert figures == tables - {"all"} | {
            *("violins-flip-hierarchical-13", "violins-noise-local-13", "paths-hierarchical"),
        }

    def test_a_later_report_replaces_an_earlier_one(self, tmp_path):
        make_result(tmp_path / "a", "mah", num_mazes=1, record=False)
        make_result(tmp_path / "b", "mah", "hierarchical", num_mazes=1, record=False)
        write_report([tmp_path / "a"], tmp_path / "out")
        write_report([tmp_path / "b"], tmp_path / "out")
        assert {path.stem for path in (tmp_path / "out" / "tables").glob("*.md")} == {"hierarchical-13", "all"}

    def test_a_folder_with_something_else_is_refused_and_left_as_it_is(self, made, tmp_path):
        (tmp_path / "diary.txt").touch()
        with pytest.raises(InputError, match=r"found 'diary\.txt' in it"):
            write_report([made], tmp_path)
        assert [path.name for path in tmp_path.iterdir()] == ["diary.txt"]

    def test_results_that_differ_only_in_what_was_played_share_a_row_of_provenance(self, made):
        rows = provenance_of(read_results([made]))
        found = rows[["agent", "checkpoint", "seed", "results", "episodes", "in"]].values.tolist()
        assert found == [
            [agent, "none", 0, 5, 28, os.path.relpath(made / str(number))] for number, agent in enumerate(MADE_AGENTS)
        ]
        assert rows.command[0] == "mazebench eval --agent mah"
        assert set(rows.versions) == {f"mazebench-mujoco 0.1.0, numpy {np.__version__}, Python 3.11.7"}
