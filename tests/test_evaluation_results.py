"""Results read back: whatever was cut, edited or put there is refused in one line, and nothing is changed."""

from __future__ import annotations

import json
import pathlib
import shutil
from collections.abc import Callable

import pytest

from mazebench.errors import InputError
from mazebench.evaluation.harness import EvalOptions, evaluate
from mazebench.evaluation.results import load_result


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("runs") / "random"
    evaluate(EvalOptions("random", distances=(1, 2), episodes_per_distance=1), folder)
    return folder


@pytest.fixture
def copy(run, tmp_path) -> pathlib.Path:
    shutil.copytree(run, tmp_path / "run")
    return tmp_path / "run"


def edit(path: pathlib.Path, change: Callable[[str], str]) -> None:
    before = path.read_text()
    path.write_text(change(before))
    assert path.read_text() != before


def edit_record(number: int, **changes) -> Callable[[str], str]:
    def change(text: str) -> str:
        lines = text.splitlines()
        record = {**json.loads(lines[number]), **changes}
        lines[number] = json.dumps({key: value for key, value in record.items() if value is not ...})
        return "\n".join(lines) + "\n"

    return change


def edit_summary(**changes) -> Callable[[str], str]:
    return lambda text: json.dumps(
        {key: value for key, value in {**json.loads(text), **changes}.items() if value is not ...}
    )


def test_result_when_whole(run):
    result = load_result(run)
    assert result.folder == run
    assert result.summary == json.loads((run / "summary.json").read_text())
    assert [record["episode"] for record in result.records] == list(range(40))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text[:-30], "expected the record of episode 39 in line 40, found no record"),
        (lambda text: "", "expected 40 records, found 0"),
        (lambda text: text + text.splitlines()[-1], "expected the record of episode 40 in line 41, found episode 39"),
        (lambda text: "\n".join(text.splitlines()[:-1]), "expected 40 records, found 39"),
        (lambda text: "\n".join(text.splitlines()[1:]), "expected the record of episode 0 in line 1, found episode 1"),
        (lambda text: "[" * 50_000, "in line 1, found no record"),
        (lambda text: "[" * 100_000, "in line 1, found more than 65536 bytes"),
        (lambda text: "null\n" + text, "in line 1, found no record"),
        (edit_record(3, success="yes"), "in line 4, found a record with success 'yes'"),
        (edit_record(3, success=1), "in line 4, found a record with success '1'"),
        (edit_record(3, spl=1.5), "in line 4, found a record with spl '1.5'"),
        (edit_record(3, spl=float("nan")), "in line 4, found no record"),
        (edit_record(3, path_length=float("inf")), "in line 4, found no record"),
        (edit_record(3, steps=-1), "in line 4, found a record with steps '-1'"),
        (edit_record(3, episode=True), "in line 4, found a record with episode 'True'"),
        (edit_record(3, start=[1]), r"in line 4, found a record with start '\[1\]'"),
        (edit_record(3, maze=...), "in line 4, found a record without maze"),
        (
            edit_record(3, spl_grid=0.123),
            "expected the records that summary.json was made from, spl_grid .*, found others",
        ),
    ],
)
def test_records_when_cut_or_edited(copy, change, said):
    edit(copy / "episodes.jsonl", change)
    content = (copy / "episodes.jsonl").read_bytes()
    with pytest.raises(InputError, match=rf"episodes\.jsonl: .*{said}"):
        load_result(copy)
    assert (copy / "episodes.jsonl").read_bytes() == content


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text[:50], "expected JSON, found"),
        (lambda text: "[]", "expected an evaluation's summary, found no object"),
        (lambda text: "{}", "expected an evaluation's summary, found agent 'None'"),
        (edit_summary(benchmark=...), "found benchmark 'None'"),
        (edit_summary(episodes="40"), "found episodes '40'"),
        (edit_summary(episodes=0), "found 0 episodes"),
        (edit_summary(overall={"success_rate": 2}), "found overall success_rate 2"),
        (edit_summary(overall=...), "found overall 'None'"),
    ],
)
def test_summary_when_cut_or_edited(copy, change, said):
    edit(copy / "summary.json", change)
    with pytest.raises(InputError, match=rf"summary\.json: .*{said}"):
        load_result(copy)


def test_result_when_records_are_missing(copy):
    (copy / "episodes.jsonl").unlink()
    with pytest.raises(InputError, match=r"episodes\.jsonl: can't read the records: No such file"):
        load_result(copy)


def test_result_when_run_is_not_finished(copy):
    (copy / "summary.json").unlink()
    with pytest.raises(InputError, match="expected a finished evaluation, found one that is not finished; go on with"):
        load_result(copy)
