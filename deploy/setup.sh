#!/usr/bin/env bash
# Installs what building, testing and running videofields needs from Debian or Ubuntu. Idempotent: what is
# there is left alone, and nothing is asked of the network when nothing is missing. Rust itself comes from
# https://rustup.rs or the distribution (1.92 or later). Arguments are names of further packages.
set -euo pipefail

packages=(
  # Building: the C compiler and the headers of GStreamer; SQLite and zstd come with their crates.
  gcc libc6-dev make pkg-config libgstreamer1.0-dev libgstreamer-plugins-base1.0-dev
  # Decoding: files and containers, RTSP, VP8 and MJPEG (good), everything FFmpeg knows (libav). Recording: parsers (bad).
  gstreamer1.0-plugins-base gstreamer1.0-plugins-good gstreamer1.0-libav gstreamer1.0-plugins-bad
  # Tests alone: an encoder of H.264 (ugly), an RTSP server to play a camera.
  gstreamer1.0-plugins-ugly libgstrtspserver-1.0-dev
  # Tests alone: the attacks (tests/attacks) are written in it.
  python3
  # Rendering: the Vulkan loader, and Mesa's drivers with the software rasteriser for machines without a GPU.
  libvulkan1 libegl1 mesa-vulkan-drivers
  # What the README's commands call.
  curl ca-certificates git
)
# The system's Node and npm fetch the tools of the web pages, and the newer Node that those need (web/install.sh). Debian's own are
# enough. Those that came from elsewhere are left alone.
node_major=$(node --version 2>/dev/null | sed -n 's/^v\([0-9]*\).*/\1/p' || true)
if [ "${node_major:-0}" -lt 18 ] || ! command -v npm >/dev/null 2>&1; then
  packages+=(nodejs npm)
fi
# Tests of the web pages alone: a browser, but where CHROMIUM names one already.
if [ -z "${CHROMIUM:-}" ]; then
  packages+=(chromium)
fi
packages+=("$@")

if ! command -v cargo >/dev/null 2>&1 && [ -f "${HOME:-/root}/.cargo/env" ]; then
  # shellcheck disable=SC1091
  . "${HOME:-/root}/.cargo/env"
fi
if ! command -v cargo >/dev/null 2>&1; then
  echo "setup: cargo is missing: install Rust 1.92 or later from https://rustup.rs, then run this again" >&2
  exit 1
fi

if ! command -v dpkg-query >/dev/null 2>&1 || ! command -v apt-get >/dev/null 2>&1; then
  echo "setup: this system has no apt. Install the equivalents of these Debian packages, then run this again" >&2
  echo "setup: with VIDEOFIELDS_SKIP_SETUP=1 in the environment:" >&2
  printf '  %s\n' "${packages[@]}" >&2
  [ "${VIDEOFIELDS_SKIP_SETUP:-}" = 1 ] && exit 0
  exit 1
fi

missing=()
for package in "${packages[@]}"; do
  state=$(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2>/dev/null || true)
  [ "$state" = installed ] || missing+=("$package")
done
if [ "${#missing[@]}" -eq 0 ]; then
  exit 0
fi

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null 2>&1; then
    echo "setup: these packages are missing, and installing them needs root or sudo:" >&2
    printf '  %s\n' "${missing[@]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi

echo "setup: installing ${missing[*]}" >&2
export DEBIAN_FRONTEND=noninteractive
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
