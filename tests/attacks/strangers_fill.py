#!/usr/bin/env python3
"""Strangers fill memory, log and database: long names, long queries, many names, many routes, fields and bodies without end.

The harm as it was: 400 log-ins with a name of 1 MB took 384 MiB, and `DELETE /api/v1/session?...` with 2 KB of query wrote 26,000
rows of the audit log in 30 s.
"""

import json
import sys

from harness import Crowd, House, Report, arguments, ask
from harness.callers import Caller

MOST_MIB, MOST_ROWS, MOST_LOG_KIB, MOST_DATABASE_MIB = 48.0, 64, 64.0, 0.25


def long_names(port):
    def attack(idx, crowd):
        # The whole body is sent at once, whether it is read or not.
        body = json.dumps({"user": "a" * (1 << 20), "password": "b" * 12}).encode()
        head = f"POST /api/v1/session HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\ncontent-length: {len(body)}\r\n\r\n"
        answer = ask(port, head.encode() + body, f"127.0.0.{2 + idx}", 4.0)
        crowd.count(answer[9:12].decode("ascii", "replace") or "closed")
    return attack


def long_queries(port):
    kept = {}

    def attack(idx, crowd):
        caller = kept.setdefault(idx, Caller(port, None, f"127.0.0.{2 + idx}", keep=True))
        crowd.n = getattr(crowd, "n", 0) + 1
        crowd.count_answer(caller.ask("DELETE", f"/api/v1/session?{crowd.n}" + "q" * 2000))
    return attack


def many_names(port):
    def attack(idx, crowd):
        crowd.tried = getattr(crowd, "tried", 0) + 1
        name = f"{crowd.tried}-".ljust(64, "n")
        caller = Caller(port, None, f"127.0.{idx}.{2 + crowd.tried % 200}")
        crowd.count_answer(caller.post("/api/v1/session", {"user": name, "password": "wrong password"}))
    return attack


def many_routes(port):
    methods = ("GET", "PUT", "DELETE", "PATCH", "POST", "OPTIONS", "PROPFIND", "M-SEARCH")

    def attack(idx, crowd):
        crowd.tried = getattr(crowd, "tried", 0) + 1
        caller = Caller(port, None, f"127.0.0.{2 + idx}")
        method = methods[crowd.tried % len(methods)] if crowd.tried % 3 else f"M{crowd.tried}"
        fields = {"X-Forwarded-For": f"10.0.{crowd.tried % 250}.1", "User-Agent": "u" * 4000, "Cookie": "c" * 4000}
        paths = (f"/api/v1/cameras/c{crowd.tried}", f"/{crowd.tried}" + "p" * 1500, f"/api/v1/scenes/s{crowd.tried}/view.jpg",
                 f"/api/v1/views/{crowd.tried}%0a%1b[31mforged", "/api/v1/audit")
        crowd.count_answer(caller.ask(method, paths[crowd.tried % len(paths)], None, fields))
    return attack


def endless_bodies(port):
    piece = b"10000\r\n" + b"z" * 0x10000 + b"\r\n"

    def attack(idx, crowd):
        path = ("/api/v1/session", "/api/v1/scenes/plaza/import", "/api/v1/assets/bomb.png")[idx % 3]
        method = "PUT" if "assets" in path else "POST"
        head = f"{method} {path} HTTP/1.1\r\nhost: localhost\r\ntransfer-encoding: chunked\r\n\r\n".encode()
        answer = ask(port, head + piece * 64, f"127.0.0.{2 + idx}", 2.0)
        crowd.count(answer[9:12].decode("ascii", "replace") or "closed")
    return attack


def main():
    given = arguments(__doc__, 10.0)
    report = Report("Strangers fill memory, log and database", given.quick)
    attacks = {"names of 1 MB": long_names, "queries of 2 KB": long_queries}
    if not given.quick:
        attacks |= {"many names from 2000 addresses": many_names, "many routes, methods and fields": many_routes,
                    "bodies without end": endless_bodies}
    with House(given.daemon) as house:
        report.begin(house)
        began = (house.rss_mib(), house.n_audit_rows(of_strangers=True), house.log_bytes, house.written_by_callers_mib())
        n = 0
        for name, attack in attacks.items():
            n += sum(report.attack(house, name, lambda: Crowd(name, 8, attack(house.port)), given.seconds).values())
        ended = (house.rss_mib(), house.n_audit_rows(of_strangers=True), house.log_bytes, house.written_by_callers_mib())
        more = [end - begin for begin, end in zip(began, ended)]
        report.say(f"{n} requests of strangers: {more[0]:+.0f} MiB, {more[1]:+d} rows, {more[2] / 1024:+.1f} KiB of log, "
                   f"{more[3]:+.3f} MiB of rows that requests write")
        report.check(more[0] <= MOST_MIB, f"memory grew by {more[0]:.0f} MiB (at most {MOST_MIB:.0f})")
        report.check(more[1] <= MOST_ROWS, f"the audit log grew by {more[1]} rows (at most {MOST_ROWS})")
        with house.database() as database:
            n_twice = database.execute("select count(*) - count(distinct action) from audit where user is null").fetchone()[0]
        report.check(n_twice <= 2, f"{n_twice} of a stranger's rows say the same of a route again (one a route in ten minutes)")
        report.check(more[2] / 1024 <= MOST_LOG_KIB, f"the log grew by {more[2] / 1024:.1f} KiB (at most {MOST_LOG_KIB:.0f})")
        report.check(more[3] <= MOST_DATABASE_MIB, f"what requests can write in the database grew by {more[3]:.3f} MiB (at most {MOST_DATABASE_MIB})")
        log = house.log()
        report.check("\x1b[31mforged" not in log and "\nforged" not in log, "no stranger wrote a line or a colour into the log")
        report.end(house)
    return report.done()


if __name__ == "__main__":
    sys.exit(main())
