#!/usr/bin/env python3
"""A manager of one camera opens no other: neither its film, nor the archive, nor sealed snapshots, nor ports of the network.

The harm as it was: an operator who may manage `west` alone set its source to another camera's film, to the archive and to sealed
snapshots, past privacy zones, and scanned ports by the reasons that the camera's state told.
"""

import json
import socket
import sys
import time

from harness import House, Report, arguments
from harness.house import DEMO

SOURCE = "/api/v1/cameras/west/source"
# Takes away what belongs to a file.
NO_FILE = {key: None for key in ("path", "end", "from_secs", "rate_hz", "pace", "start", "timing", "until_secs")}


def shape(answer):
    """Returns what an answer tells, but for the names that were asked for."""
    return answer.status, json.dumps(answer.json().get("detail"))


def clean(source):
    return {key: value for key, value in source.items() if value is not None}


def wait(seconds, is_so):
    end = time.monotonic() + seconds
    while not (found := is_so()) and time.monotonic() < end:
        time.sleep(0.3)
    return found


def main():
    given = arguments(__doc__, 0.0)
    report = Report("Managing one camera opens no other", given.quick)
    with House(given.daemon) as house, socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        open_port = listening.getsockname()[1]
        root, otto = house.caller("root"), house.caller("otto")
        made = root.post("/api/v1/snapshots", {"camera": "east", "hold": True})
        picture = next((path for path in (house.folder / "attacks.snapshots").rglob("*") if path.is_file()), None)
        recorded = wait(15, lambda: next((house.folder / "archive").rglob("*.mkv"), None) or next(
            (path for path in (house.folder / "archive").rglob("*") if path.is_file()), None))
        sources = {
            "another camera's film": {"path": str(DEMO / "clips/east.webm")},
            "the archive": {"path": str(recorded)},
            "a sealed snapshot": {"path": str(picture)},
            "the database": {"path": str(house.folder / "attacks.sqlite")},
            "a file that is not there": {"path": str(house.folder / "films/none.webm")},
            "/etc/passwd": {"path": "/etc/passwd"},
            "an open port": NO_FILE | {"url": f"rtsp://127.0.0.1:{open_port}/a"},
            "a closed port": NO_FILE | {"url": "rtsp://127.0.0.1:1/a"},
            "the cloud's own address": NO_FILE | {"url": "http://169.254.169.254/latest"},
            "a device": NO_FILE | {"device": "/dev/video0"},
        }
        report.check(made.status == 201 and picture is not None and recorded is not None, "there is a snapshot and a recording to reach for",
                     f"nothing to reach for: {made.status} {picture} {recorded}")
        before, rows = otto.get(SOURCE).json(), []
        shapes = set()
        for name, source in sources.items():
            for operation, answer in (
                ("PATCH source", otto.patch(SOURCE, {"source": source})),
                ("PUT camera", otto.put_new("/api/v1/cameras/mine", {"source": clean(source)})),
                ("a look at it", otto.post("/api/v1/sources/look", {"source": clean(source)})),
            ):
                rows.append((name, operation, answer.status))
                if operation == "PATCH source":
                    shapes.add(shape(answer))
                report.check(400 <= answer.status < 500 and answer.status != 429, f"{name}: {operation} is {answer.status}",
                             f"{name}: {operation} is {answer.status} {answer.text[:200]}")
        report.table(["source", "asked", "status"], rows)
        report.check(len(shapes) == 1, "all refusals are alike, so that nothing can be told from them", f"refusals differ: {shapes}")
        for answer, name in ((otto.get("/api/v1/sources/files"), "the list of files"),
                             (otto.post("/api/v1/sources/discover", {}), "the search for cameras"),
                             (otto.get("/api/v1/cameras/west/document"), "the camera's document"),
                             (otto.patch("/api/v1/cameras/east/source", {"enabled": False}), "another camera's settings")):
            report.check(answer.status in (403, 404), f"{name} is {answer.status}", f"{name} is {answer.status} {answer.text[:200]}")
        report.check(otto.get(SOURCE).json() == before, "the camera's source is as it was")

        # Reasons tell others than admins no address and no file.
        for url, name in ((f"rtsp://127.0.0.1:{open_port}/a", "open"), ("rtsp://127.0.0.1:1/a", "closed")):
            root.patch(SOURCE, {"source": NO_FILE | {"url": url}})
            wait(12, lambda: otto.get("/api/v1/cameras/west").json().get("reason"))
            for path in ("/api/v1/cameras/west", "/api/v1/cameras", "/api/v1/jobs", "/api/v1/events"):
                told = otto.get(path).text
                report.check("127.0.0.1" not in told and f":{open_port}" not in told, f"{path} tells no address ({name} port)",
                             f"{path} tells {told[:300]}")
            reason = wait(12, lambda: otto.get("/api/v1/cameras/west").json().get("reason"))
            report.say(f"reason of the {name} port: {reason!r}; to admins {root.get('/api/v1/cameras/west').json().get('reason')!r}")
        # Versions bring no source back that an admin took away.
        root.delete(SOURCE)
        wait(15, lambda: root.get("/api/v1/cameras/west").json().get("state") == "live")

        # Zones hold wherever the film is shown: an admin feeds `west` by the film of `east`, whose zone hides all of it.
        zone = {"name": "all", "reason": "test", "polygon": [[0, 0], [1, 0], [1, 1], [0, 1]]}
        tag = root.get("/api/v1/cameras/east/privacy").fields.get("etag", "*")
        put = root.ask("PUT", "/api/v1/cameras/east/privacy", {"zones": [zone]}, {"If-Match": tag})
        n_clear = len(otto.get("/api/v1/cameras/west/frame.png").body)
        root.patch(SOURCE, {"source": {"path": str(DEMO / "clips/east.webm")}})
        n_hidden = wait(15, lambda: (n := len(otto.get("/api/v1/cameras/west/frame.png").body)) and n < n_clear / 5 and n)
        report.check(put.status == 200 and bool(n_hidden),
                     f"a zone of `east` hides its film where `west` shows it ({n_clear} bytes of picture, then {n_hidden})",
                     f"a zone of `east` does not hide its film where `west` shows it ({put.status} {put.text[:200]})")
        root.delete(SOURCE)
        # No file is reached by names of assets, scenes and calibrations.
        for method, path in (("PUT", "/api/v1/assets/..%2fattacks.toml"), ("GET", "/api/v1/assets/..%2f..%2fattacks.toml"),
                             ("GET", "/api/v1/assets/%2fetc%2fpasswd"), ("GET", "/assets/..%2f..%2fattacks.toml")):
            answer = otto.ask(method, path, b"x" if method == "PUT" else None)
            report.check(answer.status in (400, 403, 404), f"{method} {path} is {answer.status}",
                         f"{method} {path} is {answer.status} {answer.text[:100]}")
        report.alive(house)
    return report.done()


if __name__ == "__main__":
    sys.exit(main())
