#!/usr/bin/env python3
"""Runs the daemon against RTSP cameras that fail in random ways, and accounts for every frame that they sent.

    tests/cameras/hour.py FOLDER [--seconds N] [--cameras N] [--seed N] [--daemon FILE] [--out FOLDER] [--only FAULT,FAULT] [--options JSON]

FOLDER has the server that misbehaves as told, `rtspodd.py`, and `media.sh`, which makes what it sends; nothing of it is copied.
Each camera goes through episodes of 20 to 120 s (in runs of less than 15 minutes a third of that), in each of which its server has
faults that the seed chose (`FAULTS`, or those that --only names; --options hold in all). In between the server is killed and started
anew, often with another codec. It writes a ledger of what it sends, and every frame bears its name (`watched.py`).
At the end the servers are killed, counters are read once all has arrived, and the daemon is stopped. Then (`account.py`):

- what is recorded was sent, once, in order, its slices unchanged but where a fault was injected, and bears times in the order in
  which it is seen;
- what is missing has one of `REASONS`; all else is unexplained;
- what is recorded is in the index, whose times increase, and all counters agree with the files.

Ends with 1 where anything is unexplained or does not agree. Needs ffmpeg, and ports from 21000 on. --out keeps all of the run.
"""
import argparse
import collections
import json
import os
import pathlib
import random
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request

from account import REASONS, Account

FIRST_PORT, API_PORT = 21000, 21100
WATCHED = os.path.join(os.path.dirname(os.path.abspath(__file__)), "watched.py")
# Seconds between two looks at the daemon, and between two at its memory.
LOOK_SECS, MEMORY_SECS, SETTLED_SECS = 2, 10, 60
# Options of `rtspodd.py` that move times about, so that nothing is known of the order in which reordered frames are seen.
MOVES_TIME = ("jumps", "outlier")


def keep_alive(r):
    ways = [{}, {"get_parameter": "501 Not Implemented"}, {"get_parameter_silent": True}, {"get_parameter_kills": True},
            {"public": "OPTIONS, DESCRIBE, SETUP, TEARDOWN, PLAY", "get_parameter_kills": True}]
    return {"timeout": r.choice([2, 5, 10]), "enforce": True} | r.choice(ways)


FAULTS = {
    "none": lambda r: {},
    "dies": lambda r: {"die_after": r.uniform(2, 25)},
    "ssrc": lambda r: r.choice([{"ssrc_per_gop": True}, {"first_ssrc": r.randint(1, 9)}]),
    "stall": lambda r: {"stall_at": [(at := r.uniform(3, 12)), at + r.uniform(1, 13)]},
    "outlier": lambda r: {"outlier": {"every": r.randint(5, 60), "secs": r.choice([-9800, -7, -0.5, 0.5, 7, 37600])}},
    "jumps": lambda r: {"jumps": [[r.uniform(3, 25), r.choice([-4000, -5, -1, 1, 5, 4000])] for _ in range(r.randint(1, 3))]},
    "garbage": lambda r: {"garbage": [r.choice([0, 36, 82, 255, r.randrange(256)]) for _ in range(r.randint(1, 60))]},
    "keep": keep_alive,
    "auth": lambda r: {"auth": r.choice(["md5", "sha256", "both", "md5first", "plain", "basic", "digest_basic"]),
                       "qop": r.choice(["", "auth"]), "stale": r.random() < 0.3},
    "udp": lambda r: {"udp_only": True},
    "tcp": lambda r: {"tcp_only": True},
    "sprop": lambda r: {"sprop": r.choice(["full", "empty", "nopps", "none", "wrong"])},
    "marker": lambda r: {"no_marker": True},
    "ntp": lambda r: {"ntp": [[0, r.choice([0, -3600, -30, 30, 600, 3600, {"abs": 1000}])], [r.uniform(5, 20), r.choice([0, 30, -30])]]},
    "rtpinfo": lambda r: {"rtpinfo": r.choice(["", "url={url}", "url={url};seq=0;rtptime=0", "url={url};seq={seq}"])},
    "wrap": lambda r: {"ts0": (1 << 32) - r.randint(1, 1800000), "seq0": 65536 - r.randint(1, 900)},
    "rate": lambda r: {"fps": (fps := r.choice([2, 5, 15, 25])), "real_fps": fps * r.choice([1, 1, 0.84, 1.1])},
    "start": lambda r: {"x_start": r.randint(1, 59)},
    "reset": lambda r: {"x_cut": r.randint(5, 300)},
    "away": lambda r: {"x_away": r.uniform(2, 15)},
    "busy": lambda r: {"x_busy": r.uniform(2, 15)},
    "lose": lambda r: {"x_lose": r.choice([0.01, 0.05])},
    "damage": lambda r: {"x_damage": r.choice([0.01, 0.05])},
    "swap": lambda r: {"x_swap": r.choice([0.05, 0.3])},
}
CODECS = {"base.h264": 4, "base.h265": 3, "bframes.h264": 3}


