#!/usr/bin/env python3
"""One user's large views leave other users their small ones.

The harm as it was: four connections that ask for views of 6000 x 5000 with hulls left four of five of the admin's small views without
an answer. Two operators at once are tried too, and the same by streams, walls and named views.
"""

import sys

from harness import Crowd, House, Report, arguments
from harness.callers import connect

LARGE = "width=6000&height=5000&entities=hulls&eye={x:.3f},{y:.2f},6&target=0,0,1"


def views(house, users):
    callers = {}

    def attack(idx, crowd):
        caller = callers.setdefault(idx, house.caller(users[idx % len(users)]))
        crowd.n = getattr(crowd, "n", 0) + 1
        query = LARGE.format(x=-14 + 0.001 * crowd.n, y=-14 - 0.01 * idx)
        crowd.count_answer(caller.get(f"/api/v1/scenes/plaza/view.jpg?{query}"))
    return attack


def streams(house, users):
    def attack(idx, crowd):
        with connect(house.port) as stream:
            query = f"width=1920&height=1080&rate=25&entities=hulls&eye={-14 + 0.1 * idx},-14,6&target=0,0,1"
            stream.sendall(f"GET /api/v1/scenes/plaza/view.mjpeg?{query} HTTP/1.1\r\nhost: localhost\r\n"
                           f"authorization: Bearer {house.tokens[users[idx % len(users)]]}\r\n\r\n".encode())
            crowd.count(stream.recv(4096)[9:12].decode("ascii", "replace"))
            stream.settimeout(2.0)
            while not crowd.over.is_set():
                try:
                    if not stream.recv(1 << 20):
                        break
                except TimeoutError:
                    continue
    return attack


def main():
    given = arguments(__doc__, 20.0)
    report = Report("The renderer is shared", given.quick)
    attacks = {"4 loops of 6000 x 5000 with hulls": (views, 4, ["olga"])}
    if not given.quick:
        attacks |= {"16 loops of 6000 x 5000 with hulls, two operators": (views, 16, ["olga", "otto"]),
                    "16 streams of 1920 x 1080": (streams, 16, ["olga"])}
    with House(given.daemon) as house:
        house.caller("olga").get("/api/v1/scenes/plaza/view.jpg?width=320&height=180&entities=hulls")
        report.begin(house)
        for name, (attack, n, users) in attacks.items():
            counts = report.attack(house, name, lambda: Crowd(name, n, attack(house, users), 0.05), given.seconds)
            report.check(not any(what.startswith("undescribed") for what in counts), f"{name}: all refusals are described",
                         f"{name}: some refusals are not described: {dict(counts)}")
        report.end(house)
    return report.done()


if __name__ == "__main__":
    sys.exit(main())
