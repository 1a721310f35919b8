"""The tables of tracks: success rate and SPL by track and level."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from mazebench.report.measures import make_table
from mazebench.report.results import ReportedResult
from mazebench.report.rows import DISTANCES_NOTE, Row, level_rows
from mazebench.report.table import Table
from mazebench.tasks.tracks import TRACKS


def track_tables(results: Sequence[ReportedResult], labels: Sequence[str]) -> Iterator[Table]:
    """Yields a table of all tracks, with a row for each track and level, and a table of each track."""
    groups = {name: [result for result in results if result.setting.track == name] for name in TRACKS}
    groups = {name: group for name, group in groups.items() if group}
    if groups:
        rows = {f"{name} {level}": row for name, group in groups.items() for level, row in level_rows(group).items()}
        played = [result for group in groups.values() for result in group]
        yield make_table("tracks", "Tracks", DISTANCES_NOTE, "track and level", rows, (), played, labels)
    for name, group in groups.items():
        levels = level_rows(group)
        meanings = "; ".join(f"{level}: {TRACKS[name].levels[int(level) - 1]}" for level in levels)
        rows = levels | _fact_rows(levels, group)
        x = tuple(map(float, levels))
        yield make_table(
            f"track-{name}", f"Track {name}", f"{TRACKS[name].help} {meanings}.", "level", rows, x, group, labels
        )


def _fact_rows(levels: dict[str, Row], results: Sequence[ReportedResult]) -> dict[str, Row]:
    """Returns a row for each level and each fact that the records tell, such as "1, blocked"."""
    facts = dict.fromkeys(fact for result in results for fact in result.episodes.facts)

    def row(of_level: Row, fact: str) -> Row:
        return lambda result: of_level(result) & result.episodes.facts.get(fact, False)

    return {f"{level}, {fact}": row(of_level, fact) for level, of_level in levels.items() for fact in facts}