class Camera:
    """A camera of the daemon, and the servers that it has one after the other."""

    def __init__(self, number, arguments, out):
        self.number, self.id, self.port = number, f"c{number}", FIRST_PORT + number
        self.folder, self.out, self.always = arguments.folder, out, json.loads(arguments.options)
        self.random = random.Random(f"{arguments.seed}/{number}")
        self.faults = arguments.only.split(",") if arguments.only else list(FAULTS)
        self.scale = 1 if arguments.seconds >= 900 else 1 / 3
        self.end = threading.Event()
        self.episodes = []

    def config(self):
        transport = "udp" if self.number % 4 == 3 else "tcp"
        return (f'[[camera]]\nid = "{self.id}"\nvision = false\n[camera.source]\nurl = "rtsp://127.0.0.1:{self.port}/a"\n'
                f'transport = "{transport}"\nuser = "u"\npassword_env = "HOUR_PASSWORD"\n')

    def run(self):
        """Has one server after the other, until it is to end."""
        while not self.end.is_set():
            episode = self.choose()
            self.episodes.append(episode)
            stem, options = self.out / f"{self.id}-{len(self.episodes):04}", episode["options"]
            self.end.wait(options.get("x_away", 0))
            command = [sys.executable, WATCHED, self.folder, str(self.port), json.dumps(options), f"{stem}.ledger"]
            with open(f"{stem}.log", "w", encoding="utf-8") as log:
                server = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)
            self.end.wait(episode["secs"])
            server.send_signal(episode["signal"])
            server.wait()

    def choose(self):
        r = self.random
        faults = r.sample(self.faults, min(len(self.faults), r.choice([1, 1, 2, 3])))
        options = {"file": r.choices(list(CODECS), CODECS.values())[0]}
        for fault in faults:
            options |= FAULTS[fault](r)
        if "udp_only" in options:
            options.pop("tcp_only", None)
        options |= self.always
        path = self.out / "media" / options["file"]
        if path.name == "bframes.h264":
            offsets, first = places_shown(path), options.get("x_start", 0)
            options["pts_rel"] = offsets[first:] + offsets[:first]
        options |= {"file": str(path), "hevc": path.suffix == ".h265", "x_name": f"{self.number}/{len(self.episodes) + 1}"}
        secs, ending = r.uniform(20, 120) * self.scale, r.choice([signal.SIGTERM, signal.SIGKILL])
        return {"began": time.time(), "secs": secs, "faults": faults, "signal": ending, "options": options}

    def place_shown(self, episode, _connection, n):
        """The place of frame `n` in the order in which frames are seen, where that is known."""
        options = self.episodes[episode - 1]["options"]
        offsets = options.get("pts_rel")
        if not offsets or any(option in options for option in MOVES_TIME):
            return n if not offsets else (0, 0)
        return n + offsets[n % len(offsets)]


def places_shown(path):
    """How many places later than it comes each frame of a file is seen."""
    probe = ["ffprobe", "-v", "error", "-show_entries", "frame=coded_picture_number", "-of", "csv=p=0", path]
    coded = [int(line.strip(",")) for line in subprocess.check_output(probe, text=True).split()]
    return [coded.index(n) - n for n in range(len(coded))]


def get(path):
    with urllib.request.urlopen(f"http://127.0.0.1:{API_PORT}{path}", timeout=20) as answer:
        return answer.read().decode()


def look():
    """The time, and the daemon's counters: `(camera, metric, reason) -> number`."""
    counters = {}
    for metric, labels, value in re.findall(r"^videofields_(\w+)\{([^}]*)\} (\d+)$", get("/metrics"), re.M):
        labels = dict(re.findall(r'(\w+)="([^"]*)"', labels))
        counters[labels.get("camera"), metric, labels.get("reason", "")] = int(value)
    return time.time(), counters


