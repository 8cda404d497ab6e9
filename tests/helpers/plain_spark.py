"""The network once more, as plainly as its equations: one skeleton, joint, head and frame at a
time, no padding, no fused attention. It reads the weights of a `spark.training.model.Spark`."""

import math

import torch
from torch import Tensor

from spark.network.config import NO_ROTATION, RESIDUAL_SCALE, ROTATION_GAIN
from spark.sixd import matrix_from_sixd
from spark.training.attention import Attention, TemporalBlock
from spark.training.model import Spark
from spark.training.tensors import Body, PoseTensors, Start


def retargeted(
    model: Spark, pose: PoseTensors, source: Body, target: Body, start: Start | None
) -> PoseTensors:
    """What `model` must give for a batch of one without padding, in evaluation."""
    latent = encode(model, pose, source)
    return decode(model, latent, target, start)


def attend(layer: Attention, x: Tensor, context: Tensor) -> Tensor:
    """Each of `x` (Q D) over all of `context` (K D), head by head (eq. 1 with projections)."""
    D, C = layer.width, layer.width // layer.heads
    weights, biases = layer.qkv.weight.split(D), layer.qkv.bias.split(D)
    projected = zip((x, context, context), weights, biases, strict=True)
    q, k, v = (tokens @ weight.T + bias for tokens, weight, bias in projected)
    heads = []
    for h in range(layer.heads):
        own = slice(h * C, (h + 1) * C)
        queries, keys = q[:, own], k[:, own]
        if layer.rotary:
            queries, keys = turned(queries), turned(keys)
        scores = queries @ keys.T / math.sqrt(C)
        heads.append(torch.exp(scores) / torch.exp(scores).sum(-1, keepdim=True) @ v[:, own])
    return layer.out(torch.cat(heads, -1))


def turned(x: Tensor) -> Tensor:
    """Rotary positions: the pair (i, i + C/2) of frame t turned by t times the pair's rate."""
    a, b = x.chunk(2, -1)
    rates = [math.exp(-6.9078 * i / a.shape[-1]) for i in range(a.shape[-1])]
    angles = torch.tensor([[t * rate for rate in rates] for t in range(len(x))])
    c, s = torch.cos(angles), torch.sin(angles)
    return torch.cat([a * c - b * s, a * s + b * c], -1)


def along_time(block: TemporalBlock, x: Tensor) -> Tensor:
    """Eq. 2 and 3 for one token (T D)."""
    normed = block.norm_time(x)
    x = x + attend(block.time, normed, normed)
    return x + block.ff(block.norm_ff(x))


def joint_embeddings(model: Spark, body: Body) -> tuple[Tensor, list[dict[int, Tensor]]]:
    """E_name + MLP(T-pose) of each joint (J D), and E_pos of each joint in each of its groups."""
    embedding = model.embedding
    features = body.tpose[0].clone()
    if not model.config.tpose_rotations:
        features[:, 3:9] = torch.tensor(NO_ROTATION)
    if embedding.shape_features:
        features = torch.cat([features, body.shape[0]], -1)
    known = embedding.name(body.names[0]) + embedding.tpose(features)
    places: list[dict[int, Tensor]] = []
    for g, joints in enumerate(body.groups[0].tolist()):
        places.append({})
        for n, joint in enumerate(j for j in joints if j >= 0):
            place = embedding.position[g, n]
            if embedding.arc_length:
                place = place + embedding.arc.weight[:, 0] * body.arc[0, g, n]
            places[g][joint] = place
    return known, places


