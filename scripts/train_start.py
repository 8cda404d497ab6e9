"""Train the network that says where the solver starts on a robot, and put it into the package.

    python -m scripts.train_start DATA OUT
    python -m scripts.train_start DATA OUT --without unitree_h1 booster_t1

Motions are solved on robots, and on robots like them with other limbs and limits, from plain
copies; the network learns what that changes. OUT keeps the solved examples: ten minutes on one
core, and not made again. With `--without`, nothing is put into the package: each of these robots in
turn is left out, with all that is like it and every fifth recording, and solved with these.
"""

import argparse
from pathlib import Path
from time import perf_counter

import numpy as np
import torch
from safetensors.numpy import save_file
from torch import nn

from robots.cues import answer_mirror, cue_mirror
from robots.known import known
from robots.start import MOST, SHIPPED, STRIDES, Layers
from scripts.start_bench import compare, show
from scripts.start_examples import SETS, Example, load, recordings, save, solved

WIDTH, HIDDEN = 5, 128  # frames that a convolution sees, and what it gives of each
EPOCHS, BATCH, FRAMES, RATE, DECAY = 6, 64, 32, 2e-3, 0.02
NOISE, KINK = 0.1, 0.15  # of cues; of errors, where squares become absolute values
LARGEST = 1.5  # [rad, hip heights] of an answer
LIMB = (1.0, 1.0, 0.7, 1.0, 1.0, 0.3)
HEAVY = np.array([2.0, 1.5, *LIMB, *LIMB])  # how parts count; limbs hang on the first two
WAY = np.array([1.5, 1.5, 3.0])  # how the hips' way counts


class Net(nn.Module):
    """`robots.start.predict` without its mirror image, for time last."""

    def __init__(self, cues: int, answers: int) -> None:
        super().__init__()
        near, far = STRIDES
        self.first = nn.Conv1d(cues, HIDDEN, WIDTH, padding="same", padding_mode="replicate")
        self.second = nn.Conv1d(
            HIDDEN, HIDDEN, WIDTH, padding="same", padding_mode="replicate", dilation=far
        )
        self.last = nn.Conv1d(HIDDEN, answers, 1)
        self.straight = nn.Conv1d(cues, answers, 1, bias=False)
        assert near == 1
        nn.init.zeros_(self.last.bias)
        nn.init.zeros_(self.straight.weight)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        first = nn.functional.silu(self.first(x))
        second = first + nn.functional.silu(self.second(first))
        return self.last(second) + self.straight(x)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help=f"holds {', '.join(SETS)}")
    parser.add_argument("out", type=Path)
    parser.add_argument("--without", nargs="*", default=[], metavar="ROBOT")
    args = parser.parse_args()
    torch.set_num_threads(1)
    args.out.mkdir(parents=True, exist_ok=True)
    kept = args.out / "examples.npz"
    motions = recordings(args.data)
    if not kept.exists():
        save(list(solved(motions)), kept)
    examples = load(kept)
    if not args.without:
        SHIPPED.parent.mkdir(exist_ok=True)
        layers = {name: layer.astype(np.float16) for name, layer in fit(examples).items()}
        save_file(layers, SHIPPED)
        print(f"{SHIPPED.name}: {SHIPPED.stat().st_size / 1e6:.2f} MB")
    unseen = sorted(motions)[::5]
    for robot in args.without:
        seen = [e for e in examples if e.robot != robot and e.recording not in unseen]
        layers = fit(seen)
        show(robot, compare(known(robot), [motions[path][0] for path in unseen], layers))


def fit(examples: list[Example]) -> Layers:
    """The layers, in the order of `robots.start`: kernels over time, input and output."""
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    order, signs = cue_mirror()
    some = np.concatenate([e.cues[::4] for e in examples])
    some = np.concatenate([some, some[:, order] * signs])
    mean, scale = some.mean(0), some.std(0) + 1e-3
    cues, answers, weights = stretches(examples, mean, scale)
    net = Net(cues.shape[1], answers.shape[1])
    optimizer = torch.optim.AdamW(net.parameters(), RATE, weight_decay=DECAY)
    steps = len(cues) // BATCH * EPOCHS
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, RATE, steps + 1, pct_start=0.1)
    began = perf_counter()
    for epoch in range(EPOCHS):
        total = 0.0
        for batch in np.array_split(rng.permutation(len(cues)), len(cues) // BATCH):
            seen = cues[batch].float()
            seen = seen + NOISE * torch.randn(*seen.shape[:2], 1)
            error = (net(seen) - answers[batch]) * weights[batch]
            loss = _robust(error) + _robust(error.diff(dim=2))
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
            total += loss.item()
        spent = perf_counter() - began
        print(f"epoch {epoch + 1}: {total / (len(cues) // BATCH):.4f}, {spent:.0f} s", flush=True)
    return layers_of(net, mean, scale)


def layers_of(net: Net, mean: np.ndarray, scale: np.ndarray) -> Layers:
    """As `robots.start` has them."""
    tensors = {name: tensor.detach().numpy() for name, tensor in net.state_dict().items()}
    return {
        "mean": mean.astype(np.float32),
        "scale": scale.astype(np.float32),
        "first": np.ascontiguousarray(tensors["first.weight"].transpose(2, 1, 0)),
        "first_bias": tensors["first.bias"],
        "second": np.ascontiguousarray(tensors["second.weight"].transpose(2, 1, 0)),
        "second_bias": tensors["second.bias"],
        "last": np.ascontiguousarray(tensors["last.weight"][:, :, 0].T),
        "last_bias": tensors["last.bias"],
        "straight": np.ascontiguousarray(tensors["straight.weight"][:, :, 0].T),
    }


def stretches(
    examples: list[Example], mean: np.ndarray, scale: np.ndarray
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """All of the examples and their mirror images, in stretches of `FRAMES` (S C F): cues, answers
    and how these count: missing parts, and what fills short ones up, don't."""
    (order, signs), (back, back_signs) = cue_mirror(), answer_mirror()
    counts = np.concatenate([np.repeat(HEAVY, 3), WAY])
    out: tuple[list[np.ndarray], ...] = ([], [], [])
    for e in examples:
        has = np.concatenate([np.repeat(e.has, 3), np.ones(3)])
        answer = np.clip(e.answer, -LARGEST, LARGEST)
        both = (
            (e.cues, answer, has * counts),
            (e.cues[:, order] * signs, answer[:, back] * back_signs, (has * counts)[back]),
        )
        for cues, answers, weights in both:
            seen = np.clip((cues - mean) / scale, -MOST, MOST)
            for start in range(0, len(seen), FRAMES):
                at = np.arange(start, start + FRAMES)
                inside = np.minimum(at, len(seen) - 1)
                out[0].append(seen[inside].T.astype(np.float16))
                out[1].append(answers[inside].T.astype(np.float32))
                out[2].append(np.outer(weights, at < len(seen)).astype(np.float32))
    cues, answers, weights = (torch.from_numpy(np.stack(part)) for part in out)
    return cues, answers, weights


def _robust(error: torch.Tensor) -> torch.Tensor:
    return nn.functional.smooth_l1_loss(error, torch.zeros_like(error), beta=KINK) * error.shape[1]


if __name__ == "__main__":
    main()
