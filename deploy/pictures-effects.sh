#!/usr/bin/env bash
# Draws the simulated plaza with each effect alone and with all of them into target/pictures/effects/, with an index.html of
# captions, for a person to judge. What docs/effects.md shows is made as small JPEG files in docs/ beneath it. VIDEOFIELDS names
# another binary than the release build's.
set -euo pipefail
cd "$(dirname "$0")/.."
videofields=${VIDEOFIELDS:-target/release/videofields}
out=target/pictures/effects
export NODEVICE_SELECT=1
rm -rf "$out"
mkdir -p "$out/docs"
index=$out/index.html
cat >"$index" <<'EOF'
<!doctype html>
<meta charset="utf-8">
<title>Effects</title>
<style>body { font: 15px sans-serif; margin: 2em; } figure { display: inline-block; margin: 0 1em 1.5em 0; vertical-align: top; width: 640px } img { width: 100% } figcaption { margin-top: .3em }</style>
<h1>Effects</h1>
EOF

# Committed as docs/images/effect-NAME.jpg.
shown=" none occlusion relight-noon relight-evening stipple all "

# The demo under a sky of several colours, which light is taken of.
cp -r config/demo "$out/demo"
sed -i 's/"sky": {[^}]*}/"sky": {"gradient": {"zenith_srgb": "#3a6fb0", "horizon_srgb": "#cfdde8", "ground_srgb": "#6b665c"}}/' \
  "$out/demo/plaza.json"

# On the clips' second lap no figure is left in a background.
plaza() { # NAME CAPTION [flags]
  local name=$1 caption=$2
  shift 2
  local from=(--eye=-6,-13,2.6 --target=2,2,1.2 --fov 55)
  [[ " $* " == *" --projection map "* ]] && from=()
  local draw=("$videofields" view --config "$out/demo/plaza.toml" --scene plaza --t 29000000000
    "${from[@]}" "$@")
  "${draw[@]}" --out "$out/$name.png" --width 1280 --height 720
  if [[ $shown == *" $name "* ]]; then
    # Dots do not compress.
    local size=(--width 640 --height 360)
    [[ " $* " == *" --stipple on "* ]] && size=(--width 400 --height 225)
    "${draw[@]}" --out "$out/docs/effect-$name.jpg" "${size[@]}"
  fi
  printf '<figure><a href="%s"><img src="%s" alt=""></a><figcaption><b>%s</b><br>%s</figcaption></figure>\n' \
    "$name.png" "$name.png" "$name" "$caption" >>"$index"
  echo "$out/$name.png"
}

plaza none "As cameras saw it, under its sky."
plaza occlusion "Ambient occlusion within 1.5 m." --occlusion on
plaza occlusion-wide "Within 5 m, twice as strong." --occlusion on --occlusion-radius 5 --occlusion-strength 2
plaza relight-sky "In the light of the sky." --relight sky
plaza relight-noon "With a sun high in the south-west, a stop brighter." --relight sky --sun-azimuth 225 --sun-elevation 50 --sun-strength 8 --relight-exposure 1
plaza relight-evening "With a strong sun low in the west, three stops darker." \
  --relight sky --sun-azimuth 280 --sun-elevation 6 --sun-strength 15 --relight-exposure -3
plaza relight-camera "In the light of what the west camera sees." --relight camera --relight-camera west
plaza stipple "Dots on paper." --stipple on
plaza stipple-coarse "Dots of three pixels, no dots in flat areas." \
  --stipple on --stipple-dot 3 --stipple-blur 12 --stipple-shade 0
plaza all "All of them." --occlusion on --relight sky --sun-azimuth 225 --sun-elevation 50 --sun-strength 8 --relight-exposure 1 --stipple on
plaza points "All of them, people as points." --entities points --occlusion on \
  --relight sky --sun-azimuth 225 --sun-elevation 50 --sun-strength 8 --relight-exposure 1 --stipple on
plaza map "The map with occlusion and a sun." --projection map --target=0,0,0 --across 60 \
  --occlusion on --relight sky --sun-azimuth 225 --sun-elevation 50 --sun-strength 8 --relight-exposure 1

# What dots make of seams: they are drawn where light changes, and so along every seam (Du et al. 2019, figure 13). Photographs are not
# part of the project, and pictures of them are not either.
printf '<h2>Dots on what several pictures colour, with seams and without</h2>\n' >>"$index"
for fields in normals montage; do
  plaza "stipple-fields-$fields" "The plaza in dots, colours as cameras have them; fields: $fields." \
    --colors raw --fields "$fields" --stipple on
done
castle=../shared/data/sceaux_castle
if [[ -f $castle/cameras.json ]]; then
  "$videofields" sequence from-set --cameras "$castle/cameras.json" --images "$castle/images" \
    --mesh "$castle/scene_mesh.ply" --name castle --out "$out/castle" >/dev/null
  printf '{"version": 1, "sky": {"color_srgb": "#d8dde6"}, "sequences": [{"id": "castle", "file": "castle"}]}\n' >"$out/castle.json"
  printf '[media]\nroots = ["%s"]\n[[scene]]\nid = "castle"\nfile = "castle.json"\n' "$(realpath "$castle")" >"$out/castle.toml"
  for stipple in off on; do
    for fields in normals montage; do
      name=castle-$fields-stipple-$stipple
      "$videofields" view --config "$out/castle.toml" --scene castle --eye=0.7,-8.7,-1.3 --target=0.1,0,-0.35 --fov 34 \
        --fields "$fields" --stipple "$stipple" --width 1280 --height 720 --out "$out/$name.png"
      printf '<figure><a href="%s"><img src="%s" alt=""></a><figcaption>A castle from ten photographs; fields: %s, dots: %s</figcaption></figure>\n' \
        "$name.png" "$name.png" "$fields" "$stipple" >>"$index"
    done
  done
else
  echo "<p>Not at hand: $castle.</p>" >>"$index"
  echo "no photographs of the castle at $castle: their pictures are left out"
fi
echo "$index"
