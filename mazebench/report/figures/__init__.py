"""The report's figures for print, by matplotlib."""

from __future__ import annotations

import pathlib
from collections.abc import Iterator, Sequence

from mazebench.report.distributions import Distribution
from mazebench.report.document import Picture
from mazebench.report.figures.curves import draw_table, draw_table_panels
from mazebench.report.figures.trajectories import draw_gallery
from mazebench.report.figures.violins import draw_distribution
from mazebench.report.galleries import Gallery
from mazebench.report.looks import agent_looks
from mazebench.report.table import UNTRAINED_NOTE, Table

# Figures with a panel for each of several tables: their names, the beginning of the tables' names, their titles.
_PANELS = (
    ("local-sizes", "local-", "Local navigation by distance, in mazes of several sizes"),
    ("tracks", "track-", "Tracks: success rate by level"),
)


def draw_figures(
    tables: Sequence[Table],
    distributions: Sequence[Distribution],
    galleries: Sequence[Gallery],
    labels: Sequence[str],
    folder: pathlib.Path,
) -> Iterator[Picture]:
    """Draws all figures of a report into `folder`, and yields each one once it is written."""
    looks = agent_looks(labels)
    curves = [table for table in tables if table.x]
    for table in curves:
        draw_table(table, looks, folder / table.name)
        yield Picture(table.name, table.title, table.note)
    for name, prefix, title in _PANELS:
        panels = [table for table in curves if table.name.startswith(prefix)]
        if len(panels) > 1:
            draw_table_panels(panels, title, looks, folder / name)
            marked = [UNTRAINED_NOTE] if any(UNTRAINED_NOTE in table.note for table in panels) else []
            yield Picture(name, title, " ".join(["Success rate.", *marked]))
    for distribution in distributions:
        draw_distribution(distribution, looks, folder / distribution.name)
        yield Picture(distribution.name, distribution.title, distribution.note)
    for gallery in galleries:
        draw_gallery(gallery, looks, folder / gallery.name)
        yield Picture(gallery.name, gallery.title, gallery.note)
