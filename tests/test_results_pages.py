"""The tables of results in README.md and docs, and the records that they are made from."""

from __future__ import annotations

import pathlib
import tarfile

import pandas as pd
import pytest

import mazebench
from benchmarks.results.figures import figures
from benchmarks.results.kept import Kept, keep, read_kept
from benchmarks.results.pages import PAGES, RECORDS, ROOT, with_tables
from mazebench.errors import InputError
from mazebench.results.reading import load_result

NOTHING = Kept({}, {}, pd.DataFrame(), {})


@pytest.fixture(scope="module")
def kept() -> Kept:
    return read_kept(RECORDS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("results") / "run"
    mazebench.evaluate("random", folder, distances=(1,), episodes_per_distance=1)
    return folder


class TestPages:
    @pytest.mark.parametrize("page", PAGES)
    def test_the_tables_of_a_page_are_those_of_the_records(self, page, kept):
        text = (ROOT / page).read_text(encoding="utf-8")
        assert with_tables(text, kept) == text, "`make results` writes them anew"

    def test_no_other_page_has_such_tables(self):
        pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
        found = [path for path in pages if "<!-- table: " in path.read_text(encoding="utf-8")]
        assert sorted(path.relative_to(ROOT).as_posix() for path in found) == sorted(PAGES)

    def test_every_panel_of_a_figure_has_series(self, kept):
        for figure in figures(kept):
            assert all(panel.series for panel in figure.panels), figure.name
            assert (ROOT / "docs" / "images" / f"{figure.name}.png").exists()

    def test_an_unknown_table_is_refused_in_a_line(self):
        for name in ("v9", "paper", "paper local-13 spl"):
            with pytest.raises(InputError, match=f"unknown table '{name}'; tables: paper-local, paper-runs"):
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


class TestRecords:
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
        with pytest.raises(InputError, match="expected finished evaluations, found none"):
            keep(tmp_path, tmp_path / "records")

    def test_two_evaluations_of_one_agent_on_one_part_are_refused(self, folder, tmp_path):
        path = keep(folder, tmp_path)
        path.with_name("other.tar.xz").write_bytes(path.read_bytes())
        with pytest.raises(InputError, match=r"one evaluation of random on run, found two: other.tar.xz, run.tar.xz"):
            read_kept(tmp_path)

    def test_records_without_the_papers_protocol_are_refused(self, folder, tmp_path):
        keep(folder, tmp_path)
        with pytest.raises(InputError, match="expected records of the suite 'paper', found none"):
            read_kept(tmp_path)
