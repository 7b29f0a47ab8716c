"""Report of an attack: tables of figures, and what is judged of them."""

import json
import os
import sys

from .callers import shown
from .victim import Victim

# The victim's 99th percentile may be so many times what it is without an attacker.
MOST_TIMES = 1.5
# Beyond that it may be so many milliseconds more: what other work on the same two cores moves an answer by.
ALLOWED_MILLISECONDS = {"json": 20.0, "view": 60.0}


class Report:
    """What a script found. `done` prints the end and returns the exit status."""

    def __init__(self, title, quick=False):
        self.quick, self.harms, self.n_checks = quick, [], 0
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

    def figures(self, stages):
        """A table of `{stage: House.figures()}`."""
        heads = list(next(iter(stages.values())))
        self.table(["", *heads], [[stage, *(figures[head] for head in heads)] for stage, figures in stages.items()])

    def victims(self, stages):
        """A table of `{stage: Victim}`, and whether the machine was quiet: other work moves these times more than any attack."""
        rows = [[f"{kind}, {stage}", *of.row(kind)] for kind in Victim.KINDS for stage, of in stages.items()]
        self.table(["owner's requests", "answered", "not", "p50 ms", "p99 ms", "most ms"], rows)
        before, after = (stages.get(stage) for stage in ("alone", "alone, after"))
        for kind in Victim.KINDS if before and after else ():
            ends = sorted((before.p(kind, 0.99), after.p(kind, 0.99)))
            if ends[1] > MOST_TIMES * ends[0]:
                self.say(f"the machine is not quiet: without an attacker the owner's p99 for {kind} is {ends[0]:.0f} and {ends[1]:.0f} ms")

    def judge_victim(self, before, during, name, kinds=Victim.KINDS):
        """Judges that the owner is answered, and about as fast as without an attacker."""
        for kind in kinds:
            failed, n = during.n_failed(kind), during.n_answered(kind)
            self.check(failed == 0 and n > 0, f"{name}: all of the owner's {n} requests for {kind} were answered",
                       f"{name}: of the owner's requests for {kind} {failed} were not answered, {n} were: "
                       f"{json.dumps(during.of[kind]['failures'])}")
            alone, beside = before.p(kind, 0.99), during.p(kind, 0.99)
            times = beside / alone if alone else float("nan")
            allowed = ALLOWED_MILLISECONDS[kind]
            text = (f"{name}: the owner's p99 for {kind} is {times:.2f} times what it is without "
                    f"({alone:.1f}, then {beside:.1f} ms; n = {before.n_answered(kind)}, {n}; "
                    f"at most {MOST_TIMES} times, or {allowed:.0f} ms more)")
            if self.quick:
                self.say(f"not judged: {text}")
            else:
                self.check(times <= MOST_TIMES or beside <= alone + allowed, text, text)

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
