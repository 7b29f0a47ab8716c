#!/usr/bin/env bash
# Runs all fuzzers of tests/fuzz/targets one after the other, and says what each came to.
#
#   MINUTES=10                time for each
#   TARGETS="http_pictures"   some of them
#   SANITIZER=none            without AddressSanitizer (address)
#
# What a fuzzer found worth keeping: target/fuzz/corpus/; inputs on which something does not hold: target/fuzz/artifacts/. Such an input is
# tried again with `target/fuzz/x86_64-unknown-linux-gnu/release/NAME FILE`. cargo-fuzz wants a nightly compiler for its flags; the stable
# one takes them where RUSTC_BOOTSTRAP is set, so that no other has to be installed.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=tests/fuzz
work=target/fuzz
minutes=${MINUTES:-10}
targets=${TARGETS:-$(sed -n 's/^name = "\([a-z_]*\)"$/\1/p' $here/Cargo.toml)}
host=$(rustc -vV | sed -n 's/^host: //p')
export RUSTC_BOOTSTRAP=1
# What GLib complains of ends a fuzzer, as a panic does.
export G_DEBUG=fatal-criticals
# What GStreamer keeps for good is no leak, and SQLite has constants of one name in several functions.
export ASAN_OPTIONS=detect_leaks=0:detect_odr_violation=0

command -v cargo-fuzz >/dev/null || { echo "cargo-fuzz is missing: cargo install --locked cargo-fuzz" >&2; exit 1; }
cargo fuzz build --fuzz-dir $here --target-dir $work --sanitizer "${SANITIZER:-address}"

failed=0
for target in $targets; do
  corpus=$work/corpus/$target artifacts=$work/artifacts/$target log=$work/$target.txt
  mkdir -p "$corpus" "$artifacts"
  ended=0
  "$work/$host/release/$target" "$corpus" "$here/seeds/$target" -max_total_time=$((minutes * 60)) -timeout=10 -rss_limit_mb=4096 \
    -artifact_prefix="$artifacts/" -print_final_stats=1 >"$log" 2>&1 || ended=$?
  n_runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  coverage() { sed -n 's/^#[0-9]*\t'"$1"' *cov: \([0-9]*\).*/\1/p' "$log"; }
  begun=$(coverage INITED | tail -1) covered=$(coverage '[A-Za-z]*' | tail -1)
  echo "$target: ${n_runs:-no} runs, coverage ${begun:-none} -> ${covered:-none}"
  if ((ended != 0)); then
    failed=1
    grep -a -m 3 -E "panicked at|ERROR|CRITICAL" "$log" || true
    echo "  something does not hold: $log"
  fi
done
exit $failed
