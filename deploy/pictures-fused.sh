#!/usr/bin/env bash
# Renders the fused view from every side into target/pictures/fused/, with an index.html of captions, for a person to
# judge: the simulated plaza and campus, and real footage where it is at hand. Some minutes on two cores. What
# docs/views.md shows is made as small JPEG files in docs/ beneath it. VIDEOFIELDS names another binary than the release
# build's.
set -euo pipefail
cd "$(dirname "$0")/.."
videofields=${VIDEOFIELDS:-target/release/videofields}
lab=${VIDEOFIELDS_LAB:-target/release/videofields-lab}
out=target/pictures/fused
export NODEVICE_SELECT=1
rm -rf "$out"
mkdir -p "$out/docs"
index=$out/index.html
cat >"$index" <<'EOF'
<!doctype html>
<meta charset="utf-8">
<title>The fused view</title>
<style>body { font: 15px sans-serif; margin: 2em; } figure { display: inline-block; margin: 0 1em 1.5em 0; vertical-align: top; width: 640px } img { width: 100% } figcaption { margin-top: .3em }</style>
<h1>The fused view</h1>
EOF

part() { # TITLE
  printf '<h2>%s</h2>\n' "$1" >>"$index"
}

# Committed as docs/images/fused-NAME.jpg.
shown=" plaza-walker-billboards plaza-behind-see-through-off plaza-behind-see-through-on plaza-map plaza-panorama \
exposure-raw exposure-even campus-overview "

view() { # CONFIG SCENE NAME CAPTION [flags of `view`]; `height` may be set before it
  local config=$1 scene=$2 name=$3 caption=$4
  shift 4
  local draw=("$videofields" view --config "$config" --scene "$scene" "$@")
  "${draw[@]}" --out "$out/$name.png" --width 1280 --height "${height:-720}"
  if [[ $shown == *" $name "* ]]; then
    "${draw[@]}" --out "$out/docs/fused-$name.jpg" --width 640 --height "$((${height:-720} / 2))" --quality exact
  fi
  printf '<figure><a href="%s"><img src="%s" alt=""></a><figcaption><b>%s</b><br>%s</figcaption></figure>\n' \
    "$name.png" "$name.png" "$name" "$caption" >>"$index"
  echo "$out/$name.png"
}

# On the clips' second lap no figure is left in a background.
plaza() { # NAME CAPTION [flags]; `at_secs` may be set before it
  local name=$1 caption=$2
  shift 2
  view config/demo/plaza.toml plaza "plaza-$name" "$caption" --t "${at_secs:-29}000000000" "$@"
}

part "People, three ways"
for style in billboards points none; do
  plaza "square-$style" "From above the south edge; entities: $style." \
    --eye=0,-20,6 --target=0,4,1 --fov 45 --entities "$style"
  plaza "walker-$style" "At eye height on the paving; entities: $style." \
    --eye=-6,-13,1.8 --target=2,2,1.2 --fov 55 --entities "$style"
done

part "Behind a building"
for see in off on; do
  at_secs=36 plaza "behind-see-through-$see" "Somebody behind the café; see-through $see." \
    --eye=2,-12,3 --target=11.5,4,1.2 --fov 45 --see-through "$see"
done

part "Projections"
plaza perspective "The scene's own view." --eye=-6,-19,7 --target=0.5,1,0.5 --fov 45
plaza orthographic "The same direction, 40 m across." --projection orthographic --eye=-6,-19,7 --target=0.5,1,0.5 --across 40
plaza map "Straight down, 60 m across; people lean back so far that they are seen." --projection map --target=0,0,0 --across 60
height=360 plaza panorama "All around from the middle of the paving, at eye height." \
  --projection panorama --eye=-1,-3,1.8 --target=-1,10,1.8 --span 360 --fov 90
plaza stereo "A stereo pair, eyes 0.5 m apart, that agrees at 14 m." --projection stereo --eye=-6,-13,1.8 --target=2,2,1.2 --fov 55 --eye-distance 0.5 --convergence 14
plaza window "Through a screen 4 m x 2.25 m whose viewer stands 2.5 m before it, off its middle." \
  --projection window --eye=1,-14.5,1.9 --window=-2,-12,0.6,2,-12,0.6,-2,-12,2.85

part "Quality"
for quality in draft balanced exact; do
  plaza "near-$quality" "Near somebody; quality=$quality." \
    --eye=0.5,-8,1.8 --target=4.4,-3.2,0.9 --fov 35 --quality "$quality"
done

part "Cameras that differ in exposure"
worlds=$out/worlds
mkdir -p "$worlds"
for form in "dark 0.10" "bright 0.40"; do
  read -r name target <<<"$form"
  echo '{"version": 1, "base": "plaza", "name": "'"$name"'", "effects": {"cast_shadows": {"casters": "still"}, "exposure": {"target": '"$target"'}}}' \
    >"$worlds/$name.json"
  "$lab" simulate --world "$worlds/$name.json" --out "$worlds/$name" --truth-every 0 --samples 2 >/dev/null 2>&1
done
cp "$worlds/dark/clips/west.webm" "$worlds/bright/clips/west.webm"
for colors in raw even; do
  view "$worlds/bright/bright.toml" bright "exposure-$colors" \
    "The west camera's exposure aims at a quarter of the others' brightness; colors=$colors." \
    --eye=-2,-19,9 --target=0,1,0 --fov 50 --t 29000000000 --colors "$colors"
done

part "A hundred cameras of 320 x 180 over a campus"
"$lab" simulate --world campus100 --out "$worlds/campus" --size-px 320x180 --rate-hz 5 --seconds 6 \
  --samples 1 --truth-every 0 >/dev/null 2>&1
campus() { # NAME CAPTION [flags]
  local name=$1 caption=$2
  shift 2
  view "$worlds/campus/campus100.toml" campus100 "campus-$name" "$caption" --t 5600000000 "$@"
}
campus overview "From above the south-west." --eye=-60,-190,90 --target=0,-10,0 --fov 50
campus map "The map, 240 m across." --projection map --target=0,-5,0 --across 240
campus square "Over the square." --eye=-6,-46,9 --target=0,6,0 --fov 50
campus square-closed "The same, buildings closed." --eye=-6,-46,9 --target=0,6,0 --fov 50 --see-through off

# Real footage is not part of the project, and pictures of it are not either.
part "PETS 2009 S2.L1: one camera"
if [[ -d ../shared/data/pets2009_s2l1 ]]; then
  pets() { # NAME CAPTION [flags]
    local name=$1 caption=$2
    shift 2
    view config/pictures/pets.toml pets "pets-$name" "$caption" --t 2009-12-14T12:34:30Z "$@"
  }
  for style in billboards points none; do
    pets "$style" "The scene's own view; entities: $style." --entities "$style"
  done
  pets side "From the side." --eye=-4,-24,4 --target=-9,-4,1 --fov 50
  pets map "The map, 50 m across." --projection map --target=-9,-4,0 --across 50
else
  echo "<p>Not at hand: ../shared/data/pets2009_s2l1.</p>" >>"$index"
  echo "no PETS 2009 S2.L1 at ../shared/data/pets2009_s2l1: its pictures are left out"
fi
echo "$index"
