#!/usr/bin/env python3
"""Compares what decoding costs in two or more daemons, on the same inputs in one run, and prints it as Markdown.

    tests/cameras/costs.py --daemon BEFORE --daemon AFTER [--name before --name after] [--rounds N] [--seconds N] [--quick]
                           [--parts cpu,latency,past] [--source rtsp|file] [--most-cpu-percent N] [--most-pss-mb N] ...

Daemons are measured in turns, each started anew in a temporary folder, without users, on a loopback port; figures are medians over
rounds, and all others are held against the first. Cameras send the demo's clips with some noise, as H.264 with a key frame every 2 s.

- `cpu`: 16 cameras of 640 x 360 and 8 of 1280 x 720, 10 frames a second, by RTSP from one process (or as files), vision by its
  defaults, nothing recorded, 16 MiB of memory a camera. Processor time of the daemon and all that descends from it, by /proc/*/stat,
  and the sum of their proportional set sizes (PSS), by /proc/*/smaps_rollup. Percents "a camera" are of one processor; 1 MB = 10^6.
- `latency`: a camera of JPEG over HTTP, 1280 x 720, vision off. From when a picture's last byte was written until an answer of
  `/api/v1/cameras/{id}` is there whose `last` is another than before. It is asked for again and again over one connection, but only
  while a picture is on its way; the time of one such question is how fine the figure is, and is printed.
- `past`: all daemons record a camera of 1280 x 720 at once, vision off, until the server ends (files go on). Then they are asked in
  turns for pictures, `frame.jpg?t=`, at instants at random (the same for all), and frame by frame, as many on as back.

Ends with 1 where a bound is exceeded that --most-... names, or a daemon fails to do the work, else with 0. Needs ffmpeg. Takes eleven
minutes with two daemons, with --quick less than two; what that prints is to try the script alone. Nothing else may run beside it.
"""
import argparse
import contextlib
import ctypes
import datetime
import http.client
import json
import math
import os
import pathlib
import random
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time

from sender import RATE_HZ, PictureServer, RtspServer

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENES = ("west", "east", "north")
# Name, number of cameras, columns and rows, bits a second.
SETS = (("small", 16, 640, 360, "500k"), ("large", 8, 1280, 720, "1200k"))
START_SECS, STOP_SECS, ANSWER_SECS = 60.0, 10.0, 15.0
# Seconds of a recording's beginning and end at which nothing is asked for: the end is in memory yet.
LEFT_OUT_SECS = 3.0
TICKS_HZ = os.sysconf("SC_CLK_TCK")
CONFIG = """\
[storage]
database = "costs.sqlite"
[media]
roots = ["{media}"]
[archive]
folder = "{archive}"
segment_secs = 10
min_free_mib = 0
[accuracy]
measure_at_start = false
[timeline]
mib_per_camera = 16
[render]
warm_up = false
"""


class Failure(Exception):
    """Why a daemon cannot be measured."""


def make_clips(folder):
    """Makes clips, bare and as files, and pictures of one of them."""
    for size, _, columns, rows, rate in SETS:
        for scene in SCENES:
            stem = folder / f"{size}-{scene}"
            filters = f"scale={columns}:{rows}:flags=bicubic,noise=alls=4:allf=t,format=yuv420p"
            film = ["-i", ROOT / "config/demo/clips" / f"{scene}.webm", "-vf", filters, "-r", str(RATE_HZ), "-an"]
            encoder = ["-c:v", "libx264", "-preset", "veryfast", "-bf", "0", "-g", "20", "-b:v", rate, "-maxrate", rate, "-bufsize", rate,
                       "-x264-params", "scenecut=0:sliced-threads=0:slices=1:repeat-headers=1"]
            run_ffmpeg(*film, *encoder, "-f", "h264", f"{stem}.h264")
            run_ffmpeg("-r", str(RATE_HZ), "-i", f"{stem}.h264", "-c", "copy", f"{stem}.mp4")
    run_ffmpeg("-i", folder / "large-west.mp4", "-q:v", "4", folder / "picture%03d.jpg")


