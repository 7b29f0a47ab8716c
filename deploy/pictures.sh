#!/usr/bin/env bash
# Renders every picture for judging into target/pictures/: the plaza beside its truth, with figures; the README's
# picture; and the real footage where it is at hand. VIDEOFIELDS names another binary than the release build's.
set -euo pipefail
cd "$(dirname "$0")/.."
videofields=${VIDEOFIELDS:-target/release/videofields}
lab=${VIDEOFIELDS_LAB:-target/release/videofields-lab}
out=target/pictures
export NODEVICE_SELECT=1
mkdir -p "$out"

view() { # CONFIG SCENE FILE [further flags]
  local config=$1 scene=$2 file=$3
  shift 3
  "$videofields" view --config "$config" --scene "$scene" --out "$file" "$@"
  echo "$file"
}

# A figure of `compare`'s JSON, cut to hundredths (SSIM: thousandths).
figures() { # REFERENCE PICTURE [MASK]
  local json
  json=$("$videofields" compare "$1" "$2" ${3:+--mask "$3"})
  sed -E 's/.*"psnr_db":([0-9]+\.[0-9]{0,2}|null)[0-9]*.*"ssim":(-?[0-9]+(\.[0-9]{0,3})?)[0-9]*.*"n_pixels":([0-9]+).*/\1 \2 \4/' <<<"$json"
}

# Places where no camera stands: name, eye, target, vertical field of view (degrees).
views=(
  "square 0,-20,6 0,4,1 45"
  "walker -6,-13,1.8 2,2,1.2 55"
  "window -6,6.3,4.6 1,-6,0.5 60"
)
secs=12
frame=$(printf %06d $((secs * 10)))
plaza=$out/plaza
rm -rf "$plaza"
flags=()
for line in "${views[@]}"; do
  read -r name eye target fov <<<"$line"
  flags+=(--view "$name=$eye:$target:$fov:960x540")
done
"$lab" simulate --world plaza --out "$plaza" --only-views --at-secs "$secs" "${flags[@]}" >/dev/null

report=$out/plaza.txt
printf '%-7s %-10s %-7s %8s %7s %8s\n' view entities part PSNR_dB SSIM pixels >"$report"
for line in "${views[@]}"; do
  read -r name eye target fov <<<"$line"
  truth=$plaza/truth/$name
  for style in billboards points; do
    file=$out/plaza-$name-$style.png
    view config/demo/plaza.toml plaza "$file" --eye="$eye" --target="$target" --fov "$fov" \
      --width 960 --height 540 --t "${secs}000000000" --entities "$style"
    for part in whole seen static people; do
      case $part in
        whole) mask= ;;
        people) mask=$truth/instance/$frame.png ;;
        *) mask=$truth/$part/$frame.png ;;
      esac
      read -r psnr ssim pixels <<<"$(figures "$truth/frame/$frame.png" "$file" "$mask")"
      printf '%-7s %-10s %-7s %8s %7s %8s\n' "$name" "$style" "$part" "$psnr" "$ssim" "$pixels" >>"$report"
    done
  done
  cp "$truth/frame/$frame.png" "$out/plaza-$name-truth.png"
  echo "$out/plaza-$name-truth.png"
done
cat "$report"

# The README's picture, committed as docs/images/plaza.jpg; on the clips' second lap no figure is left in a background.
view config/demo/plaza.toml plaza "$out/plaza.jpg" --eye=-8,-18,6.2 --target=1,1,0.5 --fov 42 \
  --width 1280 --height 720 --t 29000000000

# Real footage is not part of the project, and pictures of it are not either.
if [[ -d ../shared/data/pets2009_s2l1 ]]; then
  for style in billboards points; do
    view config/pictures/pets.toml pets "$out/pets-$style.png" --width 1280 --height 720 \
      --t 2009-12-14T12:34:30Z --entities "$style"
  done
else
  echo "no PETS 2009 S2.L1 at ../shared/data/pets2009_s2l1: its pictures are left out"
fi
if [[ -d ../shared/data/utrecht_voxel4 ]]; then
  for style in billboards points hulls; do
    view config/pictures/utrecht.toml utrecht "$out/utrecht-$style.png" --width 1280 --height 720 \
      --t 2020-01-01T00:00:08Z --entities "$style"
  done
else
  echo "no Utrecht recordings at ../shared/data/utrecht_voxel4: their pictures are left out"
fi
