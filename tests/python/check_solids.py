"""Ray casts what is to be marked of a solid, and compares it with a job folder.

  check_solids.py LIMIT_DEG PITCH_MM  [FACETS FOLDER DIRECTION]...

FACETS is binary STL, the PLY of `terrace import` or a file of doubles, nine for a facet, in mm; FOLDER a job folder
whose one texture is a hatch over the part along DIRECTION, 0 or 90 deg. Prints a line of JSON for each:

  mark_mm    length of the marks of the job
  cast_mm    length that is to be marked
  extra_mm   length that is marked and is not to be
  missing_mm length that is not marked and is to be
  depth_mm   length that is marked in a block whose heights are others
  twice_mm   length that is marked more than once

A line is cut just beside itself, on either side. Of each cut the topmost facets count, and of those the ones that are
not steeper than the limit; the line is to be marked where that holds on either side, at the height of the higher one."""

import json
import math
import sys
from pathlib import Path

import numpy as np

# Distance of a cut from its line, mm.
BESIDE = 1e-5
# By how much heights may differ from the range of their block, mm: beside a line on a steep facet they differ a little.
HEIGHT = 1e-3


def read_facets(path):
    data = path.read_bytes()
    if path.suffix == ".stl":
        kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
        return np.frombuffer(data, kind, offset=84)["corners"].astype(float)
    if path.suffix == ".ply":
        return read_ply(data)
    return np.frombuffer(data, "<f8").reshape(-1, 3, 3)


def read_ply(data):
    head, body = data.split(b"end_header\n", 1)
    lines = [line.split() for line in head.splitlines()]
    vertices, faces = (next(int(w[2]) for w in lines if w[:2] == [b"element", what]) for what in (b"vertex", b"face"))
    points = np.frombuffer(body, "<f8", 3 * vertices).reshape(-1, 3)
    kind = np.dtype([("count", "u1"), ("corners", "<u4", 3)])
    return points[np.frombuffer(body, kind, faces, 24 * vertices)["corners"]]


class Cuts:
    """Facets that are cut by planes; `along` is the axis of the lines, 0 or 1."""

    def __init__(self, facets, along, limit):
        normal = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
        level = np.abs(normal[:, 2])
        # A vertical facet is not seen from above.
        seen = level > 1e-9 * np.linalg.norm(normal, axis=1)
        self.facets = facets[seen]
        self.across = self.facets[:, :, 1 - along]
        self.along = along
        self.allowed = (np.hypot(normal[:, 0], normal[:, 1])[seen] <= math.tan(limit) * level[seen])

    def at(self, place):
        """Segments of a cut, a row each: x0, z0, x1, z1, allowed."""
        hit = (self.across.min(axis=1) < place) & (self.across.max(axis=1) > place)
        rows = []
        for corners, across, allowed in zip(self.facets[hit], self.across[hit], self.allowed[hit]):
            ends = []
            for i in range(3):
                a, b = across[i], across[(i + 1) % 3]
                # An end on the plane itself counts as above it: two sides cross in any case.
                if (a < place) != (b < place):
                    p, q = corners[i], corners[(i + 1) % 3]
                    at = p + (place - a) / (b - a) * (q - p)
                    ends.append((at[self.along], at[2]))
            (x0, z0), (x1, z1) = sorted(ends)
            if x1 > x0:
                rows.append((x0, z0, x1, z1, allowed))
        return np.array(rows).reshape(-1, 5)


def heights(segments, x):
    x0, z0, x1, z1 = segments[:, :4].T
    return z0 + (z1 - z0) * (x - x0) / (x1 - x0)


def upper(segments):
    """The topmost segments from left to right: rows of x0, z0, x1, z1, allowed."""
    out = []
    ends = np.unique(segments[:, [0, 2]])
    for a, b in zip(ends[:-1], ends[1:]):
        over = segments[(segments[:, 0] < (a + b) / 2) & (segments[:, 2] > (a + b) / 2)]
        if len(over):
            split(over, a, b, out)
    return np.array(out).reshape(-1, 5)


def split(over, a, b, out):
    """Adds the topmost of segments that all reach from a to b."""
    left, right = heights(over, a), heights(over, b)
    # Of equal ones at one end the higher one at the other.
    i, j = np.lexsort((right, left))[-1], np.lexsort((left, right))[-1]
    if left[j] >= left[i] - 1e-12 or right[i] >= right[j] - 1e-12 or b - a < 1e-9:
        k = j if left[j] >= left[i] - 1e-12 else i
        out.append((a, left[k], b, right[k], over[k, 4]))
        return
    lead, lag = left[i] - left[j], right[j] - right[i]
    middle = a + (b - a) * lead / (lead + lag)
    if not a < middle < b:
        middle = (a + b) / 2
    split(over, a, middle, out)
    split(over, middle, b, out)


