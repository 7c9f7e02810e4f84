"""GRBL 1.1 on a pseudo-terminal: a stage with three axes that answers, moves and fails as the firmware does.

Prints the path of the terminal and runs until its standard input ends. Modelled after the firmware's documentation and
sources: one `ok` or `error:N` for each line, the receive buffer of 128 bytes and lines of 79 characters, the planner,
real-time commands (`?`, `!`, `~`, 0x18, 0x84), status reports with MPos or WPos and with WCO in every tenth, the work
offsets G54 and G55, G92, a tool length, touches (G38.2) of what `--trips` names, alarms that lock, the state after a power-up with homing, soft limits, and $$, $N=VALUE, $I, $G, $#, $H, $X. Not modelled:
acceleration, arcs, jogging, tools, parking.

Ends with 3 if a sender overruns the receive buffer. `--fault KIND@N` fails at move N, counted from 1; given several
times, each fault has its own terminal and its own log, FILE.0 and so on:

  alarm, door, hold, reset   in mid-move: hard limit, door opened, feed hold pressed, power cycled
  silent                     sends nothing more, from then on (0: from the start); it still moves
  drop-ok                    the answer to the line is lost
  drop-end, drop-digit       the line loses its end, or the first digit of its first number
  stuck                      the move never ends
  hang-up                    the terminal is closed
"""

import argparse
import errno
import math
import os
import re
import select
import sys
import time
import tty

RECEIVE_BUFFER = 128
LONGEST_LINE = 79
PLANNER_BLOCKS = 15
HOLD_S = 0.02
SETTINGS = {
    0: 10, 1: 25, 2: 0, 3: 0, 4: 0, 5: 0, 6: 0, 10: 1, 11: 0.010, 12: 0.002, 13: 0, 20: 0, 21: 1, 22: 1, 23: 0,
    24: 25.0, 25: 500.0, 26: 250, 27: 1.0, 30: 1000, 31: 0, 32: 0, 100: 400.0, 101: 400.0, 102: 800.0, 110: 60000.0,
    111: 60000.0, 112: 30000.0, 120: 500.0, 121: 500.0, 122: 500.0, 130: 400.0, 131: 400.0, 132: 300.0,
}
WHOLE = {0, 1, 2, 3, 4, 5, 6, 10, 13, 20, 21, 22, 23, 26, 32}


class Refused(Exception):
    """A line that is answered with error:N."""


class PowerCycle(Exception):
    """The board starts anew."""


