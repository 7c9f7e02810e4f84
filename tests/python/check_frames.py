"""The frames of a job folder: drawings read by ezdxf hold one closed rectangle around the marks that program.txt has for
their block; the programs of the stage, run by the interpreter of LinuxCNC, stop at the registration points and at the
places of the outline with the output off, and never switch it on."""

import ezdxf

from check_dxf import points_of
from check_gcode import canonical
from job import Job, demand, run


def rectangle(job, block):
    points = [job.controller(p) for stroke in block.strokes for p in stroke.points]
    xs, ys = [p[0] for p in points], [p[1] for p in points]
    return {(x, y) for x in (min(xs), max(xs)) for y in (min(ys), max(ys))}


def check_drawings(job, pen):
    for block in job.program.blocks:
        path = job.folder / f"frames/{block.id}-frame.dxf"
        entities = list(ezdxf.readfile(path).modelspace())
        demand(len(entities) == 1, f"{path}: {len(entities)} entities")
        points = points_of(entities[0])
        demand(set(points) == rectangle(job, block), f"{path}: not the rectangle around the marks")
        demand(points[0] == points[-1], f"{path}: it is not closed")
        demand(entities[0].dxf.layer == f"{block.id}_P{pen + 1}", f"{path}: layer {entities[0].dxf.layer}")
    return len(job.program.blocks)


def stops(job):
    """Where the programs have to stop: x, y and z, or x and y alone where the head is lifted."""
    outline = set(job.manifest["frames"]["outline"])
    setups, out, setup = job.manifest["setups"], [], None
    for entry in job.manifest["blocks"]:
        if entry["id"] not in outline:
            continue
        if entry["setup"] != setup:
            setup = entry["setup"]
            out += [None] * (len(setups) > 1)
            out += [point["stage"] for point in setups[setup - 1]["registration"]]
        out.append(entry["stage"])
    return out


def check_program(job, commands, name, off):
    place, is_off, wanted = [None] * 3, False, iter(stops(job))
    for command in commands:
        if command.startswith("STRAIGHT_TRAVERSE"):
            demand(is_off, f"{name}: the output is not off before {command}")
            place = [float(v) for v in command.split("(")[1].strip(")").split(",")[:3]]
        elif command.startswith(off):
            is_off = True
        elif command == "PROGRAM_STOP()":
            expected = next(wanted) or []
            near = all(abs(a - b) < 0.6e-4 for a, b in zip(place, expected))
            demand(near and is_off, f"{name}: stops at {place}, not at {expected}")
        demand(not command.startswith(("SET_AUX", "START_SPINDLE", "STRAIGHT_FEED")), f"{name}: {command}")
    demand(next(wanted, "none") == "none", f"{name}: a stop is missing")
    demand("PROGRAM_END()" in commands, f"{name}: no end")


def check(folder, rs274, tool_table):
    job = Job(folder)
    pen = [p[0] for p in job.program.pens].index(job.manifest["frames"]["pen"])
    count = check_drawings(job, pen)
    for name, off in (("stage-frame.ngc", "CLEAR_AUX_OUTPUT_BIT(0)"), ("stage_m0-frame.nc", "STOP_SPINDLE_TURNING")):
        check_program(job, canonical(rs274, tool_table, job.folder / "frames" / name), name, off)
    return f"{count} frames, {len(stops(job))} stops"


if __name__ == "__main__":
    run(check, "FOLDER RS274 TOOL_TABLE", 3)
