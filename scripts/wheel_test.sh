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
"$spark_sim" inspect motions/*.bvh
set +x
echo "wheel: works from a foreign folder"