class Grbl:
    def __init__(self, master, options):
        self.master, self.options = master, options
        self.settings = SETTINGS | dict(options.set)
        self.is_used = self.is_door_open = False
        self.work = {"G54": list(options.wco), "G55": [0.0] * 3}
        self.steps = [0, 0, 0]
        self.moves = 0
        self.log_file = open(options.log, "a", buffering=1) if options.log else None
        self.power_on(options.start == "alarm")

    def power_on(self, is_locked):
        self.state = "Alarm" if is_locked and self.settings[22] else "Idle"
        self.reset_state()
        if self.options.start != "homed":
            self.greet()

    def reset_state(self):
        """What a reset clears; the position and an alarm stay."""
        self.received, self.blocks, self.now_moving = b"", [], None
        self.is_dead, self.held_until, self.waiting = False, None, None
        self.modes = {"motion": "G0", "units": "G21", "distance": "G90", "spindle": "M5"}
        self.reports = 0
        self.active, self.tool = "G54", 0.0
        self.g92 = [0.0] * 3 if self.is_used else list(self.options.g92)
        self.is_used = True
        self.shift()

    def shift(self):
        """Where the zero of positions lies now: work offset, G92 and tool length."""
        self.offset = [a + b for a, b in zip(self.work[self.active], self.g92)]
        self.offset[2] += self.tool

    # --- Out

    def log(self, text):
        if self.log_file:
            self.log_file.write(f"{time.time():.4f} {text}\n")

    def say(self, text):
        kind, number = self.options.fault
        if kind != "silent" or self.moves < number:
            os.write(self.master, (text + "\r\n").encode())

    def greet(self):
        self.say("\r\nGrbl 1.1h ['$' for help]")
        if self.state == "Alarm":
            self.say("[MSG:'$H'|'$X' to unlock]")

    def position(self):
        """Steps at this moment."""
        if self.now_moving is None:
            return self.steps
        start, end, begin, duration = self.now_moving
        share = min(1.0, (time.monotonic() - begin) / duration)
        return [round(a + (b - a) * share) for a, b in zip(start, end)]

    def report(self):
        state = self.state
        if state == "Hold":
            state = "Hold:1" if self.held_until else "Hold:0"
        elif state == "Door":
            state = "Door:2" if self.held_until else "Door:1"
        machine = [s / self.settings[100 + k] for k, s in enumerate(self.position())]
        shown, kind = machine, "MPos"
        if not self.settings[10] & 1:
            shown, kind = [m - o for m, o in zip(machine, self.offset)], "WPos"
        fields = [state, f"{kind}:" + ",".join(f"{v:.3f}" for v in shown)]
        if self.settings[10] & 2:
            fields.append(f"Bf:{PLANNER_BLOCKS - len(self.blocks)},{RECEIVE_BUFFER - len(self.received)}")
        fields.append("FS:%d,0" % (self.settings[110] if self.now_moving else 0))
        if self.reports % 10 == 0:
            fields.append("WCO:" + ",".join(f"{o:.3f}" for o in self.offset))
        elif self.reports % 10 == 1:
            fields.append("Ov:100,100,100")
            if self.modes["spindle"] != "M5":
                fields.append("A:" + {"M3": "S", "M4": "C"}[self.modes["spindle"]])
        self.reports += 1
        self.say("<" + "|".join(fields) + ">")

    # --- In

    def take(self, data):
        for byte in data:
            if byte == 0x18:
                self.reset()
            elif byte == ord("?"):
                # A critical alarm answers nothing but a reset.
                if not self.is_dead:
                    self.report()
            elif byte == ord("!"):
                self.hold("Hold")
            elif byte == ord("~"):
                self.resume()
            elif byte == 0x84:
                self.hold("Door")
            elif byte < 0x80:
                self.received += bytes([byte])
                if len(self.received) > RECEIVE_BUFFER:
                    self.log("overrun")
                    print("overrun of the receive buffer", file=sys.stderr)
                    sys.exit(3)

    def hold(self, state):
        if self.state in ("Alarm", "Home") or self.is_dead:
            return
        if state == "Door":
            self.say("[MSG:Check Door]")
            self.modes["spindle"] = "M5"
        elif self.state == "Door":
            return
        self.held_until = time.monotonic() + HOLD_S if self.now_moving else None
        self.state = state

    def resume(self):
        if self.state == "Hold" and self.held_until is None:
            self.state = "Idle"
            if self.blocks:
                self.start()

    def reset(self):
        self.log("reset")
        is_lost = self.state in ("Run", "Home") or self.held_until is not None
        self.steps = self.position()
        if is_lost:
            self.state = "Alarm"
            self.say("ALARM:3")
        elif self.state != "Alarm":
            self.state = "Door" if self.is_door_open else "Idle"
        self.reset_state()
        self.greet()

    def alarm(self, number, is_critical):
        self.steps, self.now_moving, self.blocks = self.position(), None, []
        self.state, self.is_dead = "Alarm", is_critical
        self.modes["spindle"] = "M5"
        self.log(f"alarm {number}")
        self.say(f"ALARM:{number}")
        if is_critical:
            self.say("[MSG:Reset to continue]")

    # --- Motion

    def start(self):
        """Begins the oldest block of the planner."""
        end = self.blocks[0]
        way = [abs(b - a) / self.settings[100 + k] / (self.settings[110 + k] / 60)
               for k, (a, b) in enumerate(zip(self.steps, end))]
        duration = max([0.001, *way])
        if self.fault() == "stuck":
            duration = 1e9
        self.now_moving = (self.steps, end, time.monotonic(), duration)
        self.state = "Run"

    def fault(self):
        kind, number = self.options.fault
        is_now = self.moves == number
        return kind if is_now else None

    def advance(self):
        """What time has done."""
        if self.held_until and time.monotonic() >= self.held_until:
            self.steps, self.held_until, self.now_moving = self.position(), None, None
        if self.state == "Idle" and self.blocks:
            self.start()
        if self.state != "Run":
            return
        start, end, begin, duration = self.now_moving
        elapsed = time.monotonic() - begin
        if elapsed > duration / 2 and self.fault() in ("alarm", "door", "hold", "reset"):
            kind, self.options.fault = self.fault(), ("", 0)
            if kind == "alarm":
                self.alarm(1, True)
            elif kind == "reset":
                raise PowerCycle
            else:
                self.is_door_open = kind == "door"
                self.hold(kind.capitalize())
            return
        if elapsed >= duration:
            self.steps, self.now_moving = end, None
            self.blocks.pop(0)
            self.state = "Idle"
            self.log("machine " + " ".join(f"{s / self.settings[100 + k]:.4f}" for k, s in enumerate(end)))
            self.log("at " + " ".join(f"{s / self.settings[100 + k] - self.offset[k]:.4f}" for k, s in enumerate(end)))

    # --- Lines

    def execute(self):
        """Executes one received line, if there is one and the planner and the state let it pass."""
        if self.is_dead or self.state in ("Hold", "Door") or self.waiting and (self.blocks or self.now_moving):
            return False
        if self.waiting:
            self.waiting = None
            self.say("ok")
            return True
        if b"\n" not in self.received or len(self.blocks) >= PLANNER_BLOCKS:
            return False
        if self.received.startswith(b"G38") and (self.blocks or self.now_moving):
            return False
        raw, self.received = self.received.split(b"\n", 1)
        text = re.sub(r"\([^)]*\)|;.*|[\s/]", "", raw.decode("ascii", "replace")).upper()
        self.log("line " + text)
        try:
            if len(text) > LONGEST_LINE:
                raise Refused(11)
            if text.startswith("$"):
                self.command(text)
            elif text:
                if self.state == "Alarm":
                    raise Refused(9)
                self.code(text)
            if not self.waiting and not self.is_dead and self.fault() != "drop-ok":
                self.say("ok")
        except Refused as refused:
            self.say(f"error:{refused}")
        return True

    def command(self, text):
        if text == "$$":
            if self.state not in ("Idle", "Alarm"):
                raise Refused(8)
            for key, value in sorted(self.settings.items()):
                self.say(f"${key}={value:d}" if key in WHOLE else f"${key}={value:.3f}")
        elif text == "$I":
            self.say(f"[VER:1.1h.20190825:{self.options.name}]")
            self.say(f"[OPT:V,{PLANNER_BLOCKS},{RECEIVE_BUFFER}]")
        elif text == "$G":
            motion, units, distance, spindle = (self.modes[k] for k in ("motion", "units", "distance", "spindle"))
            self.say(f"[GC:{motion} G54 G17 {units} {distance} G94 {spindle} M9 T0 F0 S0]")
        elif text == "$#":
            for name, values in (*self.work.items(), ("G92", self.g92)):
                self.say(f"[{name}:" + ",".join(f"{v:.3f}" for v in values) + "]")
            self.say(f"[TLO:{self.tool:.3f}]")
        elif text == "$X":
            if self.state == "Alarm":
                self.say("[MSG:Caution: Unlocked]")
                self.state = "Idle"
        elif text == "$H":
            if not self.settings[22]:
                raise Refused(5)
            self.steps = [round(-self.settings[27] * self.settings[100 + k]) for k in range(3)]
            self.state = "Idle"
        elif re.fullmatch(r"\$[0-9]+=[0-9.]+", text):
            if self.state not in ("Idle", "Alarm"):
                raise Refused(8)
            key, value = setting(text[1:])
            self.settings[key] = value
        else:
            raise Refused(3)

    def code(self, text):
        words = re.findall(r"([A-Z])([-+]?[0-9]*\.?[0-9]*)", text)
        if "".join(a + b for a, b in words) != text:
            raise Refused(1)
        if any(not any(c.isdigit() for c in value) for _, value in words):
            raise Refused(2)
        axes, seen, others, given = {}, set(), [], {}
        groups = {"G0": "motion", "G38.2": "motion", "G1": "motion", "G80": "motion", "G20": "units", "G21": "units", "G90": "distance",
                  "G91": "distance", "M3": "spindle", "M4": "spindle", "M5": "spindle"}
        for letter, value in words:
            number = float(value)
            if letter in "GM":
                name = letter + f"{number:g}"
                if name in groups:
                    if groups[name] in seen:
                        raise Refused(21)
                    seen.add(groups[name])
                    self.modes[groups[name]] = name
                elif name in ("G10", "G43.1", "G49", "G54", "G55", "G92", "G92.1"):
                    others.append(name)
                elif name not in ("G4", "G17", "G40", "G94", "M0", "M2", "M9"):
                    raise Refused(20)
            elif letter in "XYZ":
                if letter in axes:
                    raise Refused(25)
                axes["XYZ".index(letter)] = number * (25.4 if self.modes["units"] == "G20" else 1)
            elif letter in "FLNPS":
                given[letter] = number
            else:
                raise Refused(20)
        # Of these one stands in a line with axes or without, and is no move.
        if self.set_zero(others, axes, given):
            return
        if axes and self.modes["motion"] == "G38.2":
            self.touch(axes, given)
        elif axes:
            if self.modes["motion"] == "G80":
                raise Refused(31)
            self.move(axes)
        elif "spindle" in seen:
            # Synchronises: it is answered when all motion has ended.
            self.waiting = True
            self.log(self.modes["spindle"])

    def set_zero(self, names, axes, given):
        """Sets work offset, G92 and tool length; whether that takes the axes of the line."""
        takes = [name for name in names if name in ("G10", "G43.1", "G49", "G92")]
        if len(takes) > 1 or "G49" in takes and axes:
            raise Refused(24)
        for name in names:
            now = [s / self.settings[100 + k] for k, s in enumerate(self.blocks[-1] if self.blocks else self.steps)]
            if name == "G10":
                if given.get("L") != 2 or given.get("P") not in (1, 2):
                    raise Refused(20)
                table = self.work["G54" if given["P"] == 1 else "G55"]
                for k, mm in axes.items():
                    table[k] = mm
            elif name == "G43.1":
                self.tool = axes.get(2, 0.0)
            elif name == "G49":
                self.tool = 0.0
            elif name == "G92.1":
                self.g92 = [0.0] * 3
            elif name == "G92":
                for k, mm in axes.items():
                    self.g92[k] = now[k] - self.work[self.active][k] - (self.tool if k == 2 else 0.0) - mm
            else:
                self.active = name
            self.shift()
        return bool(takes)

    def touch(self, axes, given):
        """Down until the tip touches what lies there; at once, since only where it ends matters."""
        if not given.get("F") or list(axes) != [2]:
            raise Refused(22)
        scale = self.settings[102]
        x, y, z = (s / self.settings[100 + k] - self.offset[k] for k, s in enumerate(self.steps))
        trips = [t[2] for t in self.options.trips if abs(t[0] - x) < 0.02 and abs(t[1] - y) < 0.02]
        trip = max(trips, default=float("-inf"))
        if trip >= z:
            self.alarm(4, False)
            return
        is_met = trip >= axes[2]
        self.steps[2] = math.floor(((trip if is_met else axes[2]) + self.offset[2]) * scale)
        self.log("touch " + " ".join(f"{s / self.settings[100 + k]:.4f}" for k, s in enumerate(self.steps)))
        machine = ",".join(f"{s / self.settings[100 + k]:.3f}" for k, s in enumerate(self.steps))
        self.say(f"[PRB:{machine}:{int(is_met)}]")
        if not is_met:
            self.alarm(5, False)

    def move(self, axes):
        self.moves += 1
        target = list(self.blocks[-1] if self.blocks else self.steps)
        for k, mm in axes.items():
            scale = self.settings[100 + k]
            base = target[k] / scale if self.modes["distance"] == "G91" else self.offset[k]
            target[k] = round((base + mm) * scale)
            if self.settings[20] and not -self.settings[130 + k] <= target[k] / scale <= 0:
                self.alarm(2, True)
                return
        if self.fault() == "hang-up":
            sys.exit(0)
        self.blocks.append(target)

    def damage(self, data):
        """Bytes as the line lets them through."""
        kind, number = self.options.fault
        if kind in ("drop-end", "drop-digit") and self.moves + 1 == number and b"X" in data:
            self.options.fault = ("", 0)
            return data.replace(b"\n", b"", 1) if kind == "drop-end" else re.sub(rb"(X-?)[0-9]", rb"\1", data, count=1)
        return data


