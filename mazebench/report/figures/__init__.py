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
from mazebench.report.table import Table


def draw_figures(
    tables: Sequence[Table],
    distributions: Sequence[Distribution],
    galleries: Sequence[Gallery],
    labels: Sequence[str],
    folder: pathlib.Path,
) -> Iterator[Picture]:
    """Draws all figures of a report into `folder`, and yields each one once it is written."""
    curves = [table for table in tables if table.x]
    for table in curves:
        draw_table(table, labels, folder / table.name)
        yield Picture(table.name, table.title, table.note)
    by_size = [table for table in curves if table.name.startswith("local-")]
    if len(by_size) > 1:
        title = "Local navigation by distance, in mazes of several sizes"
        draw_table_panels(by_size, title, labels, folder / "local-sizes")
        yield Picture("local-sizes", title, "Success rate.")
    for distribution in distributions:
        draw_distribution(distribution, labels, folder / distribution.name)
        yield Picture(distribution.name, distribution.title, distribution.note)
    for gallery in galleries:
        draw_gallery(gallery, folder / gallery.name)
        yield Picture(gallery.name, gallery.title, gallery.note)