def memory(daemon):
    """RSS and PSS of the daemon, and those of all its decoding processes, MiB."""
    sums, workers = [0.0] * 4, set()
    for children in pathlib.Path(f"/proc/{daemon}/task").glob("*/children"):
        try:
            workers.update(map(int, children.read_text().split()))
        except OSError:
            pass  # That thread has ended.
    for process in (daemon, *workers):
        try:
            text = pathlib.Path(f"/proc/{process}/smaps_rollup").read_text(encoding="ascii")
        except OSError:
            continue  # That process has.
        for at, kind in enumerate(("Rss", "Pss")):
            sums[at + 2 * (process != daemon)] += int(re.search(rf"^{kind}:\s+(\d+)", text, re.M)[1]) / 1024
    return sums


def slope(points):
    """Slope of the line nearest to points, by least squares."""
    mean = [sum(values) / len(points) for values in zip(*points)]
    spread = sum((x - mean[0]) ** 2 for x, _ in points)
    return sum((x - mean[0]) * (y - mean[1]) for x, y in points) / spread if spread else 0.0


def lost_datagrams():
    """Datagrams that the kernel had no room for, of all programs."""
    lines = pathlib.Path("/proc/net/snmp").read_text(encoding="ascii").splitlines()
    heads, values = [line.split() for line in lines if line.startswith("Udp:")]
    return int(dict(zip(heads, values))["RcvbufErrors"])


class Run:
    """Daemon and cameras, from their beginning to their end."""

    def __init__(self, arguments, out):
        self.secs, self.out, self.began = arguments.seconds, out, time.time()
        self.cameras = [Camera(number, arguments, out) for number in range(arguments.cameras)]
        self.seen, self.samples, self.live_secs, self.told = [(self.began, {})], [], collections.Counter(), []
        config = (f'[server]\nlisten = "127.0.0.1:{API_PORT}"\n[storage]\ndatabase = "{out}/db.sqlite"\n'
                  f'[archive]\nfolder = "{out}/archive"\nsegment_secs = 10\nmin_free_mib = 0\n'
                  "[accuracy]\nmeasure_at_start = false\n[render]\nwarm_up = false\n")
        (out / "hour.toml").write_text(config + "".join(camera.config() for camera in self.cameras))
        environment = {"VIDEOFIELDS_LOG": "info"} | os.environ | {"HOUR_PASSWORD": "p"}
        command = ["nice", "-n", "-5", arguments.daemon, "serve", "--config", out / "hour.toml"]
        with open(out / "daemon.log", "w", encoding="utf-8") as log:
            self.daemon = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
        try:
            self.follow()
        finally:
            for camera in self.cameras:
                camera.end.set()
            self.daemon.terminate()
            self.status = self.daemon.wait(30)

    def follow(self):
        threads = [threading.Thread(target=camera.run) for camera in self.cameras]
        for thread in threads:
            thread.start()
        while time.time() < self.began + self.secs and self.daemon.poll() is None:
            time.sleep(LOOK_SECS)
            try:
                self.look()
            except OSError:
                continue  # It starts yet, or is slow.
            passed = time.time() - self.began
            if passed >= SETTLED_SECS + MEMORY_SECS * len(self.samples):
                self.samples.append((passed / 3600, *memory(self.daemon.pid)))
        for camera in self.cameras:
            camera.end.set()
        for thread in threads:
            thread.join()
        time.sleep(5)  # What is on its way arrives.
        self.look()

    def look(self):
        self.seen.append(look())
        self.told = json.loads(get("/api/v1/cameras"))["cameras"]
        passed = self.seen[-1][0] - self.seen[-2][0]
        self.live_secs.update({camera["id"]: passed for camera in self.told if camera["state"] == "live"})


def hold_counters_against_files(account, counters, told):
    """Metrics, the API, the index and the files say the same."""
    sums, recording, in_files = collections.Counter(), told["recording"], len(account.recorded)
    for (camera, metric, _reason), n in counters.items():
        sums[metric] += n if camera == account.camera.id else 0
    counted = {"in files": in_files, "in the index": account.n_indexed,
               "by metrics": sums["archive_frames_total"], "by the API": recording["frames"]}
    account.check(len(set(counted.values())) == 1, f"recorded frames are {counted}")
    for of_api, metric in ((recording["dropped"], "archive_frames_dropped_total"), (told["frames"], "ingest_frames_total"),
                           (told["dropped"], "ingest_frames_dropped_total")):
        account.check(of_api == sums[metric], f"{of_api} by the API, {metric} is {sums[metric]}")


