"""How symmetric the colour edges around every pixel lie, on a ring of one radius.

With t the angle of a gradient and g = t - a its angle to a line in direction a, two pixels i and
j of the line, equally far from its middle, count

    sum over channels k, l of  M_ik M_jl cos^2(g_ik + g_jl) cos^2 g_ik cos^2 g_jl

(Heidemann, PAMI 26(7) 2004), where M = log(1 + |gradient|). With x = cos 2g and y = sin 2g, eight
times one term is M_i M_j (1 + x_i x_j - y_i y_j) (1 + x_i) (1 + x_j): a sum of three products of
something of i with something of j. So the nine channel pairs cost no more than one, and what a
pixel contributes follows, for any direction, from five sums over its channels.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from retrieval.kernels import kernel

_DIRECTIONS = 8


def colour_symmetry(colour: NDArray[np.float32], radius: float) -> NDArray[np.float32]:
    """Mean over 8 directions of the pair measure above, times 8, of opposite pixels of a ring.

    Parameters
    ----------
    colour : (3, h, w) float32, blurred to suit the radius.
    radius : of the ring, pixels; between whole ones the two next rings are interpolated.

    Returns
    -------
    (h, w) float32, never negative up to rounding; zero where a ring leaves the image.
    """
    strength, cosine, sine = gradient_axes(colour)
    cv2.log(strength.reshape(-1), dst=strength.reshape(-1))
    return ring_symmetry(channel_sums(strength, cosine, sine), float(radius))


@kernel
def gradient_axes(
    colour: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Central differences as strength and double angle.

    Parameters
    ----------
    colour : (c, h, w) float32.

    Returns
    -------
    1 + |gradient|, cos 2t, sin 2t : (c, h, w) float32; 1, 0, 0 on the border and where it is flat.
    """
    channels, height, width = colour.shape
    strength = np.ones(colour.shape, np.float32)
    cosine = np.zeros(colour.shape, np.float32)
    sine = np.zeros(colour.shape, np.float32)
    half, tiny = np.float32(0.5), np.float32(1e-12)
    for channel in range(channels):
        for row in range(1, height - 1):
            above, here, below = (
                colour[channel, row - 1],
                colour[channel, row],
                colour[channel, row + 1],
            )
            for column in range(1, width - 1):
                gx = half * (here[column + 1] - here[column - 1])
                gy = half * (below[column] - above[column])
                xx, yy = gx * gx, gy * gy
                total = xx + yy + tiny
                strength[channel, row, column] += np.sqrt(xx + yy)
                cosine[channel, row, column] = (xx - yy) / total
                sine[channel, row, column] = np.float32(2.0) * gx * gy / total
    return strength, cosine, sine


@kernel
def channel_sums(
    strength: NDArray[np.float32], cosine: NDArray[np.float32], sine: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Sum M, M c, M s, M c c and M c s over the channels: (c, h, w) float32 to (5, h, w)."""
    channels, height, width = strength.shape
    sums = np.zeros((5, height, width), np.float32)
    for row in range(height):
        for channel in range(channels):
            for column in range(width):
                m, c = strength[channel, row, column], cosine[channel, row, column]
                s = sine[channel, row, column]
                sums[0, row, column] += m
                sums[1, row, column] += m * c
                sums[2, row, column] += m * s
                sums[3, row, column] += m * c * c
                sums[4, row, column] += m * c * s
    return sums


@kernel
def ring_symmetry(sums: NDArray[np.float32], radius: float) -> NDArray[np.float32]:
    """Add up the pair measure over the ring's directions; see `colour_symmetry`.

    Parameters
    ----------
    sums : (5, h, w) float32, of `channel_sums`.
    """
    _, height, width = sums.shape
    symmetry = np.zeros((height, width), np.float32)
    facing = np.empty((3, height, width), np.float32)
    inner = int(radius)
    share = np.float32(radius - inner)
    margin = inner + 1
    if min(height, width) <= 2 * margin:
        return symmetry
    for direction in range(_DIRECTIONS):
        angle = np.pi * direction / _DIRECTIONS
        _face(sums, np.float32(np.cos(2.0 * angle)), np.float32(np.sin(2.0 * angle)), facing)
        x, y = np.cos(angle), np.sin(angle)
        for row in range(margin, height - margin):
            line = symmetry[row, margin : width - margin]
            for distance, weight in ((inner, np.float32(1.0) - share), (inner + 1, share)):
                if weight > np.float32(0.0):
                    dx, dy = int(np.rint(distance * x)), int(np.rint(distance * y))
                    before, after = margin - dx, margin + dx
                    _pair(
                        line,
                        weight / np.float32(_DIRECTIONS),
                        facing[:, row - dy, before : before + len(line)],
                        facing[:, row + dy, after : after + len(line)],
                    )
    return symmetry


@kernel
def _face(
    sums: NDArray[np.float32], cos: np.float32, sin: np.float32, facing: NDArray[np.float32]
) -> None:
    """Per pixel the channel sums of M (1 + x), M x (1 + x) and M y (1 + x) for one direction."""
    _, height, width = sums.shape
    cos_cos, sin_sin, cos_sin = cos * cos, sin * sin, cos * sin
    for row in range(height):
        for column in range(width):
            m, mc, ms = sums[0, row, column], sums[1, row, column], sums[2, row, column]
            mcc, mcs = sums[3, row, column], sums[4, row, column]
            mss = m - mcc
            x = mc * cos + ms * sin
            y = ms * cos - mc * sin
            xx = mcc * cos_cos + np.float32(2.0) * mcs * cos_sin + mss * sin_sin
            xy = mcs * (cos_cos - sin_sin) + (mss - mcc) * cos_sin
            facing[0, row, column] = m + x
            facing[1, row, column] = x + xx
            facing[2, row, column] = y + xy


@kernel
def _pair(
    line: NDArray[np.float32],
    weight: np.float32,
    before: NDArray[np.float32],
    after: NDArray[np.float32],
) -> None:
    for i in range(len(line)):
        line[i] += weight * (
            before[0, i] * after[0, i] + before[1, i] * after[1, i] - before[2, i] * after[2, i]
        )