def run(master, options):
    grbl = Grbl(master, options)
    while True:
        wait = 0.003 if grbl.blocks or grbl.held_until else 0.05
        ready, _, _ = select.select([master, sys.stdin], [], [], wait)
        if sys.stdin in ready and not os.read(sys.stdin.fileno(), 4096):
            return
        try:
            if master in ready:
                try:
                    grbl.take(grbl.damage(os.read(master, 4096)))
                except OSError as e:
                    if e.errno != errno.EIO:
                        raise
                    # Nobody has the terminal open.
                    time.sleep(0.005)
            grbl.advance()
            while grbl.execute():
                grbl.advance()
        except PowerCycle:
            grbl.steps = [0, 0, 0]
            options.start = "alarm"
            grbl.power_on(True)


def fault(text):
    kind, number = text.split("@")
    return kind, int(number)


def trips(path):
    return [[float(v) for v in row.split()] for row in open(path)]


def setting(text):
    key, value = text.split("=")
    return int(key), int(value) if int(key) in WHOLE else float(value)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--start", choices=["homed", "alarm"], default="homed", help="as found when it is opened")
    parser.add_argument("--name", default="", help="the name in $I")
    parser.add_argument("--wco", type=lambda t: [float(v) for v in t.split(",")], default=[0.0] * 3, metavar="X,Y,Z",
                        help="offset of G54, mm")
    parser.add_argument("--g92", type=lambda t: [float(v) for v in t.split(",")], default=[0.0] * 3, metavar="X,Y,Z",
                        help="offset of G92 until a reset, mm")
    parser.add_argument("--set", type=setting, action="append", default=[], metavar="N=VALUE", help="a setting of $$")
    parser.add_argument("--fault", type=fault, action="append", default=[], metavar="KIND@N")
    parser.add_argument("--trips", type=trips, default=[], metavar="FILE",
                        help="where a touch meets something, row by row: x, y and z of the axes from the zero of G54, mm")
    parser.add_argument("--log", help="appends the lines, moves and resets to this file, each with its time in s since 1970")
    options = parser.parse_args()
    faults = options.fault or [("", 0)]
    for number, options.fault in enumerate(faults):
        master, slave = os.openpty()
        tty.setraw(slave)
        print(os.ttyname(slave), flush=True)
        os.close(slave)
        if len(faults) > 1:
            if os.fork() > 0:
                os.close(master)
                continue
            options.log = options.log and f"{options.log}.{number}"
        return run(master, options)
    for _ in faults:
        os.wait()


if __name__ == "__main__":
    main()