def report(run, out):
    """Prints the account of each camera; the number of what is unexplained or at fault."""
    kinds, totals = [*REASONS, "unexplained"], collections.Counter()
    faults = [f"the daemon ended with {run.status}"] * (run.status != 0)
    log = (out / "daemon.log").read_text(errors="replace")
    faults += [f"the daemon's log: {line}" for line in log.splitlines() if "panicked" in line]
    heads = ("camera", "sent whole", "recorded", *kinds, "+ touched", "in index", "live s", "connections", "episodes")
    print(*(f"{head:>11}" for head in heads))
    details = []
    for camera, told in zip(run.cameras, run.told):
        counters = run.seen[-1][1]
        account = Account(camera, out, run.seen)
        hold_counters_against_files(account, counters, told)
        n_recorded = len(account.recorded) - account.n_touched
        row = [account.n_whole, n_recorded, *(account.why[kind] for kind in kinds), account.n_touched, account.n_indexed,
               round(run.live_secs[camera.id]), len(account.sent), len(camera.episodes)]
        print(*(f"{value:>11}" for value in (camera.id, *row)))
        totals.update(dict(enumerate(row)))
        faults += account.faults
        dropped = {reason: n for (id_, metric, reason), n in counters.items()
                   if n and (id_, metric) == (camera.id, "archive_frames_dropped_total")}
        details.append(f"{camera.id}: the daemon counted as not recorded: {dropped or 'none'}")
        places = collections.defaultdict(list)
        for connection, n, part in account.unexplained:
            places[connection, part].append(n)
        details += [f"{camera.id}: unexplained in episode {episode}, connection {connection}, at its {part}: {len(numbers)} frames, "
                    f"{numbers[0]} to {numbers[-1]} ({', '.join(camera.episodes[episode - 1]['faults'])})"
                    for ((episode, connection), part), numbers in places.items()]
    print(*(f"{value:>11}" for value in ("all", *totals.values())))
    meanings = REASONS | {"+ touched": "recorded although a fault was injected into them: not among those sent whole"}
    print(*(f"{kind}: {meaning}" for kind, meaning in meanings.items()), *details, sep="\n")
    reasons = collections.Counter(re.sub(r"rtsp://\S+ ", "", error) for error in re.findall(r"source failed.* error=(.*) retry_in", log))
    print(*(f"connections that ended: {n} times: {reason}" for reason, n in reasons.most_common()), sep="\n")
    for at, name in enumerate(("daemon RSS", "daemon PSS", "decoders RSS", "decoders PSS"), 1):
        points = [(sample[0], sample[at]) for sample in run.samples]
        if len(points) >= 4:
            values, half = [y for _, y in points], points[len(points) // 2:]
            print(f"{name}: {min(values):.1f} to {max(values):.1f} MiB, {slope(half):+.1f} MiB an hour over the second half")
    print(*(f"at fault: {fault}" for fault in faults), sep="\n")
    return len(faults) + totals[2 + kinds.index("unexplained")]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=os.path.abspath)
    parser.add_argument("--seconds", type=float, default=3600)
    parser.add_argument("--cameras", type=int, default=8)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--daemon", default="target/debug/videofields")
    parser.add_argument("--out", help="a folder for all of the run, which is kept")
    parser.add_argument("--only", help="faults that may come, with commas between them, of " + ", ".join(FAULTS))
    parser.add_argument("--options", default="{}", help="options of the servers that hold in all episodes, JSON: to find a fault's cause")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="videofields-hour-") as folder:
        out = pathlib.Path(arguments.out or folder).resolve()
        (out / "media").mkdir(parents=True)
        subprocess.run([os.path.join(arguments.folder, "media.sh")], check=True, stdout=subprocess.DEVNULL,
                       env=os.environ | {"CASES_MEDIA": str(out / "media")})
        lost_before = lost_datagrams()
        run = Run(arguments, out)
        for camera in run.cameras:
            (out / f"{camera.id}.json").write_text(json.dumps(camera.episodes, indent=1))
        n_at_fault = report(run, out)
        print("datagrams that the kernel lost meanwhile:", lost_datagrams() - lost_before)
        return 1 if n_at_fault else 0


if __name__ == "__main__":
    sys.exit(main())
