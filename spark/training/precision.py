"""What is computed in bfloat16, where the processor multiplies it faster, and what never is."""

from contextlib import AbstractContextManager, nullcontext

import torch
from torch import Tensor


def fast_products(device: torch.device, enabled: bool = True) -> AbstractContextManager[object]:
    """Matrix products in bfloat16, if `enabled` and the device has them; weights stay float32."""
    if enabled and has_bfloat16(device):
        return torch.autocast(device.type, torch.bfloat16)
    return nullcontext()


def exactly(like: Tensor) -> torch.autocast:
    """Full precision within `fast_products`. For kinematics: 8 bits of a rotation are half a
    degree."""
    device = "cpu" if like.is_meta else like.device.type  # a tensor of no device has no autocast
    return torch.autocast(device, enabled=False)


def has_bfloat16(device: torch.device) -> bool:
    """Whether products in bfloat16 are the device's own, not emulated."""
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported(including_emulation=False)
    known: dict[str, object] = getattr(torch.cpu, "get_capabilities", dict)()
    return bool(known.get("avx512_bf16") or known.get("amx_bf16"))
