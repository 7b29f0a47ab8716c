"""House under attack: a daemon with the demo's plaza, its database, accounts and recordings, all in a temporary folder."""

import argparse
import ctypes
import os
import pathlib
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time

from .callers import Caller

ROOT = pathlib.Path(__file__).resolve().parents[3]
DEMO = ROOT / "config" / "demo"
PASSWORD = "a password of this house"
ALL = "*=live,history,export,manage"
START_SECONDS = 120.0
CAMERAS = ("west", "east", "north")
WRITTEN_BY_CAMERAS = {"background", "background_history", "texture_map", "measured_cost", "segment", "activity", "track",
                      "entity_set", "entity_span", "entity"}

CONFIG = """\
[storage]
database = "attacks.sqlite"
{storage}
[media]
roots = ["{clips}", "films"]
[archive]
folder = "archive"
segment_secs = 5
min_free_mib = 0
export_gib = 0.05
{archive}
[accuracy]
measure_at_start = false
[timeline]
mib_per_camera = 16
[render]
cache_mib = 8
{cameras}
[[scene]]
id = "plaza"
file = "{demo}/plaza.json"
{more}
"""
CAMERA = """\
[[camera]]
id = "{id}"
source = {{ path = "{clips}/{id}.webm", end = "loop" }}
segment = {{ delta = 0.1, min_area_px = 40 }}
"""


def arguments(description, seconds):
    """The arguments that every script takes."""
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--daemon", default=os.environ.get("VIDEOFIELDS", str(ROOT / "target/release/videofields")),
                        help="the videofields binary that is attacked (default: the release build)")
    parser.add_argument("--seconds", type=float, default=seconds, help="for how long the victim is measured each time (%(default)s)")
    parser.add_argument("--quick", action="store_true",
                        help="a few seconds: answers, memory and rows are judged, and times are printed alone")
    found = parser.parse_args()
    # A signal that ends the script ends its daemon and takes its folder away too.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    if found.quick:
        found.seconds = min(found.seconds, 2.0)
    return found