def to_be_marked(cuts, place):
    """Of either side what may be marked: rows of x0, z0, x1, z1."""
    sides = []
    for side in (-BESIDE, BESIDE):
        top = upper(cuts.at(place + side))
        sides.append(top[top[:, 4] > 0, :4])
    return sides


def over(rows, x):
    """The row that holds each x, or -1; rows lie side by side."""
    if not len(rows):
        return np.full(len(x), -1)
    k = np.searchsorted(rows[:, 0], x, side="right") - 1
    return np.where((k >= 0) & (x < rows[np.maximum(k, 0), 2]), k, -1)


def height_of(rows, x):
    k = over(rows, x)
    z = np.full(len(x), -np.inf)
    z[k >= 0] = [heights(rows[[i]], at)[0] for i, at in zip(k[k >= 0], x[k >= 0])]
    return z


def read_marks(folder, along):
    """Marks by their line, nm: rows of x0, x1, lowest and highest height of the block, mm."""
    marks = {}
    block = None
    for line in (folder / "program.txt").read_text().splitlines():
        words = line.split(" ")
        if words[0] == "block":
            block = [int(w) for w in words[2:]]
        elif block and words[0].isdigit():
            numbers = [int(w) for w in words[4:]]
            points = np.array(numbers).reshape(-1, 2) + block[5:7]
            across = set(points[:, 1 - along].tolist())
            if len(across) != 1:
                raise SystemExit(f"{folder}: a mark is not along its line")
            ends = points[[0, -1], along] / 1e6
            marks.setdefault(across.pop(), []).append((ends.min(), ends.max(), block[8] / 1e6, block[9] / 1e6))
    return {across: np.array(rows) for across, rows in marks.items()}


def compare_line(sides, marks, total):
    ends = np.unique(np.concatenate([rows[:, [0, 2]].ravel() for rows in sides] + [marks[:, :2].ravel()]))
    if len(ends) < 2:
        return
    middle, length = (ends[1:] + ends[:-1]) / 2, np.diff(ends)
    z = np.maximum(*(height_of(rows, middle) for rows in sides))
    wanted = z > -np.inf
    covers = (marks[:, [0]] < middle) & (marks[:, [1]] > middle)
    times = covers.sum(axis=0)
    fits = covers & (marks[:, [2]] - HEIGHT <= z) & (z <= marks[:, [3]] + HEIGHT)
    total["mark_mm"] += float((marks[:, 1] - marks[:, 0]).sum())
    total["cast_mm"] += length[wanted].sum()
    total["extra_mm"] += length[~wanted & (times > 0)].sum()
    total["missing_mm"] += length[wanted & (times == 0)].sum()
    total["twice_mm"] += (length * np.maximum(times - 1, 0)).sum()
    total["depth_mm"] += length[wanted & (times > 0) & ~fits.any(axis=0)].sum()


def places_of(facets, across, pitch):
    """Lines of the hatch, nm: the first through the lower corner of the box, the last on its other border at most."""
    low, high = (round(float(of(facets[:, :, across])) * 1e6) for of in (np.min, np.max))
    return range(low, high + 1, round(pitch * 1e6))


def compare(facets, folder, degrees, limit, pitch):
    along = {"0": 0, "90": 1}[degrees]
    cuts, marks = Cuts(facets, along, limit), read_marks(folder, along)
    total = dict.fromkeys(("mark_mm", "cast_mm", "extra_mm", "missing_mm", "twice_mm", "depth_mm"), 0.0)
    places = places_of(facets, 1 - along, pitch)
    # A border that is no whole number of nanometres may be rounded either way.
    lines = {min(places, key=lambda place: abs(place - at)): rows for at, rows in marks.items()}
    if len(lines) < len(marks) or any(abs(a - b) > 1000 for a, b in zip(sorted(lines), sorted(marks))):
        raise SystemExit(f"{folder}: marks lie on other lines than those of the hatch")
    for place in places:
        compare_line(to_be_marked(cuts, place / 1e6), lines.get(place, np.empty((0, 4))), total)
    return total


limit, pitch = math.radians(float(sys.argv[1])), float(sys.argv[2])
rest = sys.argv[3:]
for file, folder, degrees in zip(rest[::3], rest[1::3], rest[2::3]):
    print(json.dumps(compare(read_facets(Path(file)), Path(folder), degrees, limit, pitch)))