def encode(model: Spark, pose: PoseTensors, body: Body) -> Tensor:
    """H (T 24 D)."""
    config, encoder = model.config, model.encoder
    joints, root = pose.rotations[0], pose.root[0]
    if config.residual:
        joints = ROTATION_GAIN * (joints - torch.tensor(NO_ROTATION))
    if config.positions_in:
        joints = torch.cat([joints, positions(pose, body) - root[:, None]], -1)
    x = encoder.motion(joints)
    x[:, 0] += encoder.root(root)
    known, places = joint_embeddings(model, body)
    taken: set[int] = set()
    frames = []
    for t in range(len(x)):
        taken.clear()
        tokens = []
        for g, group in enumerate(places):
            mine = [j for j in group if config.share_joints or j not in taken]
            taken.update(mine)
            features = [x[t, j] + known[j] + group[j] for j in mine]
            if not features:
                features = [torch.zeros(config.width)]
            tokens.append(attend(encoder.pool, encoder.queries[g], torch.stack(features)))
        frames.append(torch.cat(tokens))
    latent = torch.stack(frames)
    if not config.relative_time:
        for t in range(len(latent)):
            for i in range(config.width // 2):
                angle = t * math.exp(-9.21034 * 2 * i / config.width)
                latent[t, :, i] += math.sin(angle)
                latent[t, :, i + config.width // 2] += math.cos(angle)
    for block in encoder.time:
        latent = torch.stack([along_time(block, latent[:, k]) for k in range(24)], 1)
    return encoder.norm(latent)


def decode(model: Spark, latent: Tensor, body: Body, start: Start | None) -> PoseTensors:
    """The motion on `body`; the decoder begins with its learned query. A residual network decodes
    the unmatched joints of its start, one window's at a time, and moves them and what follows
    them."""
    decoder = model.decoder
    known, places = joint_embeddings(model, body)
    for j in range(len(known)):
        known[j] += next(group[j] for group in places if j in group)
    y = (known + decoder.query).repeat(len(latent), 1, 1)
    if start is not None:
        unmatched = start.unmatched[0].tolist()
        corrected_joints = [j for j in range(len(known)) if unmatched[j] == j]
        if not corrected_joints:
            return start.pose
        seen = ROTATION_GAIN * (start.rotations[0][:, corrected_joints] - torch.tensor(NO_ROTATION))
        assert decoder.start is not None
        y = y[:, corrected_joints] + decoder.start(seen)
    for block in decoder.blocks:
        for t in range(len(y)):
            normed = block.norm_self(y[t])
            y[t] += attend(block.self_attention, normed, normed)
            y[t] += attend(block.cross_attention, block.norm_cross(y[t]), latent[t])
            y[t] += block.ff(block.norm_ff(y[t]))
        if block.along_time is not None:
            y = torch.stack([along_time(block.along_time, y[:, j]) for j in range(y.shape[1])], 1)
    y = decoder.norm(y)
    sixd = decoder.rotation(y)
    if start is None:
        assert decoder.root is not None
        return PoseTensors(sixd[None], decoder.root(y[:, 0])[None])
    little = matrix_from_sixd(
        model.config.shrink * RESIDUAL_SCALE * sixd + torch.tensor(NO_ROTATION)
    )
    parents = body.parents[0].tolist()
    local = matrix_from_sixd(start.rotations[0])
    before = [local[:, 0]]
    for j in range(1, len(known)):
        before.append(before[parents[j]] @ local[:, j])
    after = list(before)
    for j in range(len(known)):
        if unmatched[j] >= 0:
            own = before[unmatched[j]]
            after[j] = own @ little[:, corrected_joints.index(unmatched[j])] @ own.mT @ before[j]
    out = [after[0]] + [after[parents[j]].mT @ after[j] for j in range(1, len(known))]
    turned = torch.stack(out, 1)
    return PoseTensors(torch.cat([turned[..., 0], turned[..., 1]], -1)[None], start.root)


def positions(pose: PoseTensors, body: Body) -> Tensor:
    """Joints (T J 3), from the root outwards."""
    local = matrix_from_sixd(pose.rotations[0])
    parents, offsets = body.parents[0].tolist(), body.offsets[0]
    world, at = [local[:, 0]], [pose.root[0]]
    for j in range(1, len(parents)):
        world.append(world[parents[j]] @ local[:, j])
        at.append(at[parents[j]] + world[parents[j]] @ offsets[j])
    return torch.stack(at, 1)
