"""Training speed against an older revision, in one run, as Markdown: CPU seconds of a step at the
paper's size (16 windows of 64 frames, width 128), one thread.

Usage: python scripts/train_bench.py [REVISION] (default: the first version of the training)

Both do the same steps, taking turns; the least of each one's times counts, user and system time
together, so that other work on the machine matters little. The newest also runs without bfloat16.
The default preset's corrects every joint here, as if the transfer had guessed them all.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

FIRST = "42982b2"
CHECKOUT = Path(__file__).parents[1]
ROUNDS, STEPS = 2, 4

# Runs in either revision: it uses what both have.
STEP = """
import json, sys, time
import numpy as np
import torch
torch.set_num_threads(1)
from dataclasses import replace
from spark.batch import Collator
from spark.canonical import to_canonical
from spark.features import body_features, pose_features
from spark.model import Spark
from spark.names import NameConfig, NameEncoder
from spark.pairs import Pairs, Windows
from spark.sample import sample_motion, sample_rig
from spark.settings import TrainConfig
from spark.train import Objective, network, optimiser_of, take_step
from spark.transfer import transfer

preset, bf16, steps = sys.argv[1], sys.argv[2] == "bf16", int(sys.argv[3])
source, target = sample_rig("walker"), sample_rig("dancer")
walk = to_canonical(sample_motion("walk", source, 30.0), source)
def windows(clip):
    sixd, root, _ = pose_features(clip, (body := body_features(clip.rig)))
    cut = [slice(k, k + 64) for k in range(16)]
    return Windows(body, np.stack([sixd[c] for c in cut]), np.stack([root[c] for c in cut]))
moved = windows(transfer(walk, target))
planted = np.ones((16, 64, 2), bool)
given = {
    "source": windows(walk),
    "target": moved,
    "start": moved,
    "guess": np.arange(len(moved.body.joints)),
    "planted": planted,
    "frame_time": 1 / 30,
}
draw = Pairs(*(given[name] for name in Pairs._fields))
torch.manual_seed(0)
names = NameEncoder(NameConfig(blocks=1))
config = TrainConfig.of(preset)
if hasattr(config, "bf16"):
    config = replace(config, bf16=bf16)
model = Spark(network(config, names.config.width)).train()
objective, optimiser = Objective(model, config), optimiser_of(model, config)
batch = Collator(names.encode).batch([draw])
times = []
for n in range(steps):
    began = time.process_time()
    take_step(objective, optimiser, batch, n, config)
    times.append(time.process_time() - began)
print(json.dumps(min(times)))
"""


def seconds(tree: Path, preset: str, products: str) -> float:
    """CPU seconds of a step of the program in `tree`."""
    done = subprocess.run(
        [sys.executable, "-c", STEP, preset, products, str(STEPS)],
        env=os.environ | {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1"},
        cwd=tree,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        sys.exit(done.stderr)
    return float(json.loads(done.stdout))


def main(revision: str = FIRST) -> None:
    with tempfile.TemporaryDirectory() as folder:
        archive = subprocess.run(
            ["git", "archive", revision, "spark"], cwd=CHECKOUT, capture_output=True, check=True
        )
        subprocess.run(["tar", "x", "-C", folder], input=archive.stdout, check=True)
        print(f"| CPU seconds of a step | {revision} | now, float32 | now, bfloat16 | ratios |")
        print("|---|---|---|---|---|")
        for preset in ("paper", "default"):
            best = [float("inf")] * 3
            for _ in range(ROUNDS):
                for k, tree in enumerate((Path(folder), CHECKOUT, CHECKOUT)):
                    best[k] = min(best[k], seconds(tree, preset, "bf16" if k == 2 else "float32"))
            told = " | ".join(f"{value:.2f}" for value in best)
            print(f"| `{preset}` | {told} | {best[0] / best[1]:.2f}, {best[0] / best[2]:.2f} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
