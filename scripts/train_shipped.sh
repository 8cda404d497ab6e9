#!/usr/bin/env bash
# Trains the networks that ship, from recordings to the files in the package: about two hours on one
# core. DATA holds the folders named below (docs/model.md says where they come from); OUT gets the
# dataset, the name encoder and the run, and what is in it already is not made again.
#
# Usage: scripts/train_shipped.sh DATA OUT
set -euo pipefail
cd "$(dirname "$0")/.."
data=$1 out=$2
export OMP_NUM_THREADS=1

# One tree, since characters and their cells are named and drawn by where they lie in it.
mkdir -p "$out/sets/mesh2motion"
for set in animateddrawings cmu_asf cmu_dance cmu_expmap deepmimic makehuman reactidle; do
  ln -sfn "$(realpath "$data/$set")" "$out/sets/$set"
done
ln -sfn "$(realpath "$data")"/mesh2motion/human* "$out/sets/mesh2motion/"
spark-sim prepare "$out/sets" -o "$out/dataset" --seed 6
[ -e "$out/names.safetensors" ] || python scripts/train_names.py "$out/names.safetensors"
if [ -e "$out/run" ]; then
  spark-sim train -o "$out/run" --resume
else
  spark-sim train "$out/dataset" -o "$out/run" --config scripts/shipped.toml \
    --names "$out/names.safetensors"
fi
python scripts/ship_weights.py "$out/run/checkpoint.safetensors"
