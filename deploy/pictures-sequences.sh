#!/usr/bin/env bash
# Plays mesh sequences for a person to judge, into target/pictures/sequences/ with an index.html of captions: people of a
# simulated world, and real sets where they are at hand. Some minutes on two cores. VIDEOFIELDS names another binary than the
# release build's.
set -euo pipefail
cd "$(dirname "$0")/.."
videofields=${VIDEOFIELDS:-target/release/videofields}
lab=${VIDEOFIELDS_LAB:-target/release/videofields-lab}
out=target/pictures/sequences
rm -rf "$out"
mkdir -p "$out"
index=$out/index.html
cat >"$index" <<'EOF_PAGE'
<!doctype html>
<meta charset="utf-8">
<title>Mesh sequences</title>
<style>
  body { font: 15px sans-serif; margin: 2em; }
  figure { display: inline-block; margin: 0 1em 1.5em 0; vertical-align: top; width: 480px }
  img { width: 100% }
  figcaption { margin-top: .3em }
</style>
<h1>Mesh sequences</h1>
EOF_PAGE

# Every third picture of what is played, with what the command told.
play() { # NAME CAPTION [flags of `sequence play`]
  local name=$1 caption=$2
  shift 2
  local said
  said=$("$videofields" sequence play --out "$out/$name" "$@" | tr '\n' ' ')
  printf '<h2>%s</h2><p>%s</p>\n' "$caption" "$said" >>"$index"
  local file
  for file in "$out/$name"/*[0369].png; do
    printf '<figure><a href="%s"><img src="%s" alt=""></a></figure>\n' "$name/${file##*/}" "$name/${file##*/}" >>"$index"
  done
  echo "$out/$name: $said"
}

walk=$out/walk
"$lab" sequence --world plaza --from 3 --seconds 1 --out "$walk"
"$videofields" sequence check "$walk"
camera=$(grep -o '"id": "[^"]*"' "$walk/sequence.json" | head -1 | cut -d'"' -f4)
for fields in off normals montage; do
  play "walk-$fields" "People who walk, seen from where the camera $camera stands, which lends nothing; fields: $fields" \
    --manifest "$walk" --hold-back "$camera" --fps 10 --fields "$fields"
done
play walk-orbit "The same from around them" --manifest "$walk" --eye=0,-12,4 --target=0,0,1 --orbit 90 --fps 10

# Real sets are not part of the project, and pictures of them are not either.
if [[ -d ../shared/data/sceaux_castle ]]; then
  castle=../shared/data/sceaux_castle
  "$videofields" sequence from-set --cameras "$castle/cameras.json" --images "$castle/images" \
    --mesh "$castle/scene_mesh.ply" --name castle --out "$out/castle"
  for fields in off normals montage; do
    play "castle-$fields" "A castle, from where photograph 4 was taken; fields: $fields" \
      --manifest "$out/castle" --hold-back 00004 --fps 1 --to 0 --fields "$fields"
  done
else
  echo "<p>Not at hand: ../shared/data/sceaux_castle.</p>" >>"$index"
  echo "no castle at ../shared/data/sceaux_castle: its pictures are left out"
fi
echo "$index"
