"""Every list for an RTC board of a job folder, gone through as a caller of the board's library would: coordinates,
settings in force at every mark, and lengths of lists."""

from job import Job, demand, half_up, run

# Laser delays and pulse periods in one us, and the greatest coordinate.
BOARDS = {"rtc4": (1, 8, 0x7FFF), "rtc5": (2, 64, 0x7FFFF), "rtc6": (64, 64, 0x7FFFF)}


def us(text):
    return float(text.removesuffix(" s")) * 1e6


def played(path, block, rtc):
    """The marks of a file, each from point to point or a point with its dwell in 10 us, with the settings that hold there."""
    lines = path.read_text(encoding="ascii").split("\n")
    demand(lines[:3] == ["terrace rtc 1", f"board {rtc['board']}", f"block {block.id}"], f"{path}: its head")
    demand(lines[-1] == "" and lines[-2] == "end", f"{path}: its end")
    settings, at, marks, commands = None, None, [], 0
    for line in lines[3:-1]:
        word, *values = line.split(" ")
        commands += 1
        if word == "list":
            demand(settings is None, f"{path}: a list in a list")
            settings, at, commands = {}, None, 0
        elif word == "end":
            demand(commands <= rtc["list_memory"], f"{path}: a list of {commands} commands")
            settings = None
        elif word == "jump":
            at = tuple(map(int, values))
        elif word == "mark":
            to = tuple(map(int, values))
            marks.append((at, to, dict(settings)))
            at = to
        elif word == "laser_on":
            marks.append((at, int(values[0]), dict(settings)))
        else:
            settings[word] = tuple(map(float, values))
    return marks


def check_block(job, block, entry):
    machine, path = job.manifest["machine"], job.folder / entry["files"]["rtc"]
    rtc, delays = machine["rtc"], machine["delays"]
    delay, period, most = BOARDS[rtc["board"]]
    full = float(machine["laser"]["max_power"].removesuffix(" W"))
    jump = float(machine["scanner"]["jump_speed"].removesuffix(" mm/s"))
    bit = lambda nm: half_up(nm * rtc["bits_per_mm"] / 1e6)
    wanted = []
    for stroke in block.strokes:
        pen = job.manifest["pens"][stroke.pen]
        settings = {
            "laser_delays": tuple(float(half_up(us(delays[k]) * delay)) for k in ("laser_on", "laser_off")),
            "scanner_delays": tuple(-(-us(delays[k]) // 10) for k in ("jump", "mark", "polygon")),
            "jump_speed": (jump * rtc["bits_per_mm"] / 1000,),
            "power": (float(half_up(4095 * pen["power_w"] / full)),),
            "half_period": (float(half_up(500 / pen["frequency_khz"] * period)),),
            "mark_speed": (pen["speed_mm_s"] * rtc["bits_per_mm"] / 1000,),
        }
        if rtc.get("focus_bits_per_mm"):
            settings["focus"] = (float(half_up(entry["focus_shift_mm"] * rtc["focus_bits_per_mm"])),)
        points = [tuple(map(bit, job.controller(p))) for p in stroke.points]
        demand(all(abs(c) <= most for p in points for c in p), f"{path}: a coordinate beyond the board")
        for _ in range(pen["passes"]):
            wanted += [(a, b, settings) for a, b in zip(points, points[1:]) if a != b]
            if len(points) == 1:
                wanted.append((points[0], round(pen["dwell_us"] / 10), settings))
    found = played(path, block, rtc)
    demand(len(found) == len(wanted), f"{path}: {len(found)} marks, program.txt has {len(wanted)}")
    for (a, b, s), (c, d, t) in zip(found, wanted):
        demand((a, b) == (c, d), f"{path}: a mark from {a} to {b}, not from {c} to {d}")
        same = s.keys() == t.keys() and all(abs(u - v) <= 1e-6 * max(1, abs(v)) for k in t for u, v in zip(s[k], t[k]))
        demand(same, f"{path}: settings {s}, not {t}")
    return len(wanted)


def check(folder):
    job = Job(folder)
    marks = sum(check_block(job, b, e) for b, e in zip(job.program.blocks, job.manifest["blocks"]))
    return f"{len(job.program.blocks)} files of {marks} marks in bits"


if __name__ == "__main__":
    run(check, "FOLDER", 1)
