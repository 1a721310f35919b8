"""Names of the kinds of files that are handed in as maps, and what to do with those that are not read."""

from __future__ import annotations

_PICTURE = "convert it to PNG"
_DRAWING = "export it as PNG and give its scale by --pixel-size"
_READ = "text, pictures such as PNG, arrays (.npy) and ROS maps (.yaml) are read; convert another picture to PNG"
_TENSORS = "save its tensors as safetensors or its array as .npy"
# The first bytes of all pictures that are read.
_PICTURES: tuple[bytes, ...] = (b"\x89PNG", b"\xff\xd8\xff", b"BM", b"GIF8", b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_PICTURES += (b"RIFF", b"P2", b"P5", b"P6", b"P1\n", b"P3\n", b"P4\n", b"P1\r\n", b"P3\r\n", b"P4\r\n")
# And of others: JPEG 2000 and XL, PAM, SGI, Photoshop, GIMP, QOI, OpenEXR, DDS and icons.
_OTHERS: tuple[bytes, ...] = (b"\0\0\0\x0cjP", b"\xff\x4f\xff\x51", b"\0\0\0\x0cJXL", b"\xff\x0a", b"P7\n", b"\1\xda")
_OTHERS += (b"8BPS", b"gimp xcf", b"qoif", b"v/1\1", b"DDS ", b"\0\0\1\0", b"icns")
# By the first bytes: the name, and what to do with a file that is not read.
_KINDS = {
    **dict.fromkeys(_PICTURES, ("a picture", "")),
    **dict.fromkeys(_OTHERS, ("a picture of another format", _PICTURE)),
    b"\x93NUMPY": ("a NumPy array", ""),
    b"image:": ("the yaml of a ROS map", ""),
    b"%PDF": ("a PDF", _DRAWING),
    b"<svg": ("an SVG drawing", _DRAWING),
    b"AC10": ("a DWG drawing", _DRAWING),
    b"version https://git-lfs": ("a Git LFS pointer", "run git lfs pull"),
    **dict.fromkeys((b"<!DOCTYPE", b"<!doctype", b"<html", b"<HTML"), ("an HTML page", "download the file itself")),
    **dict.fromkeys((b"\x80\x02", b"\x80\x04", b"\x80\x05"), ("a pickle", _TENSORS)),
    b"PK\x03\x04": ("a ZIP archive", "unpack it"),
    b"\x1f\x8b": ("a gzip archive", "unpack it"),
    b"<?xml": ("XML", _READ),
    b"<mujoco": ("an MJCF model", "give the map it was made from"),
    b"version 1": ("scenarios of MovingAI", "give the .map"),
}
# By bytes further on.
_CONTAINED = {
    b"/data.pkl": ("a file of PyTorch", _TENSORS),
    b"ftypavif": ("an AVIF picture", _PICTURE),
    b"ftyphe": ("a HEIC picture", _PICTURE),
    b"<svg": ("an SVG drawing", _DRAWING),
    b"\nSECTION": ("a DXF drawing", _DRAWING),
    b"\r\nSECTION": ("a DXF drawing", _DRAWING),
}


def kind_of(content: bytes) -> str | None:
    """Returns what a file is by its first bytes, in words, such as "a PDF"; None if they are of no known kind."""
    if not content:
        return "an empty file"
    head = content[:1000].lstrip(b"\xef\xbb\xbf \t\r\n")
    contained = (kind for part, (kind, _) in _CONTAINED.items() if part in content[:1000])
    return next(contained, next((kind for start, (kind, _) in _KINDS.items() if head.startswith(start)), None))


def way_out(kind: str | None) -> str:
    """Returns what to do with a file of a kind that is never read, to be set after its name; empty for other kinds."""
    ways = [way for name, way in (*_KINDS.values(), *_CONTAINED.values(), (None, _READ)) if name == kind and way]
    return f"; {ways[0]}" if ways else ""
