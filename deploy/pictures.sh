#!/usr/bin/env bash
# Renders every picture for judging into target/pictures/: the plaza against its truth, and the real footage where
# it is at hand. Needs a release build.
set -euo pipefail
cd "$(dirname "$0")/.."
videofields=target/release/videofields
out=target/pictures
mkdir -p "$out"

view() { # config scene name [further flags]
  local config=$1 scene=$2 name=$3
  shift 3
  "$videofields" view --config "$config" --scene "$scene" --out "$out/$name.png" "$@"
  echo "$out/$name.png"
}

# The plaza: three places where no camera stands, each beside the simulator's truth and with its error.
instant=12000000000
rm -rf "$out/plaza"
"$videofields" simulate --world plaza --out "$out/plaza" --views-only --at-secs 12
while IFS=' ' read -r name eye target fov; do
  for style in billboards points; do
    view config/demo/plaza.toml plaza "plaza-$name-$style" --eye="$eye" --target="$target" --fov "$fov" \
      --width 960 --height 540 --t "$instant" --entities "$style"
  done
done <"$out/plaza/views.txt"