def run_ffmpeg(*words):
    subprocess.run(["ffmpeg", "-v", "error", "-y", *words], check=True, stdin=subprocess.DEVNULL)


def end_with_parent():
    """Has the kernel end this process when the script is gone, however that ended."""
    pr_set_pdeathsig = 1
    ctypes.CDLL(None, use_errno=True).prctl(pr_set_pdeathsig, signal.SIGTERM)


class Daemon:
    """A daemon in a folder of its own, which ends and goes with it."""

    def __init__(self, binary, cameras, media, is_recorded=False):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="videofields-costs-"))
        self.process, self.connection = None, None
        try:
            blocks = (f'[[camera]]\nid = "{id_}"\n{keys}\n' for id_, keys in cameras.items())
            config = self.folder / "costs.toml"
            config.write_text(CONFIG.format(media=media, archive="archive" if is_recorded else "") + "".join(blocks))
            self.start(binary, config)
        except BaseException:
            self.close()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def start(self, binary, config):
        environment = {name: value for name, value in os.environ.items() if not name.startswith(("VIDEOFIELDS_", "RUST_LOG"))}
        command = [binary, "serve", "--config", str(config), "--listen", "127.0.0.1:0", "--log", "warn"]
        with open(self.folder / "log", "wb") as log:
            self.process = subprocess.Popen(
                command, cwd=self.folder, start_new_session=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log,
                preexec_fn=end_with_parent, env=environment | {"NODEVICE_SELECT": "1"})
        found = re.search(rb":(\d+)/", self.process.stdout.readline())
        if not found:
            self.fail("it does not start")
        self.port = int(found[1])
        # What it says later is read and dropped, so that it never waits for a reader.
        threading.Thread(target=self.process.stdout.read, daemon=True).start()

    def fail(self, why):
        log = (self.folder / "log").read_text(errors="replace")
        raise Failure(f"{why}\n{log[-4000:]}")

    def get(self, path):
        """An answer's status, header fields and body, over a connection that is kept."""
        is_new = self.connection is None
        if is_new:
            self.connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=ANSWER_SECS)
        try:
            self.connection.request("GET", path)
            answer = self.connection.getresponse()
            return answer.status, answer.headers, answer.read()
        except (OSError, http.client.HTTPException) as error:
            self.connection.close()
            self.connection = None
            if is_new or isinstance(error, TimeoutError):
                raise
        return self.get(path)  # The daemon had closed it, since nothing was asked for some time.

    def cameras(self):
        return json.loads(self.get("/api/v1/cameras")[2])["cameras"]

    def camera(self, id_):
        return json.loads(self.get(f"/api/v1/cameras/{id_}")[2])

    def wait_until_live(self):
        """Waits until each camera has shown some frames."""
        end = time.monotonic() + START_SECS
        while True:
            told = self.cameras()
            if all(camera["state"] == "live" and camera["frames"] >= 3 for camera in told):
                return
            if self.process.poll() is not None or time.monotonic() > end:
                states = [(camera["id"], camera["state"], camera["reason"]) for camera in told]
                self.fail(f"not all cameras are live: {states}")
            time.sleep(0.2)

    def n_frames(self):
        return sum(camera["frames"] for camera in self.cameras())

    def close(self):
        if self.connection:
            self.connection.close()
        if self.process:
            self.process.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(STOP_SECS)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)  # Nothing is left of it, however it ended.
            self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


def family(root):
    """Processor seconds of a process and of all that descend from it or are of its session, by their numbers."""
    stats = {}
    for path in pathlib.Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            # Behind the name, which may hold anything: state, parent, group, session, and so on.
            stats[int(path.parent.name)] = path.read_text(errors="replace").rpartition(")")[2].split()
    found = {root} | {process for process, fields in stats.items() if int(fields[3]) == root}
    while more := {process for process, fields in stats.items() if int(fields[1]) in found} - found:
        found |= more
    # User and system time of its own, and of children that have ended and were waited for.
    return {process: sum(map(int, stats[process][11:15])) / TICKS_HZ for process in found if process in stats}


