"""Names that other systems write, and the canonical name of each.

Sources: AFarCloud's own vehicle plan (`maximum_linear_speed`), and the misprints of the
information model's tables, which programs written from those tables send.
"""

from typing import Final

SPELLINGS: Final[dict[str, str]] = {
    "maximum_linear_speed": "maximum_speed",
    "commands": "command_array",
    "sequence_numer": "sequence_number",
    "sequence_nuber": "sequence_number",
    "vethicle_id": "vehicle_id",
    "minimmum_pitch": "minimum_pitch",
    "minimmum_target_attitude": "minimum_target_altitude",
    "minimum_target_attitude": "minimum_target_altitude",
    "target_attitude": "minimum_target_altitude",
    "radious": "radius",
    "angural_velocity": "angular_velocity",
    "angular_valocity": "angular_velocity",
    "angural_valocity": "angular_velocity",
    "is_clock_wise": "is_clockwise",
    "is_ClockWise": "is_clockwise",
    "ombit_type": "orbit_type",
    "comand_status_id": "command_status_id",
    "obsarved_proparty": "observed_property",
    "reslt_value": "result_value",
    "result wom": "result_uom",
}
"""Sent name to canonical name; no canonical name is another's misprint, so the place is free."""

ENVELOPES: Final[dict[str, str]] = {
    "even": "event",
    "state_vetor": "state_vector",
}
"""Sent envelope key to the canonical one."""
