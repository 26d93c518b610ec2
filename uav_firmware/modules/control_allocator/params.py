"""Where the rotors are and how they answer, named as PX4 names it."""

from dataclasses import dataclass

from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlAllocatorParams:
    """Geometry of the rotors and the curve from command to thrust."""

    rotor0_x: float = param(
        "CA_ROTOR0_PX", 0.1651, unit="m", minimum=-100.0, maximum=100.0,
        short="Rotor 1 (front right), forward of the centre of mass",
        locked_while_armed=True,
    )  # fmt: skip
    rotor0_y: float = param(
        "CA_ROTOR0_PY", 0.1651, unit="m", minimum=-100.0, maximum=100.0,
        short="Rotor 1 (front right), right of the centre of mass",
        locked_while_armed=True,
    )  # fmt: skip
    rotor0_moment: float = param(
        "CA_ROTOR0_KM", 0.02, unit="N m/N", minimum=-1.0, maximum=1.0,
        short="Rotor 1, yaw moment per thrust; positive turns counter-clockwise from above",
        locked_while_armed=True,
    )  # fmt: skip
    rotor1_x: float = param(
        "CA_ROTOR1_PX", -0.1651, unit="m", minimum=-100.0, maximum=100.0,
        short="Rotor 2 (rear left), forward of the centre of mass",
        locked_while_armed=True,
    )  # fmt: skip
    rotor1_y: float = param(
        "CA_ROTOR1_PY", -0.1651, unit="m", minimum=-100.0, maximum=100.0,
        short="Rotor 2 (rear left), right of the centre of mass",
        locked_while_armed=True,
    )  # fmt: skip
    rotor1_moment: float = param(
        "CA_ROTOR1_KM", 0.02, unit="N m/N", minimum=-1.0, maximum=1.0,
        short="Rotor 2, yaw moment per thrust; positive turns counter-clockwise from above",
        locked_while_armed=True,
    )  # fmt: skip
    rotor2_x: float = param(
        "CA_ROTOR2_PX", 0.1651, unit="m", minimum=-100.0, maximum=100.0,
        short="Rotor 3 (front left), forward of the centre of mass",
        locked_while_armed=True,
    )  # fmt: skip
    rotor2_y: float = param(
        "CA_ROTOR2_PY", -0.1651, unit="m", minimum=-100.0, maximum=100.0,
        short="Rotor 3 (front left), right of the centre of mass",
        locked_while_armed=True,
    )  # fmt: skip
    rotor2_moment: float = param(
        "CA_ROTOR2_KM", -0.02, unit="N m/N", minimum=-1.0, maximum=1.0,
        short="Rotor 3, yaw moment per thrust; positive turns counter-clockwise from above",
        locked_while_armed=True,
    )  # fmt: skip
    rotor3_x: float = param(
        "CA_ROTOR3_PX", -0.1651, unit="m", minimum=-100.0, maximum=100.0,
        short="Rotor 4 (rear right), forward of the centre of mass",
        locked_while_armed=True,
    )  # fmt: skip
    rotor3_y: float = param(
        "CA_ROTOR3_PY", 0.1651, unit="m", minimum=-100.0, maximum=100.0,
        short="Rotor 4 (rear right), right of the centre of mass",
        locked_while_armed=True,
    )  # fmt: skip
    rotor3_moment: float = param(
        "CA_ROTOR3_KM", -0.02, unit="N m/N", minimum=-1.0, maximum=1.0,
        short="Rotor 4, yaw moment per thrust; positive turns counter-clockwise from above",
        locked_while_armed=True,
    )  # fmt: skip
    thrust_model_factor: float = param(
        "THR_MDL_FAC", 0.8, unit="1", minimum=0.0, maximum=1.0,
        short="Share of the thrust that grows with the square of the motor command",
        locked_while_armed=True,
    )  # fmt: skip
    idle: float = param(
        "DSHOT_MIN", 0.055, unit="1", minimum=0.0, maximum=0.3,
        short="Motor command of an armed motor without thrust, full command being 1",
        locked_while_armed=True,
    )  # fmt: skip
