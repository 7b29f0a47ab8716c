"""Report of an attack: tables of figures, and what is judged of them."""

import json
import math
import os
import sys
import time

from .callers import shown
from .victim import Victim

# The victim's 99th percentile may be so many times what it is without an attacker.
MOST_TIMES = 1.5
# Beyond that it may be so many milliseconds more: what other work on the same two cores moves an answer by.
ALLOWED_MILLISECONDS = {"json": 20.0, "view": 60.0}
ATTEMPTS = 3


def times(kind, alone, beside):
    return beside.p(kind, 0.99) / alone.p(kind, 0.99) if alone.n_answered(kind) else math.nan


def excess(kind, alone, beside):
    """Returns how many times more than it may be the owner's 99th percentile is; 0 where it is within what is allowed."""
    if not alone.n_answered(kind) or not beside.n_answered(kind):
        return math.inf
    is_good = times(kind, alone, beside) <= MOST_TIMES or beside.p(kind, 0.99) <= alone.p(kind, 0.99) + ALLOWED_MILLISECONDS[kind]
    return 0.0 if is_good else times(kind, alone, beside)


def badness(alone, beside):
    """Returns what measurements are compared by: requests that were not answered, then times."""
    return sum(map(beside.n_failed, Victim.KINDS)), max(excess(kind, alone, beside) for kind in Victim.KINDS)


class Report:
    """What a script found. `done` prints the end and returns the exit status."""

    def __init__(self, title, quick=False):
        self.quick, self.harms, self.n_checks = quick, [], 0
        self.pairs, self.stages, self.n_views = {}, {}, 0
        self.title = title
        print(f"# {title}\n", flush=True)

    def check(self, is_good, gone, harm=None):
        """Says that a harm is gone, or that it is there."""
        self.n_checks += 1
        if is_good:
            print(f"harm is gone: {gone}", flush=True)
        else:
            self.harms.append(harm or f"not so: {gone}")
            print(f"HARM: {self.harms[-1]}", flush=True)
        return is_good

    @staticmethod
    def limit(text):
        """Tells of a limit that the documentation names: it is not judged."""
        print(f"known limit: {text}", flush=True)

    @staticmethod
    def say(text):
        print(text, flush=True)

    @staticmethod
    def table(heads, rows):
        print()
        print("| " + " | ".join(map(str, heads)) + " |")
        print("| " + " | ".join(["---"] + ["---:"] * (len(heads) - 1)) + " |")
        for row in rows:
            print("| " + " | ".join(map(str, row)) + " |")
        print(flush=True)

    def begin(self, house):
        """Notes figures before the attacks, once memory is what the daemon needs for itself."""
        Victim.measure(house, 1.0 if self.quick else 5.0)
        house.settle(4.0 if self.quick else 20.0)
        self.stages["before"] = house.figures()

    def end(self, house):
        """Prints the tables of all attacks."""
        self.stages["after"] = house.figures()
        self.victims(self.pairs)
        self.figures(self.stages)
        self.alive(house)

    def figures(self, stages):
        """A table of `{stage: House.figures()}`."""
        heads = list(next(iter(stages.values())))
        self.table(["", *heads], [[stage, *(figures[head] for head in heads)] for stage, figures in stages.items()])

    def victims(self, pairs):
        """A table of `{attack: (Victim without, Victim beside)}`."""
        rows = [[f"{kind}, {name}", *alone.row(kind)[:4], *beside.row(kind)[:4], f"{times(kind, alone, beside):.2f}"]
                for kind in Victim.KINDS for name, (alone, beside) in pairs.items()]
        self.table(["owner's requests", "alone: answered", "not", "p50 ms", "p99 ms", "beside: answered", "not", "p50 ms", "p99 ms", "times"], rows)

    def attack(self, house, name, crowd, seconds, also=None):
        """Measures the owner without a crowd and beside it, and judges that.

        Other work on the machine only makes answers later, so what fails is measured anew, up to `ATTEMPTS` times, and the best counts.
        `crowd` makes a crowd; `also` is done while the owner is measured, both times. Returns what the crowd met.
        """
        best, met = None, None
        for _ in range(1 if self.quick else ATTEMPTS):
            if not self.quick:
                house.wait_until_quick()
            alone = self._measure(house, seconds, also)
            with crowd() as attackers:
                time.sleep(1.5)
                beside = self._measure(house, seconds, also)
                self.stages[name] = house.figures()
                met = attackers.stop() if met is None else met + attackers.stop()
            pair = (alone, beside)
            if best is None or badness(*pair) < badness(*best):
                best = pair
            if badness(*best) == (0, 0.0):
                break
        self.pairs[name] = best
        self.counts(f"{name}, attackers met", met)
        self.judge_victim(*best, name)
        return met

    def _measure(self, house, seconds, also):
        self.n_views += 400
        victim = Victim.begin(house, seconds, self.n_views)
        if also:
            also(time.monotonic() + seconds)
        return Victim.finish(victim)

    def judge_victim(self, alone, beside, name):
        """Judges that the owner is answered, and about as fast as without an attacker."""
        for kind in Victim.KINDS:
            failed, n = beside.n_failed(kind), beside.n_answered(kind)
            if self.quick and kind == "view":
                # Beside other tests a picture may wait longer than its limit, whoever attacks.
                self.say(f"not judged: {name}: {n} views were answered, {failed} were not")
                continue
            self.check(failed == 0 and n > 0, f"{name}: all of the owner's {n} requests for {kind} were answered",
                       f"{name}: of the owner's requests for {kind} {failed} were not answered, {n} were: "
                       f"{json.dumps(beside.of[kind]['failures'])}")
            text = (f"{name}: the owner's p99 for {kind} is {times(kind, alone, beside):.2f} times what it is without "
                    f"({alone.p(kind, 0.99):.1f}, then {beside.p(kind, 0.99):.1f} ms; n = {alone.n_answered(kind)}, {n}; "
                    f"at most {MOST_TIMES} times, or {ALLOWED_MILLISECONDS[kind]:.0f} ms more)")
            if self.quick:
                self.say(f"not judged: {text}")
            else:
                self.check(excess(kind, alone, beside) == 0.0, text, text)

    def counts(self, name, counts):
        print(f"{name}: {shown(counts)}", flush=True)

    def alive(self, house):
        """Judges that the daemon lives, and that its log tells of no fault of its own."""
        self.check(house.is_alive(), "the daemon lives", f"the daemon ended: {house.log()[-2000:]}")
        faults = [line for line in house.log().splitlines() if "panicked" in line or "met a fault of the daemon" in line]
        self.check(not faults, "its log tells of no fault of its own", f"its log: {faults[:3]}")

    def done(self):
        print(f"\n{self.title}: {self.n_checks - len(self.harms)} of {self.n_checks} hold", flush=True)
        for harm in self.harms:
            print(f"HARM: {harm}")
        summary = os.environ.get("ATTACKS_SUMMARY")
        if summary:
            with open(summary, "a", encoding="utf-8") as file:
                file.write(json.dumps({"title": self.title, "checks": self.n_checks, "harms": self.harms}) + "\n")
        sys.stdout.flush()
        return 1 if self.harms else 0
