"""Parameters of the pack: what its charge is estimated by. Names and defaults are PX4's."""

from dataclasses import dataclass

from uav_firmware.modules.battery.charge import Pack
from uav_firmware.parameters import param


@dataclass(frozen=True, slots=True, kw_only=True)
class BatteryParams:
    """A lithium polymer pack of four cells; PX4 leaves number, capacity and resistance open."""

    cell_empty_v: float = param(
        "BAT1_V_EMPTY", 3.6, unit="V", minimum=2.5, maximum=4.0,
        short="Voltage of a cell, load compensated, at which the battery counts as empty",
    )  # fmt: skip
    cell_charged_v: float = param(
        "BAT1_V_CHARGED", 4.05, unit="V", minimum=4.01, maximum=4.5,
        short="Voltage of a cell, load compensated, from which on the battery counts as full",
    )  # fmt: skip
    cells: int = param(
        "BAT1_N_CELLS", 4, unit="1", minimum=1, maximum=16,
        short="Number of cells in series",
    )  # fmt: skip
    capacity_mah: float = param(
        "BAT1_CAPACITY", 5200.0, unit="mAh", minimum=-1.0, maximum=1e6,
        short="Charge of the full battery; -1 unknown, then only the voltage is used",
    )  # fmt: skip
    cell_resistance_ohm: float = param(
        "BAT1_R_INTERNAL", 0.005, unit="Ohm", minimum=0.0, maximum=0.2,
        short="Internal resistance of a cell, which makes up for the load's voltage drop",
    )  # fmt: skip

    @property
    def pack(self) -> Pack:
        """The pack in SI units."""
        return Pack(
            self.cells,
            self.cell_empty_v,
            self.cell_charged_v,
            self.cell_resistance_ohm,
            self.capacity_mah * 1e-3,
        )