def pss_mb(processes):
    """Sum of proportional set sizes."""
    total = 0.0
    for process in processes:
        try:
            text = pathlib.Path(f"/proc/{process}/smaps_rollup").read_text(encoding="ascii")
        except (FileNotFoundError, ProcessLookupError):
            continue  # It has ended.
        total += int(re.search(r"^Pss:\s+(\d+)", text, re.M)[1]) * 1024 / 1e6
    return total


def percentile(values, share):
    """The least value that so large a share of all does not exceed; of none there is no number."""
    return sorted(values)[max(0, math.ceil(share * len(values)) - 1)] if values else math.nan


def source(arguments, server, clip, number):
    """Keys of a camera that shows a clip."""
    if arguments.source == "file":
        return f'source = {{ path = "{arguments.media}/{clip}.mp4", end = "loop" }}'
    return f'source = {{ url = "rtsp://127.0.0.1:{server.port}/{clip}/{number}" }}'


def measure_cpu(arguments, binary, server, size, n_cameras):
    """One run of a set of cameras: processor seconds a second, PSS, processes, frames a second."""
    clips = [f"{size}-{SCENES[number % len(SCENES)]}" for number in range(n_cameras)]
    cameras = {f"c{number}": source(arguments, server, clip, number) for number, clip in enumerate(clips)}
    with Daemon(binary, cameras, arguments.media) as daemon:
        daemon.wait_until_live()
        time.sleep(arguments.warm_up)
        pss, n_before, counted_first = [], daemon.n_frames(), time.monotonic()
        before, began = family(daemon.process.pid), time.monotonic()
        n_looks = 5
        for look in range(1, n_looks + 1):
            time.sleep(max(0.0, began + look * arguments.seconds / n_looks - time.monotonic()))
            after, ended = family(daemon.process.pid), time.monotonic()
            pss.append(pss_mb(after))
        n_frames, counted = daemon.n_frames() - n_before, time.monotonic()
        passed = ended - began
        if daemon.process.poll() is not None:
            daemon.fail("it has ended")
        return {"cpu": (sum(after.values()) - sum(before.values())) / passed, "pss": statistics.median(pss), "processes": len(after),
                "frames": n_frames / (counted - counted_first)}


def compare_cpu(arguments):
    """Prints processor time and memory of both sets, and returns bounds that are exceeded."""
    exceeded, rows = [], []
    for size, n_cameras, columns, n_rows, _ in SETS:
        runs = {name: [] for name in arguments.names}
        paths = [arguments.media / f"{size}-{scene}.h264" for scene in SCENES]
        for _ in range(arguments.rounds):
            for name, binary in zip(arguments.names, arguments.daemon):
                with RtspServer(paths) as server:
                    tell(f"{n_cameras} cameras of {columns} x {n_rows}: {name}")
                    runs[name].append(measure_cpu(arguments, binary, server, size, n_cameras))
        middle = {name: {key: statistics.median(run[key] for run in of) for key in of[0]} for name, of in runs.items()}
        first = middle[arguments.names[0]]
        for name, of in middle.items():
            cpu, pss = of["cpu"] - first["cpu"], of["pss"] - first["pss"]
            more = [f"{100 * cpu / first['cpu']:+.1f} %", f"{100 * cpu / n_cameras:+.2f} %", f"{pss / n_cameras:+.1f} MB"]
            more = ["", "", ""] if of is first else more
            each = " ".join(f"{run['cpu']:.3f}" for run in runs[name])
            rows.append([f"{n_cameras} of {columns} x {n_rows}", name, f"{of['cpu']:.3f}", each, f"{100 * of['cpu'] / n_cameras:.2f} %",
                         more[0], more[1], f"{of['pss']:.0f} MB", f"{of['pss'] / n_cameras:.1f} MB", more[2], f"{of['processes']:.0f}",
                         f"{of['frames']:.1f}"])
            what = f"{name}, {n_cameras} cameras of {columns} x {n_rows}"
            exceeded += exceeds(f"{what}: processor a camera, percent of one, more", 100 * cpu / n_cameras, arguments.most_cpu_percent)
            rise = 100 * cpu / first["cpu"]
            exceeded += exceeds(f"{what}: processor, percent of the first daemon's, more", rise, arguments.most_cpu_rise_percent)
            exceeded += exceeds(f"{what}: PSS a camera, MB, more", pss / n_cameras, arguments.most_pss_mb)
            # One that leaves work undone is cheap.
            exceeded += exceeds(f"{what}: frames a second that are missing, percent", 100 - 100 * of["frames"] / (n_cameras * RATE_HZ), 5)
    print_table("Processor and memory", ["cameras", "daemon", "processor, s/s", "each round", "a camera", "more", "more a camera", "PSS",
                                         "a camera", "more a camera", "processes", "frames a second"], rows)
    return exceeded


