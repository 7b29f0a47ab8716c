#!/usr/bin/env bash
# Draws people as hulls for a person to judge, into target/pictures/hulls/ with an index.html of captions: every method and
# every way of texturing over simulated people, and, where the footage is at hand, one person who was seen by four cameras,
# from all around. Some minutes on two cores. VIDEOFIELDS names another binary than the release build's.
set -euo pipefail
cd "$(dirname "$0")/.."
videofields=${VIDEOFIELDS:-target/release/videofields}
lab=${VIDEOFIELDS_LAB:-target/release/videofields-lab}
out=target/pictures/hulls
export NODEVICE_SELECT=1
rm -rf "$out"
mkdir -p "$out"
index=$out/index.html
cat >"$index" <<'EOF_PAGE'
<!doctype html>
<meta charset="utf-8">
<title>Hulls</title>
<style>
  body { font: 15px sans-serif; margin: 2em; }
  figure { display: inline-block; margin: 0 1em 1.5em 0; vertical-align: top; width: 640px }
  img { width: 100% }
  figcaption { margin-top: .3em }
</style>
<h1>Hulls</h1>
EOF_PAGE

figure() { # FILE CAPTION
  printf '<figure><a href="%s"><img src="%s" alt=""></a><figcaption>%s</figcaption></figure>\n' "$1" "$1" "$2" >>"$index"
}

# The papers' comparisons: methods, with and without feathering, visibility by nothing, depth maps and rays, weights at
# corners and at fragments.
for cameras in 4 8; do
  printf '<h2>Simulated people, %s cameras around them</h2>\n' "$cameras" >>"$index"
  "$lab" bench hulls --cameras "$cameras" --width 1280 --moments 1 --pictures "$out" >"$out/hulls_$cameras.txt"
  for file in "$out/hulls_${cameras}"_*.png; do
    name=$(basename "$file" .png)
    figure "$name.png" "${name#hulls_"${cameras}"_}"
  done
done

# Real footage is not part of the project, and pictures of it are not either.
printf '<h2>Utrecht: four cameras around one person</h2>\n' >>"$index"
if [[ -d ../shared/data/utrecht_voxel4 ]]; then
  utrecht() { # NAME CAPTION [flags of `view`]
    local name=$1 caption=$2
    shift 2
    "$videofields" view --config config/pictures/utrecht.toml --scene utrecht --t 2020-01-01T00:00:08Z \
      --width 1280 --height 720 --out "$out/utrecht-$name.png" "$@"
    figure "utrecht-$name.png" "$caption"
  }
  for style in billboards points hulls none; do
    utrecht "$style" "The scene's own view; entities: $style." --entities "$style"
  done
  utrecht other-side "From the other side." --eye=3,2,1.8 --target=0,0,1 --fov 60
  utrecht raw "The scene's own view; colors=raw." --colors raw
  utrecht map "The map, 8 m across." --projection map --target=0.5,-0.25,0 --across 8
  # Once around the person, level with the chest, 2.4 m from it.
  for turn in 0 45 90 135 180 225 270 315; do
    eye=$(awk -v turn="$turn" 'BEGIN { a = turn * atan2(0, -1) / 180; printf "%.3f,%.3f,1.4", 0.4 + 2.4 * cos(a), 0.4 + 2.4 * sin(a) }')
    for style in billboards hulls; do
      utrecht "turn-$turn-$style" "From $turn degrees; entities: $style." --eye="$eye" --target=0.4,0.4,0.8 --fov 50 \
        --entities "$style"
    done
  done
else
  echo "<p>Not at hand: ../shared/data/utrecht_voxel4.</p>" >>"$index"
  echo "no Utrecht recordings at ../shared/data/utrecht_voxel4: their pictures are left out"
fi
echo "$index"
