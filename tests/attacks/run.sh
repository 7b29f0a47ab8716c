#!/usr/bin/env bash
# Attacks a daemon of its own in every way that the scripts beside this one know, and says of each whether it still does harm.
#
#   tests/attacks/run.sh                      all of them, and fifteen minutes of mixed load at the end
#   tests/attacks/run.sh --quick              a few seconds each: answers, memory and rows are judged, times are not
#   ATTACKS="small_leaks audit_tells" ...     some of them
#   VIDEOFIELDS=...                           another binary than the release build's
#   SECONDS_MIXED=120                         a shorter mixed load; 0 leaves it out
#
# Everything stays on loopback addresses and in temporary folders. Needs Python 3.11. Ends with 1 where one does harm.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=tests/attacks
videofields=${VIDEOFIELDS:-target/release/videofields}
mixed_secs=${SECONDS_MIXED:-900}
all="strangers_hold_places strangers_fill manage_opens_nothing evidence_stays clock_ahead one_user_takes_all users_together users_fill
  renderer_is_shared audit_tells small_leaks slow_readers odd_requests expensive_routes mixed"
attacks=${ATTACKS:-$all}
[[ -x $videofields ]] || { echo "there is no $videofields: build it (cargo build --release --locked), or name one in VIDEOFIELDS" >&2; exit 1; }

ATTACKS_SUMMARY=$(mktemp)
export ATTACKS_SUMMARY
trap 'rm -f "$ATTACKS_SUMMARY"' EXIT
echo "$("$videofields" --version), $(nproc) cores, load before: $(cut -d' ' -f1-3 /proc/loadavg)"
failed=()
for attack in $attacks; do
  more=("$@")
  if [[ $attack == mixed ]]; then
    [[ $mixed_secs != 0 && " $* " != *" --quick "* ]] || continue
    more+=(--seconds "$mixed_secs")
  fi
  echo
  python3 "$here/$attack.py" --daemon "$videofields" ${more[@]+"${more[@]}"} || failed+=("$attack")
done
echo
python3 - "$ATTACKS_SUMMARY" <<'PYTHON'
import json
import sys

print("| attack | checks | harm |")
print("| --- | ---: | ---: |")
with open(sys.argv[1], encoding="utf-8") as file:
    for line in file:
        of = json.loads(line)
        print(f"| {of['title']} | {of['checks']} | {len(of['harms'])} |")
PYTHON
[[ ${#failed[@]} -eq 0 ]] || { echo "harm is done by: ${failed[*]}" >&2; exit 1; }
echo "no attack does harm"