def measure_latency(arguments, binary, pictures):
    """Milliseconds until each picture was shown, those of single questions, and how many were not shown before the next."""
    shown_ms, asked_ms, n_missed = [], [], 0
    with contextlib.ExitStack() as stack:
        server = stack.enter_context(PictureServer())
        keys = f'vision = false\nsource = {{ url = "http://127.0.0.1:{server.port}/" }}'
        daemon = stack.enter_context(Daemon(binary, {"http": keys}, arguments.media))
        n_first, n, taken = 2 * RATE_HZ, 0, 0
        due, end = time.monotonic(), time.monotonic() + START_SECS
        while taken < n_first + arguments.frames:
            before = daemon.camera("http")["last"]
            due = max(due + 1 / RATE_HZ, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()))
            written, n = server.write(pictures[n % len(pictures)]), n + 1
            if written is None:
                if time.monotonic() > end:
                    daemon.fail("it does not connect")
                continue
            shown, questions = None, []
            while shown is None and time.monotonic() < due + 0.9 / RATE_HZ:
                asked = time.monotonic()
                is_shown = daemon.camera("http")["last"] != before
                answered = time.monotonic()
                questions.append(1000 * (answered - asked))
                shown = answered if is_shown else None
            if before is None and shown is None and time.monotonic() < end:
                continue  # It reads the first pictures.
            taken += 1
            if taken <= n_first:
                continue
            asked_ms += questions
            if shown is None:
                n_missed += 1
            else:
                shown_ms.append(1000 * (shown - written))
    return shown_ms, asked_ms, n_missed


def compare_latency(arguments):
    """Prints how long pictures take until they are shown, and returns bounds that are exceeded."""
    pictures = [path.read_bytes() for path in sorted(arguments.media.glob("picture*.jpg"))]
    runs = {name: [] for name in arguments.names}
    for _ in range(arguments.rounds):
        for name, binary in zip(arguments.names, arguments.daemon):
            tell(f"latency: {name}")
            runs[name].append(measure_latency(arguments, binary, pictures))
    exceeded, rows, first = [], [], None
    for name, of in runs.items():
        median, late = (statistics.median(percentile(shown, share) for shown, _, _ in of) for share in (0.5, 0.9))
        n, n_missed = sum(len(shown) for shown, _, _ in of), sum(missed for _, _, missed in of)
        asked = statistics.median(percentile(questions, 0.5) for _, questions, _ in of)
        first = median if first is None else first
        rows.append([name, n, n_missed, f"{median:.2f} ms", " ".join(f"{percentile(shown, 0.5):.2f}" for shown, _, _ in of), f"{late:.2f} ms",
                     f"{median - first:+.2f} ms" if rows else "", f"{asked:.2f} ms"])
        exceeded += exceeds(f"{name}: latency, ms, more", median - first, arguments.most_latency_ms)
        exceeded += exceeds(f"{name}: pictures that were not shown, percent", 100 * n_missed / max(1, n + n_missed), 5)
    print_table("Latency of a picture over HTTP", ["daemon", "frames", "not shown in time", "median", "each round", "90th percentile",
                                                   "median, more", "one question"], rows)
    return exceeded


