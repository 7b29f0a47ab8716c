#!/usr/bin/env bash
# Colours meshes by pictures of them for a person to judge, into target/pictures/fields/ with an index.html of captions: every way
# beside what a camera saw, of a simulated place and, where the photographs are at hand, of a castle. Some minutes on two cores.
# VIDEOFIELDS names another binary than the release build's.
set -euo pipefail
cd "$(dirname "$0")/.."
videofields=${VIDEOFIELDS:-target/release/videofields}
lab=${VIDEOFIELDS_LAB:-target/release/videofields-lab}
castle=../shared/data/sceaux_castle
out=target/pictures/fields
export NODEVICE_SELECT=1
rm -rf "$out"
mkdir -p "$out"
index=$out/index.html
cat >"$index" <<'EOF_PAGE'
<!doctype html>
<meta charset="utf-8">
<title>Texture fields</title>
<style>
  body { font: 15px sans-serif; margin: 2em; }
  figure { display: inline-block; margin: 0 1em 1.5em 0; vertical-align: top; width: 640px }
  img { width: 100% }
  figcaption { margin-top: .3em }
</style>
<h1>Texture fields</h1>
EOF_PAGE

figure() { # FILE CAPTION
  printf '<figure><a href="%s"><img src="%s" alt=""></a><figcaption>%s</figcaption></figure>\n' "$1" "$1" "$2" >>"$index"
}

# Cameras that are a pixel off and unevenly exposed, and a view where none stands.
printf '<h2>Plaza, simulated: three cameras, a view between them</h2>\n' >>"$index"
"$lab" bench fields --world plaza --off-px 1 --width 960 --pictures "$out" >"$out/plaza.txt"
for stage in best_camera __evened__the_baseline baseline__filtered baseline__floating __smoothing__all truth; do
  figure "plaza-still-0-$stage.png" "${stage//_/ }"
done
printf '<pre>%s</pre>\n' "$(cat "$out/plaza.txt")" >>"$index"

# Photographs are not part of the project, and pictures of them are not either.
printf '<h2>The castle of Sceaux: what one of ten cameras saw, by the nine others</h2>\n' >>"$index"
if [[ -f $castle/cameras.json ]]; then
  for mesh in scene_mesh scene_mesh_refine; do
    printf '<h3>%s</h3>\n' "$mesh" >>"$index"
    mkdir -p "$out/$mesh"
    for camera in 00001 00004 00007; do
      "$videofields" montage --mesh "$castle/$mesh.ply" --cameras "$castle/cameras.json" --images "$castle/images" \
        --hold-back "$camera.jpg" --ways best,normals,filtered,floating,fields --out "$out/$mesh" >"$out/$mesh/$camera.txt"
      for way in best normals filtered floating fields; do
        figure "$mesh/$camera-$way.png" "$camera, $way: $(awk -v way="$way" -v camera="$camera" '$1 == camera && $2 == way' "$out/$mesh/$camera.txt")"
      done
      figure "$mesh/$camera-fields-owners.png" "$camera: who lends most"
      figure "$mesh/$camera-photograph.png" "$camera: the photograph"
    done
  done
else
  echo "<p>Not at hand: $castle.</p>" >>"$index"
  echo "no photographs of the castle at $castle: their pictures are left out"
fi
echo "$index"
