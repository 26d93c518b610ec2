"""The parameter of the signatures."""

from dataclasses import dataclass

from uav_firmware.parameters import param

SIGN_NEVER = 0
SIGN_BEYOND_LOOPBACK = 1
SIGN_ALWAYS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class SigningParams:
    """Which links must be signed; the name and its values are PX4 1.17's.

    The loopback interface stands for PX4's USB: what reaches the vehicle there runs on the
    same machine. PX4's default is 0, because it has no keys at first; without a key the value
    makes no difference here either.
    """

    sign_cfg: int = param(
        "MAV_SIGN_CFG",
        SIGN_BEYOND_LOOPBACK,
        unit="1",
        minimum=SIGN_NEVER,
        maximum=SIGN_ALWAYS,
        short="Who must sign if the vehicle has a key: 0 nobody, 1 all but loopback while a "
        "configured peer there has no key, 2 everybody",
    )
