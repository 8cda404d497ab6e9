#!/usr/bin/env bash
# Shows everything once: demo motions, what is understood of one, a motion on another body, its
# report, and both side by side as a page, a picture and a video. Usage: demo.sh SPARK_SIM FOLDER
set -euo pipefail
spark_sim=$1
folder=$2
result=$folder/walker_walk_on_dancer_walk.bvh

show() {
  echo
  echo "\$ spark-sim $*"
  "$spark_sim" "$@"
}

show sample "$folder" --force
show inspect "$folder/dancer_walk.bvh"
show retarget "$folder/walker_walk.bvh" --to "$folder/dancer_walk.bvh" -o "$result" --force
show report "$result" --source "$folder/walker_walk.bvh"
show play "$folder/walker_walk.bvh" "$result" --force \
  --html "$folder/walk.html" --strip "$folder/walk.png" --video "$folder/walk.mp4"
echo
echo "Open $folder/walk.html in a browser, or $folder/walk.mp4 in a player."