class House:
    """A running daemon: `root` (admin), `olga` (operator with every right), `otto` (operator who manages west alone), `vera` (viewer
    who sees west alone), and their tokens."""

    def __init__(self, daemon, storage="", archive="", more="", sign=False):
        self.binary = os.path.abspath(daemon)
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="videofields-attack-"))
        self.daemon, self.log_bytes, self.log_tail = None, 0, b""
        try:
            self._prepare(storage, archive, more, sign)
            self._start()
        except BaseException:
            self.close()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def command(self, *words, feed="", check=True):
        """Runs a command of the binary on this house's configuration."""
        done = subprocess.run([self.binary, *words], input=feed, capture_output=True, text=True, timeout=60,
                              env=self.environment(), check=False)
        if check and done.returncode != 0:
            raise RuntimeError(f"{words}: {done.stderr}")
        return done

    @staticmethod
    def environment():
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("VIDEOFIELDS_", "RUST_LOG"))}
        return kept | {"NODEVICE_SELECT": "1"}

    def _prepare(self, storage, archive, more, sign):
        (self.folder / "films").mkdir()
        if sign:
            storage += '\naudit_key = "audit.key"'
        cameras = "".join(CAMERA.format(id=of, clips=DEMO / "clips") for of in CAMERAS)
        self.config = self.folder / "attacks.toml"
        self.config.write_text(CONFIG.format(storage=storage, archive=archive, clips=DEMO / "clips", cameras=cameras, demo=DEMO, more=more))
        config = str(self.config)
        if sign:
            # The key is made before the configuration names it.
            named = self.config.read_text()
            self.config.write_text(named.replace('audit_key = "audit.key"\n', ""))
            self.command("audit", "--config", config, "key", "--out", str(self.folder / "audit.key"))
            self.config.write_text(named)
        users = [("root", "admin", ALL), ("olga", "operator", ALL), ("otto", "operator", "west=live,history,export,manage"),
                 ("vera", "viewer", "west=live,history,export")]
        self.tokens = {}
        for user, role, rights in users:
            self.command("user", config, "set", user, "--role", role, "--camera", rights, "--password", feed=PASSWORD + "\n")
            self.tokens[user] = self.command("token", config, "add", user, "--note", "attack").stdout.strip().splitlines()[0]

    def _start(self):
        self.daemon = subprocess.Popen(
            [self.binary, "serve", "--config", str(self.config), "--listen", "127.0.0.1:0", "--log", "info"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=self.environment(), preexec_fn=end_with_parent)
        threading.Thread(target=self._read_log, daemon=True).start()
        line = self.daemon.stdout.readline().decode()
        found = re.search(r":(\d+)/", line)
        if not found:
            raise RuntimeError(f"the daemon does not start: {line}{self.log()}")
        self.port = int(found[1])
        root, end = self.caller("root"), time.monotonic() + START_SECONDS
        while True:
            ready = root.get("/readyz")
            live = {camera["id"]: camera["state"] for camera in root.get("/api/v1/cameras").json().get("cameras", [])}
            if ready.status == 200 and all(live.get(of) == "live" for of in CAMERAS):
                break
            if self.daemon.poll() is not None or time.monotonic() > end:
                raise RuntimeError(f"the daemon is not ready: {ready.text} {live}\n{self.log()}")
            time.sleep(0.2)
        self.ready_at = time.monotonic()
        # The first picture makes the device's programs.
        root.get("/api/v1/scenes/plaza/view.jpg?width=320&height=180&entities=none")

    def _read_log(self):
        """Counts the log's bytes and keeps its end."""
        while piece := self.daemon.stderr.read1(1 << 16):
            self.log_bytes += len(piece)
            self.log_tail = (self.log_tail + piece)[-(1 << 20):]

    def log(self):
        return self.log_tail.decode("utf-8", "replace")

    def caller(self, user=None, address="127.0.0.1", **more):
        return Caller(self.port, self.tokens[user] if user else None, address, **more)

    def log_in(self, user, password, address="127.0.0.1"):
        return Caller(self.port, None, address).post("/api/v1/session", {"user": user, "password": password})

    # Figures ---------------------------------------------------------------------------------------------------------------
    def rss_mib(self, peak=False):
        """Resident memory of the daemon alone."""
        return status_mib(self.daemon.pid, "VmHWM" if peak else "VmRSS")

    def rss_decoders_mib(self):
        """Resident memory of the processes that it started: they decode cameras."""
        total = 0.0
        for children in pathlib.Path(f"/proc/{self.daemon.pid}/task").glob("*/children"):
            try:
                total += sum(status_mib(int(child), "VmRSS") for child in children.read_text().split())
            except OSError:
                pass  # That thread has ended.
        return total

    def n_descriptors(self):
        return len(os.listdir(f"/proc/{self.daemon.pid}/fd"))

    def n_audit_rows(self, of_strangers=False):
        with self.database() as database:
            which = " where user is null" if of_strangers else ""
            return database.execute(f"select count(*) from audit{which}").fetchone()[0]

    def settle(self, seconds=20.0):
        """Waits until memory stays as it is for three seconds; what the daemon needs for itself is there then."""
        end, seen = time.monotonic() + seconds, []
        while time.monotonic() < end:
            seen.append(self.rss_mib())
            if len(seen) >= 7 and max(seen[-7:]) - min(seen[-7:]) < 2.0:
                break
            time.sleep(0.5)

    def wait_until_quick(self, seconds=20.0):
        """Waits until nothing of an attack is left: a small view is drawn within a second."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            answer = self.caller("root").get(f"/api/v1/scenes/plaza/view.jpg?width=64&height=36&entities=none&eye=-9,{-9 - time.time() % 1:.4f},6")
            if answer.status == 200 and answer.seconds < 1.0:
                break

    def database(self):
        return sqlite3.connect(f"file:{self.folder}/attacks.sqlite?mode=ro", uri=True, timeout=10)

    def database_mib(self):
        return sum(path.stat().st_size for path in self.folder.glob("attacks.sqlite*") if path.is_file()) / 2**20

    def written_by_callers_mib(self):
        """Bytes in the rows that requests can write: all but those of what cameras see, which grow by themselves."""
        n_bytes = 0
        with self.database() as database:
            for (table,) in database.execute("select name from sqlite_schema where type = 'table' and name not like 'sqlite_%'").fetchall():
                if table in WRITTEN_BY_CAMERAS:
                    continue
                columns = [row[1] for row in database.execute(f"pragma table_info({table})")]
                lengths = " + ".join(f"coalesce(length(cast({column} as blob)), 0)" for column in columns)
                n_bytes += database.execute(f"select coalesce(sum({lengths}), 0) from {table}").fetchone()[0]
        return n_bytes / 2**20

    def figures(self):
        """Memory, rows of the audit log, database and log, for a table."""
        return {"daemon MiB": f"{self.rss_mib():.0f}", "decoders MiB": f"{self.rss_decoders_mib():.0f}",
                "descriptors": self.n_descriptors(), "audit rows": self.n_audit_rows(),
                "database MiB": f"{self.database_mib():.2f}", "log KiB": f"{self.log_bytes / 1024:.1f}"}

    def audit(self, user="root"):
        """All entries of the audit log."""
        entries, cursor = [], ""
        while True:
            page = self.caller(user).get(f"/api/v1/audit?limit=1000{cursor}").json()
            entries += page.get("entries", [])
            if not page.get("next"):
                return entries
            cursor = f"&cursor={page['next']}"

    def is_alive(self):
        return self.daemon is not None and self.daemon.poll() is None

    def stop(self):
        """Ends the daemon; whether it ended by itself within ten seconds."""
        if not self.is_alive():
            return False
        self.daemon.send_signal(signal.SIGTERM)
        try:
            self.daemon.wait(10)
            return True
        except subprocess.TimeoutExpired:
            self.daemon.kill()
            self.daemon.wait()
            return False

    def close(self):
        if self.daemon is not None:
            self.stop()
        if os.environ.get("ATTACKS_KEEP"):
            print(f"kept: {self.folder}", file=sys.stderr)
        else:
            shutil.rmtree(self.folder, ignore_errors=True)


def end_with_parent():
    """Has the kernel end this process when its parent is gone, however that ended."""
    pr_set_pdeathsig = 1
    ctypes.CDLL(None, use_errno=True).prctl(pr_set_pdeathsig, signal.SIGTERM)


def status_mib(process, name):
    """A figure of /proc in MiB; 0 where that process has ended."""
    try:
        text = pathlib.Path(f"/proc/{process}/status").read_text(encoding="ascii", errors="replace")
    except OSError:
        return 0.0
    found = re.search(rf"^{name}:\s+(\d+) kB", text, re.M)
    return int(found[1]) / 1024 if found else 0.0
