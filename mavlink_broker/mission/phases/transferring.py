"""PLACING_GEOFENCE, HOLDING, UPLOADING, VERIFYING, SELECTING: the mission goes onto the vehicle.

The geofence is placed once for a mission, before the vehicle may fly. Each segment of mission
items is then uploaded, proved, and its first item selected.
"""

from afarcloud.route import highest_m
from mavlink_broker.effects import Effects
from mavlink_broker.microservices.command import Accepted, Refused
from mavlink_broker.microservices.mission_download import Different, Verified
from mavlink_broker.microservices.mission_upload import NotStored, Stored, Uncertain
from mavlink_broker.mission import exchanges
from mavlink_broker.mission.context import HOVERING, ON_GROUND, MissionContext
from mavlink_broker.mission.geofence_transfer import GeofenceTransfer, WantedGeofence
from mavlink_broker.mission.phases.phase import Fault, Phase, Result
from mavlink_broker.mission.states import Event
from mavlink_broker.planning.geofence import as_flown, rally_items
from mavlink_broker.planning.mission import RefusedError
from mavlink_broker.vehicle.control_authority import Claim


class _Transfer(Phase):
    """A phase in which the vehicle receives the mission: disarmed on the ground, or hovering."""

    def __init__(self, context: MissionContext) -> None:
        self._mission = context

    @property
    def claim(self) -> Claim:
        """The vehicle is disarmed on the ground, or hovers."""
        return HOVERING if self._mission.is_hovering else ON_GROUND


class PlacingGeofence(_Transfer):
    """The state PLACING_GEOFENCE."""

    def __init__(self, context: MissionContext) -> None:
        super().__init__(context)
        self._transfer: GeofenceTransfer | None = None
        self._is_placed = False  # For the whole mission

    def forget(self) -> None:
        """Place the geofence again: the vehicle was restarted."""
        self._is_placed = False

    def enter(self, now: float, effects: Effects) -> Result:
        """Place the geofence, once for the whole mission; restore what an earlier plan replaced."""
        self._transfer = GeofenceTransfer(self._wanted(), self._mission.vehicle)
        if self._is_placed or self._transfer.is_needless:
            return self._next()
        self.exchange = self._transfer
        effects.messages += self._transfer.start(now)
        return self.settle(now, effects)

    def settle(self, now: float, effects: Effects) -> Result:
        """Go on within the geofence."""
        del now, effects
        match self.exchange.outcome if self.exchange else None:
            case Accepted():
                return self._placed()
            case Refused(reason):
                return Fault(reason)
        return None

    def _wanted(self) -> WantedGeofence:
        work, vehicle = self._mission.work, self._mission.vehicle
        height_m = highest_m(as_flown(work.mission.command_array, vehicle.family))
        return WantedGeofence(work.geofence, rally_items(work.rally_points), highest_m=height_m)

    def _placed(self) -> Result:
        """Check the mission again, for the vehicle may keep a lower height limit of its own."""
        self._is_placed = True
        if self._transfer is not None:
            self._mission.ledger.remark(self._transfer.notes)
            try:
                self._mission.check_area(own_limit_m=self._transfer.own_limit_m)
            except RefusedError as error:
                return Fault(error.reason, error.command_index)
        return self._next()

    def _next(self) -> Event:
        """Fly the next segment: live, by items from a hover, or by items from the ground."""
        if self._mission.is_live:
            return Event.LIVE_NEXT
        return Event.IN_AIR if self._mission.is_flying else Event.GEOFENCE_PLACED


class Holding(_Transfer):
    """A hovering vehicle leaves its mission mode, so that it does not fly items as they arrive."""

    def enter(self, now: float, effects: Effects) -> Result:
        """Order the hold mode."""
        vehicle = self._mission.vehicle
        self.exchange = exchanges.commands(vehicle.family.holding, vehicle)
        effects.messages += self.exchange.start(now)
        return None

    def settle(self, now: float, effects: Effects) -> Result:
        """Go on when the vehicle has accepted."""
        del now, effects
        match self.exchange.outcome if self.exchange else None:
            case Accepted():
                return Event.HELD
            case Refused(reason):
                return Fault(reason)
        return None


