"""Every list for a BJJCZ card of a job folder: word for word what galvoplotter's own controller sends for the same
strokes, and back in mm within half a unit of the card."""

import struct

from galvo.consts import list_command_lookup
from galvo.controller import GalvoController
from galvo.mock_connection import MockConnection

from job import Job, demand, half_up, run

PACKET = 3072


def quiet(controller):
    """Takes the packets that a controller sends; a board that is always ready answers."""
    sent = []
    MockConnection.read = lambda self, index=0: struct.pack("<4H", 0, 0, 0, 0x20)
    MockConnection.write = lambda self, index=0, packet=None: sent.append(bytes(packet))
    controller.connect_if_needed()
    return sent


def us(text):
    # Whole: the controller cuts fractions off.
    return round(float(text.removesuffix(" s")) * 1e6)


def units(point, scale):
    return tuple(0x8000 + half_up(nm * scale / 1e6) for nm in point)


def of_galvoplotter(job, block):
    machine = job.manifest["machine"]
    scale, delays = machine["lmc"]["units_per_mm"], machine["delays"]
    first = job.manifest["pens"][block.strokes[0].pen]
    full = float(machine["laser"]["max_power"].removesuffix(" W"))
    percent = lambda pen: 100 * pen["power_w"] / full
    controller = GalvoController(
        mock=True, galvos_per_mm=scale, travel_speed=float(machine["scanner"]["jump_speed"].removesuffix(" mm/s")),
        mark_speed=first["speed_mm_s"], power=percent(first), frequency=first["frequency_khz"],
        delay_laser_on=us(delays["laser_on"]), delay_laser_off=us(delays["laser_off"]),
        delay_polygon=us(delays["polygon"]))
    sent = quiet(controller)
    controller.marking_configuration()
    for stroke in block.strokes:
        pen = job.manifest["pens"][stroke.pen]
        controller.set(mark_speed=pen["speed_mm_s"], power=percent(pen), frequency=pen["frequency_khz"])
        controller.set_delay_jump(us(delays["jump"]))
        points = [units(job.controller(p), scale) for p in stroke.points]
        for _ in range(pen["passes"]):
            controller.list_jump(*points[0])
            for point in points[1:]:
                controller.mark(*point)
            if len(points) == 1:
                controller.list_laser_on_point(round(pen["dwell_us"] / 10))
            controller.list_delay_time(-(-us(delays["mark"]) // 10))
    controller.initial_configuration()
    return b"".join(p for p in sent if len(p) == PACKET)


def check_block(job, block, entry):
    path = job.folder / entry["files"]["lmc"]
    data = path.read_bytes()
    expected = of_galvoplotter(job, block)
    demand(data == expected, f"{path}: not the words of galvoplotter")
    scale = job.manifest["machine"]["lmc"]["units_per_mm"]
    marks = []
    for at in range(0, len(data), 12):
        command, x, y, *_ = struct.unpack_from("<6H", data, at)
        if list_command_lookup[command] in ("listJumpTo", "listMarkTo"):
            marks.append(((x - 0x8000) / scale, (y - 0x8000) / scale))
    wanted = []
    for stroke in block.strokes:
        points = [job.controller(p) for p in stroke.points]
        # Points that are one in units of the card are marked once.
        kept = points[:1] + [b for a, b in zip(points, points[1:]) if units(a, scale) != units(b, scale)]
        wanted += kept * job.manifest["pens"][stroke.pen]["passes"]
    demand(len(marks) == len(wanted), f"{path}: {len(marks)} points, program.txt has {len(wanted)}")
    for mark, nm in zip(marks, wanted):
        off = max(abs(m - v / 1e6) for m, v in zip(mark, nm))
        demand(off <= 0.5 / scale + 1e-9, f"{path}: a point is {off} mm off")
    return len(wanted)


def check(folder):
    job = Job(folder)
    points = sum(check_block(job, b, e) for b, e in zip(job.program.blocks, job.manifest["blocks"]))
    return f"{len(job.program.blocks)} lists of {points} points, word for word those of galvoplotter"


if __name__ == "__main__":
    run(check, "FOLDER", 1)
