"""The leaderboard of the tracks: its tables from made-up results, its place in a page, what it refuses."""

from __future__ import annotations

import datetime
import os
import pathlib
import shutil

import pytest
from made_results import edit_records, edit_summary, edit_task, make_result, read_summary

from mazebench.errors import InputError
from mazebench.maps.benchmark import TRACKS_BENCHMARK
from mazebench.report.leaderboard import (
    BEGIN,
    END,
    PARTS,
    Credit,
    Entry,
    check_credit,
    kept_entries,
    main,
    make_tables,
    read_entries,
    write_leaderboard,
)
from mazebench.results.reading import SUITE
from mazebench.storage.json_files import write_json
from mazebench.world.looks import LOOKS_VERSION

PAGE = pathlib.Path(__file__).parent.parent / "docs" / "leaderboard.md"
CREDIT = Credit("A. Nobody", "Nobody 2026, https://example.org/paper", "https://example.org/agent")
CREDIT_CELLS = ["A. Nobody", "[Nobody 2026](https://example.org/paper)", "[page](https://example.org/agent)"]


def make_part(folder, agent, task="adrift", level=1, successes=240, code="c" * 64, num_mazes=48, **options):
    """Writes the result of an agent that reaches the first `successes` of the 240 goals."""
    part = make_result(
        folder / f"{task}-{level}", agent, task, level=level, record=False, num_mazes=num_mazes, **options
    )
    origin = {"agent_package": "made-up 1.0", "agent_code_sha256": code}
    edit_summary(part, provenance=read_summary(part)["provenance"] | origin)

    def edit(record):
        success = record["episode"] < successes
        lengths = {"path_length": 0.5, "shortest_path": 0.5, "steps": 1}
        return record | lengths | {"success": success, "spl": float(success), "spl_grid": float(success)}

    return edit_records(part, edit)


def make_entry(agent, success=1.0, on_time=0.5, checkpoints=()):
    means = {"on_time": (on_time, 0.0, 1.0), "success": success, "date": datetime.date(2026, 1, 2)}
    code = (f"made-up 1.0 {'c' * 64}",)
    parts = dict.fromkeys(PARTS, (on_time, success))
    names = {"agent": agent, **CREDIT._asdict()}
    return Entry(privileged=False, code=code, checkpoints=checkpoints, parts=parts, **names, **means)


def rows(entries):
    """The cells of each line of the first table."""
    _, first, *_ = make_tables(entries).split("\n\n")
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in first.splitlines()[2:]]


@pytest.fixture
def page(tmp_path):
    """A page without entries."""
    (tmp_path / "page.md").write_text(f"before\n{BEGIN}old\n{END}after\n")
    return tmp_path / "page.md"


@pytest.fixture(scope="module")
def suite(tmp_path_factory):
    """A run of the suite with an agent, of which half of the goals are reached at level 3, and all at the others."""
    folder = tmp_path_factory.mktemp("suite")
    for part in PARTS:
        track, level = part.split()
        make_part(folder / "x", "x", track, int(level), 120 if level == "3" else 240, privileged=True)
    content = {"suite": "tracks", "parts": [part.replace(" ", "-") for part in PARTS], "benchmark": TRACKS_BENCHMARK}
    content |= {"benchmark_manifest_sha256": "0" * 64, "seed": 0, "agents": ["x"]}
    write_json(folder / SUITE, content | {"folders": {"x": "x"}})
    return folder


