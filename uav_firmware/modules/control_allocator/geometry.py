"""What each rotor does to the body, and the mix that inverts it.

The effectiveness matrix B (4 by 4: roll, pitch, yaw, thrust from four rotors) has one column
per rotor: a rotor at (x, y) with moment ratio k, thrusting along -z with force f, gives
roll -y f, pitch x f, yaw k f (body frame FRD). Its pseudo-inverse is the mix. The mix is scaled
so that normalised torques keep the same meaning for every frame: a roll or pitch torque of 1
moves the rotors by 1/sqrt(2) of their range in the root mean square, a yaw torque of 1 and a
thrust of 1 by the whole range.
"""

from typing import NamedTuple, TypeAlias

import numpy as np

MixRow: TypeAlias = tuple[float, float, float]
Mix: TypeAlias = tuple[MixRow, MixRow, MixRow, MixRow]
"""Per motor: change of its thrust for a unit of roll, pitch and yaw torque; thrust adds 1."""


class GeometryError(ValueError):
    """The rotors cannot turn the vehicle about every axis."""


class Rotor(NamedTuple):
    """Place and handedness of one rotor."""

    x: float  # [m] Forward of the centre of mass
    y: float  # [m] Right of the centre of mass
    moment_ratio: float  # [N m/N] Yaw moment per thrust


def mix_of(rotors: tuple[Rotor, Rotor, Rotor, Rotor]) -> Mix:
    """Invert the effectiveness of four rotors.

    Raises:
        GeometryError: if the rotors leave an axis without torque.
    """
    effectiveness = np.array(
        [
            [-rotor.y for rotor in rotors],
            [rotor.x for rotor in rotors],
            [rotor.moment_ratio for rotor in rotors],
            [1.0 for _ in rotors],
        ]
    )
    if np.linalg.matrix_rank(effectiveness) < 4:
        raise GeometryError("CA_ROTOR*: the rotors cannot turn the vehicle about every axis")
    inverse = np.linalg.pinv(effectiveness)
    inverse[:, 0] /= np.sqrt(2.0 * np.mean(inverse[:, 0] ** 2))
    inverse[:, 1] /= np.sqrt(2.0 * np.mean(inverse[:, 1] ** 2))
    inverse[:, 2] /= np.max(np.abs(inverse[:, 2]))
    rows = [(float(row[0]), float(row[1]), float(row[2])) for row in inverse]
    return (rows[0], rows[1], rows[2], rows[3])
