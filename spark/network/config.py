"""What makes one SPARK network differ from another. No torch here: inference needs none."""

from dataclasses import dataclass
from math import log

N_GROUPS = 6
QUERIES_PER_GROUP = 4
N_TOKENS = N_GROUPS * QUERIES_PER_GROUP
TPOSE_FEATURES = 13
TPOSE_ROTATION = slice(3, 9)  # of them: 6D, between position and velocity
SHAPE_FEATURES = 6  # bone offset, depth, leaf flag, degrees of freedom
# A step of Adam moves a head's output by about rate times width, whatever is still missing. What a
# residual has to say is small (some degrees); unscaled, steps overshoot it and learn nothing.
RESIDUAL_SCALE = 0.1

NO_ROTATION = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)  # in 6D
# Deviations from no rotation are small: multiplied by this they are of the other features' size.
ROTATION_GAIN = 4.0

# Positions in time turn pairs of features at rates from 1 to 1/base radians a frame.
LN_SINUSOID_BASE = log(1e4)  # of absolute positions, as Vaswani et al. (2017) have it
LN_ROTARY_BASE = 6.9078  # of rotary ones: ln 1000, to the digits that networks were trained with


@dataclass(frozen=True)
class Config:
    """Everything that makes one network differ from another. `spark.training.settings` sets the
    sizes of a training run: width, heads and blocks."""

    width: int = 128
    heads: int = 4
    encoder_blocks: int = 4
    decoder_blocks: int = 4
    name_width: int = 130  # of the name encoder, and two for the side
    max_group: int = 16
    mask_joints: float = 0.1  # share of joints zeroed before pooling, in training
    drop_names: float = 0.0  # share of skeletons whose names are withheld, in training
    blur_bodies: float = 0.0  # noise on joints' positions in the T-pose, in training [hip heights]
    share_joints: bool = True  # False: the ablation "w/o share"
    positions_in: bool = False  # True: the ablation "w/ pos"
    tpose_rotations: bool = False  # read how the file's joints are turned in the T-pose
    residual: bool = False  # correct the analytic transfer's unmatched joints
    shrink: float = 1.0  # share of a correction that is made: others are not quite like those seen
    noise: bool = True  # decoder starts from noise, as in the paper, or from a learned query
    shape_features: bool = False
    relative_time: bool = False  # rotary positions along time instead of absolute ones
    causal: bool = False  # a frame sees the past alone: for streaming
    decoder_time: bool = False  # the decoder's joints look along time too

    @classmethod
    def paper(cls) -> "Config":
        """The published network."""
        return cls(tpose_rotations=True)

    @classmethod
    def default(cls) -> "Config":
        """Corrects the unmatched joints of the analytic transfer: starts equal to it."""
        return cls(
            mask_joints=0.3,
            drop_names=0.1,
            blur_bodies=0.1,
            residual=True,
            shrink=0.8,
            noise=False,
            shape_features=True,
            relative_time=True,
            decoder_time=True,
        )
