"""What all checks share: reading program.txt and manifest.json of a job folder, and failing clearly.

Nothing here comes from terrace's own code: program.txt and the manifest are read by their written form.
"""

import json
import pathlib
import re
import struct
import sys


class Fault(Exception):
    """A job folder that is not what it should be."""


def demand(condition, message):
    if not condition:
        raise Fault(message)


def half_up(value):
    """The nearest whole number; halves go away from 0."""
    return int(abs(value) + 0.5) * (1 if value >= 0 else -1)


class Stroke:
    __slots__ = ("pen", "source", "segment", "reversed", "points")


class Block:
    __slots__ = (
        "id", "section", "level", "tilt", "centre", "focus", "accepts", "stage", "focus_shift", "retract", "marks",
        "strokes",
    )


class Program:
    """program.txt: pens as lists of five texts and a dwell or None, blocks with strokes, all lengths integers in nm."""

    def __init__(self, path):
        lines = iter(pathlib.Path(path).read_text(encoding="utf-8").split("\n"))
        demand(next(lines) == "terrace program 1", f"{path}: no program text")
        self.origins = []
        while (line := next(lines)).startswith("origin "):
            self.origins.append([int(n) for n in line.removeprefix("origin ").split()])
        self.pens = []
        for _ in range(int(line.removeprefix("pens "))):
            pen = next(lines).removeprefix("pen ")
            # Passes are a bare number; a dwell follows where the pen marks dots.
            pen, dwell = pen.rsplit(" | ", 1) if pen.endswith(" s") else (pen, None)
            self.pens.append(pen.rsplit(" | ", 4) + [dwell])
        self.blocks, self.focus_shift = [], 0
        for _ in range(int(next(lines).removeprefix("blocks "))):
            self.blocks.append(self._block(lines))
        demand(list(lines) == ["end", ""], f"{path}: the end is missing")

    def _block(self, lines):
        # The pass, the set-up and the focus shift are said where they change.
        while (words := next(lines).split())[0] in ("pass", "setup", "focus_shift"):
            if words[0] == "focus_shift":
                self.focus_shift = int(words[1])
        demand(words[0] == "block" and len(words) == 19, "program.txt: no block line")
        numbers = [int(w) for w in words[2:]]
        block = Block()
        block.id = words[1]
        block.section, block.level, block.tilt = numbers[0:2], numbers[2], numbers[3:5]
        block.centre, block.focus, block.accepts = numbers[5:7], numbers[7], numbers[8:10]
        block.stage, block.retract, block.marks = numbers[10:13], bool(numbers[13]), numbers[14:16]
        block.focus_shift, block.strokes = self.focus_shift, []
        for _ in range(numbers[16]):
            words = next(lines).split()
            stroke = Stroke()
            stroke.pen, stroke.source, stroke.segment = (int(w) for w in words[:3])
            stroke.reversed = words[3] == "-"
            flat = [int(w) for w in words[4:]]
            stroke.points = list(zip(flat[0::2], flat[1::2]))
            block.strokes.append(stroke)
        return block


class Job:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.manifest = json.loads((self.folder / "manifest.json").read_text(encoding="utf-8"))
        self.program = Program(self.folder / "program.txt")
        ids = [b["id"] for b in self.manifest["blocks"]]
        demand(ids == [b.id for b in self.program.blocks], "manifest and program.txt list different blocks")
        demand(len(ids) > 0, "the job has no block")
        if "subset" in self.manifest:
            # The folder holds files of these blocks alone.
            held = set(self.manifest["subset"]["blocks"])
            self.manifest["blocks"] = [b for b in self.manifest["blocks"] if b["id"] in held]
            self.program.blocks = [b for b in self.program.blocks if b.id in held]
            demand(len(self.program.blocks) == len(held), "the subset lists blocks that the job does not have")

    def controller(self, point):
        """Controller coordinates of a field point, nm: swap first, then mirrors."""
        scanner = self.manifest["machine"]["scanner"]
        x, y = point
        if scanner["swap_xy"]:
            x, y = y, x
        return (-x if scanner["mirror_x"] else x, -y if scanner["mirror_y"] else y)

    def has(self, name):
        return any(f["file"] == name for f in self.manifest["files"])


def nm(text):
    """Nanometres of a decimal number of mm with exactly six decimals."""
    demand(re.fullmatch(r"-?\d+\.\d{6}", text), f"{text!r} is not a plain decimal with six digits")
    value = int(text.replace(".", ""))
    demand(value != 0 or not text.startswith("-"), "a zero has a sign")
    return value


def single(value):
    """The nearest number of single precision."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


def run(check, usage, count):
    """Runs a check on the arguments of the command line; says 'ok: ...' or fails."""
    if len(sys.argv) != count + 1:
        sys.exit(f"usage: {pathlib.Path(sys.argv[0]).name} {usage}")
    try:
        print("ok: " + check(*sys.argv[1:]))
    except (Fault, OSError, ValueError, KeyError, IndexError, StopIteration) as fault:
        sys.exit(f"{pathlib.Path(sys.argv[0]).name}: {type(fault).__name__}: {fault}")
