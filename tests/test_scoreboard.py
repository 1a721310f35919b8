"""The scoreboard of the tracks: its table from made-up results, its place in a page, what it refuses."""

from __future__ import annotations

import pathlib
import subprocess
import sys

import pytest
from made_results import edit_records, edit_summary, make_result, read_summary

from mazebench.errors import InputError
from mazebench.maps.benchmark import KINDS_VERSION
from mazebench.report.scoreboard import (
    BEGIN,
    END,
    Configuration,
    Entry,
    Part,
    check,
    kept_entries,
    read_entries,
    to_markdown,
    write_scoreboard,
)
from mazebench.results.reading import SUITE
from mazebench.storage.json_files import write_json
from mazebench.tasks.tracks import TRACKS

PAGE = pathlib.Path(__file__).parent.parent / "docs" / "scoreboard.md"
PARTS = [(track, level) for track in TRACKS for level in (1, 2, 3)]


def make_part(folder, agent, track, level, successes=240, code="c" * 64, num_mazes=48, **options):
    """Writes the result of an agent that reaches the first `successes` of the 240 goals."""
    part = make_result(
        folder / f"{track}-{level}", agent, track=track, level=level, record=False, num_mazes=num_mazes, **options
    )
    origin = {"agent_package": "made-up 1.0", "agent_code_sha256": code}
    edit_summary(part, provenance=read_summary(part)["provenance"] | origin)

    def edit(record):
        success = record["episode"] < successes
        lengths = {"path_length": 1.0, "shortest_path": 1.0, "steps": 1}
        return record | lengths | {"success": success, "spl": float(success), "spl_grid": float(success)}

    return edit_records(part, edit)


def rows(entries):
    """The cells of each line of a scoreboard."""
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in to_markdown(entries).splitlines()]


@pytest.fixture
def page(tmp_path):
    """A page without entries."""
    (tmp_path / "page.md").write_text(f"before\n{BEGIN}old\n{END}after\n")
    return tmp_path / "page.md"


@pytest.fixture(scope="module")
def suite(tmp_path_factory):
    """A run of the suite with two agents: `whole` on all tracks and levels, `part` on two."""
    folder = tmp_path_factory.mktemp("suite")
    for track, level in PARTS:
        make_part(folder / "whole", "whole", track, level, 240 if level < 3 else 120, privileged=True)
    for level, checkpoint in ((1, "a" * 64), (2, "b" * 64)):
        make_part(folder / "part", "part", "adrift", level, 60, checkpoint=checkpoint)
    edit_summary(folder / "part" / "adrift-2", untrained_scale=True)
    content = {"suite": "v3", "parts": [f"{track}-{level}" for track, level in PARTS], "benchmark": KINDS_VERSION}
    content |= {"benchmark_manifest_sha256": "0" * 64, "seed": 0, "agents": ["part", "whole"]}
    write_json(folder / SUITE, content | {"folders": {"part": "part", "whole": "whole"}})
    return folder


class TestTable:
    def test_a_row_is_an_agent_and_a_column_a_track_and_level(self, suite):
        head, _, part, whole = rows(read_entries([suite]))
        parts = [f"{track} {level}" for track, level in PARTS]
        assert head == ["agent", "mean", "on time", *parts, "configurations", "from"]
        # In 8 of 12 parts all goals are reached, in 4 half of them.
        assert whole[1].startswith("0.83 [0.")
        assert whole[0] == "whole (privileged)"
        assert whole[2:] == ["0.83, 0.83", *["1.00, 1.00", "1.00, 1.00", "0.50, 0.50"] * 4, "1", "made-up 1.0 cccccccc"]
        assert part == ["part", *[""] * 8, "0.25, 0.25", "0.25, 0.25\\*", *[""] * 4, "2", "made-up 1.0 cccccccc"]

    def test_a_folder_of_one_agent_gives_one_row(self, suite):
        assert read_entries([suite / "part"]) == read_entries([suite])[:1]
        assert [entry.agent for entry in read_entries([suite / "part" / "adrift-1", suite / "whole"])] == [
            "part",
            "whole",
        ]


