#!/usr/bin/env python3
"""Strangers hold every place: bodies and heads that never come, and connections that ask for nothing.

The harm as it was: 64 sockets that announce a log-in and never send it left nobody else an answer. Sockets come from one address,
and from twenty (127.0.0.2 to 127.0.0.21). The owner asks by a token over new connections, and logs in from an address of its own.
"""

import socket
import sys
import time

from harness import Crowd, House, Report, Victim, arguments
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
        stages, figures = {"alone": Victim.measure(house, given.seconds)}, {"before": house.figures()}
        log_ins = {}
        for name, n, request, addresses, drip in attacks:
            with Crowd(name, n, held(house.port, request, addresses, drip)) as crowd:
                time.sleep(1.5)
                victim = Victim.begin(house, given.seconds, len(stages) * 1000)
                good, end = [], time.monotonic() + given.seconds
                while time.monotonic() < end:
                    answer = house.log_in("root", PASSWORD, "127.0.0.99")
                    good.append(answer.status if answer.status else answer.why)
                    time.sleep(1.0)
                stages[name] = Victim.finish(victim)
                figures[name] = house.figures()
                log_ins[name] = (sum(found == 200 for found in good), len(good))
                crowd.stop()
            report.counts(f"{name}, attackers met", crowd.counts)
        stages["alone, after"] = Victim.measure(house, given.seconds, 3000)
        figures["after"] = house.figures()
        report.victims(stages)
        report.figures(figures)
        before = stages["alone"].with_more(stages["alone, after"])
        for name, _, request, addresses, _ in attacks:
            report.judge_victim(before, stages[name], name)
            answered, n = log_ins[name]
            text = f"{name}: {answered} of {n} of the owner's log-ins were answered"
            if request == BODY and len(addresses) > 1:
                # docs/decisions/0034-trust.md: strangers of six addresses and more can take all of the strangers' places.
                report.limit(text)
            else:
                report.check(answered == n, text)
        report.alive(house)
    return report.done()


if __name__ == "__main__":
    sys.exit(main())
