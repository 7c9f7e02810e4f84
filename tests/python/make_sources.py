"""Writes the parts of fixtures/sources as 16-bit height maps: `python3 tests/python/make_sources.py fixtures/sources`.
The results are committed. Needs nothing but Python.

cao/dome.png   the dome z = a (1 - (u² + v²) / 2), u and v from -1 to 1 over 450 x 450 mm, samples 2.5 mm apart;
               facets lie at most 0.5 um off it
ma/hills.png   three hills over 50 x 50 mm, the surface of fixtures/anchors/seven_axis.json, samples 0.25 mm apart;
               facets lie at most 1.2 um off it
"""

import json
import math
import pathlib
import struct
import sys
import zlib

AMPLITUDE = 10.043874448175666


def dome(x, y):
    u, v = (x - 225) / 225, (y - 225) / 225
    return AMPLITUDE * (1 - (u * u + v * v) / 2)


def hills(surface):
    s, a, m = (surface[key] for key in "sam")

    def height(x, y):
        at = lambda i: ((x - m[i][0]) ** 2 + (y - m[i][1]) ** 2) / (2 * s[i] ** 2)
        return surface["c0"] + sum(a[i] * math.exp(-at(i)) for i in range(3))

    return height


def filtered(row, above):
    """A row of a PNG by whichever of its filters leaves the least to pack."""
    def left(i):
        return row[i - 2] if i >= 2 else 0

    def paeth(i):
        a, b, c = left(i), above[i], above[i - 2] if i >= 2 else 0
        p = a + b - c
        return min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]

    guesses = [lambda i: 0, left, lambda i: above[i], lambda i: (left(i) + above[i]) // 2, paeth]
    rows = [bytes([kind]) + bytes((row[i] - guess(i)) % 256 for i in range(len(row))) for kind, guess in enumerate(guesses)]
    return min(rows, key=lambda r: sum(min(b, 256 - b) for b in r[1:]))


def write(path, n, pixel, origin, height, z0, z1):
    """n x n samples of `height`, `pixel` apart from `origin` on; 0 stands for z0 and 65535 for z1, row 0 at the top."""
    above, packed = bytes(2 * n), b""
    for j in reversed(range(n)):
        values = [(height(origin + i * pixel, origin + j * pixel) - z0) / (z1 - z0) * 65535 for i in range(n)]
        assert min(values) >= 0 and max(values) <= 65535, path
        row = struct.pack(f">{n}H", *map(round, values))
        packed += filtered(row, above)
        above = row
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    head = struct.pack(">IIBBBBB", n, n, 16, 0, 0, 0, 0)
    png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(packed, 9)) + chunk(b"IEND", b"")
    path.write_bytes(png)
    print(path, len(png))


def main(folder):
    anchors = pathlib.Path(__file__).parents[2] / "fixtures/anchors/seven_axis.json"
    write(folder / "cao/dome.png", 181, 2.5, 0.0, dome, 0.0, 13.107)
    write(folder / "ma/hills.png", 201, 0.25, -25.0, hills(json.loads(anchors.read_text())["surface"]), 10.0, 23.107)


main(pathlib.Path(sys.argv[1]))
