"""Habits of a body from those of known bodies that are like it.

Nothing says that habits go straight with lengths of bones, and a straight line through few bodies
says the more of others, the less they resemble them. Bodies that resemble one another have like
habits: they covary with exp(-distance), and the mean of that, given what recorded pairs say, is a
sum over the known bodies (kriging; Rasmussen and Williams, Gaussian Processes for Machine Learning,
equations 2.25 and 4.18). Far from all of them it is nothing. By how much it may be wrong is known,
too (2.26).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from spark.network.recorded import BodyTokens


@dataclass(frozen=True, eq=False)
class Likeness:
    """`measures` are those of the N known bodies, `weights` what each adds to `HABITS` of one just
    like it, and `lengths` the distances, in `BodyTokens.measures`, within which bodies are alike.
    `sizes` are the habits' standard deviations, `certain` says by how much what is known lowers
    them."""

    measures: Float[np.ndarray, "N M"]
    weights: Float[np.ndarray, "N 6"]
    lengths: Float[np.ndarray, "6"]
    sizes: Float[np.ndarray, "6"]
    certain: Float[np.ndarray, "6 N N"]

    def __call__(self, body: BodyTokens) -> Float[np.ndarray, "6"]:
        """The habits of any body."""
        alike = covariance(apart(body.measures[None], self.measures)[0, :, None], self.lengths)
        told: Float[np.ndarray, 6] = (alike * self.weights).sum(0)
        return told

    def doubt(self, source: BodyTokens, target: BodyTokens) -> Float[np.ndarray, "6"]:
        """Standard deviations of what the scales of two bodies differ by."""
        both = np.stack([source.measures, target.measures])
        alike = covariance(apart(both, self.measures)[..., None], self.lengths)
        further = alike[1] - alike[0]
        told = np.einsum("nh,hnm,mh->h", further, self.certain, further)
        unknown = 2.0 - 2.0 * covariance(apart(both, both)[:1, 1], self.lengths) - told
        doubt: Float[np.ndarray, 6] = self.sizes * np.sqrt(np.maximum(unknown, 0.0))
        return doubt


def apart(a: Float[np.ndarray, "A M"], b: Float[np.ndarray, "B M"]) -> Float[np.ndarray, "A B"]:
    """How far bodies are from one another: the root mean square of their measures' differences."""
    distance: Float[np.ndarray, "A B"] = np.sqrt(np.square(a[:, None] - b).mean(-1))
    return distance


def covariance(
    distance: Float[np.ndarray, "*#n"], length: float | Float[np.ndarray, "*#n"]
) -> Float[np.ndarray, "*n"]:
    """Of the habits of two bodies so far apart, over their variance."""
    return np.exp(-distance / length)
