#!/usr/bin/env bash
# Runs the tests of whatever draws on SwiftShader's Vulkan, which Debian's chromium brings, and on the first driver under Khronos'
# validation layer. Fails where a test does that deploy/drivers-known.txt does not name, or where the layer says what
# deploy/validation-allowed.txt does not allow.
# Arguments are handed to the tests, such as a part of their names. What is left: target/drivers/.
set -euo pipefail
cd "$(dirname "$0")/.."
second=${SECOND_DRIVER:-/usr/lib/chromium/vk_swiftshader_icd.json}
second_name=${SECOND_NAME:-SwiftShader}
out=target/drivers
mkdir -p "$out"
built=$(cargo test --workspace --locked --test render --no-run --message-format json-render-diagnostics)
tests=$(sed -n 's/.*"name":"render".*"executable":"\([^"]*\)".*/\1/p' <<<"$built" | tail -1)
n_threads=${RUST_TEST_THREADS:-$(nproc)}
failed=0

# Runs the tests with the environment given before `--`, and says what they came to: run NAME VARIABLE=VALUE... -- ARGUMENTS...
run() {
  local name=$1 environment=() begun
  shift
  while [ "$1" != -- ]; do
    environment+=("$1")
    shift
  done
  shift
  begun=$(date +%s)
  env CI=true RUST_TEST_THREADS="$n_threads" "${environment[@]}" "$tests" "$@" >"$out/$name.txt" 2>&1 || true
  echo "$name: $(grep -a '^test result:' "$out/$name.txt" || echo 'no result'), $(($(date +%s) - begun)) s"
  grep -aq '^test result:' "$out/$name.txt" || failed=1
  while read -r test; do
    if grep -q "^$name $test " deploy/drivers-known.txt; then
      echo "  $test: known, $(sed -n "s/^$name $test //p" deploy/drivers-known.txt)"
    else
      echo "  $test: does not hold"
      failed=1
    fi
  done < <(sed -n 's/^test \(.*\) \.\.\. FAILED$/\1/p' "$out/$name.txt")
}

run "$second_name" VK_DRIVER_FILES="$second" VK_ICD_FILENAMES="$second" VIDEOFIELDS_TEST_ADAPTER="$second_name" -- "$@"

cat >"$out/vk_layer_settings.txt" <<'SETTINGS'
khronos_validation.debug_action = VK_DBG_LAYER_ACTION_LOG_MSG
khronos_validation.report_flags = error,warn,perf
khronos_validation.log_filename = stdout
khronos_validation.enable_message_limit = true
khronos_validation.duplicate_message_limit = 2
SETTINGS
run validation VK_INSTANCE_LAYERS=VK_LAYER_KHRONOS_validation VK_LAYER_SETTINGS_PATH="$PWD/$out/vk_layer_settings.txt" -- "$@"

# Messages of the layer bear a name between brackets: [ VUID-... ] or [ UNASSIGNED-... ].
grep -ao '\[ [A-Z][A-Za-z0-9_.-]*-[A-Za-z0-9_.-]* \]' "$out/validation.txt" | tr -d '[] ' | sort | uniq -c >"$out/messages.txt" || true
echo "messages of the validation layer: $(wc -l <"$out/messages.txt") kinds"
while read -r n message; do
  if grep -q "^$message " deploy/validation-allowed.txt; then
    echo "  $n x $message: allowed, $(sed -n "s/^$message //p" deploy/validation-allowed.txt)"
  else
    echo "  $n x $message: not allowed"
    failed=1
  fi
done <"$out/messages.txt"
exit "$failed"
