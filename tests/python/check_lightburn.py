"""Every LightBurn project of a job folder, loaded by meerk40t: strokes in mm after its transforms, in order, with speed
and power of the operation that they belong to; frequency and passes, which it does not keep, from the XML."""

import io
import threading
import xml.etree.ElementTree as ElementTree

from meerk40t.core.units import UNITS_PER_MM
from meerk40t.extra.lbrn import LbrnLoader

from job import Job, demand, run


class Node:
    """As much of a tree of meerk40t as its loader adds to."""

    def __init__(self, **values):
        self.values, self.children, self.references = values, [], []

    def add(self, **values):
        self.children.append(Node(**values))
        return self.children[-1]

    def add_reference(self, node):
        node.values["op"] = self

    def remove_all_children(self):
        self.children.clear()

    def focus(self):
        """What the window would scroll to."""


class Elements:
    def __init__(self):
        self.op_branch, self.elem_branch, self.node_lock = Node(), Node(), threading.RLock()


def lines(text, path):
    """The lines of a project with the label, speed and power of their operation."""
    elements = Elements()
    LbrnLoader.parse(str(path), io.BytesIO(text), elements)
    found = []
    for node in elements.elem_branch.children[0].children:
        geometry, op = node.values["geometry"], node.values["op"].values
        for start, _, _, _, end in geometry.segments[: geometry.index]:
            found.append((start / UNITS_PER_MM, end / UNITS_PER_MM, op["label"], op["speed"], op["power"]))
    return found


def check_block(job, block, entry):
    path = job.folder / entry["files"]["lightburn"]
    text = path.read_bytes()
    field = [float(v.removesuffix(" mm")) / 2 for v in job.manifest["machine"]["lens"]["field"]]
    if job.manifest["machine"]["scanner"]["swap_xy"]:
        field.reverse()
    full = float(job.manifest["machine"]["laser"]["max_power"].removesuffix(" W"))
    wanted = []
    for stroke in block.strokes:
        pen = job.manifest["pens"][stroke.pen]
        points = [complex(x / 1e6 + field[0], y / 1e6 + field[1]) for x, y in map(job.controller, stroke.points)]
        op = (f"{block.id}_P{stroke.pen + 1}", pen["speed_mm_s"], 1000 * pen["power_w"] / full)
        wanted += [(a, b, *op) for a, b in zip(points, points[1:])]
    found = lines(text, path)
    demand(len(found) == len(wanted), f"{path}: {len(found)} lines, program.txt has {len(wanted)}")
    for (a, b, label, speed, power), (c, d, name, v, p) in zip(found, wanted):
        demand(abs(a - c) <= 1e-6 and abs(b - d) <= 1e-6, f"{path}: a line from {a} to {b}, not from {c} to {d} mm")
        demand(label == name and abs(speed - v) <= 1e-6 and abs(power - p) <= 1e-4, f"{path}: settings of {label}")
    for setting in ElementTree.fromstring(text).iter("CutSetting"):
        value = {child.tag: child.get("Value") for child in setting}
        pen = job.manifest["pens"][int(value["index"])]
        demand(int(value["frequency"]) == round(pen["frequency_khz"] * 1000), f"{path}: frequency of {pen['name']}")
        demand(int(value["numPasses"]) == pen["passes"], f"{path}: passes of {pen['name']}")
    return len(wanted)


def check(folder):
    job = Job(folder)
    count = sum(check_block(job, b, e) for b, e in zip(job.program.blocks, job.manifest["blocks"]))
    return f"{len(job.program.blocks)} projects of {count} lines as meerk40t loads them"


if __name__ == "__main__":
    run(check, "FOLDER", 1)
