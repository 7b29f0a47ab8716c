#!/usr/bin/env python3
"""Several users together take what is shared, and the admin still gets its own: listeners, streams, bodies on their way, requests.

Shares are fair to one greedy user; four users who each take three times what the others leave take all but nothing.
"""

import sys
import threading
import time

from harness import Crowd, House, Report, arguments
from harness.callers import connect
from one_user_takes_all import SOCKET, take

USERS = [f"u{idx}" for idx in range(6)]
LOCAL = threading.local()


def slow_bodies(house):
    """Bodies of users that come by a byte a second."""
    def attack(idx, crowd):
        with connect(house.port) as stream:
            stream.sendall(f"POST /api/v1/tokens HTTP/1.1\r\nhost: localhost\r\nauthorization: Bearer {house.tokens[USERS[idx % len(USERS)]]}\r\n"
                           "content-length: 600\r\n\r\n{".encode())
            stream.settimeout(1.0)
            while not crowd.over.is_set():
                try:
                    crowd.count(stream.recv(4096)[9:12].decode("ascii", "replace") or "closed")
                    crowd.over.wait(0.05)
                    return
                except TimeoutError:
                    stream.sendall(b" ")
    return attack


def strips(house, begun):
    """Requests that wait for their turn while they hold a place."""
    def attack(idx, crowd):
        if not hasattr(LOCAL, "caller"):
            LOCAL.caller, LOCAL.n = house.caller(USERS[idx % len(USERS)]), idx
        LOCAL.n += 1
        until = time.time_ns() - 10**9
        path = f"/api/v1/cameras/west/strip.jpg?from={max(begun, until - 60 * 10**9)}&to={until}&count=48&height={100 + LOCAL.n % 200}"
        crowd.count_answer(LOCAL.caller.get(path))
    return attack


def main():
    given = arguments(__doc__, 10.0)
    report = Report("Users together", given.quick)
    with House(given.daemon) as house:
        root, begun = house.caller("root"), time.time_ns()
        for user in USERS:
            root.put_new(f"/api/v1/users/{user}", {"role": "viewer", "cameras": {"west": ["live", "history"]}})
            house.tokens[user] = root.post("/api/v1/tokens", {"user": user}).json()["token"]
        report.begin(house)
        for name, path, fields in (("listening to events", "/api/v1/events/stream", ""),
                                   ("streams of views", "/api/v1/scenes/plaza/view.mjpeg?width=64&height=48&rate=1", ""),
                                   ("WebSockets", "/api/v1/scenes/plaza/frames?width=64&height=48&rate=1", SOCKET)):
            held, got = [], []
            for user in USERS:
                more, _ = take(house, user, 90, path, fields)
                held, got = held + more, [*got, len(more)]
            own, met = take(house, "root", 1, path, fields)
            report.check(bool(own), f"{name}: {len(USERS)} users hold {got}, and the admin gets its own",
                         f"{name}: {len(USERS)} users hold {got}, and the admin gets {met}")
            for stream in held + own:
                stream.close()
            time.sleep(1.0)
        attacks = {"slow bodies of six users": (120, slow_bodies(house)), "strips of six users": (120, strips(house, begun))}
        for name, (n, attack) in attacks.items():
            statuses = {}

            def change(end, statuses=statuses):
                while time.monotonic() < end:
                    answer = root.ask("PUT", "/api/v1/playheads/admin", {"scene": "plaza"})
                    statuses[answer.status] = statuses.get(answer.status, 0) + 1
                    time.sleep(0.5)
            report.attack(house, name, lambda: Crowd(name, n, attack, 0.02), given.seconds, change)
            report.check(set(statuses) <= {200, 201}, f"{name}: the admin's changes are answered {statuses} (without and beside)")
        report.end(house)
    return report.done()


if __name__ == "__main__":
    sys.exit(main())
