"""Joint angles of segments to travels of tendons and back: gains, signs, limits, coupling. Pure.

With x the displacements of all axes (mm, in the order of the configuration) and a their angles
(degrees): x = C · (s ∘ a / g), with the gain g and the sign s of each axis, and C the coupling.
C is the identity unless the configuration has rows of it. MINIR-II leads its tendons through the
middle of the segments nearer to the base, which bend without pulling them (Kim et al., IEEE Trans.
Robotics 33, 2017, 1386, doi 10.1109/TRO.2017.2719035): its segments are controlled independently.
The gain of 6.25 °/mm is that of its end segment, ±25° for ±4 mm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from smad.arrays import Array
from smad.config import Config, SegmentConfig
from smad.config.axes import coupling_of, inverse
from smad.control.commands import Samples
from smad.errors import CommandError, ConfigError
from smad.robot.angles import Angles

Segment = SegmentConfig
JOINTS = ("pitch", "yaw")


@dataclass(frozen=True)
class Robot:
    """Segments by name, all axes in order, and the coupling, shape (n, n), of their tendons."""

    segments: Mapping[str, Segment]
    axes: tuple[str, ...]
    coupling: Array

    @classmethod
    def of(cls, config: Config) -> Robot:
        """Return the robot that a configuration describes.

        Without `[[segments]]` they are made of axes called pitch-K and yaw-K. Raises ConfigError
        for a segment without its axes, an axis used twice, and a coupling that has no inverse.
        """
        names = tuple(axis.name for axis in config.axes)
        segments = {segment.name: segment for segment in config.segments or _usual(names)}
        used = [getattr(segment, joint) for segment in segments.values() for joint in JOINTS]
        for axis in used:
            if axis not in names or used.count(axis) > 1:
                raise ConfigError(
                    "a segment needs two axes of its own",
                    value=axis,
                    limit=", ".join(names) or "no [[axes]]",
                    action="correct [[segments]]",
                )
        if not segments:
            raise ConfigError(
                "there is no segment",
                limit="[[segments]], or axes called pitch-1 and yaw-1",
                action="add them to the configuration",
            )
        rows = coupling_of(config.axes)
        inverse(rows)
        return cls(segments, names, np.array(rows))

    def gains_mm_per_deg(self) -> Array:
        """Signed travel for a degree of each axis, shape (n,); nan for one of no segment."""
        gains = np.full(len(self.axes), np.nan)
        for segment in self.segments.values():
            for joint, sign in zip(JOINTS, (segment.pitch_sign, segment.yaw_sign), strict=True):
                gains[self.axes.index(getattr(segment, joint))] = sign / segment.gain_deg_per_mm
        return gains

    def angles_deg(self, displacement_mm: Mapping[str, Array]) -> dict[str, tuple[Array, Array]]:
        """Return pitch and yaw of each segment, shape (n,) each, from displacements of all axes."""
        stacked = np.array([np.asarray(displacement_mm[axis], float) for axis in self.axes])
        angles = np.linalg.solve(self.coupling, stacked) / self.gains_mm_per_deg()[:, None]
        return {
            name: (angles[self.axes.index(segment.pitch)], angles[self.axes.index(segment.yaw)])
            for name, segment in self.segments.items()
        }

    def moves(
        self, wanted: Mapping[str, Angles], *, standing_deg: Mapping[str, float] | None = None
    ) -> dict[str, Samples]:
        """Return what each axis is to follow, so that the segments follow their angles together.

        The angles are put on one set of times, and each stays at its last. `standing_deg` are the
        angles of joints that do not move, by axis (0 by default): a coupling may need their
        tendons too. Raises CommandError for an unknown segment and an angle beyond its limit.
        """
        for name, angles in wanted.items():
            self._check(name, angles)
        t_s = np.unique(np.concatenate([angles.t_s for angles in wanted.values()]))
        standing = standing_deg or {}
        angles_deg = np.array([np.full(len(t_s), standing.get(axis, 0.0)) for axis in self.axes])
        moved = np.zeros(len(self.axes), bool)
        for name, angles in wanted.items():
            for joint, values in (("pitch", angles.pitch_deg), ("yaw", angles.yaw_deg)):
                k = self.axes.index(getattr(self.segments[name], joint))
                angles_deg[k] = np.interp(t_s, angles.t_s, values)
                moved[k] = True
        gains = np.nan_to_num(self.gains_mm_per_deg())
        tendons_mm = self.coupling @ (angles_deg * gains[:, None])
        pulled = (self.coupling[:, moved] != 0.0).any(axis=1)
        return {
            axis: Samples(t_s=tuple(t_s.tolist()), displacement_mm=tuple(tendons_mm[k].tolist()))
            for k, axis in enumerate(self.axes)
            if pulled[k]
        }

    def _check(self, name: str, angles: Angles) -> None:
        if name not in self.segments:
            raise CommandError(
                "there is no segment of this name",
                value=name,
                limit=", ".join(self.segments),
                action="nothing was moved; name one of these",
            )
        limit_deg = self.segments[name].limit_deg
        for joint in JOINTS:
            most = float(np.max(np.abs(getattr(angles, f"{joint}_deg"))))
            if not most <= limit_deg + 1e-9:
                raise CommandError(
                    f"{name}: {joint} reaches {most:.4g}°",
                    limit=f"±{limit_deg:g}°",
                    action="nothing was moved; ask for less, or raise limit_deg in [[segments]]",
                )


def _usual(axes: tuple[str, ...]) -> list[Segment]:
    numbers = [axis.removeprefix("pitch-") for axis in axes if axis.startswith("pitch-")]
    return [
        Segment(name=f"segment-{number}", pitch=f"pitch-{number}", yaw=f"yaw-{number}")
        for number in numbers
        if f"yaw-{number}" in axes
    ]
