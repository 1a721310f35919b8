"""The tables of results in README.md and docs, and the records that they are made from."""

from __future__ import annotations

import tarfile

import pytest

import mazebench
from benchmarks.results.kept import Kept, keep, read_kept
from benchmarks.results.pages import PAGES, RECORDS, ROOT, with_tables
from mazebench.errors import InputError
from mazebench.results.reading import load_result


@pytest.fixture(scope="module")
def kept() -> Kept:
    return read_kept(RECORDS)


@pytest.mark.parametrize("page", PAGES)
def test_the_tables_of_a_page_are_those_of_the_records(page, kept):
    text = (ROOT / page).read_text(encoding="utf-8")
    assert with_tables(text, kept) == text, "`make results` writes them anew"


def test_an_archive_holds_the_evaluation_that_was_kept(tmp_path):
    mazebench.evaluate("random", tmp_path / "run", distances=(1,), episodes_per_distance=1)
    path = keep(tmp_path / "run", tmp_path / "records")
    with tarfile.open(path) as archive:
        archive.extractall(tmp_path / "unpacked", filter="data")
    assert load_result(tmp_path / "unpacked" / "run").records == load_result(tmp_path / "run").records
    assert keep(tmp_path / "run", tmp_path / "again").read_bytes() == path.read_bytes()


def test_what_is_not_finished_is_not_kept(tmp_path):
    with pytest.raises(InputError, match="expected finished evaluations, found none"):
        keep(tmp_path, tmp_path / "records")


def test_two_evaluations_of_one_agent_on_one_part_are_refused(tmp_path):
    mazebench.evaluate("random", tmp_path / "run", distances=(1,), episodes_per_distance=1)
    mazebench.evaluate("random", tmp_path / "other" / "run", distances=(1,), episodes_per_distance=1)
    keep(tmp_path / "run", tmp_path / "records")
    keep(tmp_path / "other", tmp_path / "records")
    with pytest.raises(InputError, match="expected one evaluation of random on run, found two"):
        read_kept(tmp_path / "records")


def test_a_page_names_tables_that_there_are():
    with pytest.raises(InputError, match="unknown table 'v9'; tables: paper-local"):
        with_tables("<!-- table: v9 -->\n<!-- end of table -->\n", Kept({}, {}, None))
    with pytest.raises(InputError, match="expected a page with tables of results, found none"):
        with_tables("text\n", Kept({}, {}, None))
