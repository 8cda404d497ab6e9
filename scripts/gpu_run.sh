#!/usr/bin/env bash
# The best that a GPU gives in MINUTES: dataset, network, tables. Needs no network, and goes on where
# it was stopped when it is called again in the same way.
#
# Usage: scripts/gpu_run.sh MINUTES DATA OUT [PRESET]
#
# DATA is a dataset of `spark-sim prepare` or a folder of motions, PRESET default (or paper, tiny).
# A tenth of the time is for reading and for the tables, and the first steps are timed, so that the
# learning rate has come down when the time is over. Batches are 64 windows where MINUTES is below
# 120, else the preset's. PYTHON names the interpreter; STEPS leaves the timing out.
set -euo pipefail
if [ $# -lt 3 ]; then
  sed -n '2,11s/^# \{0,1\}//p' "$0" >&2
  exit 2
fi
minutes=$1 data=$2 out=$3 preset=${4:-default}
began=$SECONDS
python=${PYTHON:-python}
export HF_HUB_OFFLINE=1 PYTHONUNBUFFERED=1
spark_sim() { "$python" -m spark_sim "$@"; }
left() { echo $((minutes * 54 - (SECONDS - began))); }   # seconds, of nine tenths of the time

gpu=$("$python" -c 'import torch
print(torch.cuda.get_device_name() if torch.cuda.is_available() else "")')
echo "on ${gpu:-the CPU: no GPU is visible}"
mkdir -p "$out"
if [ -e "$data/index.json" ]; then
  dataset=$data
else
  dataset=$out/dataset
  spark_sim prepare "$data" -o "$dataset"
fi

run=$out/$preset
if [ -e "$run/checkpoint.safetensors" ]; then
  settings=(--resume)
else
  compile=--no-compile
  if [ "$minutes" -ge 30 ] && [ -n "$gpu" ]; then compile=--compile; fi
  settings=("$dataset" --config "$out/$preset.toml" "$compile" --force)
  {
    echo "preset = \"$preset\""
    if [ "$minutes" -lt 120 ] && [ "$preset" != tiny ]; then
      echo "batch = 64"
      echo "rate = 2e-4"    # twice for four times the batch
    fi
  } > "$out/$preset.toml"
  if [ -z "${STEPS:-}" ]; then
    # 60 steps: the last 40 tell how long one takes.
    spark_sim train -o "$out/timing" "${settings[@]}" --steps 60
    STEPS=$("$python" - "$out/timing/log.jsonl" "$(left)" <<'PYTHON'
import json
import sys

log, left = sys.argv[1], float(sys.argv[2])
at = {entry["step"]: entry["seconds"] for entry in map(json.loads, open(log))}
step = (at[60] - at[20]) / 40
begin = at[20] - 20 * step  # compiling, and the first batches
print(max(100, int(0.95 * (left - begin) / step)))
PYTHON
)
  fi
  echo "warmup = $((STEPS < 10000 ? STEPS / 20 : 500))" >> "$out/$preset.toml"
  settings+=(--steps "$STEPS")
fi
# Whatever the timing said: at the end of the time the run is stopped, saved, and can be gone on with.
code=0
seconds=$(left)
timeout --foreground --signal INT --kill-after 120 "$((seconds > 60 ? seconds : 60))" \
  "$python" -m spark_sim train -o "$run" "${settings[@]}" || code=$?
[ "$code" = 0 ] || [ "$code" = 124 ] || [ "$code" = 130 ] || exit "$code"
if [ ! -e "$run/checkpoint.safetensors" ]; then
  echo "$run: $minutes minutes were over before the first step; give it more" >&2
  exit 1
fi

spark_sim evaluate "$dataset" --made --limit 20 --checkpoint "$preset=$run" \
  -o "$run/table.md" -o "$run/table.json" --force
echo "$run: checkpoint.safetensors, losses.png, table.md, after $(((SECONDS - began) / 60)) minutes"
