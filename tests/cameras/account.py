"""What was sent and recorded of one camera, held against each other (see `hour.py`)."""
import collections
import json
import sqlite3
import subprocess

from watched import NAME, digest, is_slice

TICK_NANOS = 100_000
# Seconds before and after a frame was sent in which the daemon's counters tell of it.
COUNTED_SECS = (2.0, 20.0)
# Seconds for which a frame is on its way through the daemon.
ON_THE_WAY_SECS = 2.0
# One in so many segments is read by ffprobe too.
PROBED = 20
REASONS = {
    "early": "sent before the connection's first whole key frame",
    "fault": "between a lost or damaged packet and the next whole key frame",
    "last": "the last of a connection that ended",
    "left": "on its way when the daemon itself ended the connection",
    "counted": "counted by the daemon as dropped, at that time",
}
CONTAINERS = {0x18538067: "segment", 0x1654AE6B: "tracks", 0xAE: "track", 0x1F43B675: "cluster", 0xA0: "group of blocks"}
CLUSTER, CODEC, CLUSTER_TIME, SIMPLE_BLOCK, BLOCK, REFERENCE = 0x1F43B675, 0x86, 0xE7, 0xA3, 0xA1, 0xFB


def read_number(data, at, marker):
    """A number of EBML at a place, with or without the bit that says its length, and the place behind it."""
    n_bytes = 9 - data[at].bit_length()
    number = int.from_bytes(data[at:at + n_bytes], "big")
    return (number if marker == "kept" else number & ((1 << 7 * n_bytes) - 1)), at + n_bytes


def read_frame(data, is_hevc):
    """The name that a recorded frame bears, if it bears one, and the digest of its slices."""
    nals = []
    while len(data) > 4:
        end = 4 + int.from_bytes(data[:4], "big")
        nals.append(data[4:end])
        data = data[end:]
    name = next((tuple(map(int, found.groups())) for found in map(NAME.search, nals) if found), None)
    return name, digest([nal for nal in nals if nal and is_slice(nal, is_hevc)])


def read_segment(path):
    """A recorded file's frames, each `[ticks, is_key, name, digest]`, and places and ticks of clusters that begin with a key frame."""
    data, at, frames, keys, cluster, is_hevc = path.read_bytes(), 0, [], [], None, False
    while at < len(data):
        began = at
        kind, at = read_number(data, at, "kept")
        size, at = read_number(data, at, "dropped")
        if kind in CONTAINERS:
            cluster = {"at": began, "ticks": 0, "is_new": True} if kind == CLUSTER else cluster
            continue
        body, at = data[at:at + size], at + size
        if kind == CODEC:
            is_hevc = b"HEVC" in body
        elif kind == CLUSTER_TIME:
            cluster["ticks"] = int.from_bytes(body, "big")
        elif kind == REFERENCE:
            frames[-1][1] = False
        elif kind in (SIMPLE_BLOCK, BLOCK):
            ticks = cluster["ticks"] + int.from_bytes(body[1:3], "big", signed=True)
            is_key = kind == BLOCK or body[3] & 128 != 0
            if cluster["is_new"] and is_key:
                keys.append((cluster["at"], ticks))
            cluster["is_new"] = False
            frames.append([ticks, is_key, *read_frame(body[4:], is_hevc)])
    return frames, keys


def read_keys(data):
    """The same clusters as a row of the index has them: differences in seven bits a byte, those of ticks in zigzag."""
    numbers, number, shift = [], 0, 0
    for byte in data:
        number, shift = number | (byte & 127) << shift, shift + 7
        if byte < 128:
            numbers.append(number)
            number, shift = 0, 0
    keys, at, ticks = [], 0, 0
    for more, step in zip(numbers[::2], numbers[1::2]):
        at, ticks = at + more, ticks + ((step >> 1) ^ -(step & 1))
        keys.append((at, ticks))
    return keys


def is_touched(frame):
    """Tells whether a fault was injected into a frame."""
    return frame["what"] in ("lost", "damaged", "cut")


