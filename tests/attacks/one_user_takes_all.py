#!/usr/bin/env python3
"""One user takes all that users share, and others still get theirs: tokens, sessions, streams, places, views, playheads, log-ins.

The harm as it was: one operator used up all 4096 tokens, all sessions, all places of those who listen to events or talk by WebSocket,
views and playheads; an attacker's wrong passwords made the owner's right one 429.
"""

import collections
import sys
import threading
import time

from harness import Crowd, House, Report, arguments
from harness.callers import connect
from harness.house import PASSWORD

WALL = {"scene": "plaza", "view": {"eye_m": [0, -14, 5], "target_m": [0, 2, 1]},
        "surface": {"grid": {"columns": 1, "rows": 1, "tile_px": [64, 48], "tile_m": [0.4, 0.3], "gap_m": [0, 0]}}}
SOCKET = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"


def take(house, user, n, path, fields="", address="127.0.0.1"):
    """Opens up to `n` streams, and holds what it gets: sockets and statuses."""
    held, statuses = [], {}
    for _ in range(n):
        try:
            stream = connect(house.port, address, receive_bytes=4096)
            stream.sendall(f"GET {path} HTTP/1.1\r\nhost: localhost\r\nauthorization: Bearer {house.tokens[user]}\r\n{fields}\r\n".encode())
            status = stream.recv(12)[9:12].decode("ascii", "replace")
        except OSError as error:
            status = type(error).__name__
        statuses[status] = statuses.get(status, 0) + 1
        if status in ("200", "101"):
            held.append(stream)
        else:
            stream.close()
    return held, statuses


class Held:
    """Streams of one user, as many as it gets, while others get theirs; it stands in the place of a crowd."""

    def __init__(self, house, report, name, path, fields):
        self.house, self.report, self.name, self.path, self.fields = house, report, name, path, fields

    def __enter__(self):
        self.held, self.met = take(self.house, "olga", 120, self.path, self.fields)
        n, statuses = len(self.held), {}
        for user in ("vera", "root"):
            more, statuses[user] = take(self.house, user, 1, self.path, self.fields)
            self.held += more
        self.report.check(all(met.keys() <= {"200", "101"} for met in statuses.values()),
                          f"{self.name}: one user got {n} of 120 ({self.met}), others get theirs",
                          f"{self.name}: one user got {n} of 120, others {statuses}")
        return self

    def stop(self):
        for stream in self.held:
            stream.close()
        return collections.Counter(self.met)

    def __exit__(self, *_):
        self.stop()


def make(house, report):
    """Makes things until they are refused; then others make theirs."""
    olga, root, otto = house.caller("olga", keep=True), house.caller("root"), house.caller("otto")
    ending = otto.get("/api/v1/session").json().get("name_ending") or ""
    things = {
        "tokens": (100, lambda who, n: who.post("/api/v1/tokens", {"note": str(n)})),
        "views": (100, lambda who, n: who.put_new(f"/api/v1/views/v{n}", {"scene": "plaza"})),
        "walls": (100, lambda who, n: who.put_new(f"/api/v1/walls/w{n}", WALL)),
        "playheads": (40, lambda who, n: who.ask("PUT", f"/api/v1/playheads/p{n}", {"scene": "plaza"})),
    }
    rows = []
    for kind, (n, one) in things.items():
        met = [one(olga, i).status for i in range(n)]
        n_made = sum(status in (200, 201) for status in met)
        other, admin = one(otto, f"a{ending}"), one(root, "admin")
        rows.append((kind, n, n_made, sorted(set(met) - {200, 201}), other.status, admin.status))
        report.check(n_made < n and other.status in (200, 201) and admin.status in (200, 201),
                     f"{kind}: one user made {n_made} of {n}, others make theirs",
                     f"{kind}: one user made {n_made} of {n}; another {other.status} {other.text[:100]}, an admin {admin.status}")
    report.table(["shared", "asked for", "made", "refused", "another user", "an admin"], rows)


def sessions(house, report, n):
    """Log-ins of one user end its own sessions alone."""
    session = house.log_in("root", PASSWORD)
    cookie = session.fields.get("set-cookie", "").split(";")[0]
    met = [house.log_in("olga", PASSWORD, "127.0.0.3").status for _ in range(n)]
    still = house.caller().get("/api/v1/session", {"Cookie": cookie})
    report.check(session.status == 200 and still.json().get("user") == "root",
                 f"{n} log-ins of one user ({sorted(set(met))}) end no session of another",
                 f"the owner's session is gone: {session.status} {still.status} {still.text[:100]}")


def passwords(house, report):
    """Wrong passwords from elsewhere make no owner wait."""
    met = [house.log_in("root", "wrong password", f"127.0.0.{2 + i % 8}").status for i in range(60)]
    begin = time.monotonic()
    answer = house.log_in("root", PASSWORD, "127.0.0.99")
    report.check(answer.status == 200, f"after 60 wrong passwords from eight addresses ({sorted(set(met))}) the owner logs in at once "
                 f"({time.monotonic() - begin:.2f} s)", f"the owner's right password is {answer.status} {answer.text[:150]}")


def main():
    given = arguments(__doc__, 12.0)
    report = Report("One user takes all", given.quick)
    with House(given.daemon) as house:
        report.begin(house)
        make(house, report)
        sessions(house, report, 8 if given.quick else 80)
        passwords(house, report)
        view = "/api/v1/scenes/plaza/view.mjpeg?width=64&height=48&rate=1"
        kinds = {
            "listening to events": ("/api/v1/events/stream", ""),
            "streams of views": (view, ""),
            "WebSockets": ("/api/v1/scenes/plaza/frames?width=64&height=48&rate=1", SOCKET),
        }
        for name, (path, fields) in kinds.items():
            report.attack(house, name, lambda: Held(house, report, name, path, fields), given.seconds)
            time.sleep(1.0)
        # Requests without end, by one user, of whatever is cheap.
        paths = ["/api/v1/cameras", "/api/v1/system", "/api/v1/events", "/api/v1/scenes/plaza", "/api/v1/openapi.json"]
        local = threading.local()

        def flood(idx, crowd):
            if not hasattr(local, "caller"):
                local.caller = house.caller("olga", keep=True)
            crowd.count_answer(local.caller.get(paths[idx % len(paths)]))
        name = "64 connections that ask without end"
        report.attack(house, name, lambda: Crowd(name, 64, flood, 0.02), given.seconds)
        report.end(house)
    return report.done()


if __name__ == "__main__":
    sys.exit(main())
