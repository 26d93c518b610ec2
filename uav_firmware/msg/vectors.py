"""Plain tuples for vectors and quaternions: no array overhead at control rate."""

from typing import TypeAlias

Vector3: TypeAlias = tuple[float, float, float]
"""Three components in the order of the frame named by the field (NED or FRD)."""

Quaternion: TypeAlias = tuple[float, float, float, float]
"""Hamilton, scalar first (w, x, y, z); `q_ned_frd` rotates a body vector into NED."""

Motors: TypeAlias = tuple[float, float, float, float]
"""One value per motor in PX4's quad-x order: front right, rear left, front left, rear right."""
