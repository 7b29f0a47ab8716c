#!/usr/bin/env python3
"""Fifteen minutes of mixed hostile load, by strangers of many addresses, an operator and a viewer at once.

Slow bodies and heads, slow readers, huge views, storms of log-ins, floods of tokens, sessions, streams, named views, snapshots and
exports. Memory of the daemon stays flat within 10 % after a minute, attackers meet no failure but described 503s, and the owner is
answered.
"""

import statistics
import sys
import threading
import time

from harness import Crowd, House, Report, Victim, arguments
from harness.callers import Caller, connect

FLAT, SAMPLE_SECONDS, WARM_SECONDS = 0.10, 5.0, 60.0
SOCKET = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="}
BODY = b"POST /api/v1/session HTTP/1.1\r\nhost: localhost\r\ncontent-length: 60\r\n\r\n{\"user\""
HEAD = b"GET /api/v1/session HTTP/1.1\r\nhost: localhost\r\nx-slow: "
LOCAL = threading.local()


def kept(house, user, idx):
    """The thread's own caller, over a connection that is kept."""
    if not hasattr(LOCAL, "caller"):
        LOCAL.caller, LOCAL.n = house.caller(user, keep=True), idx * 100_000
    LOCAL.n += 1
    return LOCAL.caller


def slow(house, request):
    """Strangers whose request never ends."""
    def attack(idx, crowd):
        with connect(house.port, f"127.0.0.{2 + idx % 20}") as stream:
            stream.sendall(request)
            stream.settimeout(12.0)
            crowd.count(stream.recv(4096)[9:12].decode("ascii", "replace") or "closed")
    return attack


def readers(house):
    """An operator's streams that are hardly read."""
    paths = ("/api/v1/scenes/plaza/view.mjpeg?width=640&height=360&rate=5&entities=none", "/api/v1/events/stream",
             "/api/v1/scenes/plaza/tracks/stream", "/api/v1/openapi.json")

    def attack(idx, crowd):
        with connect(house.port, receive_bytes=2048) as stream:
            stream.sendall(f"GET {paths[idx % len(paths)]} HTTP/1.1\r\nhost: localhost\r\nauthorization: Bearer {house.tokens['olga']}\r\n\r\n".encode())
            crowd.count(stream.recv(12)[9:12].decode("ascii", "replace"))
            end = time.monotonic() + 40
            stream.settimeout(0.5)
            while not crowd.over.is_set() and time.monotonic() < end:
                try:
                    if not stream.recv(1):
                        return
                except TimeoutError:
                    pass
                crowd.over.wait(0.5)
    return attack


def huge_views(house):
    def attack(idx, crowd):
        caller = kept(house, "olga", idx)
        query = f"width=6000&height=5000&entities=hulls&eye={-14 + 0.001 * (LOCAL.n % 5000):.3f},-14,6&target=0,0,1"
        crowd.count_answer(caller.get(f"/api/v1/scenes/plaza/view.jpg?{query}"))
    return attack


def log_ins(house):
    def attack(idx, crowd):
        LOCAL.n = getattr(LOCAL, "n", idx * 50_000) + 1
        address = f"127.0.{1 + idx}.{1 + LOCAL.n % 250}"
        name = ("root", "olga", f"n{LOCAL.n}", "a" * (1 << 20))[LOCAL.n % 4]
        crowd.count_answer(Caller(house.port, None, address).post("/api/v1/session", {"user": name, "password": "wrong password"}))
        crowd.count_answer(Caller(house.port, None, address).ask("DELETE", f"/api/v1/session?{LOCAL.n}" + "q" * 1900))
    return attack


def accounts(house):
    """A viewer's tokens and sessions, made and removed without end."""
    def attack(idx, crowd):
        caller = kept(house, "vera", idx)
        made = caller.post("/api/v1/tokens", {"note": "n" * 200})
        crowd.count_answer(made)
        public = made.json().get("id") if made.status == 201 else None
        if public and LOCAL.n % 3:
            crowd.count_answer(caller.delete(f"/api/v1/tokens/{public}"))
        crowd.count_answer(Caller(house.port).post("/api/v1/session", {"token": house.tokens["vera"]}))
    return attack


def documents(house):
    """An operator's named views, playheads, snapshots and exports."""
    def attack(idx, crowd):
        caller = kept(house, "olga", idx)
        crowd.count_answer(caller.put_new(f"/api/v1/views/m{LOCAL.n % 200}", {"scene": "plaza", "name": "n" * 200}))
        crowd.count_answer(caller.delete(f"/api/v1/views/m{(LOCAL.n + 100) % 200}"))
        crowd.count_answer(caller.ask("PUT", f"/api/v1/playheads/p{LOCAL.n % 40}", {"scene": "plaza", "paused": bool(LOCAL.n % 2)}))
        crowd.count_answer(caller.post("/api/v1/snapshots", {"camera": "west"}))
        now = time.time_ns()
        crowd.count_answer(caller.post("/api/v1/exports", {"from": str(now - 10**10), "to": str(now - 10**9), "cameras": ["west"]}))
        crowd.count_answer(caller.get("/api/v1/scenes/plaza/tracks?from=0&to=86400000000000&limit=1000"))
    return attack