class TestTables:
    def test_a_run_of_the_suite_gives_a_row_in_each_table(self, suite, page):
        entries = read_entries([suite], CREDIT)
        assert read_entries([suite / "x"], CREDIT) == entries
        write_leaderboard(entries, page)
        [row] = rows(kept_entries(page))
        # In 8 of 12 parts all goals are reached, in 4 half of them.
        assert row[2].startswith("0.83 [0.")
        assert row[:2] + row[3:-1] == ["1", "x (privileged)", "", "0.83", *CREDIT_CELLS, "made-up 1.0 cccccccc"]
        assert row[-1] == entries[0].date.isoformat()
        assert page.read_text().count(f"| 1 | x (privileged) |{' 1.00 | 1.00 | 0.50 |' * 4}") == 2  # on time, success

    def test_the_date_is_that_of_the_newest_summary(self, suite):
        old, new = (datetime.datetime(2026, 1, day, 12).timestamp() for day in (2, 3))
        for path in suite.rglob("summary.json"):
            os.utime(path, (new, new if "rough-3" in str(path) else old))
        assert read_entries([suite], CREDIT)[0].date == datetime.date(2026, 1, 3)

    def test_the_rank_is_by_time_and_the_gain_over_the_navigator_without_the_map(self, page):
        entries = [make_entry("slow", 0.9, 0.1), make_entry("never", 0.0, 0.1), make_entry("quick", 0.6, 0.5)]
        entries.append(
            make_entry("navigator without map", 0.7, 0.3).model_copy(update={"code": ("file without hash",)})
        )
        write_leaderboard(entries, page)
        found = [(row[0], row[1], row[3], row[8]) for row in rows(kept_entries(page))]
        names, codes = ["quick", "navigator without map", "slow", "never"], ["made-up 1.0 cccccccc"] * 4
        codes[1] = "file without hash"
        assert found == list(zip("1233", names, ["+0.20", "+0.00", "-0.20", "-0.20"], codes, strict=True))

    def test_rows_below_a_rate_are_folded(self):
        text = make_tables([make_entry("quick"), make_entry("slow", on_time=0.05), make_entry("lost", on_time=0.01)])
        shown, _, folded = text.partition(
            '<details markdown="1">\n<summary>On-time rate below 0.05: 1 agent</summary>\n'
        )
        assert "| 1 | quick |" in shown
        assert "| 2 | slow |" in shown
        assert folded.count("| 3 | lost |") == 3
        assert folded.endswith("</details>\n")


class TestPage:
    def test_an_entry_replaces_one_of_the_same_agent_code_and_checkpoints_only(self, suite, page):
        [entry] = read_entries([suite], CREDIT)
        for changes in ({}, {"checkpoints": ("a" * 64,)}, {"success": 0.25}):
            write_leaderboard([entry.model_copy(update=changes)], page)
        assert sorted(kept.success for kept in kept_entries(page)) == [0.25, entry.success]
        assert page.read_text() == f"before\n{BEGIN}{make_tables(kept_entries(page))}{END}after\n"

    def test_results_by_camera_alone_are_in_a_division_of_their_own(self, suite, page, tmp_path):
        shutil.copytree(suite, tmp_path / "by-camera")
        for path in (tmp_path / "by-camera").glob("x/*"):
            edit_task(path, sensors=["egocentric"], look="varied")
        with pytest.raises(InputError, match="expected pictures in version 2 of the looks, found version 1"):
            read_entries([tmp_path / "by-camera"], CREDIT)
        for path in (tmp_path / "by-camera").glob("x/*"):
            edit_summary(path, provenance=read_summary(path)["provenance"] | {"looks_version": LOOKS_VERSION})
        write_leaderboard(read_entries([suite, tmp_path / "by-camera"], CREDIT), page)
        assert {(kept.agent, kept.division) for kept in kept_entries(page)} == {("x", "camera"), ("x", "lidar")}
        assert [line for line in page.read_text().splitlines() if line.startswith("#")] == [
            "## Division lidar",
            "## Division camera",
        ]
        for path in (tmp_path / "by-camera").glob("x/*"):
            edit_task(path, sensors=["egocentric", "depth"])
        with pytest.raises(
            InputError, match=r"egocentric \(look varied\) \(division camera\), found egocentric, depth"
        ):
            read_entries([tmp_path / "by-camera"], CREDIT)

    def test_the_page_of_the_docs_is_made_from_the_kept_entries(self):
        assert f"{BEGIN}{make_tables(kept_entries(PAGE))}{END}" in PAGE.read_text(encoding="utf-8")

    def test_a_page_without_the_comments_is_left_as_it_is(self, tmp_path):
        page = tmp_path / "page.md"
        page.write_text("nothing\n")
        with pytest.raises(InputError, match=r"page\.md: expected the lines <!-- leaderboard begins --> and "):
            write_leaderboard([make_entry("x")], page)
        assert [path.name for path in tmp_path.iterdir()] == ["page.md"]
        assert page.read_text() == "nothing\n"

    def test_an_entry_without_author_paper_or_link_is_named(self, page):
        write_leaderboard([make_entry("x")], page)
        [path] = page.with_suffix("").glob("*.json")
        path.write_text(path.read_text().replace('"link"', '"lnk"'))
        with pytest.raises(InputError, match=r"x-.*\.json: expected an entry, found link: Field required"):
            kept_entries(page)

    def test_bad_input_ends_the_command_with_one_line_and_status_2(self, tmp_path, capsys):
        options = [f"--{name}={value}" for name, value in CREDIT._asdict().items()]
        with pytest.raises(SystemExit) as caught:
            main(*options, str(tmp_path / "none"), "page.md")
        said = f"mazebench: {tmp_path}/none: expected a finished evaluation, found nothing there\n"
        assert (caught.value.code, capsys.readouterr().err) == (2, said)