class TestPage:
    def test_the_table_stands_between_two_comments(self, suite, page):
        write_scoreboard(read_entries([suite]), page)
        written = page.read_text()
        assert [entry.agent for entry in kept_entries(page)] == ["whole", "part"]
        assert written == f"before\n{BEGIN}{to_markdown(kept_entries(page))}{END}after\n"
        write_scoreboard(read_entries([suite]), page)
        assert page.read_text() == written

    def test_a_new_entry_leaves_the_others(self, suite, page):
        for agent in ("whole", "part"):
            write_scoreboard(read_entries([suite / agent]), page)
        assert [row[0] for row in rows(kept_entries(page))[2:]] == ["whole (privileged)", "part"]

    def test_rows_are_ranked_by_the_share_on_time_and_of_equals_by_success(self, page):
        def entry(agent, success, on_time):
            part = Part(success_rate=success, on_time={"1.25": on_time, "2": success})
            mean, code = (success, 0.0, 1.0), Configuration(package=None, code_sha256="c", checkpoint_sha256=None)
            parts = {f"{track} {level}": part for track in TRACKS for level in (1, 2, 3)}
            return Entry(
                agent=agent, privileged=False, benchmark=KINDS_VERSION, parts=parts, mean=mean, configurations=(code,)
            )

        write_scoreboard([entry("slow", 0.9, 0.1), entry("never", 0.0, 0.1), entry("quick", 0.6, 0.5)], page)
        assert [kept.agent for kept in kept_entries(page)] == ["quick", "slow", "never"]

    def test_an_entry_replaces_one_of_the_same_agent_code_and_checkpoint_only(self, page, tmp_path):
        for name, successes, code in (("a", 24, "c"), ("b", 48, "c"), ("c", 72, "d")):
            make_part(tmp_path / name, "x", "adrift", 1, successes, code * 64)
            write_scoreboard(read_entries([tmp_path / name]), page)
        assert sorted(entry.parts["adrift 1"].success_rate for entry in kept_entries(page)) == [0.2, 0.3]

    def test_an_entry_that_would_lose_parts_is_refused(self, page, tmp_path):
        for name, track in (("a", "adrift"), ("b", "rebuilt")):
            make_part(tmp_path / name, "x", track, 1, 20, "c" * 64)
        write_scoreboard(read_entries([tmp_path / "a"]), page)
        before = page.read_text()
        for paths in ([tmp_path / "b"], [tmp_path / "a", tmp_path / "b"]):
            with pytest.raises(
                InputError, match="x: expected all parts of its entry in one folder, found none of adrift 1"
            ):
                write_scoreboard(read_entries(paths), page)
        assert page.read_text() == before

    def test_the_page_of_the_docs_is_made_from_the_kept_entries(self):
        assert f"{BEGIN}{to_markdown(kept_entries(PAGE))}{END}" in PAGE.read_text(encoding="utf-8")

    def test_a_file_that_is_no_entry_is_named(self, page):
        page.with_suffix("").mkdir()
        (page.with_suffix("") / "x.json").write_text("{}")
        with pytest.raises(InputError, match=r"x\.json: expected an entry of the scoreboard, found agent: "):
            write_scoreboard([], page)

    def test_a_page_without_the_comments_is_left_as_it_is(self, suite, tmp_path):
        page = tmp_path / "page.md"
        page.write_text("nothing\n")
        with pytest.raises(InputError, match=r"page\.md: expected the lines <!-- scoreboard begins --> and "):
            write_scoreboard(read_entries([suite / "part"]), page)
        assert [path.name for path in tmp_path.iterdir()] == ["page.md"]
        assert page.read_text() == "nothing\n"

    def test_bad_input_ends_the_command_with_one_line_and_status_2(self, tmp_path):
        command = [sys.executable, "-m", "mazebench.report.scoreboard", str(tmp_path / "none"), "page.md"]
        run = subprocess.run(command, capture_output=True, text=True)
        said = f"mazebench: {tmp_path}/none: expected a finished evaluation, found nothing there\n"
        assert (run.returncode, run.stderr) == (2, said)


