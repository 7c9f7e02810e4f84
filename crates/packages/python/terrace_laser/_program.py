"""program.txt of a stepped job."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

HEAD = "terrace program 1"


@dataclass(frozen=True)
class Pen:
    """Laser settings, as the job file states them."""

    name: str
    speed: str
    power: str
    frequency: str
    passes: int
    dwell: str | None
    """Time of a dot; None where the pen marks none."""


@dataclass(frozen=True)
class BlockRecord:
    """One stop of the stage. Lengths are nm; centre, heights and LPFL are those of the part as the stop tilts it."""

    id: str
    pass_: int
    """From 1."""
    setup: int
    """From 1."""
    section: tuple[int, int]
    level: int
    tilt: tuple[int, int]
    """Commanded angles of the two tilt axes, millionths of a degree."""
    centre: tuple[int, int]
    """Point of the part under the optical axis."""
    lpfl: int
    """Height of the focal plane."""
    admits: tuple[int, int]
    """Heights that the stop admits."""
    stage: tuple[int, int, int]
    """Commanded positions of the axes."""
    focus_shift: int
    """By how much a zoom optic raises the focal plane above the one that the stage sets."""
    retract: bool
    """Whether the stage lifts on its way there."""
    heights: tuple[int, int]
    """Lowest and highest mark."""
    strokes: range
    """Numbers of its strokes."""


@dataclass(frozen=True)
class Stroke:
    """A polyline that the scanner marks, or a dot."""

    pen: int
    """From 0."""
    source: int
    """The stroke of the texture that it is a piece of, from 0."""
    segment: int
    reversed: bool
    """Whether it is marked against the direction in which it is drawn."""
    points: npt.NDArray[np.int32]
    """(n, 2): x and y in the field frame, nm, in marking order; one point is a dot."""


@dataclass(frozen=True)
class Program:
    """A stepped program. Strokes lie one after another, in marking order."""

    origins: npt.NDArray[np.int64]
    """(set-ups, 3): the origin of the part in the table frame, nm."""
    pens: tuple[Pen, ...]
    blocks: tuple[BlockRecord, ...]
    points: npt.NDArray[np.int32]
    """(n, 2): the points of all strokes, field frame, nm."""
    first: npt.NDArray[np.int64]
    """(strokes + 1): where the points of each stroke begin, and behind the last one their number."""
    pen: npt.NDArray[np.int32]
    """(strokes)"""
    source: npt.NDArray[np.int64]
    """(strokes)"""
    segment: npt.NDArray[np.int64]
    """(strokes)"""
    reversed: npt.NDArray[np.bool_]
    """(strokes)"""

    def __len__(self) -> int:
        return len(self.pen)

    def stroke(self, i: int) -> Stroke:
        """Stroke i, from 0. Its points are a view."""
        points = self.points[self.first[i] : self.first[i + 1]]
        return Stroke(
            int(self.pen[i]), int(self.source[i]), int(self.segment[i]), bool(self.reversed[i]), points
        )

    def strokes_of(self, block: int) -> Iterator[Stroke]:
        """The strokes of a block, by its number from 0, in marking order."""
        return map(self.stroke, self.blocks[block].strokes)

    def on_part(self, block: int, points: npt.NDArray[np.int32]) -> npt.NDArray[np.int64]:
        """Points of the field of a block in the frame of the part as the stop tilts it: (n, 2), nm."""
        return points.astype(np.int64) + np.array(self.blocks[block].centre, dtype=np.int64)


class _Lines:
    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        try:
            self.lines = path.read_text(encoding="utf-8").split("\n")
        except UnicodeDecodeError as e:
            raise ValueError(f"{path}: not UTF-8 text: {e}") from None
        self.at = 0

    def ahead(self) -> str:
        """The next line, which is read again."""
        return self.lines[self.at] if self.at < len(self.lines) else ""

    def next(self) -> str:
        if self.at == len(self.lines):
            raise self.fault("the file ends too early")
        self.at += 1
        return self.lines[self.at - 1]

    def counted(self, word: str) -> int:
        line = self.next()
        name, _, number = line.partition(" ")
        if name != word or not (number.isascii() and number.isdigit()):
            raise self.fault(f'"{word} <number>" is expected')
        return int(number)

    def fault(self, what: str) -> ValueError:
        return ValueError(f"{self.path}, line {self.at}: {what}")


def read_program(path: str | os.PathLike[str]) -> Program:
    """Reads program.txt of a stepped job. Raises ValueError, with the line, for anything else."""
    lines = _Lines(pathlib.Path(path))
    if lines.next() != HEAD:
        raise lines.fault(f"{HEAD!r} is expected: this is no program of a stepped job, or one of another version")
    origins: list[list[int]] = []
    while lines.ahead().startswith("origin "):
        origins.append(_whole(lines, lines.next().split()[1:], 3))
    pens = tuple(_pen(lines) for _ in range(lines.counted("pens")))
    blocks: list[BlockRecord] = []
    heads: list[tuple[int, int, int, bool]] = []
    points: list[npt.NDArray[np.int64]] = []
    state = {"pass": 1, "setup": 1, "focus_shift": 0}
    for _ in range(lines.counted("blocks")):
        words = lines.next().split()
        # Pass, set-up and focus shift have a line of their own where they change.
        while words and words[0] in state:
            state[words[0]] = _whole(lines, words[1:], 1)[0]
            words = lines.next().split()
        if not words or words[0] != "block" or len(words) != 19:
            raise lines.fault("a block line of 19 words is expected")
        (count,) = _whole(lines, words[18:], 1)
        if count < 0:
            raise lines.fault("a number of strokes is negative")
        blocks.append(_block(lines, words, state, range(len(heads), len(heads) + count)))
        for _ in range(count):
            head = lines.next().split(" ", 4)
            if len(head) != 5 or head[3] not in ("+", "-"):
                raise lines.fault("a stroke line is expected: pen, source, segment, direction, points")
            pen, source, segment = _whole(lines, head[:3], 3)
            if not 0 <= pen < len(pens):
                raise lines.fault(f"there is no pen {pen}")
            heads.append((pen, source, segment, head[3] == "-"))
            try:
                flat = np.array(head[4].split(" "), dtype=np.int64)
            except (ValueError, OverflowError):
                raise lines.fault("a coordinate is not a whole number") from None
            if len(flat) % 2 != 0:
                raise lines.fault("a point has two coordinates")
            if np.abs(flat).max() > np.iinfo(np.int32).max:
                raise lines.fault("a coordinate lies farther than 2.1 m from the centre of the field")
            points.append(flat)
    if lines.next() != "end" or lines.lines[lines.at :] != [""]:
        raise lines.fault('"end" is expected, and nothing after it')
    all_points = np.concatenate(points) if points else np.empty(0, np.int64)
    numbers = np.array([head[:3] for head in heads], dtype=np.int64).reshape(-1, 3)
    lengths = np.array([len(flat) // 2 for flat in points], dtype=np.int64)
    return Program(
        origins=np.array(origins, dtype=np.int64).reshape(-1, 3),
        pens=pens,
        blocks=tuple(blocks),
        points=all_points.astype(np.int32).reshape(-1, 2),
        first=np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
        pen=numbers[:, 0].astype(np.int32),
        source=numbers[:, 1],
        segment=numbers[:, 2],
        reversed=np.array([head[3] for head in heads], dtype=np.bool_),
    )


def _whole(lines: _Lines, words: list[str], count: int) -> list[int]:
    try:
        numbers = [int(word) for word in words]
    except ValueError:
        raise lines.fault("whole numbers are expected") from None
    if len(numbers) != count or max(map(abs, numbers)) > np.iinfo(np.int64).max:
        raise lines.fault(f"{count} numbers of at most 64 bits are expected")
    return numbers


def _pen(lines: _Lines) -> Pen:
    line = lines.next()
    if not line.startswith("pen "):
        raise lines.fault("a pen line is expected")
    text = line.removeprefix("pen ")
    # A dwell has a unit; passes, which are last without it, have none.
    dwell = None
    if not text.rsplit(" | ", 1)[-1].isdigit():
        text, dwell = text.rsplit(" | ", 1)
    parts = text.rsplit(" | ", 4)
    if len(parts) != 5 or not parts[4].isdigit():
        raise lines.fault("a pen has a name, speed, power, frequency and passes")
    name, speed, power, frequency, passes = parts
    name = _unescaped(name)
    return Pen(name, speed, power, frequency, int(passes), dwell)


def _unescaped(name: str) -> str:
    out, escaped = [], False
    for c in name:
        if escaped:
            out.append({"n": "\n", "r": "\r"}.get(c, c))
            escaped = False
        elif c == "\\":
            escaped = True
        else:
            out.append(c)
    return "".join(out)


def _block(lines: _Lines, words: list[str], state: dict[str, int], strokes: range) -> BlockRecord:
    n = _whole(lines, words[2:], 17)
    return BlockRecord(
        id=words[1],
        pass_=state["pass"],
        setup=state["setup"],
        section=(n[0], n[1]),
        level=n[2],
        tilt=(n[3], n[4]),
        centre=(n[5], n[6]),
        lpfl=n[7],
        admits=(n[8], n[9]),
        stage=(n[10], n[11], n[12]),
        focus_shift=state["focus_shift"],
        retract=bool(n[13]),
        heights=(n[14], n[15]),
        strokes=strokes,
    )
