#!/usr/bin/env bash
# Runs the daemon against cameras that behave oddly: all that the suite has, and whatever a folder of further servers has.
#
#   tests/cameras/run.sh                 the suite's own cameras, and its decoding processes that are killed 200 times
#   tests/cameras/run.sh FOLDER [SECS]   also the servers of FOLDER: its media.sh makes what they send, its run_rtsp.py runs a daemon
#                                        against one set of them for SECS seconds (12) and prints what each camera came to
#
# Cameras that fail at random for an hour, and where each of their frames is: tests/cameras/hour.py FOLDER.
# Bombs of every kind, and what they do to the daemon and to other cameras: tests/cameras/bombs.py.
# Needs ffmpeg and Python 3 for a folder. Ends with 1 where a test of the suite fails.
set -euo pipefail
cd "$(dirname "$0")/../.."
folder=${1:-}
secs=${2:-12}

cargo build --locked
cargo test --locked -p videofields --test suite -- ingest_live ingest:: recording::
VIDEOFIELDS_KILLS=200 cargo test --locked -p videofields --test suite -- --nocapture recording::killed | grep -v XDG_RUNTIME_DIR

if [ -n "$folder" ]; then
  "$folder/media.sh"
  export VIDEOFIELDS=${VIDEOFIELDS:-$PWD/target/debug/videofields}
  for set in $(python3 -c 'import sys; sys.path.insert(0, sys.argv[1]); from cases import SETS; print(*SETS)' "$folder"); do
    echo "== $set"
    python3 "$folder/run_rtsp.py" "$set" "$secs" archive
  done
fi