class Uploading(_Transfer):
    """The items go onto the vehicle."""

    def __init__(self, context: MissionContext) -> None:
        super().__init__(context)
        self.opaque_id = 0  # That the vehicle gave to the upload; 0: none

    def enter(self, now: float, effects: Effects) -> Result:
        """Request the parameters of the segment, and begin the upload."""
        mission = self._mission
        mission.vehicle.override(tuple(override for _, override in mission.plan.overrides))
        self.exchange = exchanges.upload(mission.plan, mission.vehicle)
        effects.messages += self.exchange.start(now)
        return None

    def settle(self, now: float, effects: Effects) -> Result:
        """Have the vehicle prove what it stored, or translate again without what it refused."""
        del now, effects
        match self.exchange.outcome if self.exchange else None:
            case Stored(opaque_id):
                self.opaque_id = opaque_id
                return Event.STORED
            case Uncertain():
                self.opaque_id = 0
                return Event.STORED
            case NotStored() as refusal:
                return self._refused(refusal)
        return None

    def _refused(self, refusal: NotStored) -> Result:
        """Find other items for what the vehicle does not support, or shorter segments."""
        mission, item = self._mission, refusal.item
        if item is None and refusal.is_too_long and mission.segments.shorten():
            mission.note_changes()
            part = len(mission.plan.items)
            mission.ledger.remark((f"flown in parts of up to {part} items: {refusal.reason}",))
            return Event.REFUSED
        if item is None:
            return Fault(refusal.reason)
        if refusal.is_unsupported and mission.segments.do_without(item):
            mission.note_changes()
            return Event.LIVE_NEXT if mission.is_live else Event.REFUSED
        return Fault(refusal.reason, mission.plan.command_of_item[item])


class Verifying(_Transfer):
    """The vehicle proves that it holds the items."""

    def __init__(self, context: MissionContext, uploading: Uploading) -> None:
        super().__init__(context)
        self._uploading = uploading

    def enter(self, now: float, effects: Effects) -> Result:
        """Ask for the opaque id of the upload, or read the items back."""
        mission = self._mission
        mission.foreign_uploader = mission.verified_total = None
        opaque_id = self._uploading.opaque_id
        self.exchange = exchanges.verification(mission.plan, mission.vehicle, opaque_id)
        effects.messages += self.exchange.start(now)
        return None

    def settle(self, now: float, effects: Effects) -> Result:
        """Fly only what is proved."""
        del now, effects
        match self.exchange.outcome if self.exchange else None:
            case Verified():
                return Event.VERIFIED
            case Different(reason):
                return Fault(reason)
        return None


class Selecting(_Transfer):
    """The first item becomes the current one, and the vehicle has the parameters of the segment."""

    def enter(self, now: float, effects: Effects) -> Result:
        """Set the current item."""
        mission = self._mission
        self.exchange = exchanges.selection(mission.plan, mission.vehicle)
        effects.messages += self.exchange.start(now)
        return None

    def settle(self, now: float, effects: Effects) -> Result:
        """Go on when the parameters of the segment are set too."""
        del now, effects
        match self.exchange.outcome if self.exchange else None:
            case Accepted():
                return Event.SELECTED if self._has_parameters() else None
            case Refused(reason):
                return Fault(reason)
        return None

    def _has_parameters(self) -> bool:
        """Whether the vehicle has the parameters that the segment needs, or has refused them.

        The first command of the segment names those that every mission needs.
        """
        mission = self._mission
        plan, parameters = mission.plan, mission.vehicle.parameters
        general = ((plan.first_command, one) for one in mission.vehicle.mission_overrides)
        overrides = (*general, *plan.overrides)
        for index in {index for index, _ in overrides} if parameters.refusals else ():
            names = (override[0].name for owner, override in overrides if owner == index)
            reasons = (parameters.refusals[name] for name in names if name in parameters.refusals)
            mission.ledger.note(index, (*mission.segments.notes[index], *reasons))
        return parameters.is_settled
