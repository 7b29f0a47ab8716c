#!/usr/bin/env python3
"""A camera whose clock somebody set ahead pushes out no other camera's recordings.

Who manages one live camera sets its clock. Recordings go by scene time, the oldest first over all cameras: those of a camera that is
58 days ahead are the newest for ever, so that all others would go for it. The camera is served here, as motion JPEG.
"""

import socket
import sys
import threading
import time

from harness import House, Report, arguments

MAX_MIB, AHEAD_SECONDS, HZ = 0.01 * 1024, 5e6, 10.0


class MotionJpeg:
    """A camera that sends the pictures that it was given, one after the other, to whoever asks."""

    def __init__(self):
        self.pictures, self.listening = [], socket.create_server(("127.0.0.1", 0))
        self.port = self.listening.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        while True:
            try:
                stream, _ = self.listening.accept()
            except OSError:
                return
            threading.Thread(target=self._send, args=(stream,), daemon=True).start()

    def _send(self, stream):
        n = 0
        try:
            stream.recv(4096)
            stream.sendall(b"HTTP/1.0 200 OK\r\ncontent-type: multipart/x-mixed-replace; boundary=b\r\n\r\n")
            while True:
                if self.pictures:
                    picture = self.pictures[n % len(self.pictures)]
                    n += 1
                    head = b"--b\r\ncontent-type: image/jpeg\r\ncontent-length: %d\r\n\r\n" % len(picture)
                    stream.sendall(head + picture + b"\r\n")
                time.sleep(1 / HZ)
        except OSError:
            stream.close()


def recorded(house):
    """Per camera: files, MiB, and the seconds from the first frame to the newest."""
    with house.database() as database:
        rows = database.execute("select camera, count(*), sum(n_bytes) / 1048576.0, (max(last_at) - min(first_at)) / 1e9"
                                " from segment where state in ('open', 'closed') group by camera").fetchall()
    return {camera: (n, mib, seconds) for camera, n, mib, seconds in rows}


def main():
    given = arguments(__doc__, 60.0)
    report = Report("A clock that is ahead", given.quick)
    camera = MotionJpeg()
    more = f'[[camera]]\nid = "gate"\nvision = false\nsource = {{ url = "http://127.0.0.1:{camera.port}/a" }}\n'
    with House(given.daemon, more=more, archive="max_gib = 0.01") as house:
        olga = house.caller("olga")
        for _ in range(10):
            camera.pictures.append(olga.get("/api/v1/cameras/west/frame.jpg").body)
            time.sleep(0.1)
        # All of the room is in use, by clocks that agree.
        end = time.monotonic() + 90
        while sum(mib for _, mib, _ in recorded(house).values()) < MAX_MIB * 0.85 and time.monotonic() < end:
            time.sleep(1)
        time.sleep(10)
        before = recorded(house)
        changed = olga.patch("/api/v1/cameras/gate/source", {"clock": {"offset_secs": AHEAD_SECONDS}})
        least = dict(before)
        end = time.monotonic() + max(given.seconds, 30)
        while time.monotonic() < end:
            time.sleep(1)
            now = recorded(house)
            for of in before:
                least[of] = min(least[of], now.get(of, (0, 0.0, 0.0)), key=lambda found: found[2])
        after = recorded(house)
        rows = [(of, *(f"{value:.1f}" for found in (before[of], after.get(of, (0, 0.0, 0.0)), least[of]) for value in found[1:]))
                for of in sorted(before)]
        report.say(f"the operator's change of the clock of `gate` by {AHEAD_SECONDS:.0f} s is {changed.status}")
        report.table(["camera", "MiB before", "s before", "MiB after", "s after", "least MiB", "least s"], rows)
        for of in ("west", "east", "north"):
            kept = least[of][2] / before[of][2]
            report.check(changed.status >= 400 or kept > 0.5,
                         f"of the {before[of][2]:.0f} s of `{of}` that are kept there are never less than {least[of][2]:.0f} s afterwards",
                         f"of the {before[of][2]:.0f} s of `{of}` that were kept {least[of][2]:.0f} s were left")
        report.alive(house)
    camera.listening.close()
    return report.done()


if __name__ == "__main__":
    sys.exit(main())
