#!/usr/bin/env bash
# Writes target/bundle/videofields-gpu-report.tar.gz: what measures any Vulkan device with one command, on any x86-64 Linux with
# glibc 2.36 or newer and a driver. In it: videofields-lab, the shared libraries that it needs beyond glibc, a Vulkan loader and
# libglvnd's EGL for machines that have none, the tests of whatever draws with their goldens, and the script `gpu-report`. Worlds and shaders are in the
# programs; meshes are made by code.
set -euo pipefail
cd "$(dirname "$0")/.."
built=$(cargo build --release --locked -p videofields -p videofields-lab --bin videofields-lab --test render \
  --message-format json-render-diagnostics)
executable() {
  sed -n "s/.*\"name\":\"$1\".*\"executable\":\"\([^\"]*\)\".*/\1/p" <<<"$built" | tail -1
}
lab=$(executable videofields-lab)
tests=$(executable render)
out=target/bundle
name=videofields-gpu-report
most_bytes=$((40 * 1000 * 1000))
rm -rf "$out"
mkdir -p "$out/$name/lib" "$out/$name/vulkan"
mkdir -p "$out/$name/files/tests/golden"
cp "$lab" "$out/$name/videofields-lab"
cp "$tests" "$out/$name/render-tests"
strip "$out/$name/videofields-lab" "$out/$name/render-tests"
cp tests/golden/*.png "$out/$name/files/tests/golden/"
# What glibc itself brings is the machine's own, since it has to fit the kernel and the driver.
ldd "$lab" "$tests" | awk '$2 == "=>" && $3 ~ "^/" {print $3}' | while read -r library; do
  case $(basename "$library") in
    libc.so.* | libm.so.* | libdl.so.* | libpthread.so.* | librt.so.* | libresolv.so.* | libutil.so.* | ld-linux*) ;;
    *) cp -L "$library" "$out/$name/lib/" ;;
  esac
done
loader=$(ldconfig -p | awk '$1 == "libvulkan.so.1" && /x86-64/ && !found {print $NF; found = 1}')
[ -n "$loader" ] || { echo "bundle: there is no Vulkan loader here: deploy/setup.sh installs it" >&2; exit 1; }
cp -L "$loader" "$out/$name/vulkan/libvulkan.so.1"
# NVIDIA's driver answers the loader only where it finds the dispatcher of EGL (libglvnd), which servers without a desktop lack.
mkdir "$out/$name/egl"
for library in libEGL.so.1 libGLdispatch.so.0; do
  path=$(ldconfig -p | awk -v name="$library" '$1 == name && /x86-64/ && !found {print $NF; found = 1}')
  [ -n "$path" ] || { echo "bundle: there is no $library here: deploy/setup.sh installs it" >&2; exit 1; }
  cp -L "$path" "$out/$name/egl/$library"
done
cat >"$out/$name/gpu-report" <<'SCRIPT'
#!/bin/sh
# Measures what this machine's graphics card draws how fast: gpu-report [--minutes 8] [--out DIR] [--adapter NAME].
here=$(CDPATH='' cd "$(dirname "$0")" && pwd)
libraries=$here/lib
# The machine's own loader knows its drivers best.
PATH=$PATH:/sbin:/usr/sbin
if ! ldconfig -p 2>/dev/null | grep -q 'libvulkan\.so\.1'; then
  libraries=$libraries:$here/vulkan
fi
if ! ldconfig -p 2>/dev/null | grep -q 'libEGL\.so\.1'; then
  libraries=$libraries:$here/egl
fi
LD_LIBRARY_PATH=$libraries${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
NODEVICE_SELECT=1
export LD_LIBRARY_PATH NODEVICE_SELECT
exec "$here/videofields-lab" gpu-report "$@"
SCRIPT
chmod +x "$out/$name/gpu-report"
cp LICENSE-MIT LICENSE-APACHE "$out/$name/"
tar -C "$out" --owner=0 --group=0 --sort=name -czf "$out/$name.tar.gz" "$name"
n_bytes=$(stat -c %s "$out/$name.tar.gz")
echo "$out/$name.tar.gz: $n_bytes bytes"
if [ "$n_bytes" -gt "$most_bytes" ]; then
  echo "bundle: at most $most_bytes bytes are allowed" >&2
  exit 1
fi
