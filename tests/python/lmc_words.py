"""Prints what galvoplotter's controller sends to a BJJCZ card, one packet a line in hex, an empty line after each
order.

  lmc_words.py fiber|co2 ORDER...

Orders: `open` and `open=FILE.cor` (connecting), `mark=FILE.lmc` (a list, with the controller's own switching and its
own order of packets), `light=FILE.lmc` (the points of a list with the pilot laser), `abort`. Requests for the version,
with which it polls, are left out."""

import struct
import sys

from galvo.consts import (GetVersion, listEndOfList, listJumpDelay, listJumpTo, listMarkSpeed, listMarkTo)
from galvo.controller import GalvoController
from galvo.mock_connection import MockConnection

# One unit of the card per mm and ms: speeds are units per ms in mm/s.
SCALE = 1000


def commands(path):
    with open(path, "rb") as f:
        data = f.read()
    words = [struct.unpack_from("<6H", data, at) for at in range(0, len(data), 12)]
    while words and words[-1][0] == listEndOfList:
        words.pop()
    return words


def mark(controller, path):
    # The settings are in the list.
    for name in ("set", "list_ready", "list_delay_time", "list_write_port"):
        setattr(controller, name, lambda *args, **kwargs: None)
    controller.marking_configuration()
    for words in commands(path):
        controller._list_write(*words)
    controller.initial_configuration()


def light(controller, path):
    controller.lighting_configuration()
    delay = None
    for command, x, y, *_ in commands(path):
        if command == listMarkSpeed:
            controller.light_speed = x
            controller.set_travel_speed(x)
        elif command == listJumpDelay:
            delay = x
            controller.set_delay_jump(x)
        elif command in (listJumpTo, listMarkTo):
            controller.light(x, y, long=delay, short=delay)
    controller.initial_configuration()
    controller.light_off()


def words(source, order):
    what, _, path = order.partition("=")
    sent = []
    MockConnection.write = lambda self, index=0, packet=None: sent.append(bytes(packet))
    controller = GalvoController(mock=True, galvos_per_mm=SCALE, cor_file=path if what == "open" and path else None)
    controller.source = source
    controller.connect_if_needed()
    if what != "open":
        sent.clear()
        {"mark": mark, "light": light, "abort": lambda c, _: c.abort()}[what](controller, path)
    return [packet.hex() for packet in sent if packet[:2] != struct.pack("<H", GetVersion)]


def main():
    source, *orders = sys.argv[1:]
    MockConnection.read = lambda self, index=0: struct.pack("<4H", 0, 0, 0, 0x20)
    for order in orders:
        print("\n".join(words(source, order)), end="\n\n")


if __name__ == "__main__":
    main()
