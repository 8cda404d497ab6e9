"""A trained network run by torch, for those who have many windows: on a GPU where there is one."""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from spark.inference.weights import Weights
from spark.network.features import BodyFeatures
from spark.network.forward import Names, Network, decoder_noise
from spark.network.windows import Windows
from spark.training.batch import each
from spark.training.collator import Collator
from spark.training.model import Spark
from spark.training.tensors import Body, PoseTensors


class TorchNetwork(Network):
    """The same answers as without torch, but for rounding. Corrections of a few joints are as fast
    without it, and stay there."""

    def __init__(self, weights: Weights) -> None:
        super().__init__(weights)
        try:
            model = Spark(self.config)
            model.load_state_dict(
                {name: torch.as_tensor(x) for name, x in weights.below("model.").items()}
            )
        except (TypeError, ValueError, RuntimeError) as error:
            raise weights.damaged(error) from error
        self._device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        self._model = model.eval().requires_grad_(False).to(self._device)

    def encode(self, source: Windows, names: Names) -> Float[np.ndarray, "W T 24 D"]:
        """The latent H."""
        pose = PoseTensors(self._tensor(source.rotations), self._tensor(source.root))
        body = self._body(source.body, names, len(source.root))
        return self._model.encode(pose, body).cpu().numpy()

    def decode(
        self, latent: Float[np.ndarray, "W T 24 D"], names: Names, body: BodyFeatures
    ) -> Windows:
        """The motion that H describes on `body`, by the paper's network."""
        shape = (*latent.shape[:2], len(body.joints), self.config.width)
        noise = self._tensor(decoder_noise(shape)) if self.config.noise else None
        pose = self._model.decode(
            self._tensor(latent), self._body(body, names, len(latent)), noise=noise
        )
        return Windows(body, *(x.double().cpu().numpy() for x in pose))

    def _body(self, features: BodyFeatures, names: Names, windows: int) -> Body:
        own = torch.as_tensor(names[:, : -features.sides.shape[1]], dtype=torch.float32)
        body = Collator(lambda _: own).bodies([features])
        return Body(*(each(x.to(self._device), windows) for x in body))

    def _tensor(self, array: Float[np.ndarray, "..."]) -> Tensor:
        return torch.as_tensor(array, dtype=torch.float32, device=self._device)
