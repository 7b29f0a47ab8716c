#!/usr/bin/env python3
"""Strangers hold every place: bodies and heads that never come, and connections that ask for nothing.

The harm as it was: 64 sockets that announce a log-in and never send it left nobody else an answer. Sockets come from one address,
and from twenty (127.0.0.2 to 127.0.0.21). The owner asks by a token over new connections, and logs in from an address of its own.
"""

import socket
import sys
import time

from harness import Crowd, House, Report, arguments
from harness.callers import connect
from harness.house import PASSWORD

BODY = b"POST /api/v1/session HTTP/1.1\r\nhost: localhost\r\ncontent-length: 60\r\n\r\n{\"user\""
CHUNKED = b"POST /api/v1/session HTTP/1.1\r\nhost: localhost\r\ntransfer-encoding: chunked\r\n\r\n1\r\n{\r\n"
HEAD = b"GET /api/v1/session HTTP/1.1\r\nhost: localhost\r\nx-slow: "


def held(port, request, addresses, drip=None):
    """An attack of one socket after the other, each held until the daemon closes it; `drip` is sent twice a second."""
    def attack(idx, crowd):
        with connect(port, addresses[idx % len(addresses)]) as stream:
            stream.sendall(request)
            read = b""
            while not crowd.over.is_set():
                stream.settimeout(0.5)
                try:
                    piece = stream.recv(4096)
                    if not piece:
                        break
                    read += piece
                    crowd.count(read[9:12].decode("ascii", "replace"))
                    # One that was refused comes again, as an attacker would.
                    break
                except socket.timeout:
                    if drip:
                        stream.sendall(drip)
        crowd.over.wait(0.05)
    return attack


def main():
    given = arguments(__doc__, 12.0)
    report = Report("Strangers hold places", given.quick)
    one, many = ["127.0.0.2"], [f"127.0.0.{last}" for last in range(2, 22)]
    attacks = [("64 bodies that never come, one address", 64, BODY, one, None)]
    if not given.quick:
        attacks += [
            ("200 bodies that come by a byte, one address", 200, CHUNKED, one, b"1\r\n \r\n"),
            ("300 heads that come by a byte, 20 addresses", 300, HEAD, many, b"x"),
            ("300 connections that ask for nothing, 20 addresses", 300, b"", many, None),
            ("64 bodies that never come, 20 addresses", 64, BODY, many, None),
        ]
    with House(given.daemon) as house:
        report.begin(house)
        for name, n, request, addresses, drip in attacks:
            met = []

            def log_in(end, met=met):
                while time.monotonic() < end:
                    met.append(house.log_in("root", PASSWORD, "127.0.0.99").status)
                    time.sleep(1.0)
            report.attack(house, name, lambda: Crowd(name, n, held(house.port, request, addresses, drip)), given.seconds, log_in)
            answered = sum(status == 200 for status in met)
            text = f"{name}: {answered} of {len(met)} of the owner's log-ins were answered (without and beside)"
            if request == BODY and len(addresses) > 1:
                # docs/decisions/0034-trust.md: strangers of six addresses and more can take all of the strangers' places.
                report.limit(text)
            else:
                report.check(answered == len(met), text)
        report.end(house)
    return report.done()


if __name__ == "__main__":
    sys.exit(main())
