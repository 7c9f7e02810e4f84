"""What view.html draws, from the data that the page carries."""

from __future__ import annotations

import base64
import json
import os
import pathlib
import re
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

SCHEMA = 1


@dataclass(frozen=True)
class Part:
    """The surface in fewer triangles."""

    vertices: npt.NDArray[np.float64]
    """(n, 3): mm, frame of the part."""
    triangles: npt.NDArray[np.uint32]
    """(m, 3): numbers of vertices."""
    within_mm: float
    """How far the vertices of the surface lie from these triangles at most."""


@dataclass(frozen=True)
class Mark:
    """A line that is marked, or a dot."""

    block: int
    """Number of its block, from 0; on the fly of its run of marks."""
    pen: int
    """From 0."""
    points: npt.NDArray[np.float64]
    """(n, 3): mm on the part, in its frame."""
    defocus_um: npt.NDArray[np.float64]
    """(n): along the beam, above the focal plane positive."""
    incidence_deg: npt.NDArray[np.float64]
    """(n): angle of the beam to the surface normal."""


@dataclass(frozen=True)
class Motion:
    """The head of an on-the-fly job; mm, frame of the part."""

    time_s: npt.NDArray[np.float32]
    centre: npt.NDArray[np.float32]
    """(n, 3): the centre of the field."""
    up: npt.NDArray[np.float32]
    """(n, 3): direction to the lens."""
    spot: npt.NDArray[np.float32]
    """(n, 3): where the beam meets the focal plane."""
    is_on: npt.NDArray[np.bool_]
    """(n): whether the laser is on until then."""


@dataclass(frozen=True)
class Scene:
    """What the page shows. Points without which lines stay within `head["thinned"]["within_um"]` are left out."""

    head: dict[str, Any]
    """Machine, pens, ranges, figures and warnings; units stand in the names of the keys."""
    blocks: dict[str, Any]
    """Columns with one entry for each block."""
    part: Part
    marks: tuple[Mark, ...]
    motion: Motion | None
    """None of stepped jobs."""


class _Reader:
    def __init__(self, data: bytes) -> None:
        self.data = np.frombuffer(data, dtype=np.uint8)
        self.at = 0

    def take(self, n: int) -> npt.NDArray[np.uint8]:
        if self.at + n > len(self.data):
            raise ValueError("a data element of the page is cut short")
        self.at += n
        return self.data[self.at - n : self.at]

    def u32(self) -> int:
        return int(self.take(4).view("<u4")[0])

    def planes(self, n: int, size: int) -> npt.NDArray[np.uint32]:
        """Numbers of so many bytes, a plane for each byte."""
        out = np.zeros(n, np.uint32)
        for k in range(size):
            out |= self.take(n).astype(np.uint32) << np.uint32(8 * k)
        return out

    def u16_deltas(self, n: int) -> npt.NDArray[np.uint16]:
        return np.cumsum(self.planes(n, 2).astype(np.uint16), dtype=np.uint16)

    def u32_deltas(self, n: int) -> npt.NDArray[np.uint32]:
        return np.cumsum(self.planes(n, 4), dtype=np.uint32)

    def f32(self, n: int) -> npt.NDArray[np.float32]:
        return np.frombuffer(self.take(4 * n).tobytes(), dtype="<f4")


class _Page:
    ELEMENT = re.compile(r'<script id="([a-z0-9-]+)" type="application/[a-z-]+">([^<]*)</script>')

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        text = path.read_bytes().decode("utf-8", errors="replace")
        self.elements = {m[1]: (m.start(2), m.end(2)) for m in self.ELEMENT.finditer(text)}
        self.text = text

    def element(self, name: str) -> str:
        if name not in self.elements:
            raise ValueError(f"the page has no element {name!r}")
        start, end = self.elements[name]
        return self.text[start:end]

    def data(self, name: str) -> bytes:
        return zlib.decompress(base64.b64decode(self.element(f"data-{name}").strip()), wbits=-15)


def read_scene(path: str | os.PathLike[str]) -> Scene:
    """Reads view.html. Raises ValueError for a page of another version, and for what is none."""
    page = _Page(pathlib.Path(path))
    try:
        return _scene(page)
    except (ValueError, KeyError, IndexError, TypeError, zlib.error) as e:
        text = str(e) if isinstance(e, ValueError) else f"{type(e).__name__}: {e}"
        raise ValueError(f"{page.path}: this is no view.html that this package can read: {text}") from None


def _scene(page: _Page) -> Scene:
    head: dict[str, Any] = json.loads(page.element("head"))
    if head["schema"] != SCHEMA:
        raise ValueError(f"schema {head['schema']}, where it reads schema {SCHEMA}")
    blocks: dict[str, Any] = json.loads(page.data(head["blocks"]["name"]))
    marks: list[Mark] = []
    for chunk in head["chunks"]:
        marks += _marks(_Reader(page.data(chunk["name"])), head, blocks, chunk)
    motion = head["motion"] and _motion(_Reader(page.data(head["motion"]["name"])), head["motion"]["samples"])
    return Scene(head, blocks, _part(_Reader(page.data("mesh")), head), tuple(marks), motion)


def _part(reader: _Reader, head: dict[str, Any]) -> Part:
    vertices, triangles = reader.u32(), reader.u32()
    steps = np.stack([reader.u16_deltas(vertices) for _ in range(3)], axis=1)
    reader.take(3 * vertices)  # normals
    corners = reader.u32_deltas(3 * triangles).reshape(-1, 3)
    lo, hi = (np.array(corner) for corner in head["part"]["box"])
    return Part(lo + steps / 65535.0 * (hi - lo), corners, head["part"]["within_mm"])


def _marks(reader: _Reader, head: dict[str, Any], blocks: dict[str, Any], chunk: dict[str, Any]) -> list[Mark]:
    marks, points = reader.u32(), reader.u32()
    block_of, pen_of, length_of = reader.planes(marks, 2), reader.take(marks), reader.planes(marks, 2)
    x, y, z = (reader.u16_deltas(points).view(np.int16).astype(np.float64) for _ in range(3))
    local = np.stack([x * chunk["xy_mm"], y * chunk["xy_mm"], z * chunk["z_mm"]], axis=1)
    incidence = reader.take(points) * head["incidence_deg_per_step"]
    if head["mode"] == "on-the-fly":
        defocus = reader.u16_deltas(points).view(np.int16) * head["defocus_um_per_step"]
    else:
        # The focal plane of a block is z = 0 of its own axes.
        defocus = 1000.0 * local[:, 2]
    ends = np.cumsum(length_of)
    out = []
    for m in range(marks):
        block = chunk["first"] + int(block_of[m])
        own = slice(int(ends[m] - length_of[m]), int(ends[m]))
        frame = blocks["frame"][block]
        at = local[own] if frame is None else local[own] @ np.array(frame[:9]).reshape(3, 3).T
        out.append(Mark(block, int(pen_of[m]), at + blocks["origin"][block], defocus[own], incidence[own]))
    return out


def _motion(reader: _Reader, n: int) -> Motion:
    def three() -> npt.NDArray[np.float32]:
        return np.stack([reader.f32(n) for _ in range(3)], axis=1)

    time_s = reader.f32(n)
    return Motion(time_s, three(), three(), three(), reader.take(n) != 0)
