#!/usr/bin/env python3
"""Users who ask for much and take little: streams of views, events, pictures, exports and WebSockets that nobody reads.

Each reader has a small buffer and takes a byte now and then. Memory of the daemon stays, and others are answered.
"""

import base64
import os
import struct
import sys
import time

from harness import Crowd, House, Report, arguments
from harness.callers import connect

MOST_MIB = 160.0
SOCKET = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n"


def reader(house, user, path, fields="", then=None):
    """Returns an attack that asks, and takes a byte ten times a second; `then` is sent again and again besides."""
    def attack(idx, crowd):
        with connect(house.port, receive_bytes=2048) as stream:
            key = base64.b64encode(os.urandom(16)).decode()
            stream.sendall((f"GET {path.format(idx=idx)} HTTP/1.1\r\nhost: localhost\r\nauthorization: Bearer {house.tokens[user]}\r\n"
                            f"{fields.format(key=key)}\r\n").encode())
            status = stream.recv(12)[9:12].decode("ascii", "replace")
            crowd.count(status)
            if status not in ("200", "101"):
                crowd.over.wait(0.5)
                return
            end = time.monotonic() + 60
            stream.settimeout(0.5)
            while not crowd.over.is_set() and time.monotonic() < end:
                try:
                    if then:
                        stream.sendall(then)
                    if not stream.recv(1):
                        crowd.count("closed")
                        return
                except TimeoutError:
                    continue
                crowd.over.wait(0.1)
    return attack


def frame(opcode, body, is_last=True):
    """A masked message of a WebSocket's client."""
    length = len(body)
    head = bytes([(0x80 if is_last else 0) | opcode])
    if length < 126:
        head += bytes([0x80 | length])
    elif length < 1 << 16:
        head += bytes([0x80 | 126]) + struct.pack(">H", length)
    else:
        head += bytes([0x80 | 127]) + struct.pack(">Q", length)
    return head + b"\0\0\0\0" + body


def main():
    given = arguments(__doc__, 12.0)
    report = Report("Slow readers", given.quick)
    view = "/api/v1/scenes/plaza/view.mjpeg?width=1280&height=720&rate=10&entities=none"
    picture = "/api/v1/scenes/plaza/view.png?width=1920&height=1080&entities=none&eye=-9,-1{idx},6&target=0,0,1"
    frames = "/api/v1/scenes/plaza/frames?width=320&height=180&rate=10"
    with House(given.daemon) as house:
        attacks = {
            "72 streams of views": (72, reader(house, "olga", view)),
            "72 listeners to events": (72, reader(house, "olga", "/api/v1/events/stream")),
            "72 pictures of 1920 x 1080": (72, reader(house, "olga", picture)),
            "72 WebSockets": (72, reader(house, "olga", frames, SOCKET)),
            "72 WebSockets that flood pings": (72, reader(house, "olga", frames, SOCKET, frame(9, b"p" * 125) * 200)),
            "72 WebSockets whose message never ends": (72, reader(house, "olga", frames, SOCKET, frame(2, b"m" * 60000, False))),
            "72 copies of the contract": (72, reader(house, "olga", "/api/v1/openapi.json")),
        }
        if given.quick:
            attacks = {name: attacks[name] for name in ("72 streams of views",)}
        report.begin(house)
        began = house.rss_mib()
        for name, (n, attack) in attacks.items():
            report.attack(house, name, lambda: Crowd(name, n, attack), given.seconds)
            more = float(report.stages[name]["daemon MiB"]) - began
            report.check(more <= MOST_MIB, f"{name}: memory is {more:+.0f} MiB (at most {MOST_MIB:.0f})")
        report.end(house)
    return report.done()


if __name__ == "__main__":
    sys.exit(main())
