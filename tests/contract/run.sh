#!/usr/bin/env bash
# Holds a running daemon to its own contract: lints /api/v1/openapi.json and has Schemathesis try every operation of it with
# every check, once as an admin, an operator, a viewer with rights of one camera, and a stranger.
#
#   CASES=40         generated cases an operation and role, beside those that cover each boundary once
#   ROLES="admin"    some of: admin operator viewer stranger
#   SEED=7           other cases than the usual
#   VIDEOFIELDS=...  another binary than the release build's
#   LISTEN=...       another address
#   RUN=...          another folder for what a run leaves, so that several may go on side by side
#
# What is tried otherwise than it is described, and why (hooks.py does it, and counts it):
# - Streams of pictures are read until their first part, streams of events until their first event, WebSockets until the
#   answer that begins them. Status, fields and media types are checked; what follows is tried by the suite.
# - Names are mostly those of things that are there, or hardly any case would meet one.
# - A change that would take away what the other cases look at (the callers, the scene, its cameras) is made to a spare one.
# - A request that fits its schema and is refused is a failure, unless each place that the answer names breaks a rule that
#   JSON Schema has no words for; those rules are listed.
# No operation is left out.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=tests/contract
config=$here/plaza.toml
videofields=${VIDEOFIELDS:-target/release/videofields}
listen=${LISTEN:-127.0.0.1:18081}
url=http://$listen
roles=${ROLES:-admin operator viewer stranger}
cases=${CASES:-20}
seed=${SEED:-1}
work=target/contract
venv=$work/venv
run=${RUN:-$work/run}
export NODEVICE_SELECT=1

say() { printf '%s\n' "$*"; }
die() { printf '%s\n' "$*" >&2; exit 1; }

[[ -x $videofields ]] || die "there is no $videofields: build it (cargo build --release --locked), or name one in VIDEOFIELDS"
command -v curl >/dev/null || die "curl is missing: apt-get install curl"

# An environment of its own, made anew when what it holds is to be another.
if ! cmp -s "$here/requirements.txt" "$venv/made-of.txt"; then
  python3 -c 'import ensurepip, venv' 2>/dev/null || die "Python's venv is missing: apt-get install python3-venv"
  rm -rf "$venv"
  python3 -m venv "$venv"
  "$venv/bin/pip" install --quiet --disable-pip-version-check --requirement "$here/requirements.txt"
  cp "$here/requirements.txt" "$venv/made-of.txt"
fi

