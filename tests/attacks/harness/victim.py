"""Victim of the attacks: an owner who asks for a small view and for JSON on a schedule, in a process of its own.

    victim.py PORT TOKEN SECONDS    prints what became of its requests as JSON
"""

import json
import os
import subprocess
import sys
import threading
import time

# Requests a second: of JSON, and of views at most (the next view is asked for when the last one is there).
JSON_HZ, VIEW_HZ = 20.0, 8.0
JSON_PATH = "/api/v1/cameras"


def view_path(n):
    """The path of a small view whose eye is another each time, so that no picture that is kept answers it."""
    return f"/api/v1/scenes/plaza/view.jpg?width=320&height=180&entities=none&eye={-10 + 0.001 * (n % 4000):.3f},-14,6&target=0,0,1"


def percentile(sorted_values, share):
    return sorted_values[min(len(sorted_values) - 1, int(share * len(sorted_values)))] if sorted_values else float("nan")


class Victim:
    """Figures of a stretch of time: per kind answered, not answered, why, and milliseconds."""

    KINDS = ("json", "view")

    def __init__(self, found):
        self.of = found

    @staticmethod
    def begin(house, seconds, first_view=0):
        """Starts to measure; `finish` waits for the figures."""
        command = [sys.executable, os.path.abspath(__file__), str(house.port), house.tokens["root"], str(seconds), str(first_view)]
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    @staticmethod
    def finish(process):
        output, _ = process.communicate()
        return Victim(json.loads(output))

    @staticmethod
    def measure(house, seconds, first_view=0):
        return Victim.finish(Victim.begin(house, seconds, first_view))

    def n_answered(self, kind):
        return len(self.of[kind]["milliseconds"])

    def n_failed(self, kind):
        return sum(self.of[kind]["failures"].values())

    def p(self, kind, share):
        return percentile(self.of[kind]["milliseconds"], share)

    def with_more(self, other):
        """Both stretches of time together."""
        both = {}
        for kind in self.KINDS:
            failures = dict(self.of[kind]["failures"])
            for why, n in other.of[kind]["failures"].items():
                failures[why] = failures.get(why, 0) + n
            both[kind] = {"milliseconds": sorted(self.of[kind]["milliseconds"] + other.of[kind]["milliseconds"]),
                          "failures": failures}
        return Victim(both)

    def row(self, kind):
        """Figures of a kind as cells of a table."""
        return [self.n_answered(kind), self.n_failed(kind), f"{self.p(kind, 0.5):.1f}", f"{self.p(kind, 0.99):.1f}",
                f"{self.p(kind, 1.0):.1f}"]

    def failures(self):
        return {kind: self.of[kind]["failures"] for kind in self.KINDS if self.of[kind]["failures"]}


def main(port, token, seconds, first_view):
    sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
    from harness.callers import Caller

    end = time.monotonic() + seconds
    found = {kind: {"milliseconds": [], "failures": {}} for kind in Victim.KINDS}

    def follow(kind, period_seconds, path):
        caller, due, n = Caller(port, token), time.monotonic(), 0
        while time.monotonic() < end:
            answer = caller.get(path(n))
            n += 1
            if answer.status == 200:
                found[kind]["milliseconds"].append(answer.seconds * 1e3)
            else:
                why = str(answer.status or answer.why)
                found[kind]["failures"][why] = found[kind]["failures"].get(why, 0) + 1
            # Time that was lost is not made up for.
            due = max(due + period_seconds, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()))

    threads = [threading.Thread(target=follow, args=("json", 1 / JSON_HZ, lambda _: JSON_PATH)),
               threading.Thread(target=follow, args=("view", 1 / VIEW_HZ, lambda n: view_path(first_view + n)))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for kind in Victim.KINDS:
        found[kind]["milliseconds"].sort()
    print(json.dumps(found))


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], float(sys.argv[3]), int(sys.argv[4]))
