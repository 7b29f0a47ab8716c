#!/usr/bin/env python3
"""One user fills neither database nor log: refused requests, requests that fail, tokens made and removed again, long targets.

Strangers are bounded (strangers_fill.py); here a viewer and an operator ask as fast as they are answered.
"""

import sys
import threading

from harness import Crowd, House, Report, arguments

# Rows of the audit log that one user may cause whatever it asks, and what the log of the daemon may grow by.
MOST_ROWS, MOST_LOG_KIB = 64, 256.0
LOCAL = threading.local()


def asks(house, user, method, path, body=None):
    def attack(idx, crowd):
        if not hasattr(LOCAL, "caller"):
            LOCAL.caller, LOCAL.n = house.caller(user, keep=True), idx * 1_000_000
        LOCAL.n += 1
        crowd.count_answer(LOCAL.caller.ask(method, path.format(n=LOCAL.n), body))
    return attack


def tokens(house):
    def attack(_idx, crowd):
        if not hasattr(LOCAL, "caller"):
            LOCAL.caller = house.caller("vera", keep=True)
        made = LOCAL.caller.post("/api/v1/tokens", {"note": "n" * 200})
        crowd.count_answer(made)
        if made.status == 201:
            crowd.count_answer(LOCAL.caller.delete(f"/api/v1/tokens/{made.json()['id']}"))
    return attack


def main():
    given = arguments(__doc__, 10.0)
    report = Report("One user fills database and log", given.quick)
    with House(given.daemon) as house:
        attacks = {
            "a viewer's exports, refused": asks(house, "vera", "POST", "/api/v1/exports", {}),
            "a viewer's changes of 2 KB paths, refused": asks(house, "vera", "DELETE", "/api/v1/views/v{n}?" + "q" * 1900),
            "a viewer's looks, another each time": asks(house, "vera", "GET", "/api/v1/cameras/west/frame.jpg?t={n}000000000"),
            "a viewer's tokens, made and removed": tokens(house),
            "an operator's calibrations, at fault": asks(house, "olga", "POST", "/api/v1/calibrations/solve", {}),
        }
        if given.quick:
            attacks = {name: attacks[name] for name in list(attacks)[:2]}
        report.begin(house)
        rows = []
        for name, attack in attacks.items():
            began = (house.n_audit_rows(), house.log_bytes, house.database_mib())
            counts = report.attack(house, name, lambda: Crowd(name, 8, attack), given.seconds)
            n = sum(counts.values())
            more = [end - begin for begin, end in zip(began, (house.n_audit_rows(), house.log_bytes, house.database_mib()))]
            rows.append((name, n, more[0], f"{more[1] / 1024:.0f}", f"{more[2]:.1f}"))
            report.check(more[0] <= max(MOST_ROWS, n / 10), f"{name}: {n} requests wrote {more[0]} rows of the audit log (at most a tenth)")
            report.check(more[1] / 1024 <= MOST_LOG_KIB, f"{name}: {more[1] / 1024:.0f} KiB of log (at most {MOST_LOG_KIB:.0f})")
        report.table(["attack", "requests", "rows", "log KiB", "database MiB"], rows)
        report.end(house)
    return report.done()


if __name__ == "__main__":
    sys.exit(main())
