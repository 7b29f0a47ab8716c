#!/usr/bin/env bash
# Serves the demo plaza with the release build, asks it from many connections at once, and prints what came back as a table
# (docs/benchmarks/load.md holds one). Arguments go to `videofields-lab bench load`: such as --seconds 30 --clients 1,16,64; without
# any, it is also measured beside slow readers and idle connections, whose descriptors both ends need.
# VIDEOFIELDS and VIDEOFIELDS_LAB name other binaries than the release build's, LISTEN another address.
set -euo pipefail
cd "$(dirname "$0")/.."
videofields=${VIDEOFIELDS:-target/release/videofields}
lab=${VIDEOFIELDS_LAB:-target/release/videofields-lab}
listen=${LISTEN:-127.0.0.1:18080}
export NODEVICE_SELECT=1 VIDEOFIELDS_ACCURACY__MEASURE_AT_START=false
[[ $# -gt 0 ]] || set -- --slow-readers 200 --idle 10000
ulimit -n "$(ulimit -H -n)"
folder=$(mktemp -d)
# A database of its own, so that nothing of an earlier run is in the way.
VIDEOFIELDS_STORAGE__DATABASE=$folder/load.sqlite "$videofields" demo --listen "$listen" --log warn >"$folder/out" 2>"$folder/log" &
daemon=$!
trap 'kill "$daemon" 2>/dev/null || true; wait "$daemon" 2>/dev/null || true; rm -rf "$folder"' EXIT
for _ in $(seq 120); do
  kill -0 "$daemon" 2>/dev/null || { cat "$folder/log" >&2; exit 1; }
  curl -fsS -o /dev/null "http://$listen/readyz" 2>/dev/null && break
  sleep 0.5
done
curl -fsS -o /dev/null "http://$listen/readyz"
echo "$("$videofields" --version), $(nproc) cores, $(curl -fsS "http://$listen/readyz" | sed -E 's/.*"renderer":"([^"]*)".*/\1/'), $(git rev-parse --short HEAD 2>/dev/null || echo "no commit"), load before: $(cut -d' ' -f1-3 /proc/loadavg)"
echo
"$lab" bench load --url "http://$listen" --pid "$daemon" "$@"