def nanos(text):
    """Nanoseconds since 1970 of a time in UTC (RFC 3339)."""
    whole, _, fraction = text.removesuffix("Z").partition(".")
    seconds = datetime.datetime.fromisoformat(whole).replace(tzinfo=datetime.timezone.utc).timestamp()
    return int(seconds) * 10**9 + int(fraction.ljust(9, "0")[:9])


class Past:
    """Questions for one daemon's recording: what they took, and which failed."""

    def __init__(self, daemon):
        self.daemon, self.first = daemon, nanos(daemon.camera("past")["last"])
        self.milliseconds, self.n_failed, self.n_in_memory = {"seeks": [], "steps": []}, 0, 0

    def end(self):
        self.last = nanos(self.daemon.camera("past")["last"])

    def ask(self, kind, at, tolerance_secs):
        """Asks for the picture of an instant, and returns its own time, or None where it is another's or there is none."""
        began = time.monotonic()
        status, fields, _ = self.daemon.get(f"/api/v1/cameras/past/frame.jpg?t={at}")
        passed = time.monotonic() - began
        shown = nanos(fields["Videofields-Time"]) if status == 200 else None
        if shown is None or abs(shown - at) > tolerance_secs * 1e9:
            self.n_failed += 1
            return None
        self.milliseconds[kind].append(1000 * passed)
        self.n_in_memory += fields["Videofields-Frame"] != "0"
        return shown

    def instant(self, share):
        left_out = int(LEFT_OUT_SECS * 1e9)
        return self.first + left_out + int(share * (self.last - self.first - 2 * left_out))

    def look(self, seed, n):
        """Asks for pictures at random, and then frame by frame, half of them back."""
        chance, period = random.Random(seed), 10**9 // RATE_HZ
        self.daemon.camera("past")  # A connection that is there is no part of what is measured.
        for _ in range(n):
            self.ask("seeks", self.instant(chance.random()), 0.75 / RATE_HZ)
        at = self.ask("seeks", self.instant(chance.uniform(0, 0.5)), 0.75 / RATE_HZ)
        for step in range(n):
            way = period if step < n // 2 else -period
            at = self.ask("steps", at + way, 0.45 / RATE_HZ) if at is not None else None


def compare_past(arguments):
    """Prints how long looking back takes; no bound is set to it, but all must be answered."""
    with contextlib.ExitStack() as stack:
        server = stack.enter_context(RtspServer([arguments.media / "large-west.h264"]))
        keys = "vision = false\n" + source(arguments, server, "large-west", 0)
        pasts = {}
        tell("recording")
        for name, binary in zip(arguments.names, arguments.daemon):
            daemon = stack.enter_context(Daemon(binary, {"past": keys}, arguments.media, is_recorded=True))
            daemon.wait_until_live()
            pasts[name] = Past(daemon)
        time.sleep(arguments.record_seconds)
        for past in pasts.values():
            past.end()
        server.stop()
        time.sleep(2)  # What is on its way is written.
        for turn in range(arguments.rounds):
            for name, past in pasts.items():
                tell(f"looking back: {name}")
                past.look(turn, math.ceil(arguments.seeks / arguments.rounds))
    rows, exceeded, firsts = [], [], {}
    for name, past in pasts.items():
        for kind, of in past.milliseconds.items():
            median = percentile(of, 0.5)
            more = f"{median - firsts[kind]:+.1f} ms" if kind in firsts else ""
            firsts.setdefault(kind, median)
            rows.append([kind, name, len(of), f"{median:.1f} ms", f"{percentile(of, 0.9):.1f} ms", more, past.n_failed, past.n_in_memory])
        unanswered = 2 * arguments.seeks - sum(map(len, past.milliseconds.values()))
        exceeded += exceeds(f"{name}: questions for the past that were not answered, percent", 50 * unanswered / arguments.seeks, 5)
    heads = ["", "daemon", "answered", "median", "90th percentile", "median, more", "failed (both)", "from memory (both)"]
    print_table("Looking back", heads, sorted(rows, key=lambda row: row[0]))
    return exceeded


def exceeds(what, value, bound):
    """Tells of a bound that is exceeded, in a list, which else is empty."""
    return [f"{what}: {value:.2f}, at most {bound:g}"] if bound is not None and not value <= bound else []


