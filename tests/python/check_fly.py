"""The on-the-fly program of a job folder, run by LinuxCNC's interpreter through its Python module: it ends without
error, every place is that of the Power PMAC program to the nanometre, and every move takes the time that is TM
there, by the length and the feed that LinuxCNC makes of it."""

import math
import pathlib
import re
import sys

from job import demand, run

AXES = "XYZUV"
# Where the module has its axes, among X Y Z A B C U V W.
PLACES = (0, 1, 2, 6, 7)
INCH = 25.4


class Canon:
    """Takes the canonical commands; lengths come in inches."""

    parameter_file = "/nonexistent/fly.var"

    def __init__(self):
        self.moves, self.at, self.rate, self.dwells = [], None, 0.0, 0

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *_: None

    def get_axis_mask(self):
        return 0b111111111

    def get_tool(self, _):
        return (0, *[0.0] * 12, 0)

    def get_external_length_units(self):
        return 1 / INCH

    def get_external_angular_units(self):
        return 1.0

    def check_abort(self):
        return False

    def get_block_delete(self):
        return 0

    def set_feed_rate(self, rate):
        self.rate = rate * INCH

    def dwell(self, _):
        self.dwells += 1

    def straight_traverse(self, *to):
        self.at = [to[k] * INCH for k in PLACES]

    def straight_feed(self, *to):
        to = [to[k] * INCH for k in PLACES]
        step = [b - a for a, b in zip(self.at, to)]
        # LinuxCNC takes the length of X, Y and Z where one of them moves, else that of U and V.
        length = math.hypot(*step[:3]) or math.hypot(*step[3:])
        self.moves.append((to, length / self.rate * 60e3))
        self.at = to


def moves_of_pmac(path):
    """Place and time in ms of every timed move."""
    at, moves = {}, []
    for line in path.read_text(encoding="ascii").splitlines():
        words = {w[0]: float(w[1:]) for w in re.findall(r"(?<![A-Z])[XYZUV]-?\d+\.\d{6}", line)}
        if line.startswith(("rapid", "TM")):
            at |= words
        if line.startswith("TM"):
            moves.append(([at[a] for a in AXES], float(re.match(r"TM([\d.]+)", line)[1])))
    return moves


def check(folder, linuxcnc):
    sys.path.insert(0, str(pathlib.Path(linuxcnc) / "root/usr/lib/python3/dist-packages"))
    import gcode

    folder = pathlib.Path(folder)
    canon = Canon()
    result, line = gcode.parse(str(folder / "fly.ngc"), canon, "", "")
    demand(result <= gcode.MIN_ERROR, f"fly.ngc:{line}: {gcode.strerror(result)}")
    wanted = moves_of_pmac(folder / "fly.pmc")
    demand(len(canon.moves) == len(wanted) > 0, f"{len(canon.moves)} moves, fly.pmc has {len(wanted)}")
    worst = 0.0
    for number, ((to, ms), (place, tm)) in enumerate(zip(canon.moves, wanted), 1):
        demand(all(abs(a - b) < 4e-7 for a, b in zip(to, place)), f"move {number} goes to {to}, not {place}")
        # Lengths of few nanometres are differences of inches: their times are as good as those.
        worst = max(worst, abs(ms - tm) / tm)
        demand(abs(ms - tm) < 1e-3 * tm + 1e-3, f"move {number} takes {ms} ms, not {tm}")
    demand(canon.dwells > 0, "no dwell before the first move")
    return f"{len(wanted)} moves, times within {worst:.1e}"


if __name__ == "__main__":
    run(check, "FOLDER LINUXCNC", 2)