def streams(house):
    """A viewer's streams and WebSockets, begun and left."""
    def attack(idx, crowd):
        path, fields = (("/api/v1/cameras/west/foreground", SOCKET), ("/api/v1/events/stream", {}))[idx % 2]
        lines = "".join(f"{name}: {value}\r\n" for name, value in fields.items())
        with connect(house.port) as stream:
            stream.sendall(f"GET {path} HTTP/1.1\r\nhost: localhost\r\nauthorization: Bearer {house.tokens['vera']}\r\n{lines}\r\n".encode())
            crowd.count(stream.recv(4096)[9:12].decode("ascii", "replace"))
            crowd.over.wait(0.5 + idx % 5)
    return attack


def main():
    given = arguments(__doc__, 900.0)
    report = Report("Mixed hostile load", given.quick)
    warm = min(WARM_SECONDS, given.seconds / 5)
    with House(given.daemon, storage="snapshot_max_gib = 0.2") as house:
        crowds = [
            Crowd("slow bodies of 20 addresses", 40, slow(house, BODY), 0.2),
            Crowd("slow heads of 20 addresses", 40, slow(house, HEAD), 0.2),
            Crowd("slow readers", 40, readers(house), 0.5),
            Crowd("huge views", 2, huge_views(house), 0.1),
            Crowd("storms of log-ins", 4, log_ins(house), 0.3),
            Crowd("floods of tokens and sessions", 3, accounts(house), 0.1),
            Crowd("floods of documents, snapshots and exports", 2, documents(house), 0.2),
            Crowd("floods of streams", 12, streams(house), 0.1),
        ]
        alone = Victim.measure(house, min(20.0, given.seconds))
        figures, samples, minutes = {"before": house.figures()}, [], []
        for crowd in crowds:
            crowd.__enter__()
        try:
            began = time.monotonic()
            while (left := began + given.seconds - time.monotonic()) > 1.0 and house.is_alive():
                piece = min(60.0, left)
                victim, end = Victim.begin(house, piece, len(minutes) * 500), time.monotonic() + piece
                while (rest := end - time.monotonic()) > 0:
                    samples.append((time.monotonic() - began, house.rss_mib(), house.rss_decoders_mib(), house.n_descriptors()))
                    time.sleep(max(0.0, min(SAMPLE_SECONDS, rest)))
                minutes.append(Victim.finish(victim))
                of = minutes[-1]
                report.say(f"{samples[-1][0]:5.0f} s: {samples[-1][1]:.0f} MiB, {samples[-1][3]} descriptors; owner's p99 "
                           f"{of.p('json', 0.99):.0f} ms (JSON), {of.p('view', 0.99):.0f} ms (views), not answered {of.failures()}")
            figures["at the end"] = house.figures()
        finally:
            counts = {crowd.name: crowd.stop() for crowd in crowds}
        time.sleep(3.0)
        house.wait_until_quick(40)
        figures["after"] = house.figures()
        alone = alone.with_more(Victim.measure(house, min(20.0, given.seconds), 3900))
        beside = minutes[0]
        for more in minutes[1:]:
            beside = beside.with_more(more)
        report.table(["attackers", "what they met"], [[name, ", ".join(f"{what}: {n}" for what, n in sorted(of.items()))] for name, of in counts.items()])
        report.victims({"mixed load": (alone, beside)})
        report.figures(figures)
        memory(report, samples, warm)
        for name, of in counts.items():
            bad = {what: n for what, n in of.items() if what.startswith("undescribed") or (what.startswith("5") and what != "503")}
            report.check(not bad, f"{name}: no failure but described 503s", f"{name}: {bad}")
        report.judge_victim(alone, beside, "mixed load")
        report.alive(house)
    return report.done()


def memory(report, samples, warm):
    """Judges that memory is flat: the median of the last fifth of the time against that of the first fifth after the warm-up."""
    rss = [mib for at, mib, _, _ in samples if at >= warm]
    fifth = max(1, len(rss) // 5)
    first, last = statistics.median(rss[:fifth]), statistics.median(rss[-fifth:])
    growth = last / first - 1
    report.say(f"memory after {warm:.0f} s: least {min(rss):.0f}, most {max(rss):.0f}, median {statistics.median(rss):.0f} MiB, n = {len(rss)}")
    report.check(growth <= FLAT, f"memory is flat: {first:.0f} MiB in the first fifth, {last:.0f} in the last ({growth:+.1%})")


if __name__ == "__main__":
    sys.exit(main())
