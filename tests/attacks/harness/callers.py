"""Callers of the daemon: single requests, and crowds of attackers in processes of their own."""

import collections
import dataclasses
import http.client
import json
import multiprocessing
import os
import socket
import threading
import time

# Longest wait for an answer: a little more than the daemon's own limit of 10 s.
ANSWER_SECONDS = 12.0


@dataclasses.dataclass
class Answer:
    """Status, fields and body of an answer; status 0 where none came, and why."""

    status: int
    fields: dict
    body: bytes
    seconds: float
    why: str = ""

    def json(self):
        try:
            return json.loads(self.body)
        except ValueError:
            return {}

    @property
    def text(self):
        return self.body.decode("utf-8", "replace")

    @property
    def is_described(self):
        """Returns true where a failure has the problem document that the interface promises."""
        document = self.json()
        return (self.fields.get("content-type", "").startswith("application/problem+json") and isinstance(document, dict)
                and document.get("status") == self.status and bool(document.get("detail")))


class Caller:
    """Caller of the daemon: by a token, a cookie or nothing, from a loopback address, over a connection that is kept or is new each time."""

    def __init__(self, port, token=None, address="127.0.0.1", keep=False, seconds=ANSWER_SECONDS):
        self.port, self.token, self.address, self.keep, self.seconds = port, token, address, keep, seconds
        self.connection = None

    def ask(self, method, path, body=None, fields=None):
        fields = dict(fields or {})
        if self.token:
            fields.setdefault("Authorization", f"Bearer {self.token}")
        if isinstance(body, (dict, list)):
            body = json.dumps(body)
            fields.setdefault("Content-Type", "application/json")
        began = time.monotonic()
        try:
            if self.connection is None:
                self.connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=self.seconds,
                                                             source_address=(self.address, 0))
            if not self.keep:
                fields.setdefault("Connection", "close")
            self.connection.request(method, path, body, fields)
            answer = self.connection.getresponse()
            read = answer.read()
            found = Answer(answer.status, {name.lower(): value for name, value in answer.getheaders()}, read,
                           time.monotonic() - began)
            if not self.keep or found.fields.get("connection") == "close":
                self.close()
            return found
        except (OSError, http.client.HTTPException, ValueError) as error:
            self.close()
            return Answer(0, {}, b"", time.monotonic() - began, f"{type(error).__name__}: {error}")

    def get(self, path, fields=None):
        return self.ask("GET", path, None, fields)

    def post(self, path, body=None, fields=None):
        return self.ask("POST", path, body, fields)

    def put_new(self, path, body):
        return self.ask("PUT", path, body, {"If-None-Match": "*"})

    def patch(self, path, body):
        return self.ask("PATCH", path, body, {"If-Match": "*"})

    def delete(self, path):
        return self.ask("DELETE", path, None, {"If-Match": "*"})

    def close(self):
        if self.connection is not None:
            self.connection.close()
            self.connection = None


def ask(port, request, address="127.0.0.1", seconds=ANSWER_SECONDS):
    """Sends raw bytes over a new connection and returns all that comes back until it is closed or the time is over."""
    read = b""
    end = time.monotonic() + seconds
    try:
        with connect(port, address) as stream:
            stream.sendall(request)
            while len(read) < 1 << 22 and (left := end - time.monotonic()) > 0:
                stream.settimeout(left)
                piece = stream.recv(1 << 16)
                if not piece:
                    break
                read += piece
    except OSError:
        pass
    return read


def connect(port, address="127.0.0.1", seconds=5.0, receive_bytes=None):
    """Connects from a loopback address; a small buffer makes a slow reader."""
    stream = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        if receive_bytes:
            stream.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
        stream.settimeout(seconds)
        stream.bind((address, 0))
        stream.connect(("127.0.0.1", port))
    except OSError:
        stream.close()
        raise
    return stream


class Crowd:
    """Attackers in one process of low priority, since they would have machines of their own. It counts what they meet.

    `attack(idx, crowd)` is called again and again by each of `n` threads until `stop`; it may `count` what it met.
    """

    def __init__(self, name, n, attack, pause_seconds=0.0):
        self.name, self.n, self.attack, self.pause_seconds = name, n, attack, pause_seconds
        context = multiprocessing.get_context("fork")
        self.over, self.pipe = context.Event(), context.Pipe(duplex=False)
        self.counts = collections.Counter()
        self.lock = None
        self.process = context.Process(target=self._run, daemon=True)

    def __enter__(self):
        self.process.start()
        self.pipe[1].close()
        return self

    def __exit__(self, *_):
        self.stop()

    def stop(self):
        """Ends the crowd, and returns what it counted."""
        if self.process.is_alive():
            self.over.set()
            try:
                if self.pipe[0].poll(ANSWER_SECONDS + 8):
                    self.counts = self.pipe[0].recv()
            except EOFError:
                pass
            self.process.join(5)
            if self.process.is_alive():
                self.process.kill()
                self.process.join()
        return self.counts

    def count(self, what, n=1):
        with self.lock:
            self.counts[str(what)] += n

    def count_answer(self, answer):
        """Counts a status; of failures of the daemon also those that no problem document describes."""
        self.count(answer.status if answer.status else "no answer")
        if answer.status >= 500 and not answer.is_described:
            self.count(f"undescribed {answer.status}")

    def _run(self):
        os.nice(19)
        self.lock = threading.Lock()

        def one(idx):
            while not self.over.is_set():
                try:
                    self.attack(idx, self)
                except OSError as error:
                    self.count(type(error).__name__)
                    self.over.wait(0.05)
                if self.pause_seconds:
                    self.over.wait(self.pause_seconds)

        threads = [threading.Thread(target=one, args=(idx,), daemon=True) for idx in range(self.n)]
        for thread in threads:
            thread.start()
        self.over.wait()
        end = time.monotonic() + ANSWER_SECONDS
        for thread in threads:
            thread.join(max(0.0, end - time.monotonic()))
        with self.lock:
            self.pipe[1].send(collections.Counter(self.counts))


def shown(counts):
    """Returns counts as one line."""
    return ", ".join(f"{name}: {n}" for name, n in sorted(counts.items())) or "nothing"
