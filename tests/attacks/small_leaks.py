#!/usr/bin/env python3
"""Nothing tells what a caller may not see: names of cameras, files of scenes, names that are taken, the probe, other sites' requests.

The harm as it was: named views and walls told hidden cameras in `parameters`, /api/v1/assets served files of hidden scenes, "the name
is taken" told of hidden views, /readyz told strangers how many cameras there are, and changes that a page of another site asked for
were taken where the browser sends no `Sec-Fetch-Site`.
"""

import json
import re
import struct
import sys
import zlib

from harness import House, Report, arguments
from harness.house import DEMO, PASSWORD


def png(level):
    """A picture of four equal pixels."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    rows = (b"\0" + bytes([level] * 6)) * 2
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 2, 2, 8, 2, 0, 0, 0)) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def alike(answer, name):
    """Returns what an answer tells, but for the name that was asked for and what differs each time."""
    text = re.sub(r'; did you mean \\"(west|plaza)\\"\?', ";", answer.text.replace(name, "NAME"))
    return answer.status, text, sorted(field for field in answer.fields if field != "date")


def main():
    given = arguments(__doc__, 0.0)
    report = Report("Small leaks", given.quick)
    with House(given.daemon) as house:
        root, vera, otto, stranger = (house.caller(user) for user in ("root", "vera", "otto", None))
        # A scene of `east` alone, with a picture of its own; a view and a wall that are lit by `east`; playheads and names of it.
        document = json.loads((DEMO / "plaza.json").read_text())
        document["cameras"] = [camera for camera in document["cameras"] if camera["id"] == "east"]
        document["ground"][0]["texture"] = {"file": "assets/hidden.png", "size_m": [2, 2]}
        wall = {"scene": "plaza", "parameters": "relight=camera&relight_camera=east", "view": {"eye_m": [0, -14, 5], "target_m": [0, 2, 1]},
                "surface": {"grid": {"columns": 1, "rows": 1, "tile_px": [64, 48], "tile_m": [0.4, 0.3], "gap_m": [0, 0]}}}
        made = [root.ask("PUT", "/api/v1/assets/hidden.png", png(9), {"Content-Type": "image/png", "If-None-Match": "*"}).status,
                (put := root.put_new("/api/v1/scenes/vault", document)).status,
                root.put_new("/api/v1/views/lit", {"scene": "plaza", "parameters": wall["parameters"]}).status,
                root.put_new("/api/v1/walls/lit", wall).status,
                root.put_new("/api/v1/views/secret", {"scene": "vault"}).status,
                root.ask("PUT", "/api/v1/playheads/secret", {"scene": "vault"}).status]
        report.check(all(status in (200, 201, 204) for status in made), "there is something hidden to look for", f"it is not made: {made} {put.text[:300]}")
        lists = ("/api/v1/cameras", "/api/v1/scenes", "/api/v1/scenes/plaza", "/api/v1/views", "/api/v1/walls", "/api/v1/playheads",
                 "/api/v1/assets", "/api/v1/events", "/api/v1/jobs", "/api/v1/calibrations", "/api/v1/system", "/api/v1/users/vera",
                 "/api/v1/scenes/plaza/plan", "/api/v1/scenes/plaza/export", "/api/v1/activity?from=0&to=60000000000",
                 "/api/v1/scenes/plaza/which-cameras?x=0&y=0&z=0", "/api/v1/scenes/plaza/alignment", "/api/v1/scenes/plaza/entities",
                 "/api/v1/snapshots", "/api/v1/exports", "/api/v1/views/lit", "/api/v1/walls/lit", "/api/v1/walls/lit/screens",
                 "/api/v1/views/lit/picture.jpg?width=64&height=48", "/api/v1/scenes/plaza/view.jpg?width=1&height=zz&cameras=x")
        told = [(path, name) for path in lists for who in (vera, otto) for answer in [who.get(path)]
                for name in ("east", "north", "vault", "secret", "hidden.png") if f'"{name}"' in answer.text or f"={name}" in answer.text]
        report.check(not told, f"{len(lists)} routes name nothing that is hidden", f"hidden names are told: {told}")
        # Names of what is hidden, and of nothing at all, are answered alike.
        for path in ("/api/v1/views/{}", "/api/v1/walls/{}", "/api/v1/playheads/{}", "/api/v1/scenes/{}", "/api/v1/assets/{}.png",
                     "/api/v1/cameras/{}", "/api/v1/cameras/{}/frame.jpg", "/api/v1/views/{}/picture.jpg", "/api/v1/users/{}",
                     "/api/v1/walls/{}/tiles/r1c1/frame.jpg", "/api/v1/scenes/plaza/view.jpg?t=playhead:{}",
                     "/api/v1/scenes/plaza/view.jpg?relight=camera&relight_camera={}"):
            for hidden in ("secret", "lit", "vault", "east", "hidden"):
                names = (hidden, "qwert"[:len(hidden)] if len(hidden) < 6 else "qwertz")
                answers = [alike(otto.get(path.format(name)), name) for name in names]
                if answers[0] != answers[1]:
                    report.check(False, "", f"GET {path.format(hidden)} differs from one of nothing: {answers[0][:2]} and {answers[1][:2]}")
        for kind, body in (("views", {"scene": "plaza"}), ("walls", wall | {"parameters": ""}), ("playheads", {"scene": "plaza"})):
            for hidden in ("secret", "lit"):
                answers = [alike(otto.ask("PUT", f"/api/v1/{kind}/{name}", body, {"If-None-Match": "*"}), name) for name in (hidden, "other")]
                report.check(answers[0] == answers[1], f"the name of a hidden one is refused like any other ({kind}: {answers[0][0]})",
                             f"{kind}: {answers[0]} for a name that is taken, {answers[1]} for one that is free")
        report.check(otto.get("/api/v1/assets/hidden.png").status == 404, "the picture of a hidden scene is not there")
        ready = stranger.get("/readyz").json()
        report.check("cameras_with_frames" not in ready, f"the probe tells strangers nothing of cameras: {ready}")
        for path in ("/metrics", "/api/v1/system", "/api/v1/cameras", "/api/v1/scenes/plaza/frames"):
            report.check(stranger.get(path).status == 401, f"a stranger's {path} is 401", f"{path}: {stranger.get(path).status}")
        login = {"user": "root", "password": PASSWORD}
        for origin in ("https://evil.example", "null", "http://127.0.0.1:1", f"http://127.0.0.1.evil.example:{house.port}"):
            for method, path, body in (("POST", "/api/v1/session", login), ("DELETE", "/api/v1/session", None), ("POST", "/api/v1/tokens", {})):
                who = stranger if "session" in path else root
                answer = who.ask(method, path, body, {"Origin": origin})
                report.check(answer.status in (400, 403), f"{method} {path} from {origin} is {answer.status}")
        sessions(house, report, login)
        for host in ("evil.example", f"evil.example:{house.port}"):
            answer = root.get("/api/v1/cameras", {"Host": host})
            report.check(answer.status == 421, f"a request for {host} is {answer.status}")
        # A name that exists, and one that does not, take as long and answer alike with a wrong password.
        answers = [house.log_in(name, "wrong password", "127.0.0.5") for name in ("olga", "nobody")]
        report.check(answers[0].status == answers[1].status == 401 and answers[0].body == answers[1].body,
                     "a wrong password of a user and of nobody are answered alike", f"{answers[0].text} {answers[1].text}")
        # Turn by turn, and the shortest: other work on the machine only adds.
        times = {"olga": [], "nobody": []}
        for i in range(15):
            for idx, name in enumerate(times):
                times[name].append(house.log_in(name, "wrong password", f"127.0.{1 + idx}.{i + 1}").seconds * 1e3)
        known, unknown = (min(found) for found in times.values())
        report.check(0.7 < known / unknown < 1.4, f"and take as long: {known:.1f} and {unknown:.1f} ms (the shortest of 15 each)")
        report.alive(house)
    return report.done()


def sessions(house, report, login):
    """A cookie alone changes nothing."""
    answer = house.caller().post("/api/v1/session", login)
    cookie = {"Cookie": answer.fields.get("set-cookie", "").split(";")[0]}
    flags = answer.fields.get("set-cookie", "").lower()
    report.check("httponly" in flags and "samesite=strict" in flags, "the cookie is HttpOnly and SameSite=Strict", f"it is {flags}")
    for fields, name in (({}, "no CSRF token"), ({"X-CSRF-Token": "x" * 32}, "a wrong CSRF token")):
        changed = house.caller().ask("POST", "/api/v1/tokens", {}, cookie | fields)
        report.check(changed.status in (400, 403), f"a change by cookie with {name} is {changed.status}")


if __name__ == "__main__":
    sys.exit(main())
