#!/usr/bin/env bash
# Proves that what users install works: builds the wheel from the source archive, installs it into
# an environment of its own and runs it from a folder that knows nothing of the checkout.
# Usage: wheel_test.sh PYTHON (one that has `build`).
set -euo pipefail
checkout=$(cd "$(dirname "$0")/.." && pwd)
python=$(cd "$(dirname "$1")" && pwd)/$(basename "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

PIP_CONSTRAINT=$checkout/constraints.txt "$python" -m build --outdir "$work/dist" "$checkout" >/dev/null
"$python" -m venv "$work/env"
"$work/env/bin/python" -m pip --disable-pip-version-check install --quiet \
  -c "$checkout/constraints.txt" "$work"/dist/*.whl

mkdir "$work/elsewhere"
cd "$work/elsewhere"
spark_sim=$work/env/bin/spark-sim
set -x
"$spark_sim" --version
"$spark_sim" sample motions
"$spark_sim" inspect motions/*.bvh >/dev/null
"$spark_sim" retarget motions/walker_walk.bvh --to motions/dancer_wave.bvh -o out.bvh
"$spark_sim" robots
"$spark_sim" retarget motions/walker_walk.bvh --to robot -o robot.npz
"$spark_sim" report out.bvh --source motions/walker_walk.bvh --json > report.json
"$spark_sim" mjcf motions/dancer_wave.bvh
"$spark_sim" play motions/walker_walk.bvh out.bvh --html out.html
set +x
for file in out.bvh robot.npz report.json dancer_wave.xml out.html; do
  [ -s "$file" ] || { echo "wheel: $file was not written" >&2; exit 1; }
done
code=0
"$spark_sim" play out.bvh --strip out.png 2>error.txt || code=$?
if [ $code != 2 ] || ! grep -q "pip install 'spark-sim\[video\]'" error.txt; then
  echo "wheel: without the extra [video], --strip must say how to get it" >&2
  cat error.txt >&2
  exit 1
fi
echo "wheel: works from a foreign folder"
