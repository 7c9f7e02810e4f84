"""Prints what galvoplotter's controller sends to a BJJCZ card, one packet a line in hex.

  lmc_words.py open fiber|co2 [FILE.cor]   connecting
  lmc_words.py mark fiber|co2 FILE.lmc     a list, with the controller's own switching and its own order of packets
  lmc_words.py light fiber|co2 FILE.lmc    the points of a list with the pilot laser
  lmc_words.py abort fiber|co2             an abort

Requests for the version, with which it polls, are left out of all but the first."""

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


def main():
    what, source, *rest = sys.argv[1:]
    sent = []
    MockConnection.read = lambda self, index=0: struct.pack("<4H", 0, 0, 0, 0x20)
    MockConnection.write = lambda self, index=0, packet=None: sent.append(bytes(packet))
    controller = GalvoController(mock=True, galvos_per_mm=SCALE, cor_file=rest[0] if what == "open" and rest else None)
    controller.source = source
    controller.connect_if_needed()
    if what != "open":
        sent.clear()
        {"mark": mark, "light": light, "abort": GalvoController.abort}[what](controller, *rest)
    for packet in sent:
        if what == "open" or packet[:2] != struct.pack("<H", GetVersion):
            print(packet.hex())


if __name__ == "__main__":
    main()