class TestCredit:
    def test_author_paper_and_link_are_asked_for(self, page, capsys):
        with pytest.raises(SystemExit) as caught:
            main("--author", "A. Nobody", "results", str(page))
        said = (
            "mazebench: expected --author NAME, --paper 'AUTHORS YEAR, ADDRESS' (or none) and --link ADDRESS, found no "
        )
        assert (caught.value.code, capsys.readouterr().err) == (2, f"{said}--paper and no --link\n")

    def test_a_link_is_an_address_or_a_page_next_to_the_leaderboard(self, page):
        given = CREDIT._asdict()
        assert check_credit(given, page) == CREDIT
        assert check_credit(given | {"link": "page.md#before"}, page).link == "page.md#before"
        with pytest.raises(InputError, match=r"--link: expected an address as https://\.\.\. or .*, found 'other.md'"):
            check_credit(given | {"link": "other.md"}, page)

    def test_an_agent_after_no_paper_has_an_empty_cell(self):
        [row] = rows([make_entry("x").model_copy(update={"paper": "none"})])
        assert row[6] == ""


def with_provenance(folder, **changes):
    edit_summary(folder, provenance=read_summary(folder)["provenance"] | changes)


FAULTS = {  # of an agent's folder with its result of a part
    "one result of each of building 1, .*, rough 3, found adrift 1": lambda part: None,
    "eval episodes of a track, with its senses, found eval local": lambda part: make_result(
        part.parent / "local", "x", record=False
    ),
    "the 240 frozen episodes, found others": lambda part: edit_records(
        part, lambda record: record | {"seed": record["seed"] + (record["episode"] == 7)}
    ),
    "the 240 frozen .*, found others": lambda part: edit_records(
        part, lambda record: record | {"oracle_steps": record["oracle_steps"] + (record["episode"] == 7)}
    ),
    "results of one agent, found those of x, y": lambda part: make_part(part.parent, "y", level=2),
    "bodies of at most 3.6 m/s, found .* in episode 7": lambda part: edit_records(
        part, lambda record: record | ({"shortest_path": 2.0} if record["episode"] == 7 else {})
    ),
    "results of the installed benchmark, found those of another one": lambda part: with_provenance(
        part, benchmark_manifest_sha256="0" * 64
    ),
}


@pytest.mark.parametrize("message", FAULTS)
def test_other_results_than_one_agents_in_all_frozen_episodes_are_refused(tmp_path, message):
    FAULTS[message](make_part(tmp_path, "x"))
    with pytest.raises(InputError, match=f"expected {message}"):
        read_entries([tmp_path], CREDIT)