def print_table(title, heads, rows):
    lines = [heads, ["---"] * len(heads), *rows]
    print(f"\n## {title}\n", *("| " + " | ".join(map(str, line)) + " |" for line in lines), sep="\n", flush=True)


def tell(text):
    print(f"{time.strftime('%H:%M:%S')} {text}", file=sys.stderr, flush=True)


def machine():
    """Processors, and what they do already."""
    models = re.findall(r"^model name\s*: (.*)$", pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.M) or ["unknown"]
    load = pathlib.Path("/proc/loadavg").read_text(encoding="ascii").split()[0]
    return f"{len(os.sched_getaffinity(0))} processors ({models[0]}), load at the beginning {load}"


PARTS = {"cpu": compare_cpu, "latency": compare_latency, "past": compare_past}


def read_arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--daemon", action="append", required=True, type=os.path.abspath,
                        help="a binary; the first is what others are held against")
    parser.add_argument("--name", action="append", dest="names", default=[], help="what it is called, in the same order")
    parser.add_argument("--rounds", type=int, default=2, help="how often each is measured (%(default)s)")
    parser.add_argument("--seconds", type=float, default=40.0, help="for how long processor time is measured (%(default)s)")
    parser.add_argument("--warm-up", type=float, default=10.0, help="seconds before that, with all cameras live (%(default)s)")
    parser.add_argument("--frames", type=int, default=120, help="pictures of each round of which latency is measured (%(default)s)")
    parser.add_argument("--record-seconds", type=float, default=60.0, help="for how long is recorded (%(default)s)")
    parser.add_argument("--seeks", type=int, default=100, help="seeks, and as many steps, of each daemon (%(default)s)")
    parser.add_argument("--parts", default=",".join(PARTS), help="what is measured (%(default)s)")
    parser.add_argument("--source", choices=["rtsp", "file"], default="rtsp", help="how clips reach the daemon (%(default)s)")
    parser.add_argument("--quick", action="store_true", help="all of it, but short")
    parser.add_argument("--most-cpu-percent", type=float, help="most of one processor that a camera may take more than in the first, percent")
    parser.add_argument("--most-cpu-rise-percent", type=float, help="most that processor time may rise, percent of the first's")
    parser.add_argument("--most-pss-mb", type=float, help="most memory that a camera may take more than in the first, MB")
    parser.add_argument("--most-latency-ms", type=float, help="most that the median latency may rise, milliseconds")
    found = parser.parse_args()
    if found.quick:
        found.rounds, found.seconds, found.warm_up, found.frames, found.record_seconds, found.seeks = 1, 5.0, 3.0, 50, 15.0, 30
    found.names += [f"{number}" for number in range(len(found.names) + 1, len(found.daemon) + 1)]
    found.parts = found.parts.split(",")
    if len(set(found.names)) != len(found.daemon):
        parser.error("each daemon has one name, and no two the same")
    if found.rounds < 1 or not set(found.parts) <= set(PARTS):
        parser.error(f"there is at least one round, and parts are {', '.join(PARTS)}")
    return found


def main():
    arguments = read_arguments()
    # A signal that ends the script ends its daemons and takes their folders away too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    print(machine())
    for name, binary in zip(arguments.names, arguments.daemon):
        print(f"{name}:", subprocess.run([binary, "--version"], check=True, capture_output=True, text=True, timeout=20).stdout.strip())
    exceeded = []
    with tempfile.TemporaryDirectory(prefix="videofields-clips-") as folder:
        arguments.media = pathlib.Path(folder)
        tell("making clips")
        make_clips(arguments.media)
        for part in arguments.parts:
            try:
                exceeded += PARTS[part](arguments)
            except (Failure, OSError, http.client.HTTPException) as error:
                exceeded.append(f"{part}: {type(error).__name__}: {error}")
    print("", *(f"exceeded: {what}" for what in exceeded), sep="\n")
    return 1 if exceeded else 0


if __name__ == "__main__":
    sys.exit(main())
