"""What the encoder reads of the tendon's travel."""

import math

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.effects import slot
from evaluation.plant.layout import (
    AMPERE,
    CREPT,
    ENCODER,
    FORCE_X,
    INDEXED,
    POST,
    POST_RATE,
    PUMP,
    SLIPPED,
    SPEED,
    SPILT,
    TIME,
    UNCOUNTED,
    WHEEL,
    WHEEL_BEFORE,
    WHEEL_LOST,
)

Array = NDArray[np.float64]

BACKLASH = slot("encoder_backlash")
SLIP = slot("encoder_slip")
WIDE_INDEX = slot("wide_index")
SOFT_WHEEL = slot("soft_measuring_wheel")
LEVER = slot("lever_on_encoder")
WET_WHEEL = slot("wet_measuring_wheel")
LIFTING = slot("lifting_head")
SLOPING = slot("sloping_interpolator")
JOINED = slot("joined_scales")
DIMMED = slot("dimmed_lamp")
DRYING = slot("drying_scale")
SLACKENS = slot("slackening_string")
POST_RINGS = slot("ringing_post")
BLIND = slot("blind_to_creeping")
SPAN_SAGS = slot("sagging_span")

POST_RAD_S, POST_DAMPING = 2.0 * math.pi * 0.5, 0.1  # an encoder's post that rings
DRIES_S = 20.0  # how long a scale takes to dry
LINE_mm = 4.0  # from one line of a scale to the next
CREEPS_m_s = 1.5e-3  # speed below which an encoder misses most of its travel


@compiled
def travel(seen_mm: float, dt: float, e: Array, side: Array, pair: Array) -> float:
    """Encoder reading (mm) for the tendon's travel (mm)."""
    width = e[0, BACKLASH]
    before = pair[ENCODER]
    if width > 0.0:
        gap = seen_mm - before
        half = 0.5 * width
        soft = half / 3.0
        excess = abs(gap) - half
        if excess > 0.0:
            pair[ENCODER] = before + math.copysign(excess * excess / (excess + soft), gap)
    else:
        pair[ENCODER] = seen_mm
    moved = pair[ENCODER] - before
    if e[0, SLIP] > 0.0 and pair[FORCE_X] > 1.4:
        pair[SLIPPED] -= e[0, SLIP] * (moved if moved > 0.0 else 0.4 * moved)
    reading = pair[ENCODER] + pair[SLIPPED]
    reading += e[0, LEVER] * (seen_mm / 5.0) ** 3
    reading += e[0, JOINED] * max(seen_mm, 0.0)
    line = seen_mm / LINE_mm + e[2, SLOPING]
    reading += e[0, SLOPING] * (line - math.floor(line) - e[2, SLOPING])
    reading += e[0, LIFTING] * abs(pair[SPEED]) / (abs(pair[SPEED]) + 1e-3)
    run = seen_mm - pair[WHEEL_BEFORE]
    pair[WHEEL_LOST] += pair[SPILT] * run
    reading -= e[0, WET_WHEEL] * pair[WHEEL_LOST]
    drawn = (side[0, AMPERE] + side[1, AMPERE]) / 4.0
    pair[UNCOUNTED] += drawn * run
    reading -= e[0, DIMMED] * pair[UNCOUNTED]
    pressed = (pair[FORCE_X] - 1.24) / 0.4
    pair[WHEEL] += pressed * run
    creeping = pair[SPEED] / CREEPS_m_s
    pair[CREPT] += run / (1.0 + creeping * creeping)
    reading -= e[0, BLIND] * pair[CREPT]
    reading += e[0, SPAN_SAGS] * (1.24 / max(pair[FORCE_X], 0.3) - 1.0)
    pair[WHEEL_BEFORE] = seen_mm
    reading += e[0, SOFT_WHEEL] * pair[WHEEL]
    reading *= 1.0 + e[0, DRYING] * (1.0 - math.exp(-pair[TIME] / DRIES_S))
    if e[0, WIDE_INDEX] > 0.0:
        off = seen_mm - 6.0 * (e[2, WIDE_INDEX] - 0.5)
        if abs(off) > 1.0:
            pair[INDEXED] = 1.0 if off > 0.0 else 0.0
        reading += e[0, WIDE_INDEX] * pair[INDEXED]
    turning = side[0, PUMP] + side[1, PUMP]
    pulled = POST_RAD_S * (turning - pair[POST]) - 2.0 * POST_DAMPING * pair[POST_RATE]
    pair[POST_RATE] += dt * POST_RAD_S * pulled
    pair[POST] += dt * pair[POST_RATE]
    reading += e[0, POST_RINGS] * (pair[POST] - turning)
    slack = max(-pair[SPEED], 0.0) / 5e-3
    reading += e[0, SLACKENS] * slack * slack
    return float(reading)