# A daemon of its own, with nothing of an earlier run.
rm -rf "$run"
mkdir -p "$run"
run=$(realpath "$run")
VIDEOFIELDS_STORAGE__DATABASE=$run/contract.sqlite
VIDEOFIELDS_ARCHIVE__FOLDER=$run/archive
export VIDEOFIELDS_STORAGE__DATABASE VIDEOFIELDS_ARCHIVE__FOLDER
set_user() { "$videofields" user "$config" set "$@" >/dev/null; }
add_token() { "$videofields" token "$config" add "$1" --note "contract"; }
all='*=live,history,export,manage'
set_user root --role admin --camera "$all" --password <<<"a password of this run $RANDOM$RANDOM"
set_user olga --role operator --camera "$all"
set_user vera --role viewer --camera west=live,history,export
set_user spare --role viewer
declare -A token=([admin]=$(add_token root) [operator]=$(add_token olga) [viewer]=$(add_token vera) [stranger]="")
spare_token=$(add_token spare)
# The public part of a token: what stands between `vf_` and the next `_`.
public() { local rest=${1#vf_}; printf '%s' "${rest%%_*}"; }
CONTRACT_TOKENS="$(public "${token[admin]}") $(public "${token[operator]}") $(public "${token[viewer]}")"
CONTRACT_SPARE_TOKEN=$(public "$spare_token")

"$videofields" serve --config "$config" --listen "$listen" --log warn >"$run/out" 2>"$run/log" &
daemon=$!
trap 'kill "$daemon" 2>/dev/null || true; wait "$daemon" 2>/dev/null || true' EXIT
alive() { kill -0 "$daemon" 2>/dev/null || { tail -n 40 "$run/log" >&2; die "the daemon is gone"; }; }
for _ in $(seq 240); do
  alive
  curl -fsS -o /dev/null "$url/readyz" 2>/dev/null && break
  sleep 0.5
done
curl -fsS -o /dev/null "$url/readyz"

# What there is to look at.
admin() { curl -fsS -H "Authorization: Bearer ${token[admin]}" "$@"; }
new() { admin -o /dev/null -X PUT -H 'If-None-Match: *' -d "$2" "$url$1"; }
field() { "$venv/bin/python" -c 'import json, sys; print(json.load(sys.stdin)[sys.argv[1]])' "$1"; }
wall() { printf '{"scene": "plaza", "view": {"eye_m": [0, -14, 5], "target_m": [0, 2, 1]}, "surface": {"grid": {"columns": 2, "rows": 1, "tile_px": [160, 120], "tile_m": [0.4, 0.3], "gap_m": [-0.05, 0]}}}'; }
for id in control spare; do new "/api/v1/walls/$id" "$(wall)"; done
for id in gate spare; do new "/api/v1/views/$id" '{"scene": "plaza", "parameters": "width=160&height=90"}'; done
calibration='{"image_size_px": [640, 360], "focal_px": [424.65, 424.65], "center_px": [320, 180], "position_m": [4.6, 13.6, 7.2],
  "world_from_camera": [0.1214728841484338, 0.8389757823663423, -0.5249635839831225, -0.07600796347120722]}'
new /api/v1/scenes/spare '{"version": 1, "ground": [{"polygon": [[-5, -5], [5, -5], [5, 5], [-5, 5]]}], "cameras": [{"id": "spare", "calibration": '"$calibration"'}], "view": {"eye_m": [0, -9, 4], "target_m": [0, 0, 0]}}'
admin -o /dev/null -X PUT -d '{"scene": "plaza"}' "$url/api/v1/playheads/wall"
admin -o /dev/null -X PUT -d '{"scene": "plaza"}' "$url/api/v1/playheads/spare"
# Recordings end with a key frame: a little later there are some to export.
sleep 12
span="\"from\": \"$(date -u -d '-10 seconds' +%FT%TZ)\", \"to\": \"$(date -u -d '-2 seconds' +%FT%TZ)\""
CONTRACT_EXPORT=$(admin -X POST -d "{$span, \"cameras\": [\"west\"]}" "$url/api/v1/exports" | field id)
CONTRACT_SNAPSHOT=$(admin -X POST -d '{"scene": "plaza", "parameters": "width=160&height=90"}' "$url/api/v1/snapshots" | field id)
export CONTRACT_TOKENS CONTRACT_SPARE_TOKEN CONTRACT_EXPORT CONTRACT_SNAPSHOT

failed=()
curl -fsS -o "$run/openapi.json" "$url/api/v1/openapi.json"
"$venv/bin/openapi-spec-validator" "$run/openapi.json" || failed+=(openapi-spec-validator)
if command -v npx >/dev/null; then
  npx --yes "@redocly/cli@2.77.0" lint --config "$here/redocly.yaml" "$run/openapi.json" >"$run/redocly.txt" 2>&1 || {
    cat "$run/redocly.txt"
    failed+=(redocly)
  }
else
  say "npx is not here: Redocly's lint is left out"
fi

for role in $roles; do
  [[ -v "token[$role]" ]] || die "there is no role $role: admin operator viewer stranger"
  say "== $role"
  as=()
  [[ -z ${token[$role]} ]] || as=(--header "Authorization: Bearer ${token[$role]}")
  began=$SECONDS
  CONTRACT_COUNTS=$run/$role.json "$venv/bin/st" --config-file "$here/schemathesis.toml" run "$url/api/v1/openapi.json" \
    --url "$url" --checks all --max-examples "$cases" --seed "$seed" --generation-database none --no-color \
    ${as[@]+"${as[@]}"} >"$run/$role.txt" 2>&1 || failed+=("$role")
  say "$((SECONDS - began))" >"$run/$role.secs"
  alive
  if [[ " ${failed[*]-} " == *" $role "* ]]; then cat "$run/$role.txt"; else tail -n 25 "$run/$role.txt"; fi
done

"$venv/bin/python" "$here/table.py" "$run" $roles
if grep -E 'panicked|met a fault of the daemon' "$run/log"; then failed+=("the daemon's log"); fi
[[ ${#failed[@]} -eq 0 ]] || die "the contract does not hold: ${failed[*]} (see $run)"
say "the contract holds"
