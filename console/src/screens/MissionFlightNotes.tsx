import { useTranslation } from "react-i18next";
import type { Mission } from "../api/types";
import { useUnits } from "../app/preferences";
import { linkTo } from "../app/route";
import { Icon } from "../controls/Icon";
import { Notice } from "../controls/states";
import { describeAlarm } from "../i18n/describe_alarm";
import { useReportText } from "../i18n/use_report_text";
import { useLive } from "../live/use_live";
import type { MissionFlight } from "../live/use_plan_flights";
import { isInFlight } from "../live/use_plans";

/** What the vehicle says of a mission, and where its flight is under Flights. */
export function MissionFlightNotes({ mission, flight }: { mission: Mission; flight: MissionFlight | undefined }) {
  const { t } = useTranslation();
  const reportText = useReportText();
  const units = useUnits();
  const vehicle = useLive((state) => state.vehicles.get(mission.vehicle_id)?.vehicle);
  const warning = isInFlight(mission) ? vehicle?.warning : null;
  const isSilent = isInFlight(mission) && vehicle !== undefined && vehicle.link_state !== "connected";
  const alarms = flight?.alarms_raised ?? [];
  return (
    <>
      {isSilent && (
        <Notice kind="error">
          {t(`vehicle.${vehicle.link_state}_plan`, { id: mission.vehicle_id })}
        </Notice>
      )}
      {warning && <Notice kind="info">{reportText(warning)}</Notice>}
      {alarms.length > 0 && (
        <ul className="flight-alarms small" aria-label={t("flights.alarms")}>
          {alarms.map((alarm) => (
            <li key={alarm.id}>
              <strong>{units.clock(alarm.recorded_at)}</strong> {describeAlarm(alarm, t, reportText)}
            </li>
          ))}
        </ul>
      )}
      {flight && (
        <a className="flight-link" {...linkTo(`flights/${flight.id}`)}>
          <Icon name="flight" /> {t("flights.flight", { id: flight.id })}
        </a>
      )}
    </>
  );
}
