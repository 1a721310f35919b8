"""Names of the kinds of files that are handed in as maps, for errors."""

from __future__ import annotations

_STARTS = {
    b"\x89PNG": "a PNG picture",
    b"\xff\xd8\xff": "a JPEG picture",
    b"BM": "a BMP picture",
    b"GIF8": "a GIF picture",
    b"II*\0": "a TIFF picture",
    b"MM\0*": "a TIFF picture",
    b"RIFF": "a WebP picture",
    b"P2": "a PGM picture",
    b"P5": "a PGM picture",
    b"P6": "a PPM picture",
    b"\x93NUMPY": "a NumPy array",
    b"%PDF": "a PDF",
    b"PK\x03\x04": "a ZIP archive",
    b"\x1f\x8b": "a gzip archive",
    b"<svg": "an SVG drawing",
    b"<?xml": "XML",
    b"<mujoco": "an MJCF model",
    b"glTF": "a glTF mesh",
    b"image:": "the yaml of a ROS map",
}


def kind_of(content: bytes) -> str | None:
    """Returns what a file is by its first bytes, in words, such as "a PDF"; None if they are of no known kind."""
    if not content:
        return "an empty file"
    return next((kind for start, kind in _STARTS.items() if content.startswith(start)), None)
