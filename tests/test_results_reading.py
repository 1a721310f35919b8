"""Results read back: a damaged file is named in one line, and nothing is changed."""

from __future__ import annotations

import json
import pathlib
import shutil

import pytest
from run_folders import files_of, records_of, summary_of

from mazebench.errors import InputError
from mazebench.results.reading import load_result


@pytest.fixture
def copy(planner_run, tmp_path) -> pathlib.Path:
    shutil.copytree(planner_run, tmp_path / "run")
    return tmp_path / "run"


def edited(content: dict, **changes) -> str:
    """Returns `content` as JSON with some values replaced, or left out where they are `...`."""
    return json.dumps({key: value for key, value in (content | changes).items() if value is not ...})


def assert_refused(folder: pathlib.Path, said: str) -> None:
    before = files_of(folder)
    with pytest.raises(InputError, match=said) as refused:
        load_result(folder)
    assert "\n" not in str(refused.value)
    assert files_of(folder) == before


def test_a_finished_evaluation_is_read(planner_run):
    result = load_result(planner_run)
    assert result.folder == planner_run
    assert json.loads(json.dumps(result.summary.to_dict())) == summary_of(planner_run)
    assert [json.loads(record.to_line()) for record in result.records] == records_of(planner_run)
    assert "".join(record.to_line() for record in result.records) == (planner_run / "episodes.jsonl").read_text()


def test_what_commands_a_terminal_is_escaped_in_names(copy):
    for file in ("summary.json", "episodes.jsonl"):
        (copy / file).write_text((copy / file).read_text().replace('"planner"', r'"\u001b[31m\nplanner"'))
    result = load_result(copy)
    assert {result.summary.who, *(record.agent for record in result.records)} == {r"\x1b[31m\nplanner"}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text[:-30], "line 40: expected a record, found"),
        (lambda text: text[: text.rindex("{")], "expected 40 records, found 39"),
    ],
)
def test_records_that_were_cut_are_refused(copy, change, said):
    (copy / "episodes.jsonl").write_text(change((copy / "episodes.jsonl").read_text()))
    assert_refused(copy, rf"episodes\.jsonl: {said}")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text[:50], "found .*JSON"),
        (lambda text: edited(json.loads(text), benchmark=...), "found benchmark: Field required"),
    ],
)
def test_a_summary_that_is_damaged_is_named(copy, change, said):
    (copy / "summary.json").write_text(change((copy / "summary.json").read_text()))
    assert_refused(copy, rf"summary\.json: .*{said}")


def test_a_run_that_is_not_finished_is_refused(copy):
    (copy / "summary.json").unlink()
    assert_refused(copy, "expected a finished evaluation, found one that is not finished; go on with .* --resume")