class TestCheck:
    def test_a_complete_entry_is_told_in_one_line(self, suite):
        [line], is_complete = check(suite / "whole")
        assert is_complete
        assert line.startswith(f"{suite / 'whole'}: a complete entry of whole, all 12 parts, mean 0.83 [")

    def test_missing_parts_are_named(self, suite):
        lines, are_complete = check(suite)
        assert not are_complete
        assert [line for line in lines if "2 of 12 parts of part, no mean; missing: building 1, building 2," in line]
        assert [line for line in lines if "a complete entry of whole" in line]

    def test_nothing_is_written(self, suite, tmp_path):
        command = [sys.executable, "-m", "mazebench.report.scoreboard", "--check", str(suite / "whole")]
        run = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
        assert (run.returncode, run.stderr, len(run.stdout.splitlines())) == (0, "", 1)
        assert list(tmp_path.iterdir()) == []


class TestRefused:
    def test_a_result_of_other_episodes_than_the_frozen_ones(self, tmp_path):
        part = make_part(tmp_path, "x", "adrift", 1)
        edit_records(part, lambda record: record | {"seed": record["seed"] + (record["episode"] == 7)})
        with pytest.raises(InputError, match=r"adrift-1: expected the frozen episode 7, found another one"):
            read_entries([tmp_path])

    def test_a_result_without_the_hash_of_the_code(self, tmp_path):
        make_part(tmp_path, "x", "adrift", 1, code=None)
        with pytest.raises(InputError, match=r"adrift-1: expected the hash of the agent's code, found none"):
            read_entries([tmp_path])

    def test_a_result_that_is_not_of_a_track(self, tmp_path):
        make_result(tmp_path / "run", record=False)
        with pytest.raises(InputError, match=r"run: expected eval episodes of a track, found eval local"):
            read_entries([tmp_path / "run"])

    def test_a_result_on_train_mazes(self, tmp_path):
        make_part(tmp_path, "x", "adrift", 1, split="train")
        with pytest.raises(InputError, match=r"adrift-1: expected eval episodes of a track, found train adrift"):
            read_entries([tmp_path])

    def test_a_result_of_some_of_the_episodes(self, tmp_path):
        make_part(tmp_path, "x", "adrift", 1, num_mazes=3)
        with pytest.raises(InputError, match=r"adrift-1: expected 240 episodes, found 15"):
            read_entries([tmp_path])

    def test_a_result_of_another_benchmark(self, tmp_path):
        part = make_part(tmp_path, "x", "adrift", 1)
        provenance = read_summary(part)["provenance"] | {"benchmark_manifest_sha256": "0" * 64}
        edit_summary(part, provenance=provenance)
        with pytest.raises(InputError, match=r"adrift-1: expected results of the installed benchmark, found those of"):
            read_entries([tmp_path])

    def test_two_results_of_one_part(self, tmp_path):
        make_part(tmp_path, "x", "adrift", 1)
        make_part(tmp_path, "x", "adrift", 2)
        (tmp_path / "adrift-1").rename(tmp_path / "again")
        make_part(tmp_path, "x", "adrift", 1)
        with pytest.raises(InputError, match="expected one result of adrift 1, found two"):
            read_entries([tmp_path])

    def test_a_folder_with_two_agents_results(self, tmp_path):
        make_part(tmp_path, "x", "adrift", 1)
        make_part(tmp_path, "y", "adrift", 2)
        with pytest.raises(InputError, match="expected results of one agent, found those of x, y"):
            read_entries([tmp_path])
