#!/usr/bin/env python3
"""Requests that nobody means: nested bodies, bombs, floods of ranges, pipelines, odd heads. Each is refused, and costs little."""

import gzip
import json
import struct
import sys
import time
import zlib

from harness import Crowd, House, Report, arguments, ask
from harness.callers import connect

MOST_MIB = 96.0
MEMBERS = ("{" + ",".join(f'"k{i}":0' for i in range(60_000)) + "}").encode()


def bomb_png(columns, rows):
    """A picture whose pixels, all alike, are a thousand times what its file is."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    packer, body = zlib.compressobj(9), b""
    row = b"\0" * (1 + columns * 3)
    for _ in range(rows):
        body += packer.compress(row)
    head = struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body + packer.flush()) + chunk(b"IEND", b"")


def status(answer):
    return answer[9:12].decode("ascii", "replace") or "closed"


def shots(house):
    """Requests by name: raw bytes, and the statuses that are right."""
    token = f"authorization: Bearer {house.tokens['olga']}\r\n"
    root = f"authorization: Bearer {house.tokens['root']}\r\n"

    def raw(line, fields="", body=b""):
        return f"{line} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n{fields}\r\n".encode() + body

    def with_body(line, body, fields=token):
        return raw(line, f"{fields}content-length: {len(body)}\r\n", body)
    deep = b"[" * 500_000
    objects = b'{"a":' * 150_000
    number = b'{"scene": "plaza", "order": 1' + b"0" * 900_000 + b"}"
    polygon = json.dumps({"scene": "plaza", "tags": ["x"] * 100_000}).encode()
    gltf = json.dumps({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 1 << 40}],
                       "nodes": [{"children": [0]}], "scenes": [{"nodes": [0]}], "scene": 0}).encode()
    external = json.dumps({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 4, "uri": "file:///etc/passwd"}],
                           "images": [{"uri": "http://127.0.0.1:1/x.png"}]}).encode()
    new = "if-none-match: *\r\n"
    return {
        "500,000 lists within one another": (with_body("PUT /api/v1/views/deep", deep, token + new), ("400",)),
        "150,000 objects within one another": (with_body("PUT /api/v1/views/deep", objects, token + new), ("400",)),
        "60,000 members": (with_body("PUT /api/v1/views/deep", MEMBERS, token + new), ("400",)),
        "a number of 900,000 digits": (with_body("PUT /api/v1/views/deep", number, token + new), ("400",)),
        "100,000 tags": (with_body("PUT /api/v1/views/deep", polygon, token + new), ("400",)),
        "a glTF of a terabyte": (with_body("POST /api/v1/scenes/plaza/import", gltf, root + "content-type: model/gltf+json\r\n"), ("400", "404", "415", "422")),
        "a glTF that names other files": (
            with_body("POST /api/v1/scenes/plaza/import", external, root + "content-type: model/gltf+json\r\n"), ("400", "404", "415", "422")),
        "a picture of 20000 x 20000": (
            with_body("PUT /api/v1/assets/bomb.png", bomb_png(20000, 20000), root + new + "content-type: image/png\r\n"), ("400", "413", "422")),
        "a body of 1 MB that is 1 GB without gzip": (
            with_body("PUT /api/v1/views/deep", gzip.compress(b" " * (1 << 28)), token + new + "content-encoding: gzip\r\n"), ("400", "413", "415")),
        "a query of 60 KB": (raw("GET /api/v1/cameras?" + "q" * 60_000, token), ("414", "431", "400")),
        "a path of 1 MB": (raw("GET /" + "p" * (1 << 20), token), ("414", "431", "400", "closed")),
        "1000 parameters": (raw("GET /api/v1/scenes/plaza/view.jpg?" + "&".join(f"a{i}=1" for i in range(300)), token), ("400", "414")),
        "1000 fields": (raw("GET /api/v1/cameras", token + "x: y\r\n" * 1000), ("431", "400")),
        "a field of 1 MB": (raw("GET /api/v1/cameras", token + "x: " + "y" * (1 << 20) + "\r\n"), ("431", "400", "closed")),
        "two lengths of a body": (raw("POST /api/v1/tokens", token + "content-length: 2\r\ncontent-length: 200\r\n", b"{}"), ("400",)),
        "a length and chunks": (raw("POST /api/v1/tokens", token + "content-length: 3\r\ntransfer-encoding: chunked\r\n", b"0\r\n\r\nGET /x HTTP/1.1\r\n\r\n"),
                                ("400", "201", "411")),
        "a chunk of 2^60 bytes": (raw("POST /api/v1/tokens", token + "transfer-encoding: chunked\r\n", b"fffffffffffffff\r\n" + b"z" * 4096), ("400", "408", "413")),
        "HTTP/2 without TLS": (b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + b"\0" * 64, ("400", "505", "closed", "\0\0\0")),
        "no HTTP at all": (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + b"\0" * 300, ("400", "closed")),
        "a million ranges": (raw("GET /api/v1/openapi.json", token + "range: bytes=" + ",".join(f"{i}-{i}" for i in range(2500)) + "\r\n"), ("200", "416", "431", "400")),
        "a cursor of 2 KB": (raw("GET /api/v1/audit?cursor=" + "9" * 1900, root), ("400",)),
        "an eye of 400 digits": (raw("GET /api/v1/scenes/plaza/view.jpg?eye=" + "9" * 400 + ",0,0", token), ("400",)),
        "a time in the year 9999": (raw("GET /api/v1/cameras/west/frame.jpg?t=9999-01-01T00:00:00Z", token), ("400", "404")),
        "a picture of 65535 x 65535": (raw("GET /api/v1/scenes/plaza/view.png?width=65535&height=65535", token), ("422",)),
        "a supersampled picture beyond the limit": (raw("GET /api/v1/scenes/plaza/view.png?width=5000&height=5000&supersampling=8", token), ("422", "400")),
    }


def pipelines(house):
    """Two hundred requests at once over one connection, whose answers nobody reads."""
    line = f"GET /api/v1/openapi.json HTTP/1.1\r\nhost: localhost\r\nauthorization: Bearer {house.tokens['olga']}\r\n\r\n".encode()

    def attack(_idx, crowd):
        with connect(house.port, receive_bytes=2048) as stream:
            stream.settimeout(1.0)
            try:
                stream.sendall(line * 200)
            except TimeoutError:
                crowd.count("not taken")
            crowd.over.wait(3.0)
            crowd.count(status(stream.recv(4096)))
    return attack


def bombs(house, body, user="olga"):
    """One large body after the other: of an operator to a named view, of a viewer for a token."""
    def attack(idx, crowd):
        caller = house.caller(user)
        is_viewer = user == "vera"
        crowd.count_answer(caller.post("/api/v1/tokens", body) if is_viewer else caller.put_new(f"/api/v1/views/bomb{idx}", body))
    return attack


def main():
    given = arguments(__doc__, 12.0)
    report = Report("Odd requests", given.quick)
    with House(given.daemon) as house:
        report.begin(house)
        began, rows = house.rss_mib(), []
        for name, (request, right) in shots(house).items():
            begin = time.monotonic()
            met = status(ask(house.port, request))
            rows.append((name, f"{len(request) / 1024:.0f}", met, f"{(time.monotonic() - begin) * 1e3:.0f}"))
            report.check(met in right, f"{name}: {met}", f"{name}: {met}, not one of {right}")
            report.check(house.is_alive(), f"{name}: the daemon lives")
        report.table(["request", "KiB", "status", "ms"], rows)
        report.stages["each once"] = house.figures()
        floods = {"32 pipelines of 200 requests": (32, pipelines(house)), "16 floods of nested bodies": (16, bombs(house, b"[" * 900_000)),
                  "16 floods of 60,000 members": (16, bombs(house, MEMBERS)),
                  "2 floods of 60,000 members by a viewer": (2, bombs(house, MEMBERS, "vera"))}
        for name, (n, attack) in ({} if given.quick else floods).items():
            report.attack(house, name, lambda: Crowd(name, n, attack, 0.02), given.seconds)
        more = house.rss_mib() - began
        report.check(more <= MOST_MIB, f"memory is {more:+.0f} MiB (at most {MOST_MIB:.0f})")
        report.end(house)
    return report.done()


if __name__ == "__main__":
    sys.exit(main())