class Account:
    """One camera's account: `why` counts missing frames by reason, `unexplained` names those without, `faults` is all else."""

    def __init__(self, camera, out, seen):
        self.camera, self.out = camera, out
        self.faults, self.why, self.unexplained = [], collections.Counter(), []
        self.read_ledgers()
        self.read_recording()
        self.hold_recorded_against_sent()
        self.explain(seen)

    def check(self, is_right, fault):
        if not is_right:
            self.faults.append(f"{self.camera.id}: {fault}")

    def read_ledgers(self):
        """`sent` has the frames of each connection, `(episode, number)`; `ends` when it ended, and who ended it."""
        self.sent, self.ends = {}, {}
        for path in sorted(self.out.glob(f"{self.camera.id}-*.ledger")):
            episode = int(path.stem.split("-")[1])
            for line in path.read_text().splitlines():
                what, *rest = json.loads(line)
                if what == "frame":
                    at, connection, n, is_key, slices = rest
                    # Unless the ledger goes on, the server was killed amid it.
                    frame = {"at": at, "is_key": is_key, "slices": slices, "what": "cut"}
                    self.sent.setdefault((episode, connection), {})[n] = frame
                elif what == "done":
                    self.sent[episode, rest[0]][rest[1]]["what"] = rest[2]
                elif what == "bye":
                    self.ends[episode, rest[1]] = (rest[0], rest[2])
        self.n_whole = sum(frame["what"] == "whole" for frames in self.sent.values() for frame in frames.values())

    def read_recording(self):
        """`recorded` has all frames of the files, `(nanoseconds, is_key, name, digest)`, in their order."""
        archive, camera = self.out / "archive", self.camera.id
        with sqlite3.connect(self.out / "db.sqlite") as database:
            rows = database.execute("select path, first_at, last_at, n_frames, n_bytes, state, keys from segment "
                                    "where camera = ? order by first_at", (camera,)).fetchall()
        files = {str(path.relative_to(archive)) for path in (archive / camera).rglob("*.mkv")}
        self.check(files == {row[0] for row in rows}, "files and rows of the index are not the same")
        self.recorded, self.n_indexed, before = [], 0, 0
        for number, (name, first_at, last_at, n_frames, n_bytes, state, keys) in enumerate(rows):
            path = archive / name
            frames, clusters = read_segment(path)
            times = [first_at + frame[0] * TICK_NANOS for frame in frames]
            self.recorded += [(at, *frame[1:]) for at, frame in zip(times, frames)]
            self.n_indexed += n_frames
            self.check(state == "closed" and n_bytes == path.stat().st_size, f"{name} is {state}, {n_bytes} bytes by its row")
            self.check((n_frames, first_at, last_at) == (len(frames), min(times), max(times)), f"{name} is not as its row says")
            self.check(first_at > before, f"{name} begins before the one before ends")
            self.check(read_keys(keys) == clusters, f"{name} has other key frames than the index says")
            before = last_at
            if number % PROBED == 0:
                probe = ["ffprobe", "-v", "error", "-count_packets", "-show_entries", "stream=nb_read_packets", "-of", "csv=p=0", path]
                found = subprocess.run(probe, capture_output=True, text=True, check=False).stdout.strip(" ,\n")
                self.check(found == str(len(frames)), f"{name} has {found} frames for ffprobe, {len(frames)} here")

    def hold_recorded_against_sent(self):
        """What is recorded was sent, comes in its order, once, unchanged, and in the order in which it is seen."""
        self.found, self.n_touched, newest, shown = set(), 0, (0, 0, -1), {}
        for at, is_key, name, slices in self.recorded:
            frame = name and name[0] == self.camera.number and self.sent.get(name[1:3], {}).get(name[3])
            self.n_touched += not frame or is_touched(frame)
            if not frame:
                around = [self.sent.get(newest[:2], {}).get(newest[2] + step) for step in range(-1, 4)]
                self.check(any(map(is_touched, filter(None, around))), f"a frame at {at} that nobody sent, after {newest}")
                continue
            name = name[1:]
            self.check(name not in self.found, f"{name} is recorded twice")
            self.check(name > newest, f"{name} is recorded behind {newest}")
            self.check(is_key == frame["is_key"], f"{name} is recorded as {'a' if is_key else 'no'} key frame, unlike as it was sent")
            self.check(slices == frame["slices"] or is_touched(frame), f"{name} is recorded otherwise than it was sent")
            self.found.add(name)
            newest = max(newest, name)
            if not is_touched(frame):
                shown.setdefault(name[:2], []).append((self.camera.place_shown(*name), at, name[2]))
        for connection, places in shown.items():
            places.sort()
            wrong = [(one[2], two[2]) for one, two in zip(places, places[1:]) if one[1] >= two[1]]
            self.check(not wrong, f"{connection}: {len(wrong)} pairs of frames bear times in the wrong order, such as {wrong[:3]}")

    def explain(self, seen):
        """Finds why what is missing is missing: what has no other reason must have been counted, each frame by a count of its own."""
        missing = []
        for connection, frames in sorted(self.sent.items()):
            frames = [(n, frame) for n, frame in sorted(frames.items()) if frame["what"] != "omitted"]
            ended_at, who = self.ends.get(connection, (float("inf"), "server"))
            leaves_at = ended_at - ON_THE_WAY_SECS if who == "daemon" else float("inf")
            # Of those that were not on their way at the end: after a silence, the last one before it.
            last = max((n for n, frame in frames if frame["what"] == "whole" and frame["at"] <= leaves_at), default=-1)
            last_found = max((n for n, _ in frames if (*connection, n) in self.found), default=-1)
            reason = "early"
            for n, frame in frames:
                if frame["what"] in ("lost", "damaged"):
                    reason = reason or "fault"
                elif frame["what"] == "whole" and frame["is_key"]:
                    reason = None
                if frame["what"] != "whole" or (*connection, n) in self.found:
                    continue
                why = reason or ("left" if frame["at"] > leaves_at else "last" if n == last else None)
                missing.append((frame["at"], why, connection, n, "end" if n > last_found else "middle"))
        counts = []
        for (_, before), (at, now) in zip(seen, seen[1:]):
            dropped = [key for key in now if key[:2] == (self.camera.id, "archive_frames_dropped_total")]
            counts += [at] * sum(now[key] - before.get(key, 0) for key in dropped)
        # Of those at a connection's end the recording rarely heard, so that they come last.
        for at, why, *place in sorted(missing, key=lambda frame: (frame[-1] == "end", frame[0])):
            fitting = (n for n, counted_at in enumerate(counts) if -COUNTED_SECS[0] <= counted_at - at < COUNTED_SECS[1])
            if not why and (found := next(fitting, None)) is not None:
                why = "counted"
                del counts[found]
            self.why[why or "unexplained"] += 1
            if not why:
                self.unexplained.append(place)
