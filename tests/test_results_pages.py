"""The tables of results in README.md and docs, and the records that they are made from."""

from __future__ import annotations

import dataclasses
import pathlib
import re
import tarfile

import numpy as np
import pandas as pd
import pytest

import mazebench
from benchmarks.results.figures import figures
from benchmarks.results.kept import LOCAL, Kept, keep, read_kept
from benchmarks.results.pages import PAGES, RECORDS, ROOT, with_tables
from benchmarks.results.tables import make_table
from mazebench.errors import InputError
from mazebench.report.learning_curves import Run
from mazebench.results.reading import load_result

RESULTS = "docs/results.md"
CONSTANTS = {"1.25", "0.16"}  # times the oracle's steps, and seconds a step
NOTHING = Kept({}, {}, pd.DataFrame(), {}, {})


@pytest.fixture(scope="module")
def kept() -> Kept:
    return read_kept(RECORDS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("results") / "run"
    mazebench.evaluate("random", folder, distances=(1,), episodes_per_distance=1)
    return folder


def sections_of(page: str) -> dict[str, str]:
    """The text of each section of a page of results by its title."""
    text = (ROOT / page).read_text(encoding="utf-8")
    if page == "README.md":
        text = text[text.index("## Results") : text.index("## An agent of your own")]
    return {part.partition("\n")[0].strip("# "): part for part in re.split(r"^(?=#)", text, flags=re.MULTILINE) if part}


class TestPages:
    @pytest.mark.parametrize("page", PAGES)
    def test_the_tables_of_a_page_are_those_of_the_records(self, page, kept):
        text = (ROOT / page).read_text(encoding="utf-8")
        assert with_tables(text, kept) == text, "`make results` writes them anew"

    def test_numbers_in_prose_are_in_a_table_of_their_section(self):
        """Such as 0.52. Those of README may be in the section of docs/results.md that the list names."""
        readme = {"The paper's protocol": "Flipped maps"}
        checked = 0
        for page in ("README.md", RESULTS):
            for title, text in sections_of(page).items():
                named = sections_of(RESULTS).get(readme.get(title, title), "")
                tables = " ".join(re.findall(r"^\|.*$", f"{text}\n{named}", re.MULTILINE))
                prose = re.sub(r"```.*?```|^\|.*?$|^At 1\.00 .*?$", "", text, flags=re.DOTALL | re.MULTILINE)
                found = set(re.findall(r"(?<![\w.])\d\.\d\d(?![\w.])", prose)) - CONSTANTS
                assert not found - set(re.findall(r"\d\.\d\d", tables)), f"{page}, {title}"
                checked += len(found)
        assert checked > 30

    def test_no_other_page_has_such_tables(self):
        pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
        found = [path for path in pages if "<!-- table: " in path.read_text(encoding="utf-8")]
        assert sorted(path.relative_to(ROOT).as_posix() for path in found) == sorted(PAGES)

    def test_every_panel_of_a_figure_has_series(self, kept):
        for figure in figures(kept):
            assert all(panel.series for panel in figure.panels), figure.name
            assert (ROOT / "docs" / "images" / f"{figure.name}.png").exists()

    def test_agents_that_are_at_1_in_every_row_have_a_sentence_instead_of_a_column(self, kept):
        header, *_, sentence = make_table(kept, "paper local-13 success_rate").splitlines()
        assert "planner-closed-loop" not in header
        assert sentence == (
            "At 1.00 [0.95, 1.00] in every row, and so not in the table: "
            "oracle (privileged), belief-planner, belief-rule, planner-closed-loop, planner."
        )

    def test_an_unknown_table_is_refused_in_a_line(self):
        for name in ("v9", "paper", "paper local-13 spl"):
            with pytest.raises(
                InputError, match=f"unknown table '{name}'; tables: paper-local, paper-runs, paper-runs-spl, mmn-runs"
            ):
                with_tables(f"<!-- table: {name} -->\n<!-- end of table -->\n", NOTHING)

    @pytest.mark.parametrize(
        "text",
        [
            "text\n",
            "<!-- table: v3-success -->\n",
            "<!-- table: v3-success -->\ntext\n<!-- end of table -->\n",
            "<!-- table: v3-success -->\n<!-- end of table -->",
        ],
    )
    def test_nothing_but_a_table_is_written_over(self, text):
        with pytest.raises(InputError, match=r"expected tables between the lines .*, found 0 such tables"):
            with_tables(text, NOTHING)

    def test_a_record_that_is_missing_is_named(self):
        with pytest.raises(InputError, match="expected an evaluation of navigator on building-1 among the records"):
            with_tables("<!-- table: v3-map-worth -->\n<!-- end of table -->\n", NOTHING)
        with pytest.raises(InputError, match="expected evaluations on benchmark v2 among the records, found none"):
            with_tables("<!-- table: v2-success -->\n<!-- end of table -->\n", NOTHING)


class TestRecords:
    def test_training_runs_are_read_by_name(self, kept):
        assert [run.name for run in kept.training["mmn-hypermodel-false"]] == ["seed-0", "seed-1", "seed-2"]

    def test_an_archive_holds_the_evaluation_that_was_kept(self, folder, tmp_path):
        path = keep(folder, tmp_path / "records")
        with tarfile.open(path) as archive:
            archive.extractall(tmp_path, filter="data")
        found, expected = load_result(tmp_path / "run"), load_result(folder)
        assert (found.summary, found.records, found.oracle_steps) == (
            expected.summary,
            expected.records,
            expected.oracle_steps,
        )
        assert keep(folder, tmp_path / "again").read_bytes() == path.read_bytes()

    def test_what_is_not_finished_is_not_kept(self, tmp_path):
        with pytest.raises(InputError, match="expected finished evaluations or training runs, found neither"):
            keep(tmp_path, tmp_path / "records")

    def test_a_training_run_is_kept_with_its_last_checkpoint(self, tmp_path):
        run = tmp_path / "mine" / "seed-3"
        for steps in ("000000000100", "000000000200"):
            (run / "checkpoints" / steps).mkdir(parents=True)
            (run / "checkpoints" / steps / "agent.safetensors").write_text(steps)
            (run / "checkpoints" / steps / "replay.npz").write_text("large")
        (run / "config.json").write_text('{"seed": 3}')
        (run / "metrics.jsonl").write_text('{"env_steps": 100, "success_rate_2": 0.5}\n')
        path = keep(run.parent, tmp_path / "records")
        assert path == tmp_path / "records" / "training" / "mine.tar.xz"
        with tarfile.open(path) as archive:
            inside = ("config.json", "metrics.jsonl", "checkpoints/000000000200/agent.safetensors")
            assert archive.getnames() == [f"mine/seed-3/{name}" for name in inside]

    def test_two_evaluations_of_one_agent_on_one_part_are_refused(self, folder, tmp_path):
        path = keep(folder, tmp_path)
        path.with_name("other.tar.xz").write_bytes(path.read_bytes())
        with pytest.raises(InputError, match=r"one evaluation of random on run, found two: other.tar.xz, run.tar.xz"):
            read_kept(tmp_path)

    def test_records_without_the_papers_protocol_are_refused(self, folder, tmp_path):
        keep(folder, tmp_path)
        with pytest.raises(InputError, match="expected records of the suite 'paper', found none"):
            read_kept(tmp_path)


class TestTrainingRuns:
    def test_means_are_over_the_runs(self, kept):
        runs = kept.training_runs("mmn")
        assert len(runs) == 5
        far = [[record.success for record in run.records if record.distance == 10] for run in runs]
        line = make_table(kept, "paper-runs").splitlines()[2]
        assert line.startswith("| `mmn` | 5 | 1.00 [")
        assert f" {np.mean(far):.2f} [" in line.split("|")[-2]

    def test_a_mean_over_runs_has_students_interval(self):
        # Of .6, .6 and .65: 4.303 times the standard error .0167 to either side. One run has no interval.
        lines = [{"env_steps": 4e5, "success_rate_2": rate} for rate in (0.6, 0.6, 0.65)]
        metrics = [line | {f"success_rate_{distance}": 1.0 for distance in (4, 6, 8, 10)} for line in lines]
        runs = [Run(str(seed), {}, (line,)) for seed, line in enumerate(metrics)]
        names = ("mmn", "mmn-5-mazes", "mmn-100-mazes", "mmn-fresh", "mmn-fixed", "mmn-one-goal")
        kept = dataclasses.replace(NOTHING, training={**dict.fromkeys(names, runs), "mmn-one-goal": runs[2:]})
        _, _, first, *_, last = make_table(kept, "mmn-regimes").splitlines()
        assert "| 3 | 0.62 [0.54, 0.69] | 1.00 | 1.00 | 1.00 | 1.00 |" in first
        assert "| 1 | 0.65 | 1.00 | 1.00 | 1.00 | 1.00 |" in last

    @pytest.mark.parametrize("found", [[], ["mmn"], ["mmn", "mmn"]])
    def test_fewer_than_two_checkpoints_are_refused(self, found, kept):
        few = dataclasses.replace(kept, runs={"mmn": [kept.result(row, LOCAL) for row in found]})
        message = f"several training runs mmn, found {len(found)} of {len(set(found))} checkpoints"
        with pytest.raises(InputError, match=message):
            few.training_runs("mmn")

    def test_a_run_in_other_episodes_is_refused(self, kept):
        others = dataclasses.replace(kept, runs={"mah": [kept.result("mmn", LOCAL), kept.result("mah", "local-15")]})
        with pytest.raises(InputError, match="size"):
            others.training_runs("mah")

    def test_success_rates_are_of_milestones_that_all_runs_reached(self):
        first = ({"env_steps": 200_064, "success_rate_2": 0.1}, {"env_steps": 300_000, "td_loss": 1.0})
        last = ({"env_steps": 6_600_000, "success_rate_2": 0.8}, {"env_steps": 6_648_448, "success_rate_2": 0.9})
        second = ({"env_steps": 200_128, "success_rate_2": 0.3},)
        kept = dataclasses.replace(NOTHING, training={"a": [Run("0", {}, (*first, *last)), Run("1", {}, second)]})
        assert kept.success_rates("a", 2) == {0.2: [0.1, 0.3]}
        alone = dataclasses.replace(kept, training={"a": kept.training["a"][:1]})
        assert alone.success_rates("a", 2) == {0.2: [0.1], 6.6: [0.9]}
