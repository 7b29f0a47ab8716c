#!/usr/bin/env python3
"""Routes that cost the daemon much and the caller little, asked without end by one operator.

Each is asked by sixteen connections of one user, over the largest stretch of time that it takes.
"""

import datetime
import sys
import threading
import time

from harness import Crowd, House, Report, arguments

PAIRS = [{"picture_px": [10.0 + 7 * i % 600, 20.0 + 11 * i % 330], "place_m": [i % 7, i % 5, 0.1 * (i % 3)]} for i in range(500)]


def instant(seconds_back):
    at = datetime.datetime.now(datetime.timezone.utc) - datetime.timedelta(seconds=seconds_back)
    return at.strftime("%Y-%m-%dT%H:%M:%SZ")


def attacks(house):
    """Returns, per name, user, method, path and body; `{n}` is another number each time."""
    year, now, recent = instant(364 * 86400), instant(0), instant(60)
    span = f"from={year}&to={now}"
    return {
        "timeline of a year": ("olga", "GET", f"/api/v1/scenes/plaza/timeline?{span}&resolution=31622", None),
        "tracks of a year": ("olga", "GET", f"/api/v1/scenes/plaza/tracks?{span}&limit=1000", None),
        "paths of a day": ("olga", "GET", f"/api/v1/scenes/plaza/entities/paths?from={instant(86000)}&to={now}&limit=1000", None),
        "activity of a year": ("olga", "GET", f"/api/v1/activity?{span}&step=31622", None),
        "alignment": ("olga", "GET", "/api/v1/scenes/plaza/alignment", None),
        "strips of 48 pictures": ("olga", "GET", f"/api/v1/cameras/west/strip.jpg?from={recent}&to={now}&count=48&height=10{{m}}", None),
        "pictures of the past": ("olga", "GET", f"/api/v1/cameras/west/frame.png?t={{past}}", None),
        "views of the past": ("olga", "GET", "/api/v1/scenes/plaza/view.jpg?width=320&height=180&t={past}", None),
        "plans": ("olga", "GET", "/api/v1/scenes/plaza/plan?width=7680&height=4320&eye=-{n}.01,-14,6&target=0,0,1", None),
        "hulls of everybody": ("olga", "GET", "/api/v1/scenes/plaza/entities", None),
        "calibrations worked out": ("olga", "POST", "/api/v1/calibrations/solve", {"image_size_px": [640, 360], "pairs": PAIRS}),
        "snapshots": ("olga", "POST", "/api/v1/snapshots", {"scene": "plaza", "parameters": "width=1920&height=1080"}),
        "exports": ("olga", "POST", "/api/v1/exports", {"from": recent, "to": now, "cameras": ["west", "east", "north"]}),
        "verifications": ("olga", "GET", "/api/v1/snapshots/{snapshot}/verification", None),
        "scenes as glTF": ("olga", "GET", "/api/v1/scenes/plaza/export?format=gltf", None),
    }


def main():
    given = arguments(__doc__, 12.0)
    report = Report("Expensive routes", given.quick)
    with House(given.daemon) as house:
        time.sleep(12)
        snapshot = house.caller("olga").post("/api/v1/snapshots", {"camera": "west"}).json().get("id", "none")
        last = time.time()
        all_of = attacks(house)
        if given.quick:
            all_of = {name: all_of[name] for name in ("timeline of a year", "pictures of the past")}
        report.begin(house)
        local = threading.local()
        for name, (user, method, path, body) in all_of.items():
            def attack(idx, crowd, user=user, method=method, path=path, body=body):
                if not hasattr(local, "caller"):
                    local.caller, local.n = house.caller(user, keep=True), idx * 1000
                local.n += 1
                past = int((last - 1 - local.n % 97 / 10) * 1e9)
                target = path.format(n=local.n % 97, m=local.n % 10, past=past, snapshot=snapshot)
                crowd.count_answer(local.caller.ask(method, target, body))
            report.attack(house, name, lambda: Crowd(name, 16, attack, 0.01), given.seconds)
        report.end(house)
    return report.done()


if __name__ == "__main__":
    sys.exit(main())
