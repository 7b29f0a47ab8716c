"""Prints what a run of tests/contract/run.sh came to, a row a role."""

import json
import pathlib
import sys

folder, roles = pathlib.Path(sys.argv[1]), sys.argv[2:]
print("| role | cases | 1xx | 2xx | 3xx | 4xx | 5xx | seconds |")
print("| --- | --- | --- | --- | --- | --- | --- | --- |")
others = {}
for role in roles:
    path = folder / f"{role}.json"
    counts = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    classes = [sum(n for what, n in counts.items() if what.startswith(f"status {i}")) for i in range(1, 6)]
    secs = (folder / f"{role}.secs").read_text(encoding="utf-8").strip()
    print("| " + " | ".join(map(str, [role, counts.get("cases", 0), *classes, secs])) + " |")
    others[role] = {what: n for what, n in counts.items() if not what.startswith(("cases", "status ", "rule: "))}
for role, counts in others.items():
    print(f"{role}: " + "; ".join(f"{what} {n}" for what, n in sorted(counts.items())))
